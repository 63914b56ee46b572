"""The text of answers that have their own lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

from dvtcli.cli.view.lines import Cell, Line
from dvtcli.domain.hint import Hint
from dvtcli.domain.text import plural
from dvtcli.operations.results.facts import Diagnosis, DvtAnswer


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


_STYLES = {"ok": "green", "warn": "yellow", "FAIL": "red"}


def diagnosis_lines(result: Diagnosis, _width: int) -> Iterator[Line]:
    """Show a line per check with its next step, and the sum."""
    for check in result.checks:
        yield [Cell(f"{check.verdict:<4}", _STYLES[check.verdict]), Cell(f"  {check.name:<11} {check.text}")]
        if check.hint:
            hint = check.hint
            yield [Cell(" " * 18), Cell(hint, "dim") if isinstance(hint, str) else hint]
    count = {verdict: sum(check.verdict == verdict for check in result.checks) for verdict in _STYLES}
    yield f"{count['ok']} ok, {plural(count['warn'], 'warning')}, {count['FAIL']} failed"
