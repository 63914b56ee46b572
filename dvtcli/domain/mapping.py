"""Mapping entries: the 32-bit layout and the dummy objects of CiA 301."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

MAX_PDO_BITS = 64
MAX_ENTRIES = 64
SAM_MPDO = 0xFE
DAM_MPDO = 0xFF

#: Index of a data type usable as a dummy entry -> its length in bits (CiA 301, 7.4.7.1; CiA 306 DummyUsage).
DUMMY_BITS = {0x0001: 1, 0x0002: 8, 0x0003: 16, 0x0004: 32, 0x0005: 8, 0x0006: 16, 0x0007: 32}


@dataclass(frozen=True, slots=True, order=True)
class PdoMappingEntry:
    """A mapped object and its length in *bits* (0..255 as stored; a legal length is 1..64)."""

    index: int
    sub_index: int
    bits: int

    def __post_init__(self) -> None:
        if not (0 <= self.index <= 0xFFFF and 0 <= self.sub_index <= 0xFF and 0 <= self.bits <= 0xFF):
            raise ValueError(f"mapping entry {self.index:X}:{self.sub_index:X}/{self.bits} does not fit its fields")

    @classmethod
    def from_raw(cls, raw: int) -> PdoMappingEntry:
        """Take a 32-bit mapping entry apart: index, sub-index, length in bits."""
        return cls(raw >> 16 & 0xFFFF, raw >> 8 & 0xFF, raw & 0xFF)

    @property
    def raw(self) -> int:
        """The 32-bit word as stored in the device."""
        return self.index << 16 | self.sub_index << 8 | self.bits

    @property
    def is_dummy(self) -> bool:
        """Whether the entry only skips bits (index is a data type, 0x0001..0x0007)."""
        return self.index in DUMMY_BITS and self.sub_index == 0

    @property
    def object(self) -> str:
        """The object as printed and typed: `6C01:01`."""
        return f"{self.index:04X}:{self.sub_index:02X}"

    def __str__(self) -> str:
        return f"{self.object}/{self.bits}"


def total_bits(entries: Iterable[PdoMappingEntry]) -> int:
    """Total length of *entries* in bits."""
    return sum(entry.bits for entry in entries)


def split_dummy(bits: int, usable: Iterable[int]) -> tuple[PdoMappingEntry, ...]:
    """The fewest dummy entries that skip exactly *bits*, from the dummy indices in *usable*.

    Signed dummies are preferred, as in manufacturers' documents. Raises ValueError if the
    usable dummies cannot add up to *bits*.
    """
    sizes: dict[int, int] = {}
    for index in sorted(set(usable) & DUMMY_BITS.keys()):
        sizes.setdefault(DUMMY_BITS[index], index)
    best: dict[int, tuple[PdoMappingEntry, ...]] = {0: ()}
    for length in range(1, bits + 1):
        options = [
            (PdoMappingEntry(index, 0, size), *best[length - size])
            for size, index in sizes.items()
            if length - size in best
        ]
        if options:
            shortest = min(len(option) for option in options)
            chosen = next(option for option in options if len(option) == shortest)
            best[length] = tuple(sorted(chosen, key=lambda entry: -entry.bits))
    if bits not in best:
        have = ", ".join(f"{index:04X}/{size}" for size, index in sorted(sizes.items())) or "none"
        raise ValueError(f"{bits} bits cannot be skipped with the dummies of the device ({have})")
    return best[bits]
