"""The text of answers that have their own lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol

from dvtcli.cli.view.lines import Line
from dvtcli.domain.hint import Hint
from dvtcli.operations.results.facts import DvtAnswer


class HasLines(Protocol):
    """An answer with its own lines."""

    @property
    def text(self) -> Sequence[Hint | str]:
        """A line each."""
        ...


def text_lines(result: HasLines, _width: int) -> Iterable[Line]:
    """The lines as they are."""
    return result.text


def answer_lines(result: DvtAnswer, _width: int) -> Iterable[Line]:
    """Show a word's answer alone, as the DVT prints it, in rows if it has several."""
    return result.rows or (result.answer,)
