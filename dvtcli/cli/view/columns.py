"""Widths of texts on a terminal: an ideograph takes two columns, a combining accent none."""

from __future__ import annotations

import re

#: common characters of one column: Latin, punctuation, arrows, boxes, blocks
_ONE_EACH = re.compile(r"[ -~\u00a0-\u00ac\u00ae-\u02ff\u2010-\u2027\u2190-\u22ff\u2500-\u25ff]*")


def columns(text: str) -> int:
    """Return the columns of *text*; control characters, replaced earlier by `safe`, count 0."""
    if _ONE_EACH.fullmatch(text):
        return len(text)
    from wcwidth import wcwidth

    return sum(max(0, wcwidth(sign)) for sign in text)


def clipped(text: str, width: int, mark: str = "…") -> str:
    """Cut *text* to *width* columns, with *mark* at the cut."""
    if columns(text) <= width:
        return text
    room = max(0, width - len(mark))
    kept = text[:room]
    while columns(kept) > room:
        kept = kept[:-1]
    return kept + mark[: max(1, width)]


def squeezed(text: str, width: int) -> str:
    """Cut *text* to *width* columns with `…` in the middle, so that both ends are visible."""
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
    """Wrap *text* at *width* columns between words; a wider word stays whole on its own line."""
    lines: list[str] = []
    for word in text.split():
        if lines and columns(f"{lines[-1]} {word}") <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines or [""]
