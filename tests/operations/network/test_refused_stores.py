"""Nodes that refuse to store at the end of a network's change: the others are asked, and both ways are open then."""

from __future__ import annotations

from collections.abc import Callable, Collection
from itertools import combinations
from pathlib import Path

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.hint import Hint
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.request import PdoRequest
from dvtcli.domain.store import WhoStored
from dvtcli.errors import InputFileError, LeftChanged, SafetyRefusal, UsageError
from dvtcli.operations.changes.change import configure
from dvtcli.operations.changes.recover_change import recover
from dvtcli.operations.network.network_files import apply_file
from dvtcli.operations.results import Facts
from dvtcli.operations.session.session import Session
from dvtcli.simulator.device.memory import Refusal
from tests.operations.network.bench import Chain
from tests.operations.network.killed import Watched, afterwards
from tests.operations.network.test_network_stores import TYPE, Said, types

IDS = (5, 7, 9)
REFUSED, HARDWARE = 0x0609_0030, 0x0606_0000
STAMP = (0x1020, 1)


@pytest.fixture
def chain(home: Path) -> Chain:
    (home.parent / "files").mkdir()
    home.mkdir(exist_ok=True)
    return Chain(home.parent / "files", bus=Watched, families=dict.fromkeys(IDS, "generic"), operational=False)


def file(home: Path, *, stamp: bool) -> Path:
    path = home.parent / "stores.yaml"
    path.write_text(
        f"defaults: {{store: true, stamp: {str(stamp).lower()}, tpdo: {{1: {{transmission: 1}}}}}}\n"
        + "".join(f"n{node_id}: {{node_id: {node_id}}}\n" for node_id in IDS)
    )
    return path


def refuse_stores(chain: Chain, ids: Collection[int], code: int = REFUSED) -> list[int]:
    """These nodes refuse to store from now on, and no others; node-IDs of those that are asked."""
    asked: list[int] = []

    def download(device: object, node_id: int) -> Callable[[int, int, bytes], None]:
        def take(index: int, sub_index: int, data: bytes) -> None:
            if index == 0x1010:
                asked.append(node_id)
                if node_id in ids:
                    raise Refusal(code)
            type(device).download(device, index, sub_index, data)  # type: ignore[attr-defined]

        return take

    for node_id, device in chain.devices.items():
        device.download = download(device, node_id)  # type: ignore[method-assign]
    return asked


def refused(chain: Chain, path: Path) -> LeftChanged:
    with chain.session(node=None) as session, pytest.raises(LeftChanged) as left:
        apply_file(session, str(path))
    return left.value


def stamps(chain: Chain) -> dict[int, int]:
    return {node_id: int.from_bytes(one.value(*STAMP), "little") for node_id, one in chain.devices.items()}


def stored_types(chain: Chain) -> dict[int, bytes | None]:
    return {node_id: some.get(TYPE) for node_id, some in chain.stored().items()}


SOME = [ids for count in (1, 2, 3) for ids in combinations(IDS, count)]


@pytest.mark.parametrize("code", [REFUSED, HARDWARE])
@pytest.mark.parametrize("ids", SOME)
@pytest.mark.parametrize("stamp", [True, False])
@pytest.mark.drawn(6)
def test_the_others_are_asked_and_it_is_finished(
    chain: Chain, home: Path, ids: tuple[int, ...], code: int, *, stamp: bool
) -> None:
    asked, others = refuse_stores(chain, ids, code), tuple(one for one in IDS if one not in ids)
    left = refused(chain, file(home, stamp=stamp))
    assert tuple(asked) == IDS
    unknown = ids if code == HARDWARE else ()
    assert left.stores == WhoStored(others, () if unknown else ids, unknown)
    assert all(str(path) in str(left.details) for path in chain.journals())
    assert len(chain.journals()) == 3
    assert "recover --finish` " in typed(left.hint)
    assert types(chain) == dict.fromkeys(IDS, 1)
    assert {one for one, days in stamps(chain).items() if days} == ({*others} if stamp else set())

    again = refuse_stores(chain, ids[1:], code)
    if ids[1:]:
        with chain.session(node=None) as session, pytest.raises(LeftChanged) as still:
            recover(session, finish=True)
        assert still.value.stores == WhoStored((*sorted({*others, ids[0]}),), () if unknown else ids[1:], unknown[1:])
        assert tuple(again) == ids, "none stores twice"
        assert {one for one, days in stamps(chain).items() if days} == ({*others, ids[0]} if stamp else set())
    refuse_stores(chain, ())
    with chain.session(node=None) as session:
        recover(session, finish=True)
    assert chain.journals() == []
    assert set(stored_types(chain).values()) == {b"\x01"}
    assert all(stamps(chain).values()) is stamp
    with chain.session(node=None) as session:
        assert apply_file(session, str(file(home, stamp=stamp))).plan.writes == 0


