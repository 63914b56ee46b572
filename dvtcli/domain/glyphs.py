"""The few non-ASCII characters on screens, and their ASCII substitutes."""

from __future__ import annotations

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
