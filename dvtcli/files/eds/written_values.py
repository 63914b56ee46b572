"""Write values and limits as text of an EDS or XDD that reads back equal (CiA 306, 4.2, also for CiA 311)."""

from __future__ import annotations

import math
from collections.abc import Iterator

from dvtcli.domain.datatypes import DataType, Kind
from dvtcli.files.eds.numbers import EncodedValue, encode_value

_NODE_ID = "$NODEID"
#: Below this every whole number is a REAL64 of its own.
_ALL_WHOLE = 1 << 53
_TEXT_KINDS = (Kind.VISIBLE_STRING, Kind.UNICODE_STRING)
_NUMBER_KINDS = (Kind.BOOLEAN, Kind.INTEGER, Kind.UNSIGNED)


def is_text(data_type: DataType | None) -> bool:
    """Whether values of this type are text, so that `;` begins no comment."""
    return data_type is not None and data_type.kind in _TEXT_KINDS


def same_value(data_type: DataType | None, one: bytes | None, other: bytes | None) -> bool:
    """Whether both values are equal, apart from zeros after a text, and the byte that means true."""
    if one == other or one is None or other is None or data_type is None:
        return one == other
    if data_type.kind not in (*_TEXT_KINDS, Kind.BOOLEAN) or (data_type.size or len(one)) != len(one):
        return False
    return len(other) == (data_type.size or len(other)) and data_type.decode(one) == data_type.decode(other)


def written_value(data_type: DataType | None, data: bytes, *, relative: bool) -> str | None:
    """Return *data* as text, with `$NODEID+` if *relative*; None if no text of one line represents it."""
    return text_of(data_type, data, hexadecimal=True, exact=True, relative=relative)


def text_of(
    data_type: DataType | None, data: bytes, *, hexadecimal: bool, exact: bool, relative: bool = False
) -> str | None:
    """Return the preferred one-line text for *data*, None if there is none.

    Numbers are *hexadecimal* if possible. *exact*: every byte reads back, characters are printable, negative numbers
    have a sign, a REAL has all digits; otherwise the value is equal, and a REAL is as short as possible. *relative*
    adds `$NODEID+`.
    """
    if data_type is None:
        return None
    for text in _candidates(data_type, data, hexadecimal=hexadecimal, exact=exact):
        said = f"{_NODE_ID}+{text}" if relative else text
        if _means(data_type, said, EncodedValue(data, relative), exact=exact):
            return said
    return None


def written_limit(limit: int | float, *, relative: bool) -> str:
    """Return a limit as text, with `$NODEID+` if *relative*."""
    text = _number(limit) if isinstance(limit, int) else next(_exact_reals(limit))
    return f"{_NODE_ID}+{text}" if relative else text


def _number(number: int) -> str:
    return f"0x{number:X}" if number >= 0 else str(number)


def _candidates(data_type: DataType, data: bytes, *, hexadecimal: bool, exact: bool) -> Iterator[str]:
    """Iterate over texts that may represent *data*, preferred first."""
    if data_type.kind is Kind.OCTETS:
        yield data.hex().upper() or "0x"
        return
    try:
        value = data_type.decode(data)
    except ValueError:
        value = None  # of another length than its type
    if data_type.kind in _TEXT_KINDS:
        yield from () if value is None else [str(value)]
        return
    if isinstance(value, float):
        yield from _exact_reals(value) if exact else _reals(value)
    decimal = [str(int(value))] if isinstance(value, int) and data_type.kind in _NUMBER_KINDS else []
    if not hexadecimal or (exact and isinstance(value, int) and value < 0):
        yield from decimal
    yield f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}"
    yield from decimal


def _exact_reals(value: float) -> Iterator[str]:
    """Iterate over texts with all digits, without a point if possible: dcfgen reads no REAL that has one."""
    if value.is_integer() and abs(value) < _ALL_WHOLE and math.copysign(1, value) == math.copysign(1, int(value)):
        yield str(int(value))
    yield repr(value)


def _reals(value: float) -> Iterator[str]:
    if math.isfinite(value):
        yield from (f"{value:.7g}", f"{value:.9g}", repr(value))


def _means(data_type: DataType, text: str, wanted: EncodedValue, *, exact: bool) -> bool:
    if not text or text != text.strip() or not all(char.isprintable() if exact else char >= " " for char in text):
        return False
    try:
        found = encode_value(data_type, text)
    except ValueError:
        return False
    is_same = found.data == wanted.data if exact else same_value(data_type, found.data, wanted.data)
    return is_same and found.relative == wanted.relative
