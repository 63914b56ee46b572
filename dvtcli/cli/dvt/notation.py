"""Numbers in the DVT's words: `0x` is hexadecimal, everything else decimal."""

from __future__ import annotations

import re
from collections.abc import Iterable

from dvtcli.domain.datatypes import Value, parse_number

#: Widths of values in bytes.
WIDTHS = (1, 2, 3, 4, 8)
#: Below this index CiA 301 has data types: an index without `0x` most likely lacks the `0x`.
_FIRST_OBJECT = 0x1000
#: special characters in a Tcl list
_SPECIAL = re.compile(r'[\s{}\[\]$";\\#]')
_ESCAPES = {"\n": r"\n", "\r": r"\r", "\t": r"\t", "\v": r"\v", "\f": r"\f"}


def node_id(text: str) -> int:
    """A node-ID, 1…127; ValueError otherwise."""
    return _within(text, 1, 127, "a node-ID")


def index(text: str) -> int:
    """Return an object's index. Raises ValueError if malformed, or hexadecimal without `0x`."""
    digits = text.strip().lower()
    looks_hex = len(digits) == 4 and all(digit in "0123456789abcdef" for digit in digits)
    if looks_hex and (not digits.isdigit() or int(digits) < _FIRST_OBJECT):
        raise ValueError(f"{text}: a number without 0x is decimal here; for index 0x{digits.upper()} write the 0x")
    return _within(text, 1, 0xFFFF, "an index")


def sub_index(text: str) -> int:
    """A sub-index, 0…255; ValueError otherwise."""
    return _within(text, 0, 0xFF, "a sub-index")


def can_id(text: str) -> int:
    """Return a CAN-ID of 11 bits. Raises ValueError otherwise."""
    return _within(text, 1, 0x7FF, "a CAN-ID")


def level(text: str) -> int:
    """An access level, 0 to log out; ValueError otherwise."""
    return _within(text, 0, 0xFF, "an access level")


def width(text: str) -> int:
    """Return a value's width in bytes. Raises ValueError for an impossible width."""
    found = parse_number(text)
    if found not in WIDTHS:
        raise ValueError(f"{text}: a value has {', '.join(map(str, WIDTHS))} bytes")
    return found


def value_bytes(text: str, wanted: int | None) -> bytes:
    """Return *text* as bytes of an SDO download, lowest first; *wanted* is the width (None: from the digits).

    Raises ValueError if the width is unknown, or the number does not fit.
    """
    number = parse_number(text)
    size = wanted if wanted is not None else _width_of_digits(text)
    low = -(1 << 8 * size - 1)
    if not low <= number < 1 << 8 * size:
        raise ValueError(f"{text} does not fit into {size} byte{'' if size == 1 else 's'}")
    return (number % (1 << 8 * size)).to_bytes(size, "little")


def decimal(value: Value) -> str:
    """Return a read value for Tcl: numbers in decimal, text unchanged, bytes in wire order."""
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    return str(int(value) if isinstance(value, bool) else value)


def listed(values: Iterable[Value]) -> str:
    """Return values as a Tcl list; a device's text can neither end an element nor be a command."""
    return " ".join(
        _SPECIAL.sub(lambda found: _ESCAPES.get(found[0], f"\\{found[0]}"), decimal(value)) or "{}" for value in values
    )


def meant_in_hex(number: int) -> int:
    """Return the intended number if *number* was typed with hexadecimal digits without `0x`."""
    return int(str(number), 16)


def _width_of_digits(text: str) -> int:
    digits = text.strip().lower()
    if not digits.startswith("0x"):
        raise ValueError(
            f"{text}: a decimal value needs its width in bytes after it, or write it in hex: 0x00 is 1 byte"
        )
    count = len(digits) - 2
    if count % 2 or count // 2 not in WIDTHS:
        raise ValueError(f"{text}: in hex the digits set the width, 2 per byte; {count} digits are not possible")
    return count // 2


def _within(text: str, low: int, high: int, what: str) -> int:
    found = parse_number(text)
    if not low <= found <= high:
        raise ValueError(f"{text}: {what} is {low}…{high}")
    return found
