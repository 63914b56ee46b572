"""Every bit of a frame, named: CAN-ID, service, and data bytes. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from dvtcli.domain import lss_services as lss
from dvtcli.domain.abort import abort_text
from dvtcli.domain.can_ids import LSS_REQUEST_ID
from dvtcli.domain.datatypes import Value
from dvtcli.domain.emergency_codes import emergency_text, register_words
from dvtcli.domain.frame import Field, layout
from dvtcli.domain.ports import Frame
from dvtcli.watch.decoder import Decoder, Layout, Signal, SignalPlace
from dvtcli.watch.known_node import KnownNode, of_mpdo, said
from dvtcli.watch.service import Service, service_of
from dvtcli.watch.service_words import (
    SDO_BYTES,
    addressee,
    command_word,
    day,
    sdo_command,
    state_word,
    time_of_day,
    wrong_counter,
    wrong_length,
)

#: name and value text of an object, by index, sub-index and bytes (None: no value)
NameOf = Callable[[int, int, bytes | None], tuple[str, str]]
#: subcommands of the block transfers, by direction, command specifier and number
_BLOCK = {
    (True, 5): ("initiate", "end", "blocks' answer", "start"),
    (True, 6): ("initiate", "end"),
    (False, 5): ("initiate", "end", "blocks' answer"),
    (False, 6): ("initiate", "end"),
}


def sdo_parts(data: bytes, *, request: bool, name_of: NameOf) -> Iterator[FramePart]:
    """Parts of an SDO *request*, or an answer."""
    cut = Bytes(data)
    if len(data) < SDO_BYTES:
        yield from cut.rest(0, wrong_length("sdo", len(data)))
        return
    command = data[0] >> 5
    words = sdo_command(command, request=request) or "unknown command specifier"
    yield cut.part(5, 3, "client command specifier" if request else "server command specifier", words)
    if command == 4:
        yield from _abort(cut, name_of)
    elif command in (5, 6):
        yield from _block(cut, command, request=request, name_of=name_of)
    elif (request and command == 1) or (not request and command == 2):
        yield from _initiate(cut, name_of)
    elif (request and command == 2) or (not request and command == 3):
        yield cut.part(0, 5, "reserved")
        yield from _object(cut, name_of)
        yield from cut.rest(4, "reserved")
    elif command == 0:
        yield from _segment(cut)
    elif command in (1, 3):
        yield cut.part(4, 1, "toggle bit")
        yield cut.part(0, 4, "reserved")
        yield from cut.rest(1, "reserved")
    else:
        yield cut.part(0, 5, "not known")
        yield from cut.rest(1, "not known")


def _object(cut: Bytes, name_of: NameOf, data: bytes | None = None) -> Iterator[FramePart]:
    index, sub_index = cut.number(1, 2), cut.data[3]
    name, _ = name_of(index, sub_index, data)
    yield cut.part(8, 16, "index", f"0x{index:04X}")
    yield cut.part(24, 8, "sub-index", name, f"{index:04X}:{sub_index:02X}")


def _abort(cut: Bytes, name_of: NameOf) -> Iterator[FramePart]:
    yield cut.part(0, 5, "reserved")
    yield from _object(cut, name_of)
    yield cut.part(32, 32, "abort code", abort_text(cut.number(4, 4)))


def _initiate(cut: Bytes, name_of: NameOf) -> Iterator[FramePart]:
    """Parts of a transfer's first frame with data or the announced size."""
    expedited, sized = cut.raw(1, 1), cut.raw(0, 1)
    yield cut.part(4, 1, "reserved")
    unused = cut.raw(2, 2) if expedited and sized else 0
    yield cut.part(2, 2, "n: bytes without data", str(unused) if expedited and sized else "not used")
    yield cut.part(1, 1, "e: transfer type", "expedited" if expedited else "in segments")
    yield cut.part(0, 1, "s: size", "indicated" if sized else "not indicated")
    if not expedited:
        yield from _object(cut, name_of)
        length = cut.number(4, 4)
        yield cut.part(32, 32, "size", f"{length} bytes follow" if sized else "not used")
        return
    data = cut.data[4 : SDO_BYTES - unused]
    yield from _object(cut, name_of, data)
    _, value = name_of(cut.number(1, 2), cut.data[3], data)
    yield cut.part(32, 8 * len(data), "data", value)
    yield from cut.rest(SDO_BYTES - unused, "without data")