@pytest.mark.parametrize("ids", SOME)
@pytest.mark.parametrize("stamp", [True, False])
@pytest.mark.drawn(4)
def test_the_others_are_asked_and_it_goes_back(chain: Chain, home: Path, ids: tuple[int, ...], *, stamp: bool) -> None:
    before = types(chain)
    refuse_stores(chain, ids)
    refused(chain, file(home, stamp=stamp))
    with chain.session(node=None) as session:
        session.reporter = said = Warned()
        recover(session)
    assert (types(chain), chain.journals()) == (before, [])
    assert set(stamps(chain).values()) == {0}
    assert [
        text.partition(" stored the values")[0][-1]
        for text in said.warnings
        if " stored the values that were rolled back" in text
    ] == [str(one) for one in IDS if one not in ids]
    assert "may have stored" not in str(said.warnings)


class Warned(Said):
    """Keeps the warnings."""

    def __init__(self) -> None:
        super().__init__()
        self.warnings: list[str] = []

    def warning(self, text: Hint | str) -> None:
        self.warnings.append(typed(text))


def ways_on(session: Session, chain: Chain, *, finishes: bool) -> None:
    recover(session, finish=finishes)
    assert chain.journals() == []


@pytest.mark.parametrize("finishes", [True, False])
def test_a_node_that_only_stores_and_holds_the_stamp_already_is_no_other(
    chain: Chain, home: Path, *, finishes: bool
) -> None:
    """Node 5 is as the file says, stamp and all, and has not stored it."""
    path, node = file(home, stamp=True), chain.devices[5]
    refuse_stores(chain, ())
    chain.apply(path)
    stamp = node.value(*STAMP), node.value(0x1020, 2)
    with chain.session(node=5) as session:
        for kind in (7, 1):
            configure(session, session.node(5), {Pdo.parse("tpdo1"): PdoRequest(transmission_type=kind)})
    for sub_index, data in enumerate(stamp, 1):
        node.download(0x1020, sub_index, data)
    for node_id in (7, 9):
        chain.devices[node_id].download(*TYPE, b"\x07")
        chain.devices[node_id].download(*STAMP, bytes(4))
        chain.devices[node_id].download(0x1020, 2, bytes(4))
    held = types(chain)
    asked = refuse_stores(chain, (5, 9))
    refused(chain, path)
    assert (tuple(asked), len(chain.journals())) == (IDS, 3)
    assert [bool(days) for days in stamps(chain).values()] == [False, True, False]
    refuse_stores(chain, ())
    with chain.session(node=None) as session:
        ways_on(session, chain, finishes=finishes)
    assert types(chain) == (dict.fromkeys(IDS, 1) if finishes else held)
    assert any(stamps(chain).values()) is finishes, "a node that does not store has no stamp"


@pytest.mark.counted
@pytest.mark.parametrize("stamp", [True, False])
def test_finish_may_end_at_every_write(chain: Chain, home: Path, pytestconfig: pytest.Config, *, stamp: bool) -> None:
    """Killed at any of its writes, `recover --finish` is begun again, or everything goes back."""
    from tests.harness.sample import part

    before = types(chain)
    refuse_stores(chain, (5, 9))
    refused(chain, file(home, stamp=stamp))
    refuse_stores(chain, ())
    assert isinstance(chain.bus, Watched)
    most = 2 + (4 if stamp else 0)
    chosen = part(range(1, most + 1), pytestconfig.getoption("--kills"), pytestconfig, f"finish {stamp}")
    wrong: dict[tuple[int, bool], str] = {}
    first = chain.bus.writes

    def finished(after: Chain) -> None:
        with after.session(node=None) as session:
            recover(session, finish=True)
        assert (set(stored_types(after).values()), after.journals()) == ({b"\x01"}, [])
        assert all(stamps(after).values()) is stamp

    def back(after: Chain) -> None:
        with after.session(node=None) as session:
            recover(session)
        assert (types(after), after.journals(), set(stamps(after).values())) == (before, [], {0})

    def on_write(number: int) -> None:
        for look in (finished, back) if number - first in chosen else ():
            if failed := afterwards(chain, home, look):
                wrong[number - first, look is finished] = failed

    chain.bus.on_write = on_write
    with chain.session(node=None) as session:
        recover(session, finish=True)
    assert wrong == {}
    assert chain.bus.writes - first == most


@pytest.mark.parametrize("selected", [None, 5])
def test_nothing_is_finished_while_a_journal_cannot_be_used(chain: Chain, home: Path, selected: int | None) -> None:
    """Of all nodes the journal is named; if node 5 is selected nothing says what node 7 is to hold."""
    refuse_stores(chain, (5, 7, 9))
    refused(chain, file(home, stamp=False))
    asked = refuse_stores(chain, ())
    path = next(one for one in chain.journals() if one.stem.endswith("-7"))
    path.write_text("damaged")
    error = InputFileError if selected is None else SafetyRefusal
    with chain.session(node=selected) as session, pytest.raises(error) as told:
        recover(session, finish=True)
    assert str(path) in str(told.value.place) if selected is None else "node 7" in str(told.value)
    assert (asked, len(chain.journals())) == ([], 3)


