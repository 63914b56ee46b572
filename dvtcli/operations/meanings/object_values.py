"""Shared by `read` and `write`: types of objects, and values for results."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.datatypes import BY_SHORT_NAME, DataType, Kind
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.meanings import NOTHING, ScaledValue
from dvtcli.domain.text import hex_preview
from dvtcli.errors import SdoProtocolError
from dvtcli.operations.meanings.physical_meanings import meanings_of
from dvtcli.operations.results.values import ValueRead

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dvtcli.device.node_parts import NodeDescription

#: Strings at the same place in every device (CiA 301, 7.5.2.8 ff.).
_STRINGS = frozenset({0x1008, 0x1009, 0x100A})
#: types not obvious from bytes
_NEEDS_TYPE = frozenset({Kind.INTEGER, Kind.REAL, Kind.VISIBLE_STRING, Kind.UNICODE_STRING})
#: the first index after communication objects, and the maximum bytes of a number always printed in decimal
_MAKERS, _SHORT = 0x2000, 2
_BY_SIZE = {1: "u8", 2: "u16", 4: "u32", 8: "u64"}


def type_of(node: NodeDescription, index: int, sub_index: int, size: int) -> DataType:
    """Return the object's type in the EDS, else by its *size* in bytes."""
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    if entry is not None and entry.data_type is not None:
        return entry.data_type
    return BY_SHORT_NAME["vs" if index in _STRINGS else _BY_SIZE.get(size, "os")]


def understood(node: NodeDescription, sizes: Mapping[str, int]) -> dict[str, ScaledValue]:
    """Map the objects in *sizes* (printed form: bytes) to scaled values, if a scaling is known."""
    meanings = meanings_of(node.profile, node.dictionary)
    found = {}
    for place, size in sizes.items():
        index, sub_index = (int(part, 16) for part in place.split(":"))
        meaning, kind = meanings.of(index, sub_index), type_of(node, index, sub_index, size)
        if meaning.says or kind.kind in _NEEDS_TYPE or _is_count(node, index, sub_index):
            found[place] = ScaledValue(kind, meaning)
    return found


def _is_count(node: NodeDescription, index: int, sub_index: int) -> bool:
    """Tell whether the EDS has a long unsigned number; communication objects (0x1000…) are bit fields."""
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    kind = None if entry is None else entry.data_type
    return index >= _MAKERS and kind is not None and kind.kind is Kind.UNSIGNED and (kind.size or 0) > _SHORT


def value_words(node: NodeDescription, index: int, sub_index: int, data: bytes) -> str:
    """Print *data* of an object: `48.0 V (768)`, a word, a number; else its first bytes."""
    kind = type_of(node, index, sub_index, len(data))
    try:
        value = kind.decode(data)
    except ValueError:
        return hex_preview(data)
    if isinstance(value, bytes):
        return hex_preview(data)
    return meanings_of(node.profile, node.dictionary).of(index, sub_index).text(value, 8 * len(data)) or str(value)


def value_result(
    node: NodeDescription, index: int, sub_index: int, data: bytes, asked: DataType | None, *, written: bool = False
) -> ValueRead:
    """The answer for an object that holds *data*; *asked* is a type the user named."""
    kind = asked or type_of(node, index, sub_index, len(data))
    if asked is None and kind.size is not None and kind.size != len(data):
        kind = BY_SHORT_NAME[_BY_SIZE.get(len(data), "os")]  # the device disagrees with its file: show what it sent
    try:
        value = kind.decode(data)
    except ValueError as wrong:
        raise SdoProtocolError(
            f"0x{index:04X}:{sub_index:02X} answered {len(data)} bytes ({data[:16].hex(' ')}): {wrong}",
            node=node.node_id,
            place=f"{index:04X}:{sub_index:02X}",
            hint=Hint(Action.GIVE, {"as_type": None}, "names another type")
            + Hint(Action.GIVE, {"as_type": "os"}, "shows the bytes"),
        ) from wrong
    name = node.dictionary.display_name(index, sub_index) if node.dictionary else ""
    return ValueRead(
        node.node_id,
        f"{index:04X}:{sub_index:02X}",
        name,
        value,
        data,
        kind.short,
        meanings_of(node.profile, node.dictionary).of(index, sub_index) if asked is None else NOTHING,
        written,
    )
