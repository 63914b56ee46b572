"""What a device holds as the text of a ParameterValue (CiA 306, 4.2) that reads back as the same.

Knows data types and how files write them. Does not know which key takes the text.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from dvtcli.domain.datatypes import DataType, Kind
from dvtcli.files.eds.numbers import encode_value

_TEXT_KINDS = (Kind.VISIBLE_STRING, Kind.UNICODE_STRING)
#: the longest DOMAIN or OCTET_STRING that is written into a line (bytes)
MOST_OCTETS = 1 << 16


def is_text(data_type: DataType | None) -> bool:
    """Whether a value of this type is text, so that `;` begins no comment in it."""
    return data_type is not None and data_type.kind in _TEXT_KINDS


def value_text(data_type: DataType | None, data: bytes, like: str = "") -> str:
    """*data* of an object of *data_type* as text; hexadecimal where *like*, another value of it, is.

    ValueError, its text says why, where no text means it.
    """
    if data_type is None:
        raise ValueError("its data type is not known")
    if not data:
        raise ValueError("it is empty")
    if len(data) > MOST_OCTETS:
        raise ValueError(f"it has {len(data):,} bytes, more than {MOST_OCTETS:,}")
    if data_type.size is not None and len(data) != data_type.size:
        raise ValueError(f"the device holds {len(data)} bytes, and a {data_type.name} has {data_type.size}")
    for text in _candidates(data_type, data, is_hex="0x" in like.lower() or "$" in like):
        if _means(data_type, text, data):
            return text
    raise ValueError(f"no line of a file can say this {data_type.name}")


def same_value(data_type: DataType | None, one: bytes | None, other: bytes | None) -> bool:
    """Whether both mean the same: a text with and without zeros behind it, any byte but 0 of a BOOLEAN."""
    if one == other or one is None or other is None or data_type is None:
        return one == other
    if data_type.kind not in (*_TEXT_KINDS, Kind.BOOLEAN) or (data_type.size or len(one)) != len(one):
        return False
    return len(other) == (data_type.size or len(other)) and data_type.decode(one) == data_type.decode(other)


def _means(data_type: DataType, text: str, data: bytes) -> bool:
    if text != text.strip() or not text or any(ord(char) < 0x20 for char in text):
        return False
    try:
        return same_value(data_type, encode_value(data_type, text).data, data)
    except ValueError:
        return False


def _candidates(data_type: DataType, data: bytes, *, is_hex: bool) -> Iterator[str]:
    """Texts that may say *data*, the one that is liked best first."""
    match data_type.kind:
        case Kind.VISIBLE_STRING | Kind.UNICODE_STRING:
            yield str(data_type.decode(data))
        case Kind.OCTETS:
            yield data.hex().upper()
        case Kind.REAL:
            yield from _reals(data_type, data)
        case Kind.TIME:
            yield _hex(data)
        case Kind.BOOLEAN | Kind.INTEGER | Kind.UNSIGNED:
            if is_hex:
                yield _hex(data)
            yield str(int(data_type.decode(data)))  # type: ignore[arg-type]


def _reals(data_type: DataType, data: bytes) -> Iterator[str]:
    value = data_type.decode(data)
    if isinstance(value, float) and math.isfinite(value):
        yield from (f"{value:.7g}", f"{value:.9g}", repr(value))
    yield _hex(data)


def _hex(data: bytes) -> str:
    return f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}"
