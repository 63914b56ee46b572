"""What a device holds as the text of a ParameterValue, or why none says it. Does not know which key takes the text."""

from __future__ import annotations

from dvtcli.domain.datatypes import DataType
from dvtcli.files.eds.written_values import text_of

#: the longest DOMAIN or OCTET_STRING that is written into a line (bytes)
MOST_OCTETS = 1 << 16


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
    text = text_of(data_type, data, hexadecimal="0x" in like.lower() or "$" in like, exact=False)
    if text is None:
        raise ValueError(f"no line of a file can say this {data_type.name}")
    return text
