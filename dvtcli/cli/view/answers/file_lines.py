"""The text of plain facts."""

from __future__ import annotations

from collections.abc import Iterable

from dvtcli.cli.view.lines import Line
from dvtcli.operations.results.dvt import DvtAnswer
from dvtcli.operations.results.files import Facts


def fact_lines(result: Facts, _width: int) -> Iterable[Line]:
    """The lines as they are."""
    return result.text


def answer_lines(result: DvtAnswer, _width: int) -> Iterable[Line]:
    """The word's answer alone, as the DVT prints it; rows where it has several."""
    return result.rows or (result.answer,)
