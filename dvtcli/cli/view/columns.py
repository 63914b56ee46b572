"""How many columns of a terminal a text takes: an ideograph takes two, a combining accent none. Knows no styles."""

from __future__ import annotations

import re

#: what takes one column each, and most screens have nothing else: Latin, punctuation, arrows, boxes, blocks
_ONE_EACH = re.compile(r"[ -~\u00a0-\u00ac\u00ae-\u02ff\u2010-\u2027\u2190-\u22ff\u2500-\u25ff]*")


def columns(text: str) -> int:
    """The columns that *text* takes; control characters, which `safe` has replaced before, take none."""
    if _ONE_EACH.fullmatch(text):
        return len(text)
    from wcwidth import wcwidth

    return sum(max(0, wcwidth(sign)) for sign in text)


def clipped(text: str, width: int, mark: str = "…") -> str:
    """*text* in at most *width* columns, with *mark* where something is left out."""
    if columns(text) <= width:
        return text
    room = max(0, width - len(mark))
    kept = text[:room]
    while columns(kept) > room:
        kept = kept[:-1]
    return kept + mark[: max(1, width)]


def squeezed(text: str, width: int) -> str:
    """*text* in at most *width* columns; `…` in its middle where something is left out, so that both ends are seen."""
    if columns(text) <= width:
        return text
    begin = clipped(text, (width + 1) // 2)
    room, end = width - columns(begin), ""
    for sign in reversed(text):
        if columns(sign + end) > room:
            break
        end = sign + end
    return begin + end


def broken(text: str, width: int) -> list[str]:
    """*text* as lines of at most *width* columns, broken between words; a word that is wider stands alone, whole."""
    lines: list[str] = []
    for word in text.split():
        if lines and columns(f"{lines[-1]} {word}") <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines or [""]
