"""The parts of a frame, each with its bits, its raw number and what it says. Knows no service and no screen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from dvtcli.watch.decoder import SignalPlace

#: what the name of one bit of the part above it begins with
BIT_INDENT = "  "


@dataclass(frozen=True, slots=True)
class FramePart:
    """*bits* bits of a frame from *start_bit* on, counted from the lowest bit of byte 0; in the CAN-ID *in_id*.

    *name* is what it is, *text* what its *raw* number says; *object* is `606C:00` where it is an object's. With
    *is_big_endian* *start_bit* is its most significant bit, and the others follow as in `SignalPlace`.
    """

    start_bit: int
    bits: int
    raw: int
    name: str
    text: str = ""
    object: str = ""
    in_id: bool = False
    is_big_endian: bool = False

    @property
    def place(self) -> str:
        """Where it lies: `byte 0`, `bytes 1-2`, `byte 0 bits 5-7`, `CAN-ID bits 7-10`."""
        first, last = self.start_bit, self.start_bit + self.bits - 1
        if self.in_id:
            return f"CAN-ID {_span('bit', first, last)}"
        if self.is_big_endian:
            return _big_endian_span(_sent_at(self.start_bit), self.bits)
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


def _sent_at(bit: int) -> int:
    """The place of *bit* (from the lowest of byte 0) if bits are counted from the highest of byte 0; and back."""
    return bit ^ 7


def _big_endian_span(first: int, bits: int) -> str:
    """Where *bits* bits lie from *first* on, counted from the highest bit of byte 0."""
    last = first + bits - 1
    if first % 8 == 0 and bits % 8 == 0:
        return _span("byte", first // 8, last // 8)
    if first // 8 == last // 8:
        return f"byte {first // 8} {_span('bit', _sent_at(last) % 8, _sent_at(first) % 8)}"
    return f"byte {first // 8} bit {_sent_at(first) % 8} to byte {last // 8} bit {_sent_at(last) % 8}"


@dataclass(frozen=True, slots=True)
class Bytes:
    """A frame's data, cut into parts; what lies behind its end is left out."""

    data: bytes

    def part(self, start_bit: int, bits: int, name: str, text: str = "", of: str = "") -> FramePart:
        """The *bits* bits from *start_bit* on, least significant byte first."""
        return FramePart(start_bit, bits, self.raw(start_bit, bits), name, text, of)

    def signal_part(self, place: SignalPlace, name: str, text: str, of: str) -> FramePart:
        """The signal of a DBC file at *place*."""
        if not place.is_big_endian:
            return self.part(place.start_bit, place.bits, name, text, of)
        behind = 8 * len(self.data) - _sent_at(place.start_bit) - place.bits
        raw = int.from_bytes(self.data, "big") >> behind & (1 << place.bits) - 1 if behind >= 0 else 0
        return FramePart(place.start_bit, place.bits, raw, name, text, of, is_big_endian=True)

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
