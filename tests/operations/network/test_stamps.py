"""`stamp: true`: 0x1020 says that a node holds and has stored what a file says, and never says so of another one.

Each with devices that clear 0x1020 when their configuration changes, and with devices that do not.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from dvtcli.domain.abort import Abort
from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.request import PdoRequest
from dvtcli.domain.store import Stamp
from dvtcli.errors import DvtcliError, LeftChanged, SafetyRefusal, SdoAborted
from dvtcli.operations.changes.change import configure
from dvtcli.operations.changes.recover_change import recover
from dvtcli.operations.changes.store_restore import restore_defaults, store_settings
from dvtcli.operations.changes.undo import undo
from dvtcli.operations.network.network_files import apply_file, plan_file
from dvtcli.operations.plans.link_pdos import link_pdos
from dvtcli.operations.session.session import Session
from dvtcli.simulator.device.memory import Refusal
from tests.harness.sample import part
from tests.operations.network.bench import Chain
from tests.operations.network.killed import Watched, afterwards
from tests.surroundings import HOMES

pytestmark = pytest.mark.drawn(10, "stamps")

NODES = {1: "generic", 5: "generic"}
FILE = """
defaults: {{store: true, stamp: true}}
nodes:
  one:
    node_id: 1
    heartbeat_producer: 200
    tpdo:
      1: {{mapping: [statusword, 606C], event_timer: {timer}}}
  other:
    node_id: 5
    tpdo:
      1: {{inhibit_ms: {inhibit}}}
"""
LINKED = FILE + "links:\n  - {{from: one:tpdo1, to: other:rpdo1}}\n"
NOTHING = (bytes(4), bytes(4))


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "home"))
    (tmp_path / "home").mkdir()
    return tmp_path / "home"


@pytest.fixture(params=[True, False], ids=["clears", "keeps"])
def chain(request: pytest.FixtureRequest, tmp_path: Path) -> Chain:
    (tmp_path / "files").mkdir()
    return Chain(tmp_path / "files", families=NODES, operational=False, clears_stamps=request.param)


def file(tmp_path: Path, timer: int = 20, inhibit: int = 10, text: str = FILE) -> Path:
    path = tmp_path / f"{timer}-{inhibit}-{len(text)}.yaml"
    path.write_text(text.format(timer=timer, inhibit=inhibit))
    return path


def held(chain: Chain, node_id: int) -> tuple[bytes, bytes]:
    one = chain.devices[node_id]
    return one.value(0x1020, 1), one.value(0x1020, 2)


def stamp(chain: Chain, node_id: int) -> Stamp:
    days, ms = (int.from_bytes(data, "little") for data in held(chain, node_id))
    return Stamp(days, ms)


def unread(chain: Chain, path: Path) -> tuple[int, ...]:
    return chain.plan(path, trust_stamp=True).plan.unread


def restarted(chain: Chain) -> None:
    chain.wait(1.0)
    chain.bus.send_nmt(NmtCommand.RESET_NODE, 0)
    chain.wait(1.0)


def test_a_stamp_is_written_before_the_store_and_lasts(chain: Chain, tmp_path: Path) -> None:
    path = file(tmp_path)
    assert unread(chain, path) == ()
    assert chain.apply(path)
    made = {node_id: stamp(chain, node_id) for node_id in NODES}
    assert all(one.is_own for one in made.values())
    assert made[1] != made[5]
    restarted(chain)
    assert {node_id: stamp(chain, node_id) for node_id in NODES} == made
    assert not chain.plan(path).plan.to_do
    assert chain.apply(path).plan.writes == 0


def test_only_who_says_so_is_not_read(chain: Chain, tmp_path: Path) -> None:
    path = file(tmp_path)
    chain.apply(path)
    asked: list[int] = []
    untap = chain.bus.tap(lambda frame, sent: asked.append(frame.data[1] | frame.data[2] << 8) if sent else None)
    assert unread(chain, path) == (1, 5)
    untap()
    assert set(asked) <= {0x1000, 0x1018, 0x1020}, [hex(index) for index in set(asked)]
    assert unread(chain, file(tmp_path, timer=21)) == (5,)
    assert unread(chain, file(tmp_path, inhibit=11)) == (1,)
    changed = chain.apply(file(tmp_path, timer=21)).plan.nodes
    assert [bool(len(one.plan)) for one in changed] == [True, False]
    assert unread(chain, file(tmp_path, timer=21)) == (1, 5)


def test_a_saved_stamp_of_one_device_is_not_believed_of_another(chain: Chain, tmp_path: Path) -> None:
    path = file(tmp_path)
    chain.apply(path)
    for sub_index, data in zip((1, 2), held(chain, 1), strict=True):
        chain.devices[5].set_value(0x1020, sub_index, data)
    assert unread(chain, path) == (1,)


def test_a_change_by_hand_ends_it_and_apply_brings_it_back(chain: Chain, tmp_path: Path) -> None:
    path = file(tmp_path)
    chain.apply(path)
    made = held(chain, 1)
    with chain.session(node=1) as session:
        done = configure(session, session.node(1), {Pdo.parse("tpdo2"): PdoRequest(event_timer=70)})
        assert [step.object for step in done.plan.steps][:2] == ["1020:01", "1020:02"]
        assert held(chain, 1) == NOTHING
    assert unread(chain, path) == (5,)
    with chain.session(node=1) as session:
        assert undo(session)
    assert held(chain, 1) == NOTHING
    assert {step.object for node in chain.plan(path).plan.nodes for step in node.plan.steps} == {"1020:01", "1020:02"}
    chain.apply(path)
    assert held(chain, 1) == made


def elsewhere(chain: Chain, path: Path) -> tuple[int, ...]:
    """Who is not read by a computer that knows nothing of what was done."""
    with another_computer(chain):
        return unread(chain, path)


@contextmanager
def another_computer(chain: Chain) -> Iterator[None]:
    """Whose user's files, journals and locks are its own."""
    own, chain.folder = chain.folder, chain.folder.parent / "elsewhere"
    try:
        with pytest.MonkeyPatch.context() as patch:
            for name in HOMES:
                patch.setenv(name, str(chain.folder))
            yield
    finally:
        chain.folder = own


