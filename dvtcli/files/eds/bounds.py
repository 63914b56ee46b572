"""Limits for the size of an EDS or DCF: far above any real file, low enough to read in seconds.

Counts bytes only, before anything is built.
"""

from __future__ import annotations

import re

#: A file is some 100 kB, with some thousand sections; an array in short form stands for up to 254 sub-indices.
MOST_BYTES = 16 << 20
_MOST_LINES = 500_000
_MOST_SECTIONS = 150_000
_MOST_COMPACT = 250_000
_COMPACT = re.compile(rb"compactsubobj\s*=\s*(?:0x([0-9a-f]{1,8})|([0-9]{1,8}))")
_PER_OBJECT = 254


def too_much(data: bytes) -> str | None:
    """Describe the limit that *data* exceeds; None if within all limits."""
    if len(data) > MOST_BYTES:
        return f"larger than {MOST_BYTES >> 20} MiB"
    if max(data.count(b"\n"), data.count(b"\r")) > _MOST_LINES:
        return f"longer than {_MOST_LINES} lines"
    if data.count(b"[") > _MOST_SECTIONS:
        return f"of more than {_MOST_SECTIONS} sections"
    if _compact_sub_indices(data) > _MOST_COMPACT:
        return f"of arrays with more than {_MOST_COMPACT} sub-indices in all (CompactSubObj)"
    return None


def _compact_sub_indices(data: bytes) -> int:
    """Return an upper bound for the sub-indices of all CompactSubObj; counts exactly only if the bound is too high."""
    text = data.replace(b"\0", b"").lower()  # UTF-16 has a zero beside each letter
    most = text.count(b"compactsubobj") * _PER_OBJECT
    if most <= _MOST_COMPACT:
        return most
    return sum(min(int(a, 16) if a else int(b), _PER_OBJECT) for a, b in _COMPACT.findall(text))
