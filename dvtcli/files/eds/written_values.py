"""What an entry holds, as the text of an EDS or XDD that reads back as the same (CiA 306, 4.2; CiA 311 has its form).

Knows values and limits. Does not know which key takes the text.
"""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.datatypes import DataType, Kind
from dvtcli.files.eds.numbers import EncodedValue, encode_value

_NODE_ID = "$NODEID"
_TEXT_KINDS = (Kind.VISIBLE_STRING, Kind.UNICODE_STRING)


def written_value(data_type: DataType | None, data: bytes, *, relative: bool) -> str | None:
    """*data* as text, with the node-ID added where it is *relative*; None where no text of one line means it."""
    if data_type is None:
        return None
    for text in _candidates(data_type, data):
        said = f"{_NODE_ID}+{text}" if relative else text
        if _means(data_type, said, EncodedValue(data, relative)):
            return said
    return None


def written_limit(limit: int | float, *, relative: bool) -> str:
    """A limit as text, with the node-ID added where it is *relative*."""
    text = _number(limit) if isinstance(limit, int) else repr(limit)
    return f"{_NODE_ID}+{text}" if relative else text


def _number(number: int) -> str:
    return f"0x{number:X}" if number >= 0 else str(number)


def _candidates(data_type: DataType, data: bytes) -> Iterator[str]:
    """Texts that may mean *data*, the one that people read best first."""
    digits = f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}"
    try:
        if data_type.kind in _TEXT_KINDS:
            yield str(data_type.decode(data))
        elif data_type.kind is Kind.OCTETS:
            yield data.hex().upper() or "0x"
        elif data_type.kind is Kind.REAL:
            yield repr(data_type.decode(data))
        elif data_type.kind is Kind.INTEGER:
            number = int.from_bytes(data, "little", signed=True)
            yield digits if number >= 0 else str(number)
    except ValueError:
        return  # of another length than its type
    if data_type.kind not in _TEXT_KINDS:
        yield digits


def _means(data_type: DataType, text: str, wanted: EncodedValue) -> bool:
    if text != text.strip() or not text or not text.isprintable():
        return False
    try:
        found = encode_value(data_type, text)
    except ValueError:
        return False
    return (found.data, found.relative) == (wanted.data, wanted.relative)
