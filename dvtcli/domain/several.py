"""Short lists of names and bytes for a line; numbers with their noun."""

from __future__ import annotations

from collections.abc import Iterable


def plural(count: int, noun: str) -> str:
    """A number with its noun."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def join_some(names: Iterable[str]) -> str:
    """Names for one line: all of a few, else the first names and the number of others."""
    found = list(names)
    return ", ".join(found) if len(found) <= 4 else f"{', '.join(found[:3])} and {len(found) - 3} more"


def hex_preview(data: bytes) -> str:
    """The first bytes of *data* and its length, short enough for a line."""
    most = 16
    return data.hex(" ").upper() if len(data) <= most else f"{data[:4].hex(' ').upper()} … {len(data):,} bytes"


def value_text(data: bytes) -> str:
    """An object's value in words: a number if possible, else its first bytes."""
    if len(data) in (1, 2, 4, 8):
        return f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}"
    return hex_preview(data) or "empty"
