"""A multiplexed PDO that is changed with force, or made by it: taken back, undone and recovered, it is as it was."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dvtcli.device.change.change_guard import ChangeGuard
from dvtcli.device.change.journal import read_journal
from dvtcli.device.node import Node
from dvtcli.device.target_config import differences
from dvtcli.domain.pdo import Pdo, PdoMappingEntry
from dvtcli.domain.ports import SdoTransport
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import DeviceRefused, LeftChanged, RuleError
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.faults.recovering import recover
from tests.laws.bench import NODE, DirectBus, DirectSdo, FaultySdo, dictionary, refuse, silence
from tests.laws.bench import plain as family

TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")
COUNT, FIRST = (0x1A00, 0), (0x1A00, 1)
STATUSWORD = PdoMappingEntry(0x6041, 0, 16)
WHAT_COUNTS = [(0x1800, sub) for sub in (1, 2, 3, 5)] + [COUNT, FIRST]


class Multiplexing(StrictDevice):
    """A device that knows MPDOs: TPDO1's count may be 0xFE or 0xFF, and then as any other is opened with 0."""

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        is_open = self.value(*COUNT) == b"\0"
        if (index, sub_index) == COUNT and (data[0] >= 0xFE or self.value(*COUNT)[0] >= 0xFE):
            self.set_value(*COUNT, data)
        elif index == COUNT[0] and sub_index and is_open:
            self.set_value(index, sub_index, data)
        else:
            super().download(index, sub_index, data)

    def held(self) -> list[bytes]:
        return [self.value(*place) for place in WHAT_COUNTS]


class Bench:
    """Such a device whose TPDO1 is off, and a node with a keeper in *folder*."""

    def __init__(self, folder: Path, count: int = 0) -> None:
        self.device = Multiplexing(dictionary("generic"), family("generic"), NODE)
        self.device.boot_up()
        self.device.take_outbox()
        word = int.from_bytes(self.device.upload(0x1800, 1), "little") | 1 << 31
        self.device.set_value(0x1800, 1, word.to_bytes(4, "little"))
        if count:
            self.device.set_value(*COUNT, bytes([count]))
        self.sdo = DirectSdo(self.device)
        self.bus = DirectBus(self.device, self.sdo)
        self.folder = folder
        self.guard: ChangeGuard | None = None
        self.node = self.another()

    def another(self) -> Node:
        """A node as the next process meets it."""
        self.let_go()
        self.guard = ChangeGuard(self.folder / "state", self.folder / "locks", "direct", NODE)
        return Node(self.bus, NODE, dictionary("generic"), guard=self.guard)

    def let_go(self) -> None:
        if self.guard is not None:
            self.guard.lock.release()


@pytest.fixture
def made(tmp_path: Path) -> Iterator[Callable[[int], Bench]]:
    benches: list[Bench] = []

    def make(count: int) -> Bench:
        benches.append(Bench(tmp_path / str(len(benches)), count))
        return benches[-1]

    yield make
    for bench in benches:
        bench.let_go()


@pytest.mark.parametrize("count", [0xFE, 0xFF])
def test_a_raw_count_that_makes_one_is_kept_and_undone(made: Callable[[int], Bench], count: int) -> None:
    bench = made(0)
    before = bench.device.held()
    with pytest.raises(RuleError, match="makes a multiplexed PDO"):
        bench.node.write(*COUNT, bytes([count]))
    bench.node.write(*COUNT, bytes([count]), force=True)
    assert bench.device.value(*COUNT) == bytes([count])
    assert bench.node.pdo(TPDO1).mpdo == count
    applied = bench.node.undo()
    assert (bench.device.held(), applied.not_put_back) == (before, ())


@pytest.mark.parametrize("count", [0xFE, 0xFF])
def test_one_that_was_found_is_put_back_with_its_entries(made: Callable[[int], Bench], count: int) -> None:
    """Opened, given another entry, closed: `undo` writes the count and the entry that were found."""
    bench = made(count)
    before = bench.device.held()
    entry = (0x6064_0020).to_bytes(4, "little")
    for place, data in ((COUNT, b"\0"), (FIRST, entry), (COUNT, bytes([count]))):
        bench.node.write(*place, data, force=True)
    assert (bench.device.value(*FIRST), bench.device.held() == before) == (entry, False)
    bench.node.undo(count=3)
    assert bench.device.held() == before


