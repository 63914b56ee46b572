"""Parts of a frame, each with bits, raw number and text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from dvtcli.domain import lss_services as lss
from dvtcli.watch.decoder import SignalPlace

#: start of a name for a single bit within the part above
BIT_INDENT = "  "


@dataclass(frozen=True, slots=True)
class FramePart:
    """*bits* bits in a frame from *start_bit* on, counted from the lowest bit in byte 0; in the CAN-ID if *in_id*.

    *name* is the part's name, *text* the meaning of the *raw* number; *object* is `606C:00` for an object's part.
    With *is_big_endian*, *start_bit* is the most significant bit, and the others follow as in `SignalPlace`.
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
        """Place of the part: `byte 0`, `bytes 1-2`, `byte 0 bits 5-7`, `CAN-ID bits 7-10`."""
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
        """Whether the part is a named bit within the value of the part above."""
        return self.name.startswith(BIT_INDENT)

    @property
    def raw_text(self) -> str:
        """The raw number in hex, with all its digits; a single bit as 0 or 1."""
        return str(self.raw) if self.bits == 1 else f"0x{self.raw:0{(self.bits + 3) // 4}X}"


def _span(word: str, first: int, last: int) -> str:
    return f"{word} {first}" if first == last else f"{word}s {first}-{last}"


def _sent_at(bit: int) -> int:
    """Convert *bit* between counting from the lowest and from the highest bit of byte 0, either way."""
    return bit ^ 7


