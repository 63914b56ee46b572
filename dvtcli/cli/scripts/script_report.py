"""The outcome of each script line, collected for a report."""

from __future__ import annotations

import io
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.cli.view.reports import LineRan

if TYPE_CHECKING:
    from dvtcli.cli.view.output import Output
    from dvtcli.errors import DvtcliError


@dataclass(slots=True)
class ScriptReport:
    """The lines of a script and its nested scripts, which write to *output*.

    Collects their output, because stdout is for the report.
    """

    output: Output
    lines: list[LineRan] = field(default_factory=list)
    kept: io.StringIO = field(default_factory=io.StringIO)

    def begin(self, file: str, number: int, words: str) -> LineRan:
        """A line begins."""
        line = LineRan(file, number, words, seconds=time.monotonic())
        self.lines.append(line)
        self.output.failed = None
        self.kept.seek(0)
        self.kept.truncate()
        return line

    def end(self, line: LineRan, code: int) -> None:
        """Record that *line* ended with *code*."""
        line.code, line.error, line.said = code, self.output.failed, self.kept.getvalue()
        line.seconds = time.monotonic() - line.seconds

    def left_out(self, file: str, number: int, words: str, error: DvtcliError | None = None) -> None:
        """Add a line that did not run: it cannot be read because of *error*, or was not reached."""
        self.lines.append(LineRan(file, number, words, None if error is None else error.exit_code, error=error))