def _segment(cut: Bytes) -> Iterator[FramePart]:
    unused = cut.raw(1, 3)
    yield cut.part(4, 1, "toggle bit")
    yield cut.part(1, 3, "n: bytes without data", str(unused))
    yield cut.part(0, 1, "c", "the last segment" if cut.raw(0, 1) else "more segments follow")
    end = SDO_BYTES - unused
    if end > 1:
        yield cut.part(8, 8 * (end - 1), "data of the segment", _readable(cut.data[1:end]))
    yield from cut.rest(max(end, 1), "without data")


def _readable(data: bytes) -> str:
    """Bytes as text if all are printable ASCII."""
    return repr(data.decode("ascii")) if data and all(0x20 <= byte < 0x7F for byte in data) else ""


def _block(cut: Bytes, command: int, *, request: bool, name_of: NameOf) -> Iterator[FramePart]:
    names = _BLOCK[request, command]
    width = 2 if len(names) > 2 else 1
    number = cut.raw(0, width)
    step = names[number] if number < len(names) else "unknown"
    sends = command == 6  # the side with the data gives sizes and checksums
    if step == "initiate":
        yield cut.part(3, 2, "reserved")
        yield cut.part(2, 1, "CRC", "supported" if cut.raw(2, 1) else "not supported")
        if sends:
            yield cut.part(1, 1, "s: size", "indicated" if cut.raw(1, 1) else "not indicated")
    elif step == "end" and sends:
        yield cut.part(2, 3, "n: bytes of the last segment without data", str(cut.raw(2, 3)))
        yield cut.part(1, 1, "reserved")
    else:
        yield cut.part(width, 5 - width, "reserved")
    yield cut.part(0, width, "subcommand", step)
    yield from _block_rest(cut, step, sends=sends, request=request, name_of=name_of)


def _block_rest(cut: Bytes, step: str, *, sends: bool, request: bool, name_of: NameOf) -> Iterator[FramePart]:
    if step == "initiate":
        yield from _object(cut, name_of)
        if sends:
            yield cut.part(32, 32, "size", f"{cut.number(4, 4)} bytes" if cut.raw(1, 1) else "not used")
            return
        yield cut.part(32, 8, "block size", f"{cut.data[4]} segments")
        if request:
            yield cut.part(40, 8, "protocol switch threshold", f"{cut.data[5]} bytes")
        yield from cut.rest(6 if request else 5, "reserved")
    elif step == "end" and sends:
        yield cut.part(8, 16, "CRC")
        yield from cut.rest(3, "reserved")
    elif step == "blocks' answer":
        yield cut.part(8, 8, "last segment received in order", str(cut.data[1]))
        yield cut.part(16, 8, "block size of the next", f"{cut.data[2]} segments")
        yield from cut.rest(3, "reserved")
    else:
        yield from cut.rest(1, "reserved")


def nmt_parts(data: bytes) -> Iterator[FramePart]:
    """An NMT command and its addressee."""
    cut, wrong = Bytes(data), wrong_length("nmt", len(data))
    if data:
        word = command_word(data[0]) or "reserved"
        yield cut.part(0, 8, "command specifier", word if len(data) > 1 else f"{word}; {wrong}")
    if len(data) > 1:
        yield cut.part(8, 8, "node-ID", addressee(data[1]))
    yield from cut.rest(2, wrong)


def sync_parts(data: bytes) -> Iterator[FramePart]:
    """SYNC: empty, or its counter."""
    cut = Bytes(data)
    if data:
        yield cut.part(0, 8, "counter", wrong_counter(data[0]) or str(data[0]))
    yield from cut.rest(1, wrong_length("sync", len(data)))


