"""Devices that refuse something when an interrupted change is recovered: all else goes back, and no node is blocked."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import pytest

from dvtcli.cli.view.error_lines import error_document, error_lines
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Change, Plan, Step, ValueChange, plan_pdo
from dvtcli.errors import DvtcliError, LeftChanged
from dvtcli.operations.changes.recover_change import recover
from dvtcli.operations.results import Facts
from dvtcli.operations.session.session import Session
from dvtcli.simulator.device.memory import Refusal
from tests.operations.network.bench import Chain
from tests.surroundings import HOMES

PLACES = [(0x1017, 0), (0x1006, 0), (0x1007, 0)]
CODE = 0x0800_0020
TIMER = (0x1800, 5)


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "home"))


@pytest.fixture
def chain(tmp_path: Path) -> Chain:
    return Chain(tmp_path / "files", families={5: "generic", 9: "generic"}, operational=False)


def refuse(chain: Chain, node_id: int, *, reads: Collection[Any] = (), writes: Collection[Any] = ()) -> None:
    """From now on the node refuses to let these places be read, and be written; an index stands for all of it."""
    device = chain.devices[node_id]

    def upload(index: int, sub_index: int) -> bytes:
        if (index, sub_index) in reads or index in reads:
            raise Refusal(CODE)
        return type(device).upload(device, index, sub_index)

    def download(index: int, sub_index: int, data: bytes) -> None:
        if (index, sub_index) in writes or index in writes:
            raise Refusal(CODE)
        type(device).download(device, index, sub_index, data)

    device.upload, device.download = upload, download  # type: ignore[method-assign]


def interrupted(chain: Chain, node_id: int = 5, places: Collection[tuple[int, int]] = PLACES) -> Path:
    """The journal of a change of single objects and of the timer of TPDO1, all of which was written."""
    with chain.session(node=node_id) as session:
        node, tpdo1 = session.node(node_id), Pdo.parse("tpdo1")
        now = node.pdo(tpdo1)
        after = now.with_parameters(event_timer=50)
        changes: list[Change] = [plan_pdo(tpdo1, now, after)]
        for place in places:
            held = node.upload(*place)
            changes.append(ValueChange(Step(*place, held, bytes([7]).ljust(len(held), b"\0"), "write")))
        assert node.guard is not None
        path = node.guard.journals.write(Plan(node_id, tuple(changes)), node.identity(), None)
    for step in (step for change in changes for step in change.steps):
        chain.devices[node_id].download(step.index, step.sub_index, step.after)
    return path


def values(chain: Chain, node_id: int = 5) -> list[int]:
    return [int.from_bytes(chain.devices[node_id].value(*place), "little") for place in (TIMER, *PLACES)]


def may_be_changed(session: Session, node_id: int = 5) -> bool:
    """Whether nothing blocks the node."""
    return bool(session.node(node_id).write(0x1801, 5, b"\x09\0"))


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("is_written", [True, False])
def test_a_value_that_can_be_read_no_more_blocks_nothing(
    chain: Chain, place: tuple[int, int], *, is_written: bool
) -> None:
    before = values(chain)
    path = interrupted(chain)
    changed = values(chain)
    refuse(chain, 5, reads=[place], writes=[] if is_written else [place])
    label = f"{place[0]:04X}:{place[1]:02X}"
    with chain.session(node=5) as session:
        with pytest.raises(LeftChanged) as left:
            recover(session)
        assert label in left.value.text
        assert f"the present value of {label} of node 5 is unknown" in (left.value.state_text or "")
        assert "TPDO1" in (left.value.state_text or "")
        assert not path.exists()
        assert isinstance(recover(session), Facts), "there is nothing left to recover"
        assert may_be_changed(session)
    number = 1 + PLACES.index(place)
    wanted = [changed[one] if one == number and not is_written else before[one] for one in range(len(before))]
    assert values(chain) == wanted, "also what was written unseen"


def test_what_refuses_to_be_written_is_named_and_all_else_is_put_back(chain: Chain) -> None:
    before = values(chain)
    path = interrupted(chain)
    refuse(chain, 5, writes=[PLACES[1]])
    with chain.session(node=5) as session:
        with pytest.raises(LeftChanged) as left:
            recover(session)
        assert [row.label for row in left.value.left] == ["1006:00"]
        assert path.exists()
        refuse(chain, 5)
        recover(session)
    assert (values(chain), path.exists()) == (before, False)


@pytest.mark.parametrize("unread", [PLACES[:1], PLACES, [0x1800], [*PLACES, 0x1800]])
def test_accept_shows_what_can_be_read_and_names_the_rest(chain: Chain, unread: list[Any]) -> None:
    path = interrupted(chain)
    refuse(chain, 5, reads=unread)
    with chain.session(node=5) as session:
        done = recover(session, accept=True)
        assert isinstance(done, Facts)
        held = dict(done.rows)["held"]
        assert may_be_changed(session)
    unknown = {one.get("object") or one["pdo"] for one in held if not one["known"]}
    assert unknown == {"tpdo1" if one == 0x1800 else f"{one[0]:04X}:{one[1]:02X}" for one in unread}
    assert len(held) == 4
    assert [row for row in done.text if "unknown" in row]
    assert not path.exists()


@pytest.mark.parametrize("spoilt", ["damaged", "another device"])
def test_a_journal_that_cannot_be_used_does_not_keep_other_nodes_from_going_back(chain: Chain, spoilt: str) -> None:
    before = values(chain, 9)
    first, second = interrupted(chain, 5), interrupted(chain, 9)
    if spoilt == "damaged":
        first.write_text("{")
    else:
        chain.devices[5].set_value(0x1018, 4, b"\x99\0\0\0")
    with chain.session(node=None) as session, pytest.raises(DvtcliError) as told:
        recover(session)
    assert (told.value.exit_code, str(first) in f"{told.value} {told.value.place}") == (
        4 if spoilt == "damaged" else 6,
        True,
    )
    document = error_document(told.value)
    assert (document["done"], document["state"]) == (["node 9: rolled back"], "rolled_back")
    own = [] if spoilt == "damaged" else [{"node": 5, "state": "unchanged"}]
    assert document["nodes"] == [*own, {"node": 9, "state": "rolled_back"}]
    *_, state = error_lines(told.value)
    said = "nothing was written, except for node 9" if spoilt == "damaged" else "node 5 unchanged: nothing was written"
    assert said in str(state)
    assert (values(chain, 9), first.exists(), second.exists()) == (before, True, False)