def _big_endian_span(first: int, bits: int) -> str:
    """Place of *bits* bits from *first* on, counted from the highest bit in byte 0."""
    last = first + bits - 1
    if first % 8 == 0 and bits % 8 == 0:
        return _span("byte", first // 8, last // 8)
    if first // 8 == last // 8:
        return f"byte {first // 8} {_span('bit', _sent_at(last) % 8, _sent_at(first) % 8)}"
    return f"byte {first // 8} bit {_sent_at(first) % 8} to byte {last // 8} bit {_sent_at(last) % 8}"


@dataclass(frozen=True, slots=True)
class Bytes:
    """A frame's data, cut into parts; nothing beyond its end."""

    data: bytes

    def part(self, start_bit: int, bits: int, name: str, text: str = "", of: str = "") -> FramePart:
        """The *bits* bits from *start_bit* on, least significant byte first."""
        return FramePart(start_bit, bits, self.raw(start_bit, bits), name, text, of)

    def signal_part(self, place: SignalPlace, name: str, text: str, of: str) -> FramePart:
        """The part for a DBC file's signal at *place*."""
        if not place.is_big_endian:
            return self.part(place.start_bit, place.bits, name, text, of)
        behind = 8 * len(self.data) - _sent_at(place.start_bit) - place.bits
        raw = int.from_bytes(self.data, "big") >> behind & (1 << place.bits) - 1 if behind >= 0 else 0
        return FramePart(place.start_bit, place.bits, raw, name, text, of, is_big_endian=True)

    def raw(self, start_bit: int, bits: int) -> int:
        """Number in the bits; missing bits read 0."""
        return int.from_bytes(self.data, "little") >> start_bit & (1 << bits) - 1

    def number(self, first: int, length: int) -> int:
        """The number in *length* bytes from byte *first* on."""
        return self.raw(8 * first, 8 * length)

    def rest(self, first: int, name: str) -> Iterator[FramePart]:
        """The part from byte *first* to the end, if any."""
        if first < len(self.data):
            yield self.part(8 * first, 8 * (len(self.data) - first), name)


_ADDRESS = ("vendor-ID", "product code", "revision number", "serial number")
_RANGES = (*_ADDRESS[:2], "lowest revision", "highest revision", "lowest serial number", "highest serial number")
_NAMES = {
    lss.SWITCH_GLOBAL: "switch state global",
    lss.CONFIGURE_NODE_ID: "configure node-ID",
    lss.CONFIGURE_BIT_TIMING: "configure bit timing",
    lss.ACTIVATE_BIT_TIMING: "activate bit timing",
    lss.STORE_CONFIGURATION: "store configuration",
    lss.SELECTED: "a node is selected",
    lss.IDENTIFY_UNCONFIGURED: "identify nodes without a node-ID",
    lss.IDENTIFIED: "a node identifies itself",
    lss.IDENTIFIED_UNCONFIGURED: "a node without a node-ID identifies itself",
    lss.FAST_SCAN: "fast scan",
    lss.INQUIRE_NODE_ID: "inquire node-ID",
    **{lss.SELECT + n: f"switch state selective: {name}" for n, name in enumerate(_ADDRESS)},
    **{lss.IDENTIFY + n: f"identify: {name}" for n, name in enumerate(_RANGES)},
    **{lss.INQUIRE + n: f"inquire {name}" for n, name in enumerate(_ADDRESS)},
}
_RATES = {index: rate for rate, index in lss.BIT_TIMINGS.items()}
_REFUSALS = {
    lss.CONFIGURE_NODE_ID: lss.NODE_ID_REFUSED,
    lss.CONFIGURE_BIT_TIMING: lss.BIT_TIMING_REFUSED,
    lss.STORE_CONFIGURATION: lss.STORE_REFUSED,
}


def lss_parts(data: bytes, *, request: bool) -> Iterator[FramePart]:
    """Parts of a master's LSS *request*, or a slave's answer."""
    if not data:
        return
    cut, service = Bytes(data), data[0]
    yield cut.part(0, 8, "command specifier", _NAMES.get(service, "reserved, or not known"))
    there = 8 * len(data)
    fields = [field for field in _fields(cut, service, request=request) if field.start_bit + field.bits <= there]
    yield from fields
    yield from cut.rest(max([1, *((field.start_bit + field.bits) // 8 for field in fields)]), "reserved")


def _fields(cut: Bytes, service: int, *, request: bool) -> Iterator[FramePart]:
    if not request and service in _REFUSALS:
        code, own = cut.number(1, 1), cut.number(2, 1)
        yield cut.part(8, 8, "error code", lss.refusal(_REFUSALS[service], code, own) if code else "done")
        yield cut.part(16, 8, "the maker's error")
    elif service in range(lss.SELECT, lss.SELECT + 4) or service in range(lss.IDENTIFY, lss.IDENTIFY + 6):
        yield cut.part(8, 32, _NAMES[service].rpartition(": ")[2], str(cut.number(1, 4)))
    elif service == lss.SWITCH_GLOBAL:
        mode = {lss.WAITING: "waiting", lss.CONFIGURATION: "configuration"}.get(cut.number(1, 1), "reserved")
        yield cut.part(8, 8, "mode", mode)
    elif service == lss.CONFIGURE_NODE_ID or (service == lss.INQUIRE_NODE_ID and not request):
        yield cut.part(8, 8, "node-ID", "none" if cut.number(1, 1) == 0xFF else str(cut.number(1, 1)))
    elif service == lss.CONFIGURE_BIT_TIMING:
        table, index = cut.number(1, 1), cut.number(2, 1)
        yield cut.part(8, 8, "table selector", "the standard's" if not table else "the maker's, or reserved")
        rate = _RATES.get(index) if not table else None
        yield cut.part(16, 8, "table index", f"{rate} bit/s" if rate else "reserved, or the maker's")
    elif service == lss.ACTIVATE_BIT_TIMING:
        yield cut.part(8, 16, "switch delay", f"{cut.number(1, 2)} ms")
    elif service == lss.FAST_SCAN:
        yield cut.part(8, 32, "number asked for", f"{cut.number(1, 4)}")
        reset = cut.number(5, 1) == lss.SCAN_RESET
        yield cut.part(40, 8, "bit checked", "none: who is there" if reset else f"bits 31 to {cut.number(5, 1)}")
        for first, name in ((6, "part asked for"), (7, "part asked for next")):
            part = cut.number(first, 1)
            yield cut.part(8 * first, 8, name, _ADDRESS[part] if part < len(_ADDRESS) else "reserved")
    elif not request and service in range(lss.INQUIRE, lss.INQUIRE + 4):
        yield cut.part(8, 32, _ADDRESS[service - lss.INQUIRE], str(cut.number(1, 4)))
