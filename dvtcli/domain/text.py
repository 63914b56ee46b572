"""Texts for screens and files: short lists, numbers with their noun, escaped names, the few non-ASCII characters."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable


def plural(count: int, noun: str) -> str:
    """A number with its noun."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def join_some(names: Iterable[str]) -> str:
    """Names for one line: all of a few, else the first names and the number of others."""
    found = list(names)
    return ", ".join(found) if len(found) <= 4 else f"{', '.join(found[:3])} and {len(found) - 3} more"


def all_nodes(node_ids: Iterable[object]) -> str:
    """All of *node_ids* in a sentence: `node 1`, `nodes 1 and 5`."""
    *first, last = [*map(str, node_ids)] or [""]
    return f"nodes {', '.join(first)} and {last}" if first else f"node {last}"


def some_nodes(node_ids: Iterable[object]) -> str:
    """As `all_nodes`; of more than four the first three and the number of others."""
    return some_of("node", node_ids)


def some_of(noun: str, names: Iterable[object]) -> str:
    """A *noun* with its *names* in a sentence: `line 5`, `lines 5 and 9`, of more than four the first three."""
    found = [*map(str, names)]
    if len(found) <= 4:
        return all_nodes(found).replace("node", noun, 1)
    return f"{noun}s {join_some(found)}"


def hex_preview(data: bytes) -> str:
    """The first bytes of *data* and its length, short enough for a line."""
    most = 16
    return data.hex(" ").upper() if len(data) <= most else f"{data[:4].hex(' ').upper()} … {len(data):,} bytes"


def value_text(data: bytes) -> str:
    """An object's value in words: a number if possible, else its first bytes."""
    if len(data) in (1, 2, 4, 8):
        return f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}"
    return hex_preview(data) or "empty"


#: Cc control, Cf format (bidirectional overrides), Cs surrogates, Co private use, Zl/Zp line separators.
_UNSAFE = frozenset({"Cc", "Cf", "Cs", "Co", "Zl", "Zp"})


def safe(text: str) -> str:
    r"""*text* with every character that could control a terminal escaped as `\x1b`, `\u202e`, …."""
    if text.isprintable():  # no character of _UNSAFE is
        return text
    return "".join(_escaped(char) if unicodedata.category(char) in _UNSAFE else char for char in text)


def _escaped(char: str) -> str:
    code = ord(char)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


_ASCII = str.maketrans(
    {
        "…": "...", "→": "->", "┌": "+", "┐": "+", "└": "+", "┘": "+", "┬": "+", "┴": "+", "├": "+", "┤": "+",
        "─": "-", "│": "|", "░": ".", "µ": "u", "×": "x", "–": "-", "—": "-", "≤": "<=",
        "±": "~", "°": "deg ", "Ω": "Ohm", "↑": "^", "↓": "v", "█": "#", "▸": ">",
        "▁": "_", "▂": ".", "▃": "-", "▄": "=", "▅": "+", "▆": "*", "▇": "@",
    }
)  # fmt: skip


def ascii_only(text: str) -> str:
    """*text* in ASCII: known characters by their look-alike, others as `?`."""
    return in_encoding(text, "ascii")


def in_encoding(text: str, encoding: str) -> str:
    """*text* in the characters of *encoding*: missing characters by their look-alike, else as `?`."""
    return "".join(
        char
        if char.isascii() or _has(encoding, char)
        else char.translate(_ASCII).encode(encoding, "replace").decode(encoding)
        for char in text
    )


def _has(encoding: str, char: str) -> bool:
    try:
        char.encode(encoding)
    except UnicodeEncodeError:
        return False
    return True
