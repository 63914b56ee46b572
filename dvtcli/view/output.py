"""Where results, messages and questions go: results to stdout, everything else to stderr.

Owns colour, ASCII and JSON. Does not know what results mean (`view.text`).
"""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TextIO

from dvtcli.view.glyphs import ascii_only
from dvtcli.view.lines import MAX_WIDTH, Cell, Line
from dvtcli.view.safe import safe

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.errors import DvtcliError
    from dvtcli.results import Document, Result


@dataclass(slots=True)
class Output:
    """One pair of streams with the options that shape what is written to them."""

    stdout: TextIO = field(default_factory=lambda: sys.stdout)
    stderr: TextIO = field(default_factory=lambda: sys.stderr)
    format: str = "text"
    color: str = "auto"
    verbose: int = 0
    quiet: bool = False
    plain: bool = False

    def configure(self, format_name: str, color: str, verbose: int, *, quiet: bool, plain: bool) -> None:
        """Take the options that count from now on."""
        self.format, self.color, self.verbose = format_name, color, verbose
        self.quiet, self.plain = quiet, plain

    @property
    def json(self) -> bool:
        """Whether results are JSON documents."""
        return self.format in ("json", "jsonl")

    @property
    def width(self) -> int:
        """Columns of the terminal, at most 100; 100 where stdout is none."""
        if not self.stdout.isatty():
            return MAX_WIDTH
        return min(MAX_WIDTH, shutil.get_terminal_size((80, 24)).columns)

    def result(self, result: Result) -> None:
        """Print what a command answered."""
        if self.json:
            self._document(result.document())
            return
        from dvtcli.view.text import remarks, text

        for line in remarks(result):
            self._write(self.stderr, line)
        for line in text(result, self.width):
            self._write(self.stdout, line)
        self.stdout.flush()

    def error(self, error: DvtcliError) -> None:
        """Print a failure: as a document on stdout with --json, else as lines on stderr."""
        if self.json:
            from dvtcli.view.errors import error_document

            self._document(error_document(error))
            return
        from dvtcli.view.errors import error_lines

        self.stdout.flush()
        self.lines(error_lines(error))

    def lines(self, lines: Iterable[Line]) -> None:
        """Print messages to stderr."""
        for line in lines:
            self._write(self.stderr, line)
        self.stderr.flush()

    def traffic(self, frame: Frame, *, sent: bool) -> None:
        """Show a frame as -v and -vv ask; nothing without them."""
        from dvtcli.view.traffic import traffic_line

        line = traffic_line(frame, self.verbose, sent=sent) if self.verbose else None
        if line is not None:
            self._write(self.stderr, Cell(line, "dim"))

    def note(self, text: str) -> None:
        """Print one message to stderr, unless only errors are wanted."""
        if not self.quiet and not self.json:
            self.lines([[Cell("note: ", "cyan"), Cell(text)]])

    def ask(self, question: str) -> bool:
        """Ask *question* at the terminal; anything but yes is no."""
        self.stderr.write(f"{self._shown(safe(question))} [y/N] ")
        self.stderr.flush()
        return sys.stdin.readline().strip().lower() in ("y", "yes")

    def _document(self, document: Document) -> None:
        print(json.dumps(document, ensure_ascii=True, separators=(",", ":")), file=self.stdout, flush=True)

    def _write(self, stream: TextIO, line: Line) -> None:
        cells: Sequence[Cell] = [Cell(line)] if isinstance(line, str) else [line] if isinstance(line, Cell) else line
        styled = self._colored(stream)
        text = "".join(self._styled(cell) if styled else safe(cell.text) for cell in cells)
        print(self._shown(text.rstrip()), file=stream)

    def _styled(self, cell: Cell) -> str:
        if not cell.style or not cell.text.strip():
            return safe(cell.text)
        import click

        if cell.style in ("bold", "dim"):
            return click.style(safe(cell.text), **{cell.style: True})
        return click.style(safe(cell.text), fg=cell.style)

    def _shown(self, text: str) -> str:
        """*text* in what the stream can carry; an ASCII terminal gets look-alikes instead of an error."""
        if self.plain or not _carries(self.stdout, text):
            return ascii_only(text.replace("\x1b", "\x1b"))
        return text

    def _colored(self, stream: TextIO) -> bool:
        if self.color != "auto":
            return self.color == "always"
        if os.environ.get("FORCE_COLOR"):
            return True
        return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def _carries(stream: TextIO, text: str) -> bool:
    try:
        text.encode(getattr(stream, "encoding", None) or "utf-8")
    except UnicodeEncodeError:
        return False
    return True