def time_parts(data: bytes) -> Iterator[FramePart]:
    """TIME: milliseconds since midnight, and days since 1 January 1984."""
    cut, wrong = Bytes(data), wrong_length("time", len(data))
    if len(data) < 6:
        yield from cut.rest(0, wrong)
        return
    days = cut.number(4, 2)
    at = time_of_day(cut.raw(0, 28), days)
    clock = "more than a day has" if at is None else f"{at:%H:%M:%S}.{at.microsecond // 1000:03d}"
    yield cut.part(0, 28, "ms since midnight", clock)
    yield cut.part(28, 4, "reserved")
    yield cut.part(32, 16, "days since 1984-01-01", day(days))
    yield from cut.rest(6, wrong)


def emergency_parts(data: bytes, device_type: int | None) -> Iterator[FramePart]:
    """An emergency of a device of *device_type*: code, error register, and manufacturer-specific data."""
    cut = Bytes(data)
    if len(data) < 2:
        yield from cut.rest(0, wrong_length("emcy", len(data)))
        return
    yield cut.part(0, 16, "emergency error code", emergency_text(cut.number(0, 2), device_type))
    if len(data) > 2:
        yield cut.part(16, 8, "error register", ", ".join(register_words(data[2])) or "no error")
    yield from cut.rest(3, "the maker's own")


def heartbeat_parts(data: bytes) -> Iterator[FramePart]:
    """A heartbeat, a boot-up, or the answer of node guarding."""
    cut = Bytes(data)
    if not data:
        return
    yield cut.part(7, 1, "toggle bit of node guarding", "" if data[0] & 0x80 else "0 in a heartbeat")
    yield cut.part(0, 7, "NMT state", "boot-up" if data == b"\0" else state_word(data[0]))
    yield from cut.rest(1, wrong_length("heartbeat", len(data)))


_STANDARD_BITS, _NODE_BITS, _BYTE = 11, 7, 8


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


_BY_KIND: dict[str, Callable[[bytes], Iterator[FramePart]]] = {
    "nmt": nmt_parts,
    "sync": sync_parts,
    "time": time_parts,
    "heartbeat": heartbeat_parts,
}
_FUNCTION_NAMES = {
    0x0: "NMT, and CAN-IDs without a node", 0x1: "SYNC or EMCY", 0x2: "TIME", 0xB: "SDO answer", 0xC: "SDO request",
    0xE: "heartbeat, node guarding", 0xF: "LSS",
    **{n: f"{'TPDO' if n % 2 else 'RPDO'}{(n - 3) // 2 + 1}" for n in range(3, 11)},
}  # fmt: skip


def frame_parts(frame: Frame, decoder: Decoder, described: Callable[[int], KnownNode]) -> list[FramePart]:
    """All parts of *frame*, the CAN-ID's first; *described* returns a node's known data, by node-ID."""
    known = decoder.layout(frame)
    parts = list(_id_parts(frame, known))
    if frame.remote:
        return parts
    service, data = known.service, frame.data
    if service.kind == "sdo":
        node = service.node

        def name_of(index: int, sub_index: int, value: bytes | None) -> tuple[str, str]:
            return described(node or 0).value(index, sub_index, value)[:2]

        return [*parts, *sdo_parts(data, request=service.label.endswith("request"), name_of=name_of)]
    if service.kind == "lss":
        return [*parts, *lss_parts(data, request=frame.can_id == LSS_REQUEST_ID)]
    if service.kind == "emcy":
        return [*parts, *emergency_parts(data, described(service.node or 0).device_type)]
    if service.kind in _BY_KIND:
        return [*parts, *_BY_KIND[service.kind](data)]
    if known.mpdo is not None:
        return [*parts, *_mpdo_parts(data, service, described)]
    return [*parts, *_pdo_parts(data, known)]


def _id_parts(frame: Frame, known: Layout) -> Iterator[FramePart]:
    service = known.service
    who = f"{service.label}{f' of node {service.node}' if service.node else ''}"
    usual = service_of(frame.can_id, extended=frame.extended)
    own = service.kind == "pdo" and (usual.node != service.node or usual.label.rstrip("?") != service.label.rstrip("?"))
    if frame.extended or own or usual.node is None:
        width = 29 if frame.extended else _STANDARD_BITS
        how = ", as it is configured" if own else ""
        yield FramePart(0, width, frame.can_id, "COB-ID", who + how, in_id=True)
        return
    function, node = frame.can_id >> _NODE_BITS, frame.can_id & 0x7F
    named = usual.label if usual.kind != "pdo" else _FUNCTION_NAMES[function]
    certain = "" if usual.kind != "pdo" or not service.label.endswith("?") else " by the pre-defined connection set"
    yield FramePart(_NODE_BITS, 4, function, "function code", named + certain, in_id=True)
    yield FramePart(0, _NODE_BITS, node, "node-ID", f"node {node}", in_id=True)


