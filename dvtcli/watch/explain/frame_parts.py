"""Every bit of a frame, named: its CAN-ID, its service, and what its bytes say.

Sends nothing. Does not know where mappings, names and meanings come from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from dvtcli.domain.datatypes import Value
from dvtcli.domain.frame import Field, layout
from dvtcli.domain.lss_services import REQUEST_ID
from dvtcli.domain.meanings import Meanings
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling
from dvtcli.domain.standard_names import standard_name
from dvtcli.watch.decoder import Decoder, Layout, Signal
from dvtcli.watch.explain.lss_parts import lss_parts
from dvtcli.watch.explain.parts import BIT_INDENT, Bytes, FramePart
from dvtcli.watch.explain.sdo_parts import sdo_parts
from dvtcli.watch.explain.service_parts import (
    emergency_parts,
    heartbeat_parts,
    nmt_parts,
    sync_parts,
    time_parts,
)
from dvtcli.watch.service import service_of

_STANDARD_BITS, _NODE_BITS, _BYTE = 11, 7, 8
#: the CAN-IDs of SDO requests begin behind it
REQUESTS = 0x600
_BY_KIND: dict[str, Callable[[bytes], Iterator[FramePart]]] = {
    "nmt": nmt_parts,
    "sync": sync_parts,
    "time": time_parts,
    "emcy": emergency_parts,
    "heartbeat": heartbeat_parts,
}
_FUNCTION_NAMES = {
    0x0: "NMT, and CAN-IDs without a node", 0x1: "SYNC or EMCY", 0x2: "TIME", 0xB: "SDO answer", 0xC: "SDO request",
    0xE: "heartbeat, node guarding", 0xF: "LSS",
    **{n: f"{'TPDO' if n % 2 else 'RPDO'}{(n - 3) // 2 + 1}" for n in range(3, 11)},
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class KnownNode:
    """What is known of one node: its dictionary, if any, and what its objects mean."""

    dictionary: ObjectDictionary | None
    meanings: Meanings

    def value(self, index: int, sub_index: int, data: bytes | None) -> tuple[str, str]:
        """What the object is called, and what its value in *data* says; empty for what nobody knows."""
        entry = self.dictionary.entry(index, sub_index) if self.dictionary is not None else None
        name = self.dictionary.display_name(index, sub_index) if self.dictionary is not None else ""
        name = name or standard_name(index, sub_index)
        meaning = self.meanings.of(index, sub_index)
        if data is None:
            return name, ""
        kind = entry.data_type if entry is not None else None
        try:
            value: Value = kind.decode(data) if kind is not None else int.from_bytes(data, "little")
        except ValueError:
            value = int.from_bytes(data, "little")
        return name, said(value, meaning, 8 * len(data))


def said(value: Value, meaning: Scaling, bits: int) -> str:
    """*value* in words: with its unit or meaning where there is one."""
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    return meaning.text(value, bits) or str(value)


def frame_parts(frame: Frame, decoder: Decoder, described: Callable[[int], KnownNode]) -> list[FramePart]:
    """Every part of *frame*, the CAN-ID's first; *described* says what is known of a node, by node-ID."""
    known = decoder.layout(frame)
    parts = list(_id_parts(frame, known))
    if frame.remote:
        return parts
    service, data = known.service, frame.data
    if service.kind == "sdo" and not frame.extended:
        node = service.node

        def name_of(index: int, sub_index: int, value: bytes | None) -> tuple[str, str]:
            return described(node or 0).value(index, sub_index, value)

        return [*parts, *sdo_parts(data, request=frame.can_id & 0x780 == REQUESTS, name_of=name_of)]
    if service.kind == "lss":
        return [*parts, *lss_parts(data, request=frame.can_id == REQUEST_ID)]
    if service.kind in _BY_KIND:
        return [*parts, *_BY_KIND[service.kind](data)]
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


def _pdo_parts(data: bytes, known: Layout) -> Iterator[FramePart]:
    """The objects that a PDO carries, with the bits that have names; bytes as they are where no mapping is known."""
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
            yield cut.part(field.start_bit, field.bits, "dummy", "a gap", field.entry.object)
        else:
            yield from _object_parts(cut, field, *next(signals))
    if last < end:
        yield cut.part(last, end - last, "behind the mapping", _of_rest(known, end - last))


def _of_rest(known: Layout, bits: int) -> str:
    """What to say of the *bits* behind the mapping: less than a byte of them fills up the last one."""
    if bits < _BYTE:
        return "fills up the byte"
    if known.is_consumers:
        return f"{known.service.label} of node {known.service.node} does not take it"
    return "so the mapping is not its sender's"


def _cut_off(cut: Bytes, field: Field, known: Layout, end: int) -> Iterator[FramePart]:
    """What is there of an object that does not lie in the frame completely."""
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
        if bit in names or is_set:  # a bit that nobody names is worth a line where it is set
            yield cut.part(at, 1, f"{BIT_INDENT}{names.get(bit, f'bit {bit}')}", "set" if is_set else "")


def _signal_parts(cut: Bytes, known: Layout) -> Iterator[FramePart]:
    """The signals of a DBC file that lie in the frame."""
    for signal, value in zip(known.signals, known.read(cut.data), strict=True):
        if value is not None and signal.place is not None:
            text = said(value, signal.meaning, signal.place.bits)
            yield cut.signal_part(signal.place, signal.name or signal.key, text, signal.object)