@pytest.mark.parametrize("ids", [(5,), (7, 9), IDS])
@pytest.mark.parametrize("stamp", [True, False])
@pytest.mark.drawn(3)
def test_what_was_accepted_is_over_for_it(chain: Chain, home: Path, ids: tuple[int, ...], *, stamp: bool) -> None:
    """The first of *ids*, which refused, is accepted: it is asked for no more."""
    refuse_stores(chain, ids)
    refused(chain, file(home, stamp=stamp))
    asked = refuse_stores(chain, ids[1:2])
    with chain.session(node=ids[0]) as session:
        recover(session, accept=True)
    if ids[1:]:
        with chain.session(node=None) as session, pytest.raises(LeftChanged) as left:
            recover(session, finish=True)
        assert left.value.stores is not None
        assert ids[0] not in (*left.value.stores.stored, *left.value.stores.not_stored, *left.value.stores.unknown)
    refuse_stores(chain, ids[:1])
    with chain.session(node=None) as session:
        answer = recover(session, finish=True)
    assert isinstance(answer, Facts)
    assert ids[0] not in dict(answer.rows)["stored"]
    assert (ids[0] in asked, chain.journals()) == (False, [])
    assert {one for one, held in stored_types(chain).items() if held == b"\x01"} == {*IDS} - {ids[0]}


def test_all_that_was_interrupted_is_accepted_with_one_yes(chain: Chain, home: Path) -> None:
    refuse_stores(chain, (5, 9))
    refused(chain, file(home, stamp=False))
    held = types(chain)
    with (
        chain.session(node=None, yes=False) as session,
        pytest.raises(SafetyRefusal, match="no terminal to answer on") as no,
    ):
        recover(session, accept=True)
    assert all(f"node {node_id}" in no.value.text for node_id in IDS)
    assert len(chain.journals()) == 3
    with chain.session(node=None) as session:
        answer = recover(session, accept=True)
    assert isinstance(answer, Facts)
    rows = dict(answer.rows)
    assert (rows["accepted"], [one["node"] for one in rows["nodes"]]) == (True, [*IDS])
    assert (types(chain), chain.journals()) == (held, [])
    assert list((chain.folder / "journals").glob("*.whole")) == []
    refuse_stores(chain, ())
    with chain.session(node=None) as session:
        assert apply_file(session, str(file(home, stamp=False))).plan.writes == 0


def test_a_node_that_cannot_be_accepted_keeps_no_other_from_it(chain: Chain, home: Path) -> None:
    refuse_stores(chain, (5,))
    refused(chain, file(home, stamp=False))
    damaged = chain.journals()[1]
    damaged.write_text("damaged")
    with chain.session(node=None) as session, pytest.raises(InputFileError) as told:
        recover(session, accept=True)
    assert (str(told.value.place), chain.journals()) == (str(damaged), [damaged])
    assert ("done", "nodes 5 and 9: the present values are accepted") in told.value.details


def test_of_several_the_hint_names_what_can_be_set_aside(chain: Chain, home: Path) -> None:
    refuse_stores(chain, (5,))
    refused(chain, file(home, stamp=False))
    with chain.session(node=None) as session, pytest.raises(UsageError) as usable:
        recover(session, discard=True)
    assert "recover`" in typed(usable.value.hint)
    chain.journals()[1].write_text("damaged")
    with chain.session(node=None) as session, pytest.raises(UsageError) as told:
        recover(session, discard=True)
    assert "-n 7 recover --discard`" in typed(told.value.hint)
    with chain.session(node=7) as session:
        recover(session, discard=True)
    assert len(chain.journals()) == 2


def test_the_question_says_what_is_to_be_written_and_what_is_only_compared(chain: Chain, home: Path) -> None:
    """Node 5 has lost what was set; the others hold it."""
    refuse_stores(chain, (5,))
    refused(chain, file(home, stamp=False))
    chain.devices[5].download(*TYPE, b"\xff")
    with chain.session(node=None, yes=False) as session:
        session.reporter = asked = Asked()
        with pytest.raises(SafetyRefusal):
            recover(session)
    question = asked.questions[-1]
    back, _, same = question.partition("; ")
    assert back == "TPDO1 of node 7, TPDO1 of node 9 will be rolled back to the state before the interrupted change"
    assert same.startswith("already as before the interrupted change, compared only: TPDO1")
    assert same.endswith(" of node 5; recover?")
    assert len(chain.journals()) == 3


class Asked(Warned):
    """Keeps the questions, and answers no."""

    def __init__(self) -> None:
        super().__init__()
        self.questions: list[str] = []

    def ask(self, question: str) -> bool:
        self.questions.append(question)
        return False
