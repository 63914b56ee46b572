"""Tables and code in Markdown."""

from __future__ import annotations

import html
from collections.abc import Iterable, Iterator, Sequence


def code(text: str) -> str:
    """*text* as code within a line or a cell, whatever signs it has."""
    if "|" in text or "`" in text:
        return f"<code>{html.escape(text, quote=False).replace('|', '&#124;')}</code>"
    return f"`{text}`" if text else ""


def cell(text: str) -> str:
    """*text* that is Markdown already, as a cell."""
    return " ".join(text.split()).replace("|", "&#124;")


def plain(text: str) -> str:
    """*text* that is no Markdown, as a cell."""
    for sign in "\\*_<":
        text = text.replace(sign, f"\\{sign}")
    return cell(text)


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """A table; cells are Markdown."""
    yield f"| {' | '.join(header)} |"
    yield f"|{'---|' * len(header)}"
    for row in rows:
        yield f"| {' | '.join(row)} |"


def fenced(kind: str, lines: Iterable[str]) -> Iterator[str]:
    """A block of code."""
    yield f"```{kind}"
    yield from (line.rstrip() for line in lines)
    yield "```"