def by_hand(session: Session, event_timer: int = 70) -> None:
    configure(session, session.node(1), {Pdo.parse("tpdo1"): PdoRequest(event_timer=event_timer)})


def stored_by(chain: Chain) -> None:
    with chain.session(node=1) as session:
        store_settings(session, session.node(1), None)


@pytest.mark.parametrize("everything", [False, True])
@pytest.mark.parametrize("later", [False, True], ids=["session", "later"])
def test_an_undo_after_a_store_brings_no_stamp_back(
    chain: Chain, tmp_path: Path, *, everything: bool, later: bool
) -> None:
    path = file(tmp_path)
    chain.apply(path)
    before = chain.held()
    with chain.session(node=1) as session:
        by_hand(session)
        store_settings(session, session.node(1), None)
        if not later:
            assert undo(session, everything=everything)
    if later:
        with chain.session(node=1) as session:
            assert undo(session)
    assert chain.held() == before or everything
    assert held(chain, 1) == NOTHING
    assert 1 not in elsewhere(chain, path)
    restarted(chain)
    assert 1 not in elsewhere(chain, path)


def test_an_undo_behind_the_undo_of_a_stamped_file_is_not_refused(chain: Chain, tmp_path: Path) -> None:
    path = file(tmp_path)
    before = chain.held()
    with chain.session(node=None) as session:
        apply_file(session, str(path))
        by_hand(session)
        assert undo(session)
        assert undo(session, everything=True)
    assert chain.held() == before
    assert [held(chain, node_id) for node_id in NODES] == [NOTHING, NOTHING]


