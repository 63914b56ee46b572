"""The text of `doctor`."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Cell, Line
from dvtcli.domain.text import plural
from dvtcli.operations.results.diagnosis import Diagnosis

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
