"""Channels that turn mapping entries round or count them by fillers, entry by entry."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from dvtcli.device.quirks import FixedCount, ReversedEntries

FILLER = (0x0005_0008).to_bytes(4, "little")
ENTRY = (0x6041_0010).to_bytes(4, "little")


@dataclass
class Memory:
    """A device that holds what it is given; writes are kept, in order."""

    values: dict[tuple[int, int], bytes]
    writes: list[tuple[int, int, bytes]] = field(default_factory=list)

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        return self.values[index, sub_index]

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        self.writes.append((index, sub_index, data))
        self.values[index, sub_index] = data


def mapping(*entries: bytes, index: int = 0x1A00) -> Memory:
    return Memory({(index, 0): bytes([len(entries)]), **{(index, n): word for n, word in enumerate(entries, 1)}})


@pytest.mark.parametrize(
    ("entries", "count"),
    [
        ((FILLER, FILLER, FILLER), 0),
        ((ENTRY, FILLER, FILLER), 1),
        ((FILLER, ENTRY, FILLER), 2),
        ((ENTRY, ENTRY, ENTRY), 3),
        ((), 0),
    ],
)
def test_the_count_is_that_of_the_entries_before_the_last_fillers(entries: tuple[bytes, ...], count: int) -> None:
    for index in (0x1600, 0x1A00):
        channel = FixedCount(mapping(*entries, index=index), 0x0005_0008)
        assert channel.upload(index, 0) == bytes([count])
    elsewhere = FixedCount(Memory({(0x1018, 0): b"\4", (0x1800, 0): b"\5"}), 0)
    assert (elsewhere.upload(0x1018, 0), elsewhere.upload(0x1800, 0)) == (b"\4", b"\5")


@pytest.mark.parametrize("held", [b"\xfe", b"\xff", b"\1\0"])
def test_what_is_no_count_is_left_as_it_is(held: bytes) -> None:
    assert FixedCount(Memory({(0x1A00, 0): held}), 0).upload(0x1A00, 0) == held


@pytest.mark.parametrize(("count", "filled"), [(0, [1, 2, 3]), (1, [2, 3]), (2, [3]), (3, [])])
def test_a_count_is_written_as_fillers(count: int, filled: list[int]) -> None:
    memory = mapping(ENTRY, ENTRY, ENTRY)
    FixedCount(memory, 0x0005_0008).download(0x1A00, 0, bytes([count]))
    assert memory.writes == [(0x1A00, number, FILLER) for number in filled]
    FixedCount(memory, 0x0005_0008).download(0x1A00, 0, bytes([count]))
    assert len(memory.writes) == len(filled)


def test_only_mapping_entries_are_turned_round() -> None:
    memory = Memory({(0x1A00, 0): b"\1", (0x1A00, 1): bytes.fromhex("41 60 00 10"), (0x1800, 1): b"\1\2\3\4"})
    channel = ReversedEntries(memory)
    assert channel.upload(0x1A00, 1) == ENTRY
    assert (channel.upload(0x1A00, 0), channel.upload(0x1800, 1)) == (b"\1", b"\1\2\3\4")
    channel.download(0x1A00, 2, ENTRY)
    channel.download(0x1A00, 0, b"\2")
    channel.download(0x1800, 1, b"\1\2\3\4")
    channel.download(0x1A00, 3, b"\1\2")
    assert memory.writes == [
        (0x1A00, 2, bytes.fromhex("41 60 00 10")),
        (0x1A00, 0, b"\2"),
        (0x1800, 1, b"\1\2\3\4"),
        (0x1A00, 3, b"\1\2"),
    ]
