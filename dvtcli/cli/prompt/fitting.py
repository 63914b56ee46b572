"""Parts of a line that must fit a terminal: the least important one gives way first. Does not know what they say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: What stands between two parts.
BETWEEN = " │ "


@dataclass(frozen=True, slots=True)
class StatusPart:
    """A piece of a status line: *forms* from the longest to the shortest, `""` where it may be left out.

    Of two parts the one with the lower *weight* becomes shorter first.
    """

    weight: int
    style: str
    forms: tuple[str, ...]


def fitted(parts: Sequence[StatusPart], width: int) -> list[tuple[str, str]]:
    """(style, text) of the parts that fit *width* columns, each in the longest form that does."""
    forms = [0] * len(parts)

    def texts() -> list[tuple[str, str]]:
        chosen = [(part.style, part.forms[form]) for part, form in zip(parts, forms, strict=True)]
        return [(style, text) for style, text in chosen if text]

    for number in sorted(range(len(parts)), key=lambda number: parts[number].weight):
        while _columns(texts()) > width and forms[number] < len(parts[number].forms) - 1:
            forms[number] += 1
    return texts()


def _columns(texts: Sequence[tuple[str, str]]) -> int:
    return 1 + sum(len(text) for _, text in texts) + len(BETWEEN) * max(0, len(texts) - 1)
