"""The parts of a frame, each with its bits, its raw number and what it says. Knows no service and no screen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

#: what the name of one bit of the part above it begins with
BIT_INDENT = "  "


@dataclass(frozen=True, slots=True)
class FramePart:
    """*bits* bits of a frame from *start_bit* on, counted from the lowest bit of byte 0; in the CAN-ID *in_id*.

    *name* is what it is, *text* what its *raw* number says; *object* is `606C:00` where it is an object's.
    """

    start_bit: int
    bits: int
    raw: int
    name: str
    text: str = ""
    object: str = ""
    in_id: bool = False

    @property
    def place(self) -> str:
        """Where it lies: `byte 0`, `bytes 1-2`, `byte 0 bits 5-7`, `CAN-ID bits 7-10`."""
        first, last = self.start_bit, self.start_bit + self.bits - 1
        if self.in_id:
            return f"CAN-ID {_span('bit', first, last)}"
        if first % 8 == 0 and self.bits % 8 == 0:
            return _span("byte", first // 8, last // 8)
        if first // 8 == last // 8:
            return f"byte {first // 8} {_span('bit', first % 8, last % 8)}"
        return _span("bit", first, last)

    @property
    def is_bit_of_value(self) -> bool:
        """Whether it is a bit that has a name within the value of the part above it."""
        return self.name.startswith(BIT_INDENT)

    @property
    def raw_text(self) -> str:
        """The raw number in hex, with all its digits; one bit as 0 or 1."""
        return str(self.raw) if self.bits == 1 else f"0x{self.raw:0{(self.bits + 3) // 4}X}"


def _span(word: str, first: int, last: int) -> str:
    return f"{word} {first}" if first == last else f"{word}s {first}-{last}"


@dataclass(frozen=True, slots=True)
class Bytes:
    """A frame's data, cut into parts; what lies behind its end is left out."""

    data: bytes

    def part(self, start_bit: int, bits: int, name: str, text: str = "", of: str = "") -> FramePart:
        """The *bits* bits from *start_bit* on, least significant byte first."""
        return FramePart(start_bit, bits, self.raw(start_bit, bits), name, text, of)

    def raw(self, start_bit: int, bits: int) -> int:
        """Their number; what is not there reads 0."""
        return int.from_bytes(self.data, "little") >> start_bit & (1 << bits) - 1

    def number(self, first: int, length: int) -> int:
        """The number in *length* bytes from byte *first* on."""
        return self.raw(8 * first, 8 * length)

    def rest(self, first: int, name: str) -> Iterator[FramePart]:
        """What lies from byte *first* to the end, if anything does."""
        if first < len(self.data):
            yield self.part(8 * first, 8 * (len(self.data) - first), name)
