"""A node's objects by name, and their values in words."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

from dvtcli.domain.cob_id import SRDO_COB_IDS, SRDO_DIRECTION, CobId
from dvtcli.domain.datatypes import DataType, Kind, Value
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.object_scalings import ObjectScalings, cut_text
from dvtcli.domain.objects import (
    COB_ID_EMCY,
    COB_ID_SYNC,
    COB_ID_TIME,
    CONSUMER_HEARTBEAT,
    DEVICE_TYPE,
    SRDO_COMMUNICATION,
)
from dvtcli.domain.pdo import PdoMappingEntry, listed_objects
from dvtcli.domain.scaling import Scaling
from dvtcli.domain.standard_objects import (
    is_pdo_communication,
    is_pdo_mapping,
    is_srdo_mapping,
    standard_entry,
    standard_name,
)
from dvtcli.domain.text import hex_preview, plural

#: objects that are one COB-ID, and those whose bit 31 is no switch
_COB_IDS, _WITHOUT_OFF = (COB_ID_SYNC, COB_ID_TIME, COB_ID_EMCY), (COB_ID_SYNC, COB_ID_TIME)
_SDO_PARAMETERS = range(0x1200, 0x1300)
#: information direction of an SRDO (EN 50325-5)
_DIRECTIONS = ("off", "transmitted", "received")
#: the longest number (bytes) of an object of unknown type
_LONGEST_NUMBER = 8
_NUMBERS = (Kind.BOOLEAN, Kind.INTEGER, Kind.UNSIGNED, Kind.REAL)


class NamedValue(NamedTuple):
    """An object's *name*, and its *value*, also as *text*; None and empty if unknown."""

    name: str
    text: str = ""
    value: Value | None = None


@dataclass(frozen=True, slots=True)
class KnownNode:
    """Dictionary of a node, if any, and meanings of its objects."""

    dictionary: ObjectDictionary | None
    scalings: ObjectScalings

    def value(self, index: int, sub_index: int, data: bytes | None, *, padded: bool = False) -> NamedValue:
        """The object's name, and its value in *data* in words; *padded*: *data* may be longer than the value."""
        name = self.dictionary.display_name(index, sub_index) if self.dictionary is not None else ""
        name = name or standard_name(index, sub_index)
        if data is None:
            return NamedValue(name)
        kind = self._type(index, sub_index)
        size = kind.size if kind is not None else None
        if padded and size is not None:
            data = data[:size]
        value = _value(kind, data)
        text = self._mapped(index, sub_index, value) or self._listed(index, sub_index, value)
        text = text or _communication_text(index, sub_index, value)
        return NamedValue(name, text or said(value, self.scalings.of(index, sub_index), 8 * len(data)), value)

    @property
    def device_type(self) -> int | None:
        """The device type (0x1000) in the node's file."""
        entry = self.dictionary.entry(DEVICE_TYPE, 0) if self.dictionary is not None else None
        data = None if entry is None else entry.initial(0)
        return None if data is None else int.from_bytes(data, "little")

    def _mapped(self, index: int, sub_index: int, value: Value) -> str:
        """An object mapped into a PDO in words; empty for any other object."""
        is_mapping = (is_pdo_mapping(index) or is_srdo_mapping(index)) and sub_index
        if not is_mapping or not isinstance(value, int) or not 0 < value < 1 << 32:
            return ""
        entry = PdoMappingEntry.from_raw(value)
        name = self.value(entry.index, entry.sub_index, None).name
        return f"{' '.join(filter(None, (entry.object, name)))}, {plural(entry.bits, 'bit')}"

    def _listed(self, index: int, sub_index: int, value: Value) -> str:
        """An entry of a scanner or dispatcher list in words; empty for any other object."""
        entry = listed_objects(index, value) if sub_index and isinstance(value, int) and value >= 0 else None
        if entry is None:
            return ""
        source = f"node {entry.node_id} {entry.sources} -> " if entry.sources else ""
        name = self.value(entry.index, entry.sub_index, None).name
        return " ".join(filter(None, (f"{source}{entry.objects}", name)))

    def _type(self, index: int, sub_index: int) -> DataType | None:
        entry = self.dictionary.entry(index, sub_index) if self.dictionary is not None else None
        if entry is not None and entry.data_type is not None:
            return entry.data_type
        standard = standard_entry(index, sub_index)
        return None if standard is None else standard.data_type


def of_mpdo(described: Callable[[int], KnownNode], node: int, producer: int | None) -> KnownNode:
    """What names the objects of an MPDO: the *node* in it, else its *producer* if nothing is known of that node."""
    known = described(node or producer or 0)
    return known if known.dictionary is not None or producer is None else described(producer)


def _value(kind: DataType | None, data: bytes) -> Value:
    """The value of *kind* in *data*; of an unknown type a number, a printable text, or the bytes."""
    if kind is not None and (kind.kind not in _NUMBERS or kind.size == len(data)):
        with suppress(ValueError):  # the device disagrees with its file: show what it sent
            return kind.decode(data)
    if 0 < len(data) <= _LONGEST_NUMBER:
        return int.from_bytes(data, "little")
    text = data.rstrip(b"\0")
    return text.decode("ascii") if text and all(0x20 <= byte < 0x7F for byte in text) else data


def _communication_text(index: int, sub_index: int, value: Value) -> str:
    """A COB-ID, or a consumer heartbeat time, in words; empty for any other object."""
    if not isinstance(value, int) or not 0 <= value < 1 << 32:
        return ""
    if index == CONSUMER_HEARTBEAT and sub_index:
        return f"node {value >> 16 & 0xFF}, {value & 0xFFFF} ms"
    is_sdo = index in _SDO_PARAMETERS and sub_index in (1, 2)
    if index in SRDO_COMMUNICATION and sub_index == SRDO_DIRECTION:
        return f"{_DIRECTIONS[value]} ({value})" if value < len(_DIRECTIONS) else ""
    if index in SRDO_COMMUNICATION and sub_index in SRDO_COB_IDS:
        return str(CobId.from_raw(value))
    if not is_sdo and not (is_pdo_communication(index) and sub_index == 1) and index not in _COB_IDS:
        return ""
    cob_id = CobId.from_raw(value)
    if value == cob_id.can_id:
        return str(cob_id)
    is_off = not cob_id.valid and index not in _WITHOUT_OFF
    return f"{cob_id}{', disabled' if is_off else ''} (0x{value:08X})"


def said(value: Value, meaning: Scaling, bits: int) -> str:
    """*value* in words, with unit or meaning if known."""
    if isinstance(value, bytes):
        return hex_preview(value)
    if isinstance(value, str):
        return cut_text(value)
    return meaning.text(value, bits) or str(value)
