"""The few characters beyond ASCII that screens use, with what stands for them where they cannot be shown."""

from __future__ import annotations

_ASCII = str.maketrans(
    {
        "…": "...", "→": "->", "┌": "+", "┐": "+", "└": "+", "┘": "+", "┬": "+", "┴": "+", "├": "+", "┤": "+",
        "─": "-", "│": "|", "░": ".", "µ": "u", "×": "x", "–": "-", "—": "-", "≤": "<=",
    }
)  # fmt: skip


def ascii_only(text: str) -> str:
    """*text* without characters beyond ASCII: known ones by their look-alike, others as `?`."""
    return text.translate(_ASCII).encode("ascii", "replace").decode("ascii")