def test_an_undo_of_several_nodes_ends_a_stamp_that_came_later_from_elsewhere(chain: Chain, tmp_path: Path) -> None:
    path, early = file(tmp_path), file(tmp_path, timer=25, text=FILE.replace(", stamp: true", ""))
    chain.apply(early)
    with another_computer(chain):
        chain.apply(file(tmp_path, timer=25))
        assert unread(chain, file(tmp_path, timer=25)) == (1, 5)
    with chain.session(node=None) as session:
        assert undo(session, everything=True)
    assert [held(chain, node_id) for node_id in NODES] == [NOTHING, NOTHING]
    assert elsewhere(chain, path) == ()


@pytest.mark.parametrize("group", [None, 3], ids=["all", "application"])
def test_who_is_asked_for_its_defaults_has_no_stamp(chain: Chain, tmp_path: Path, group: int | None) -> None:
    path = file(tmp_path)
    chain.apply(path)
    with chain.session(node=1) as session:
        restore_defaults(session, session.node(1), group, prove=False)
    assert held(chain, 1) == NOTHING
    assert elsewhere(chain, path) == (5,)


def test_a_restore_that_is_written_ends_it(chain: Chain, tmp_path: Path) -> None:
    chain.apply(file(tmp_path))
    with chain.session(node=1) as session:
        session.node(1).write(0x1011, 1, b"load")
    assert held(chain, 1) == NOTHING


def test_values_that_go_other_ways_than_the_stamp_are_read(chain: Chain, tmp_path: Path) -> None:
    """An RPDO may write 0x6072, and 0x1011:03 restores it alone: the stamp does not say that it is as it was."""
    text = FILE.replace(
        "    tpdo:\n      1: {{inh", "    sdo: [{{index: 0x6072, sub_index: 0, value: 700}}]\n    tpdo:\n      1: {{inh"
    )
    path = file(tmp_path, text=text)
    chain.apply(path)
    assert stamp(chain, 5).is_own
    with chain.session(node=5) as session:
        session.node(5).write(0x6072, 0, (500).to_bytes(2, "little"))
    assert elsewhere(chain, path) == (1,)
    assert chain.plan(path, trust_stamp=True).plan.nodes[1].plan.changes


def test_a_command_ends_no_stamp(chain: Chain, tmp_path: Path) -> None:
    chain.apply(file(tmp_path))
    with chain.session(node=1) as session:
        session.node(1).write(0x6040, 0, b"\6\0")
    assert stamp(chain, 1).is_own


def test_a_file_without_stamps_ends_it(chain: Chain, tmp_path: Path) -> None:
    chain.apply(file(tmp_path))
    plain = file(tmp_path, timer=22, text=FILE.replace(", stamp: true", ""))
    assert [step.object for step in chain.plan(plain).plan.nodes[0].plan.steps][:2] == ["1020:01", "1020:02"]
    assert chain.apply(plain)
    assert held(chain, 1) == NOTHING
    assert stamp(chain, 5).is_own
    assert not chain.plan(plain).plan.to_do


@pytest.mark.parametrize("clears", [True, False])
def test_whoever_else_changes_a_device_that_clears_it_is_noticed(clears: bool, tmp_path: Path) -> None:
    chain = Chain(tmp_path / "files", families=NODES, operational=False, clears_stamps=clears)
    path = file(tmp_path)
    chain.apply(path)
    chain.devices[1].download(0x1017, 0, b"\7\0")
    assert unread(chain, path) == ((5,) if clears else (1, 5))
    assert chain.plan(path).plan.nodes[0].plan.changes
    assert chain.apply(path)
    assert chain.devices[1].value(0x1017) == (200).to_bytes(2, "little")
    assert stamp(chain, 1).is_own


def test_a_stamp_of_somebody_else_is_left_alone_and_its_node_is_read(chain: Chain, tmp_path: Path) -> None:
    path = file(tmp_path)
    for sub_index, number in ((1, 15_000), (2, 43_200_000)):
        chain.devices[5].set_value(0x1020, sub_index, number.to_bytes(4, "little"))
    shown = chain.plan(path)
    assert [finding.rule for finding in shown.plan.nodes[1].findings] == ["stamp-foreign"]
    assert "2025-01-25 12:00:00.000" in shown.plan.nodes[1].findings[0].text
    writes = [step.object for node in shown.plan.nodes for step in node.plan.steps if node.node_id == 5]
    assert "1020:01" not in writes
    chain.apply(path)
    assert not stamp(chain, 5).is_own
    assert unread(chain, path) == (1,)


