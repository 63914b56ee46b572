"""A node of a network that loses what was set while the others store, or while all are taken back: it is said.

Two nodes in virtual time. A restart is heard (a boot-up message), or is not.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from dvtcli import Bus
from dvtcli.cli.view.typed_hints import TypedCall, TypedHints, typed
from dvtcli.device.change.journal import read_journal
from dvtcli.domain.hint import Hint
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.store import WhoStored
from dvtcli.errors import DvtcliError, LeftChanged, SafetyRefusal, UsageError
from dvtcli.operations.changes.recover_change import recover
from dvtcli.operations.changes.undo import undo
from dvtcli.operations.changes.waiting_journals import newest_store_record, stores_of
from dvtcli.operations.network.network_files import apply_file
from dvtcli.operations.results import Changed, Facts
from dvtcli.operations.user.session_user import NullReporter
from dvtcli.simulator.device.memory import Refusal
from tests.cli.commands.bench import Bench
from tests.journals import journal_document
from tests.operations.network.bench import Chain
from tests.operations.network.killed import Watched, afterwards

pytestmark = pytest.mark.drawn(9, "network stores")

Act = Callable[[Chain], None]


@dataclass
class Said(NullReporter):
    """Keeps the notes."""

    notes: list[str] = field(default_factory=list)

    def note(self, text: Hint | str) -> None:
        self.notes.append(typed(text))


TYPE = (0x1800, 2)


def file(home: Path, name: str = "net", *, a: bool = True, b: bool = True, pdo: int = 1) -> Path:
    """A network file that sets the transmission type of a PDO of nodes 5 and 9; *a* and *b* say whether they store."""
    stores = ((5, "a", a), (9, "b", b))
    parts = (
        f"{name}:\n  node_id: {node_id}\n  store: {str(stored).lower()}\n  tpdo:\n    {pdo}: {{transmission: 1}}\n"
        for node_id, name, stored in stores
    )
    path = home.parent / f"{name}.yaml"
    path.write_text("".join(parts))
    return path


@pytest.fixture
def chain(home: Path) -> Chain:
    (home.parent / "files").mkdir()
    home.mkdir(exist_ok=True)
    return Chain(home.parent / "files", bus=Watched, families={5: "generic", 9: "generic"}, operational=False)


def received(node_id: int) -> Act:
    """The node restarts, and says so."""
    return lambda chain: chain.bus.send_nmt(NmtCommand.RESET_NODE, node_id)


def silent(node_id: int) -> Act:
    """The node restarts, and nobody hears that."""

    def restart(chain: Chain) -> None:
        chain.devices[node_id].restart()
        chain.devices[node_id].boot_up()
        chain.devices[node_id].take_outbox()

    return restart


def while_storing(chain: Chain, node_id: int, act: Act, *, ahead: bool = False) -> None:
    """Do *act* once, when the node was told to store; *ahead*: just before it takes that."""
    send, done = chain.bus.send_sdo, list[int]()

    def send_sdo(can_id: int, data: bytes) -> None:
        hit = can_id == 0x600 + node_id and data[0] >> 5 == 1 and bytes(data[1:3]) == b"\x10\x10" and not done
        if hit:
            done.append(1)
        if hit and ahead:
            act(chain)
        send(can_id, data)
        if hit and not ahead:
            act(chain)

    vars(chain.bus)["send_sdo"] = send_sdo


def types(chain: Chain) -> dict[int, int]:
    return {node_id: one.value(*TYPE)[0] for node_id, one in chain.devices.items()}


def stored_type(chain: Chain, node_id: int) -> bytes | None:
    return chain.stored()[node_id].get(TYPE)


def killed(chain: Chain, home: Path, path: Path, look: Act) -> None:
    """`apply` of *path* ends when node 5 is told to store; *look* is whoever comes after."""
    wrong: list[str] = []
    while_storing(chain, 5, lambda one: wrong.append(afterwards(one, home, look)), ahead=True)
    chain.apply(path)
    assert wrong == [""]


@pytest.mark.parametrize("restart", [received, silent])
def test_finish_stores_nothing_that_was_lost_meanwhile(chain: Chain, home: Path, restart: Callable[[int], Act]) -> None:
    def look(after: Chain) -> None:
        while_storing(after, 5, restart(9))
        with after.session(node=None) as session, pytest.raises(LeftChanged) as left:
            recover(session, finish=True)
        assert left.value.node == 9
        assert ("stored", "node 5") in left.value.details
        assert ("not stored", "node 9") in left.value.details
        assert " store`" not in typed(left.value.hint)
        assert stored_type(after, 9) is None
        assert len(after.journals()) == 2

    killed(chain, home, file(home), look)


def test_finish_looks_once_more_at_those_that_do_not_store(chain: Chain, home: Path) -> None:
    def look(after: Chain) -> None:
        while_storing(after, 5, silent(9))
        with after.session(node=None) as session, pytest.raises(LeftChanged) as left:
            recover(session, finish=True)
        assert left.value.node == 9
        assert len(after.journals()) == 2

    killed(chain, home, file(home, b=False), look)


@pytest.mark.parametrize("other", ["device", "value"])
def test_finish_looks_at_a_node_that_only_stores(chain: Chain, home: Path, other: str) -> None:
    chain.apply(file(home, "before", a=False, b=False))
    silent(5)(chain)  # node 9 holds what is wanted, and has not stored it

    def look(after: Chain) -> None:
        held = after.devices[9]
        if other == "device":
            held.set_value(0x1018, 2, (0x1234).to_bytes(4, "little"))
        else:
            held.download(*TYPE, b"\x07")
        with after.session(node=None) as session, pytest.raises(SafetyRefusal, match="node 9"):
            recover(session, finish=True)
        assert stored_type(after, 9) is None
        assert stored_type(after, 5) is None
        assert len(after.journals()) == 1

    killed(chain, home, file(home), look)


def test_finish_looks_at_a_node_that_was_equal_and_does_not_store(chain: Chain, home: Path) -> None:
    """It has no journal of its own: those of the others say what it is to hold."""
    chain.apply(file(home, "before", a=False, b=False))
    silent(5)(chain)

    def look(after: Chain) -> None:
        after.devices[9].download(*TYPE, b"\x07")
        with after.session(node=None) as session, pytest.raises(SafetyRefusal, match="node 9"):
            recover(session, finish=True)
        assert stored_type(after, 5) is None
        assert len(after.journals()) == 1

    killed(chain, home, file(home, b=False), look)


def test_an_equal_node_that_restarts_during_the_last_reads_behind_the_stores(chain: Chain, home: Path) -> None:
    """It is read before the nodes that stored: a boot-up that is heard then is looked at."""
    chain.apply(file(home, "before", a=False, b=False))
    silent(5)(chain)
    send, stored = chain.bus.send_sdo, list[bool]()

    def send_sdo(can_id: int, data: bytes) -> None:
        send(can_id, data)
        if can_id == 0x605 and data[0] >> 5 == 1 and bytes(data[1:3]) == b"\x10\x10":
            stored.append(True)
        elif can_id == 0x605 and stored == [True]:
            stored.append(False)
            received(9)(chain)

    vars(chain.bus)["send_sdo"] = send_sdo
    with pytest.raises(LeftChanged) as left:
        chain.apply(file(home, b=False))
    assert (left.value.node, left.value.stores) == (9, WhoStored(stored=(5,)))
    assert stored_type(chain, 5) == b"\x01"


@pytest.mark.parametrize("restart", [received, silent])
def test_apply_looks_at_all_nodes_after_the_stores(chain: Chain, home: Path, restart: Callable[[int], Act]) -> None:
    while_storing(chain, 9, restart(5))
    with pytest.raises(LeftChanged) as left:
        chain.apply(file(home, a=False))
    assert left.value.node == 5
    assert left.value.details == [("stored", "node 9")]
    assert types(chain) == {5: 255, 9: 1}
    with chain.session(node=None) as session:
        assert recover(session)
    assert (types(chain), chain.journals()) == ({5: 255, 9: 255}, [])


@pytest.mark.parametrize("restart", [received, silent])
def test_what_was_lost_before_its_store_is_not_to_be_stored(
    chain: Chain, home: Path, restart: Callable[[int], Act]
) -> None:
    while_storing(chain, 5, restart(9))
    with pytest.raises(LeftChanged) as left:
        chain.apply(file(home))
    assert "every node has the planned values" not in f"{left.value} {left.value.state_text}"
    assert "store`" not in typed(left.value.hint)
    assert ("not stored", "node 9") in left.value.details
    assert len(chain.journals()) == 2
    with chain.session(node=None) as session:
        assert recover(session)
    assert chain.apply(file(home)).stored
    assert {chain.stored()[one][TYPE] for one in (5, 9)} == {b"\x01"}


def test_a_disk_that_is_full_between_two_stores_is_told_and_ends_the_whole(chain: Chain, home: Path) -> None:
    folder = chain.folder / "journals"

    def full(_chain: Chain) -> None:
        folder.rename(chain.folder / "away")
        folder.write_text("nothing can be written here")

    while_storing(chain, 5, full)
    with chain.session(node=None) as session:
        with pytest.raises(LeftChanged) as left:
            apply_file(session, str(file(home)))
        assert left.value.state == "left_changed"
        assert ("stored", "node 5") in left.value.details
        assert session.group.id is None
    assert types(chain) == {5: 1, 9: 1}


@pytest.mark.parametrize("restart", [received, silent])
@pytest.mark.parametrize("at", [23, 26, 29])
def test_a_node_that_restarts_once_it_was_taken_back_is_put_back_again(
    home: Path, at: int, restart: Callable[[int], Act]
) -> None:
    """RAM held 7, the file wants 1, node 9 refuses; node 5 restarts at the *at*-th request to node 9."""
    (home.parent / "files").mkdir()
    families = {5: "generic", 9: "generic"}
    chain = Chain(home.parent / "files", ["9:refuse@1=0x08000000"], bus=Watched, families=families, operational=False)
    for one in chain.devices.values():
        one.download(*TYPE, b"\x07")
    send, seen = chain.bus.send_sdo, list[int]()

    def send_sdo(can_id: int, data: bytes) -> None:
        send(can_id, data)
        if can_id == 0x609 and (seen or data[0] >> 5 == 1):
            seen.append(1)
            if len(seen) == at:
                restart(5)(chain)

    vars(chain.bus)["send_sdo"] = send_sdo
    with pytest.raises(DvtcliError) as told:
        chain.apply(file(home, a=False, b=False))
    assert len(seen) >= at
    assert told.value.state == "rolled_back"
    assert types(chain) == {5: 7, 9: 7}
    assert chain.journals() == []


def test_finish_beside_another_interrupted_change_says_how_to_go_on(home: Path) -> None:
    (home.parent / "files").mkdir()
    home.mkdir(exist_ok=True)
    families = dict.fromkeys((5, 7, 9), "generic")
    chain = Chain(home.parent / "files", bus=Watched, families=families, operational=False)

    def look(after: Chain) -> None:
        (first, _) = after.journals()
        lone = {"whole": None, "name": "", "final": "", "stores": [], "entries": [], "node": 7}
        path = first.with_name(first.name.replace("-5", "-7"))
        path.write_text(json.dumps({**journal_document(first), **lone}))
        path.chmod(0o600)
        with after.session(node=None) as session, pytest.raises(UsageError, match="one network at a time") as told:
            recover(session, finish=True)
        assert "-n 5 recover --finish" in typed(told.value.hint)
        with after.session(node=None, dry_run=True) as session:
            session.reporter = said = Said()
            assert recover(session)
        assert [text for text in said.notes if "`-n 5 recover --finish` would continue" in text]
        with after.session(node=5) as session:
            assert recover(session, finish=True)
        assert {after.stored()[one][TYPE] for one in (5, 9)} == {b"\x01"}
        assert after.journals() == [path]

    killed(chain, home, file(home), look)


@pytest.mark.parametrize("finishes", [True, False])
def test_a_program_finishes_the_stores_or_goes_back_on_all_nodes(chain: Chain, home: Path, *, finishes: bool) -> None:
    before = types(chain)

    def finished(after: Chain) -> None:
        with after.session(node=None, yes=False) as session, Bus(session) as bus:
            with pytest.raises(SafetyRefusal, match="no terminal to answer on"):
                bus.finish_stores()
            assert bus.finish_stores(yes=True) == (5, 9)
            assert bus.finish_stores(yes=True) == bus.recover(yes=True) == ()
        assert {after.stored()[one][TYPE] for one in (5, 9)} == {b"\x01"}

    def recovered(after: Chain) -> None:
        with after.session(node=None, yes=False) as session, Bus(session) as bus:
            done = bus.recover(yes=True)
        assert [(one.node, bool(one)) for one in done] == [(5, True), (9, True)]
        assert types(after) == before
        assert after.journals() == []

    killed(chain, home, file(home), finished if finishes else recovered)


TEST_VALUE = (0x1802, 5)


def killed_while_proved(chain: Chain, home: Path, at: int, look: Act) -> None:
    """`apply --prove` ends at write *at* behind the store of node 5.

    1 is the test value; 2 and 3 try and put back that of node 9, 4 is its store, 5 its test value.
    """
    wrong, behind = list[str](), list[int]()

    def on_write(_count: int) -> None:
        if behind or stored_type(chain, 5) is not None:
            behind.append(1)
        if len(behind) == at + 1:
            wrong.append(afterwards(chain, home, look))

    assert isinstance(chain.bus, Watched)
    chain.bus.on_write = on_write
    chain.apply(file(home), prove="reset")
    assert wrong == [""]


@pytest.mark.parametrize("resets", [False, True])
@pytest.mark.parametrize("at", [1, 2, 3, 4, 5])
def test_what_tests_a_proof_is_never_stored_by_recover(chain: Chain, home: Path, at: int, *, resets: bool) -> None:
    def look(after: Chain) -> None:
        if resets:
            for node_id in (5, 9)[: 2 if at == 5 else 1]:
                received(node_id)(after)
        with after.session(node=None) as session:
            assert recover(session, finish=True)
        for node_id in (5, 9):
            assert after.stored()[node_id][TYPE] == b"\x01"
            assert after.stored()[node_id].get(TEST_VALUE, b"\0\0") == b"\0\0", node_id
            assert after.devices[node_id].value(*TEST_VALUE) == b"\0\0", node_id
        assert after.journals() == []

    killed_while_proved(chain, home, at, look)


@pytest.mark.parametrize("only_stores", [5, 9])
@pytest.mark.parametrize("at", [1, 2, 3, 4, 5])
def test_nor_where_a_node_only_stores(chain: Chain, home: Path, at: int, only_stores: int) -> None:
    chain.apply(file(home, "before", a=False, b=False))
    silent(14 - only_stores)(chain)  # the other one holds what is wanted, and has not stored it

    def look(after: Chain) -> None:
        with after.session(node=None) as session:
            assert recover(session, finish=True)
        for node_id in (5, 9):
            assert after.stored()[node_id][TYPE] == b"\x01"
            assert after.devices[node_id].value(*TEST_VALUE) == b"\0\0", node_id
        assert after.journals() == []

    killed_while_proved(chain, home, at, look)


@pytest.mark.parametrize("at", [1, 2, 3, 4, 5])
def test_and_finish_looks_at_all_of_a_node_that_only_stores(chain: Chain, home: Path, at: int) -> None:
    chain.apply(file(home, "before", a=False, b=False))
    silent(5)(chain)

    def look(after: Chain) -> None:
        after.devices[9].download(*TYPE, b"\x07")
        with after.session(node=None) as session, pytest.raises(SafetyRefusal, match="node 9"):
            recover(session, finish=True)
        assert stored_type(after, 9) in (None, b"\x01")

    killed_while_proved(chain, home, at, look)


@pytest.mark.parametrize("at", [1, 2, 3, 4, 5])
def test_and_goes_with_everything_else(chain: Chain, home: Path, at: int) -> None:
    before = chain.held()

    def look(after: Chain) -> None:
        with after.session(node=None) as session:
            assert recover(session)
        assert (after.held(), after.journals()) == (before, [])

    killed_while_proved(chain, home, at, look)


def test_a_test_value_that_stays_keeps_the_journals(home: Path) -> None:
    """Node 5 keeps RAM over a reset, and takes the test value back no more: stores end there, nothing is as planned."""
    (home.parent / "files").mkdir()
    families = {5: "generic", 9: "generic"}
    chain = Chain(home.parent / "files", ["5:keeps-ram"], bus=Watched, families=families, operational=False)
    before, held = chain.held(), chain.devices[5]
    take, refusing = held.download, list[bool]()

    def download(index: int, sub_index: int, data: bytes) -> None:
        if refusing and (index, sub_index) == TEST_VALUE:
            raise Refusal(0x08000020)
        take(index, sub_index, data)
        if (index, sub_index) == TEST_VALUE:
            refusing.append(True)

    held.download = download  # type: ignore[method-assign]
    with pytest.raises(LeftChanged) as left:
        chain.apply(file(home), prove="reset")
    assert left.value.stores == WhoStored(not_stored=(9,), unknown=(5,))
    assert "every node has the planned values" not in f"{left.value} {left.value.state_text}"
    assert "recover" in typed(left.value.hint)
    assert len(chain.journals()) == 2
    held.download = take  # type: ignore[method-assign]
    with chain.session(node=None) as session:
        assert recover(session)
    assert (chain.held(), chain.journals()) == (before, [])


def cut_after_stores(chain: Chain, home: Path, at: int) -> LeftChanged | None:
    """`apply` whose bus is gone at its *at*-th request behind the last store, which was acknowledged; None: at none."""
    send, requests = chain.bus.send_sdo, list[int]()
    stored = list[int]()
    while_storing(chain, 9, lambda _: stored.append(9))
    watched = chain.bus.send_sdo

    def send_sdo(can_id: int, data: bytes) -> None:
        requests.extend([can_id] * len(stored))
        if len(requests) == at:
            chain.bus._closed = True
        watched(can_id, data)

    vars(chain.bus)["send_sdo"] = send_sdo
    try:
        chain.apply(file(home))
    except LeftChanged as left:
        return left
    finally:
        vars(chain.bus)["send_sdo"] = send
    return None


def count_stores(chain: Chain) -> list[int]:
    """Node-IDs of those that are told to store from now on."""
    told, send = list[int](), chain.bus.send_sdo

    def send_sdo(can_id: int, data: bytes) -> None:
        if data[0] >> 5 == 1 and bytes(data[1:3]) == b"\x10\x10":
            told.append(can_id - 0x600)
        send(can_id, data)

    vars(chain.bus)["send_sdo"] = send_sdo
    return told


@pytest.mark.parametrize("at", [1, 2, 4])
def test_a_bus_that_is_gone_once_all_have_stored_leaves_nothing_to_store(chain: Chain, home: Path, at: int) -> None:
    left = cut_after_stores(chain, home, at)
    assert left is not None
    assert left.stores == WhoStored((5, 9), (), ())
    assert "all nodes have stored" in str(left)
    assert "continues with the stores" not in typed(left.hint)
    assert "recover --finish` reads every node again" in typed(left.hint)
    told = count_stores(chain)
    with chain.session(node=None) as session:
        session.reporter = said = Said()
        done = recover(session, finish=True)
    assert isinstance(done, Facts)
    assert (dict(done.rows)["stored"], told, chain.journals()) == ([], [], [])
    assert not [text for text in said.notes if "stores on the rest" in text]
    assert {chain.stored()[one][TYPE] for one in (5, 9)} == {b"\x01"}


def test_a_line_that_only_looks_at_what_was_stored_is_no_change(chain: Chain, home: Path) -> None:
    """A script's `recover --finish` stored nothing: no line of it stays changed when a later one fails."""
    assert cut_after_stores(chain, home, 1) is not None
    chain.bus._closed = False
    with Bench((), {"yes": True, "journal": str(chain.folder), "eds": "generic"}, chain.bus) as bench:
        ran = bench.script("recover --finish", "verify nofile.dcf")
    assert (ran.code, "is complete: every node has it" in ran.stdout) == (2, True), ran
    assert "not rolled back" not in ran.stderr
    assert chain.journals() == []


