"""A bus that is lost while several nodes are changed: what was written is never called unchanged, and comes back."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable, DvtcliError, LeftChanged
from dvtcli.operations.changes.recover_change import recover
from dvtcli.operations.network.network_files import apply_file
from tests.harness.sample import heavy
from tests.operations.network.bench import Chain, Heard

PART = "  heartbeat_producer: 300\n  tpdo: {2: {mapping: [6041, 606C]}, 1: {event_timer: 70}}\n"


class Cut(Heard):
    """A bus whose driver fails for good once it has sent so many frames that write (*left*)."""

    left = -1
    cut = False

    def _use(self) -> None:
        super()._use()
        if self.cut:
            raise BusUnavailable("the bus is gone")

    def _send(self, frame: Frame) -> None:
        super()._send(frame)
        if 0x600 < frame.can_id < 0x680 and frame.data[0] >> 5 == 1 and self.left > 0:
            self.left -= 1
            self.cut = not self.left


@heavy
@pytest.mark.parametrize("writes", [17, 18])
def test_after_each_store_it_is_said_who_has_stored_and_who_may_have(home: Path, writes: int) -> None:
    folder, path = home.parent / "files", home.parent / "net.yaml"
    folder.mkdir()
    path.write_text("".join(f"n{node_id}:\n  node_id: {node_id}\n  store: true\n{PART}" for node_id in (5, 9)))
    chain = Chain(folder, families={5: "generic", 9: "generic"}, bus=Cut, operational=False)
    before, stored = chain.held(), chain.stored()
    assert isinstance(chain.bus, Cut)
    chain.bus.left = writes
    with pytest.raises(LeftChanged) as raised:
        chain.apply(path)
    who = {label: text for label, text in raised.value.details if "stored" in label or label == "unknown"}
    if writes == 17:  # node 5 has stored, and its answer was lost
        assert who == {"not stored": "node 9", "unknown": "node 5"}
    else:
        assert who == {"stored": "node 5", "unknown": "node 9"}
    assert (chain.stored()[5] != stored[5], chain.stored()[9] != stored[9]) == (True, writes == 18)
    assert "not every node is known to have" in str(raised.value.state_text)
    assert len(chain.journals()) == 2
    chain.bus.cut = False
    with chain.session(node=None) as session:
        recover(session)
    assert chain.held() == before
    assert chain.journals() == []


@pytest.mark.parametrize("writes", range(1, 17))
def test_after_each_number_of_writes_the_nodes_are_said_to_be_changed_and_come_back(home: Path, writes: int) -> None:
    folder, path = home.parent / "files", home.parent / "net.yaml"
    folder.mkdir()
    path.write_text("".join(f"n{node_id}:\n  node_id: {node_id}\n{PART}" for node_id in (5, 9)))
    chain = Chain(folder, families={5: "generic", 9: "generic"}, bus=Cut, operational=False)
    before = chain.held()
    assert isinstance(chain.bus, Cut)
    chain.bus.left = writes
    with pytest.raises(DvtcliError) as raised:
        chain.apply(path)
    assert isinstance(raised.value, LeftChanged), raised.value
    assert (raised.value.state, raised.value.exit_code) == ("left_changed", 7)
    told = [raised.value.text, *(text for label, text in raised.value.details if label == "also")]
    changed = {node_id for node_id, held in chain.held().items() if held != before[node_id]}
    assert changed <= {node_id for node_id in (5, 9) if any(f"of node {node_id} " in text for text in told)}
    assert chain.journals()
    chain.bus.cut = False
    with chain.session() as session:
        recover(session)
    assert chain.held() == before
    assert chain.journals() == []


class CutWhereAsked(Cut):
    """The same, once it has sent so many requests."""

    #: requests before the first that writes
    requests = 0

    def _send(self, frame: Frame) -> None:
        super(Cut, self)._send(frame)
        if 0x600 < frame.can_id < 0x680 and self.left > 0:
            self.left -= 1
            self.cut = not self.left


class CutAtTheFirstWrite(CutWhereAsked):
    """The same, once, at the first request that writes; it counts those before it."""

    was_cut = False

    def _send(self, frame: Frame) -> None:
        super(Cut, self)._send(frame)
        if 0x600 < frame.can_id < 0x680 and not self.was_cut:
            self.cut = self.was_cut = frame.data[0] >> 5 == 1
            self.requests += not self.cut


@pytest.mark.parametrize("before", [1, 2, 3, 5, 8, 13])
def test_a_change_that_fails_before_its_first_write_is_over(home: Path, before: int) -> None:
    """The next change of the session is no part of it."""
    folder, path = home.parent / "files", home.parent / "net.yaml"
    folder.mkdir()
    path.write_text("".join(f"n{node_id}:\n  node_id: {node_id}\n{PART}" for node_id in (5, 7)))
    families = dict.fromkeys((5, 7), "generic")
    counting = Chain(folder, families=families, bus=CutAtTheFirstWrite, operational=False)
    with pytest.raises(DvtcliError):
        counting.apply(path)
    assert isinstance(counting.bus, CutAtTheFirstWrite)
    counting.bus.cut = False
    with counting.session() as session:
        recover(session)
    chain = Chain(home.parent / "others", families=families, bus=CutWhereAsked, operational=False)
    assert isinstance(chain.bus, Cut)
    chain.bus.left = counting.bus.requests - before
    with chain.session() as session:
        with pytest.raises(DvtcliError, match="the bus is gone"):
            apply_file(session, str(path))
        assert session.group.id is None


@pytest.mark.parametrize("cut", ["request 133", "request 205", "first write"])
def test_a_bus_that_is_gone_for_every_node_is_said_once(home: Path, cut: str) -> None:
    folder, path = home.parent / "files", home.parent / "net.yaml"
    folder.mkdir()
    path.write_text("".join(f"n{node_id}:\n  node_id: {node_id}\n{PART}" for node_id in (5, 7, 9)))
    kind = Cut if cut == "first write" else CutWhereAsked
    chain = Chain(folder, families=dict.fromkeys((5, 7, 9), "generic"), bus=kind, operational=False)
    assert isinstance(chain.bus, Cut)
    chain.bus.left = 1 if cut == "first write" else int(cut.split()[1])
    with pytest.raises(DvtcliError) as raised:
        chain.apply(path)
    assert "the bus is gone" in f"{raised.value} {raised.value.why}"
    assert ("also", "the bus is gone") not in raised.value.details
    if cut == "first write":
        assert (raised.value.node, raised.value.details) == (
            5,
            [("others", "nodes 7 and 9: nothing was written there")],
        )


class Dead(Heard):
    """A bus that is gone for good once *gone_once* is true and somebody asks who restarted."""

    gone_once: Callable[[], bool] = staticmethod(lambda: False)

    def boot_ups(self, node_id: int) -> int:
        if self.gone_once():
            raise BusUnavailable("the bus is gone")
        return super().boot_ups(node_id)


def refused(home: Path, fault: str, bus: type[Heard] = Heard) -> tuple[Chain, Path]:
    """Nodes 5, 7 and 9, of which one has a *fault*, and a file that sets each of them, in one phase."""
    folder, path = home.parent / "files", home.parent / "net.yaml"
    folder.mkdir()
    ids = (5, 7, 9)
    path.write_text("".join(f"n{one}:\n  node_id: {one}\n  tpdo: {{3: {{event_timer: 70}}}}\n" for one in ids))
    return Chain(folder, [fault], families=dict.fromkeys(ids, "generic"), bus=bus), path


def test_of_nodes_that_were_not_begun_nobody_says_that_they_were_read_back(home: Path) -> None:
    chain, path = refused(home, "7:refuse@1=0x06090030")
    before = chain.held()
    with pytest.raises(DvtcliError) as raised:
        chain.apply(path)
    assert (raised.value.state, chain.held()) == ("rolled_back", before)
    assert raised.value.state_text == (
        "rolled back: the changes are reverted on nodes 5 and 7, read back equal; nothing was written to node 9; "
        "nothing was stored"
    )


@heavy
def test_beside_one_that_is_left_changed_too(home: Path) -> None:
    chain, path = refused(home, "7:silent@1")
    with pytest.raises(LeftChanged) as raised:
        chain.apply(path)
    assert raised.value.node == 7
    others = [text for label, text in raised.value.details if label == "others"]
    assert others == ["node 5: as before, read back equal", "node 9: nothing was written there"]


@heavy
@pytest.mark.parametrize("node_id", [7, 9])
def test_a_bus_that_is_gone_once_all_is_back_replaces_no_fault(home: Path, node_id: int) -> None:
    chain, path = refused(home, f"{node_id}:refuse@1=0x06090030", Dead)
    assert isinstance(chain.bus, Dead)
    seen = list[bool]()

    def gone() -> bool:
        """Whether there were journals, and are none any more."""
        seen.append(bool(chain.journals()))
        return any(seen) and not seen[-1]

    chain.bus.gone_once = gone
    with pytest.raises(DvtcliError) as raised:
        chain.apply(path)
    assert (raised.value.exit_code, raised.value.node, raised.value.abort) == (1, node_id, 0x06090030)
    told = {
        9: "rolled back: every node is unchanged, read back equal; nothing was stored",
        7: "rolled back: the changes are reverted on nodes 5 and 7, read back equal; nothing was written to node 9; "
        "nothing was stored; whether node 9 restarted is not known: the bus is gone",
    }
    assert raised.value.state_text == told[node_id]