def _mpdo_parts(data: bytes, service: Service, described: Callable[[int], KnownNode]) -> Iterator[FramePart]:
    """A multiplexed PDO: addressing and node, object, value (CiA 301, 7.2.2.6)."""
    cut = Bytes(data)
    if len(data) < SDO_BYTES:
        yield from cut.rest(0, wrong_length("mpdo", len(data)))
        return
    node = cut.raw(0, 7)
    index, sub_index = cut.number(1, 2), data[3]
    name, text, _ = of_mpdo(described, node, service.node).value(index, sub_index, data[4:8], padded=True)
    yield cut.part(7, 1, "addressing", "of the destination" if cut.raw(7, 1) else "of the source")
    yield cut.part(0, 7, "node-ID", f"node {node}" if node else "all nodes")
    yield cut.part(8, 16, "index", f"0x{index:04X}")
    yield cut.part(24, 8, "sub-index", name, f"{index:04X}:{sub_index:02X}")
    yield cut.part(32, 32, "data", text)


def _pdo_parts(data: bytes, known: Layout) -> Iterator[FramePart]:
    """Objects in a PDO, with named bits; plain bytes without a known mapping."""
    cut, end = Bytes(data), 8 * len(data)
    if not known.mapping:
        yield from cut.rest(0, "data") if not known.signals else _signal_parts(cut, known)
        return
    signals, last = zip(known.signals, known.read(data), strict=True), 0
    for field in layout(known.mapping):
        if field.end_bit > end:
            yield from _cut_off(cut, field, known, end)
            return
        last = field.end_bit
        if field.entry.is_dummy:
            yield cut.part(field.start_bit, field.bits, "dummy", "skipped", field.entry.object)
        else:
            yield from _object_parts(cut, field, *next(signals))
    if last < end:
        yield cut.part(last, end - last, "after the mapping", _of_rest(known, end - last))


def _of_rest(known: Layout, bits: int) -> str:
    """Text for the *bits* behind the mapping: less than 8 bits are padding."""
    if bits < _BYTE:
        return "fills up the byte"
    if known.is_consumers:
        return f"{known.service.label} of node {known.service.node} does not take it"
    return "so the mapping is not its sender's"


def _cut_off(cut: Bytes, field: Field, known: Layout, end: int) -> Iterator[FramePart]:
    """The part of a truncated object that is in the frame."""
    if field.start_bit >= end:
        return
    of = field.entry
    named = next((signal.name for signal in known.signals if signal.object == of.object), "") or of.object
    text = f"cut off: {end - field.start_bit} of its {field.bits} bits are there"
    yield cut.part(field.start_bit, end - field.start_bit, named, text, of.object)


def _object_parts(cut: Bytes, field: Field, signal: Signal, value: Value | None) -> Iterator[FramePart]:
    text = "" if value is None else said(value, signal.meaning, field.bits)
    yield cut.part(field.start_bit, field.bits, signal.name or signal.object, text, signal.object)
    names = signal.meaning.bits
    for bit in range(field.bits) if names else ():
        at = field.start_bit + bit
        is_set = cut.raw(at, 1)
        if bit in names or is_set:  # a bit without name has a line only if set
            yield cut.part(at, 1, f"{BIT_INDENT}{names.get(bit, f'bit {bit}')}", "set" if is_set else "")


def _signal_parts(cut: Bytes, known: Layout) -> Iterator[FramePart]:
    """Signals of a DBC file in the frame."""
    for signal, value in zip(known.signals, known.read(cut.data), strict=True):
        if value is not None and signal.place is not None:
            text = said(value, signal.meaning, signal.place.bits)
            yield cut.signal_part(signal.place, signal.name or signal.key, text, signal.object)


#: start of a name for a single bit within the part above
BIT_INDENT = "  "


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