@pytest.mark.parametrize(
    ("code", "stands"),
    [(Abort.NO_OBJECT, True), (Abort.WRITE_ONLY, True), (Abort.DEVICE_STATE, False), (0x0504_0000, False)],
)
def test_a_stamp_that_cannot_be_read_now_is_not_taken_for_none(
    chain: Chain, tmp_path: Path, code: int, stands: bool
) -> None:
    """Else it would go on vouching for what is changed."""
    path = file(tmp_path)
    chain.apply(path)
    device, refuses = chain.devices[5], [True]
    answer = device.upload

    def upload(index: int, sub_index: int) -> bytes:
        if index == 0x1020 and refuses:
            raise Refusal(code)
        return answer(index, sub_index)

    device.upload = upload  # type: ignore[method-assign]
    before = device.value(0x1800, 5)
    with chain.session(node=5) as session, suppress(SdoAborted):
        configure(session, session.node(5), {Pdo.parse("tpdo1"): PdoRequest(event_timer=70)})
    assert (device.value(0x1800, 5) != before) == stands
    refuses.clear()
    if not stands:
        assert unread(chain, path) == (1, 5)


def test_a_node_without_0x1020_gets_none(tmp_path: Path) -> None:
    chain = Chain(tmp_path / "files", families={1: "gen4", 5: "generic"}, operational=False)
    path = file(tmp_path, text=FILE.replace("heartbeat_producer: 200", ""))
    shown = chain.plan(path)
    assert [finding.rule for finding in shown.plan.nodes[0].findings][-1:] == ["stamp-absent"]
    chain.apply(path)
    assert unread(chain, path) == (5,)


@pytest.mark.parametrize("step", range(1, 6))
def test_a_refusal_leaves_every_stamp_as_it_was(chain: Chain, tmp_path: Path, step: int) -> None:
    chain.apply(file(tmp_path))
    before, stamps = chain.held(), {node_id: held(chain, node_id) for node_id in NODES}
    refusing = Chain(
        chain.folder, [f"1:refuse@{step}=0x08000000"], families=NODES, operational=False,
        clears_stamps=chain.devices[1].family.clears_stamp,
    )  # fmt: skip
    for node_id, one in chain.devices.items():
        refusing.devices[node_id].power_on(one._memory._stored)
        refusing.devices[node_id].boot_up()
    assert refusing.held() == before
    with pytest.raises(DvtcliError) as raised:
        refusing.apply(file(tmp_path, timer=30, inhibit=40))
    assert raised.value.state == "rolled_back"
    assert refusing.held() == before
    assert {node_id: held(refusing, node_id) for node_id in NODES} == stamps


@pytest.mark.counted
@pytest.mark.drawn(2)
@pytest.mark.parametrize("clears", [True, False])
@pytest.mark.parametrize("text", [FILE, LINKED])
def test_nobody_is_told_wrong_by_a_stamp_whenever_apply_was_killed(
    clears: bool, text: str, home: Path, pytestconfig: pytest.Config
) -> None:
    """At writes as many as `--kills` says: who is not read holds what the file says, as another computer sees it."""
    (home.parent / "files").mkdir()
    chain = Chain(home.parent / "files", families=NODES, operational=False, bus=Watched, clears_stamps=clears)
    old, new = file(home.parent, text=text), file(home.parent, timer=30, inhibit=40, text=text)
    chain.apply(old)
    before = chain.held(), {node_id: held(chain, node_id) for node_id in NODES}
    chosen = part(range(1, 29), pytestconfig.getoption("--kills"), pytestconfig, f"stamp {clears} {len(text)}")

    def look_from_elsewhere(after: Chain) -> None:
        """From a computer that knows nothing of the other one."""
        with another_computer(after):
            for path in (old, new):
                trusted = unread(after, path)
                differing = [one.node_id for one in after.plan(path).plan.nodes if len(one.plan)]
                assert not set(trusted) & set(differing), (path, trusted, differing)

    def look(after: Chain) -> None:
        look_from_elsewhere(after)
        assert unread(after, new) == ()
        with after.session(node=None) as session:
            recover(session)
        assert after.held() == before[0]
        assert all(held(after, node_id) in (NOTHING, before[1][node_id]) for node_id in NODES)
        look_from_elsewhere(after)
        restarted(after)
        look_from_elsewhere(after)

    wrong: dict[int, str] = {}
    first = chain.bus.writes

    def on_write(count: int) -> None:
        if count - first in chosen and (failed := afterwards(chain, home, look)):
            wrong[count - first] = failed

    chain.bus.on_write = on_write
    chain.apply(new)
    assert wrong == {}