@pytest.mark.parametrize("at", range(1, 5))
def test_one_that_is_mapped_with_force_and_refused_in_the_middle_is_as_it_was(
    made: Callable[[int], Bench], at: int
) -> None:
    bench = made(0xFE)
    before = bench.device.held()
    bench.bus.channel = FaultySdo(bench.sdo, refuse, at)
    with pytest.raises(DeviceRefused) as caught:
        bench.node.configure({TPDO1: PdoRequest(objects=(STATUSWORD, STATUSWORD), event_timer=7)}, force=True)
    assert (caught.value.state, bench.device.held()) == ("rolled_back", before)


def test_one_that_is_mapped_with_force_is_undone_whole(made: Callable[[int], Bench]) -> None:
    bench = made(0xFF)
    before = bench.device.held()
    bench.node.configure({TPDO1: PdoRequest(objects=(STATUSWORD,), event_timer=7)}, force=True)
    assert bench.device.value(*COUNT) == b"\1"
    bench.node.undo()
    held = bench.device.held()
    assert held == before


class DiesAfterIt:
    """Takes one write, and does not answer any."""

    took = False

    def __call__(self, inner: SdoTransport, index: int, sub_index: int, data: bytes) -> None:
        if not self.took:
            self.took = True
            inner.download(index, sub_index, data)
        raise silence(index, sub_index)


@pytest.mark.parametrize("found", [0, 0xFE])
def test_a_journal_names_it_and_recover_puts_it_back(made: Callable[[int], Bench], found: int) -> None:
    bench = made(found)
    before = bench.device.held()

    bench.bus.channel = FaultySdo(bench.sdo, DiesAfterIt(), 3 if found else 1, forever=True)
    mapped = {TPDO1: PdoRequest(objects=(STATUSWORD,), event_timer=7)}
    with pytest.raises(LeftChanged):
        bench.node.configure(mapped, force=True) if found else bench.node.write(*COUNT, b"\xfe", force=True)
    assert bench.device.held() != before
    bench.bus.channel = bench.sdo
    node = bench.another()
    journal = node.guard.interrupted_journal() if node.guard else None
    assert journal is not None
    assert read_journal(journal.path) == journal
    recover(node, journal)
    assert bench.device.held() == before


def test_one_is_no_other_pdo_and_no_empty_one(made: Callable[[int], Bench]) -> None:
    """What is compared with it, before a store, by `verify` and by a proof."""
    bench = made(0xFE)
    multiplexed = bench.node.pdo(TPDO1)
    bench.device.set_value(*COUNT, b"\0")
    empty = bench.node.pdo(TPDO1)
    bench.device.set_value(*COUNT, b"\xff")
    other = bench.node.pdo(TPDO1)
    for wanted, held in ((multiplexed, empty), (empty, multiplexed), (multiplexed, other)):
        (text,) = differences(TPDO1, wanted, held)
        assert text == f"0x1A00:00 (count) is {held.count}, expected {wanted.count}"
    bench.device.set_value(*FIRST, bytes(4))
    (text,) = differences(TPDO1, other, bench.node.pdo(TPDO1))
    assert text.startswith("0x1A00:01 is ")
    assert differences(TPDO1, other, other) == []


def test_beside_a_change_its_cob_id_is_watched_like_any_other_s(made: Callable[[int], Bench]) -> None:
    bench = made(0xFE)
    before = bench.device.held()

    def moves(inner: SdoTransport, index: int, sub_index: int, data: bytes) -> None:
        inner.download(index, sub_index, data)
        bench.device.set_value(0x1800, 1, (0xC000_01A1).to_bytes(4, "little"))

    bench.bus.channel = FaultySdo(bench.sdo, moves, 2)
    with pytest.raises(DeviceRefused, match="changed TPDO1 as a side effect"):
        bench.node.configure({TPDO2: PdoRequest(cob_id=0x2A1)})
    assert bench.device.held() == before
    bench.bus.channel = bench.sdo
    bench.node.configure({TPDO2: PdoRequest(cob_id=0x2A1)})
    assert bench.node.expected.pdos[TPDO1].mpdo == 0xFE
