"""Bytes of an object as a network file has its value, so that what is read of it are those bytes. Reads no node."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.datatypes import CanopenTime, DataType, Kind

if TYPE_CHECKING:
    from dvtcli.domain.object_dictionary import ObjectDictionary

#: what an object without a type is taken for where it has such a length (bytes): UNSIGNED8 to UNSIGNED64
_OBVIOUS = (1, 2, 4, 8)


def value_word(dictionary: ObjectDictionary | None, place: tuple[int, int], data: bytes) -> tuple[str | None, str]:
    """*data* of the object at *place* as a value of `sdo:`; None, and why, where nothing that is typed means it."""
    entry = None if dictionary is None else dictionary.entry(*place)
    kind = None if entry is None else entry.data_type
    size = f"{len(data)} byte{'' if len(data) == 1 else 's'}"
    if kind is None:
        if len(data) in _OBVIOUS:
            return f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}", ""
        return None, f"{size}, and no EDS tells its type"
    try:
        text = _text(kind, data)
        if kind.parse(text) == data:
            return text, ""
    except ValueError:
        pass
    return None, f"{size}, which no value of {kind.name} is"


def _text(kind: DataType, data: bytes) -> str:
    value = kind.decode(data)
    if isinstance(value, CanopenTime):
        return f"{value.days}:{value.milliseconds}"
    if isinstance(value, bytes):
        return value.hex().upper()
    if kind.kind is Kind.UNSIGNED and kind.bits == 32:
        return f"0x{value:X}"
    return str(int(value)) if isinstance(value, bool) else str(value)