def test_an_undo_of_everything_leaves_no_stamp(chain: Chain, tmp_path: Path) -> None:
    chain.apply(file(tmp_path))
    before = chain.held()
    with chain.session(node=None) as session:
        apply_file(session, str(file(tmp_path, timer=30, inhibit=40)))
        assert undo(session, everything=True)
    assert chain.held() == before
    assert [held(chain, node_id) for node_id in NODES] == [NOTHING, NOTHING]


def test_nodes_that_are_linked_are_trusted_together(chain: Chain, tmp_path: Path) -> None:
    path = file(tmp_path, text=LINKED)
    chain.apply(path)
    assert unread(chain, path) == (1, 5)
    assert unread(chain, file(tmp_path, inhibit=12, text=LINKED)) == ()
    chain.devices[5].set_value(0x1020, 1, bytes(4))
    assert unread(chain, path) == ()


def test_half_of_a_link_is_not_stamped(tmp_path: Path) -> None:
    chain = Chain(tmp_path / "files", families={**NODES, 9: "generic"}, operational=False)
    path = file(tmp_path, text=LINKED.replace("links:", "  alone: {{node_id: 9}}\nlinks:"))
    with chain.session(node=(1, 9)) as session:
        one, alone = plan_file(session, str(path)).plan.nodes
    assert (0x1020, 1) not in one.values
    assert (0x1020, 1) in alone.values


def test_a_link_by_hand_ends_the_stamps_of_what_it_changes(chain: Chain, tmp_path: Path) -> None:
    chain.apply(file(tmp_path))
    with chain.session(node=None) as session:
        link_pdos(session, Endpoint(1, Pdo.parse("tpdo1")), [Endpoint(5, Pdo.parse("rpdo1"))])
    assert held(chain, 5) == NOTHING


def test_what_is_not_stored_is_not_trusted(chain: Chain, tmp_path: Path) -> None:
    path = file(tmp_path)
    failing = Chain(chain.folder, ["5:store-fails"], families=NODES, operational=False)
    with pytest.raises(LeftChanged) as left:
        failing.apply(path)
    held_but = "every node has the planned values but the stamp of node 5, which is 0 until the node has stored"
    assert left.value.text == f"{held_but}, and node 5 refused to store: the stored values are unknown"
    assert str(left.value.state_text).startswith(f"{held_but}, read back equal;")
    with failing.session(node=None) as session, pytest.raises(LeftChanged) as again:
        recover(session, finish=True)
    assert (again.value.text, again.value.state_text) == (left.value.text, left.value.state_text)
    first = (
        "every node has the planned values but the stamp of node 5, which is written before the stores; store on node 5"
    )
    with failing.session(node=None, yes=False) as session, pytest.raises(SafetyRefusal, match=first):
        recover(session, finish=True)
    assert held(failing, 5) == NOTHING, "nor by another computer, which remembers nothing"
    assert unread(failing, path) == (), "as long as it waits to be finished"
    with failing.session(node=None) as session:
        recover(session)
    assert (held(failing, 1), held(failing, 5)) == (NOTHING, NOTHING)
    (due,) = (one.plan.changes for one in failing.plan(path).plan.nodes if one.plan.node_id == 5)
    assert due, "another apply stamps, and stores"