def test_what_all_stored_and_one_lost_is_no_end_of_it(chain: Chain, home: Path) -> None:
    assert cut_after_stores(chain, home, 1) is not None
    chain.devices[5].download(*TYPE, b"\x07")
    with (
        chain.session(node=None) as session,
        pytest.raises(SafetyRefusal, match="the values of node 5 differ from those verified") as told,
    ):
        recover(session, finish=True)
    assert told.value.hint is not None
    shell = TypedHints(lambda: TypedCall(node=("-n", "9"), selected=9, alone=True), told.value.node)
    said = shell.text(told.value.hint)
    assert said.startswith("`dvtcli recover` rolls every node back; then `dvtcli apply ")
    assert said.endswith("net.yaml` again")
    assert len(chain.journals()) == 2
    with chain.session(node=None) as session:
        assert recover(session)
    assert (types(chain), chain.journals()) == ({5: 255, 9: 255}, [])


@pytest.mark.parametrize("ahead", [True, False])
def test_an_accepted_node_hands_on_what_is_known_of_the_stores(home: Path, *, ahead: bool) -> None:
    """Node 7 was asked to store, and may have: the others go on without it, and its `undo` knows of that."""
    (home.parent / "files").mkdir()
    home.mkdir(exist_ok=True)
    families = dict.fromkeys((5, 7, 9), "generic")
    chain = Chain(home.parent / "files", bus=Watched, families=families, operational=False)
    path = home.parent / "three.yaml"
    path.write_text(
        "defaults: {store: true, tpdo: {1: {transmission: 1}}}\n"
        + "".join(f"n{node_id}: {{node_id: {node_id}}}\n" for node_id in families)
    )

    def look(after: Chain) -> None:
        known = stores_of(newest_store_record([read_journal(one) for one in after.journals()]))
        assert known == {"stored": [5], "unknown": [7], "not stored": [9]}
        with after.session(node=7) as session:
            recover(session, accept=True)
        assert stores_of(newest_store_record([read_journal(one) for one in after.journals()])) == {
            **known,
            "unknown": [],
        }
        with after.session(node=None) as session:
            finished = recover(session, finish=True)
        assert isinstance(finished, Facts)
        assert dict(finished.rows)["stored"] == [9], "of node 7 it is over"
        with after.session(node=7) as session:
            done = undo(session)
        assert isinstance(done, Changed)
        assert not done.as_before
        assert types(after) == {5: 1, 7: 255, 9: 1}

    wrong: list[str] = []
    while_storing(chain, 7, lambda one: wrong.append(afterwards(one, home, look)), ahead=ahead)
    chain.apply(path)
    assert wrong == [""]


@pytest.mark.parametrize("dry_run", [True, False])
def test_finish_says_nothing_of_a_node_that_was_accepted(home: Path, *, dry_run: bool) -> None:
    """Node 5 refused to store and was accepted: of it nobody knows, and only node 9 is looked at."""
    (home.parent / "files").mkdir()
    families = {5: "generic", 9: "generic"}
    chain = Chain(home.parent / "files", ["5:store-fails"], bus=Watched, families=families, operational=False)
    with pytest.raises(LeftChanged):
        chain.apply(file(home))
    with chain.session(node=5) as session:
        recover(session, accept=True)
    with chain.session(node=None, dry_run=dry_run) as session:
        done = recover(session, finish=True)
    assert isinstance(done, Facts)
    assert (dict(done.rows)["looked_at"], dict(done.rows)["not_looked_at"]) == ([9], [5])
    said = typed(done.text[0])
    assert "node 9 has it, and node 9 had stored it" in said
    assert said.endswith("; accepted as found, not read: node 5")
    assert "every" not in said
    assert "complete" not in said
