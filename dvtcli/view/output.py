"""Where results, messages and questions go: results to stdout, everything else to stderr.

Owns colour, ASCII and JSON. Does not know what results mean (`view.text`).
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.errors import DvtcliError
    from dvtcli.results import Document, Result
    from dvtcli.view.lines import Line

#: Results that are read at leisure; what a change did is shown as it is.
_LISTS = frozenset({"PdoListing", "ObjectListing", "NodeListing", "Facts", "FileReport"})


class Output:
    """One pair of streams with the options that shape what is written to them."""

    def __init__(self, stdout: TextIO | None = None, stderr: TextIO | None = None) -> None:
        self.stdout = stdout or sys.stdout
        self.stderr = stderr or sys.stderr
        self.format = "text"
        self.color = "auto"
        self.verbose = 0
        self.quiet = False
        self.plain = False
        #: shows a text that is more than a screen, and says whether it did
        self.pager: Callable[[str], bool] | None = None

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
        from dvtcli.view.lines import MAX_WIDTH

        return min(MAX_WIDTH, _columns(self.stdout) or MAX_WIDTH)

    def result(self, result: Result) -> None:
        """Print what a command answered."""
        if self.json:
            self._document(result.document())
            return
        from dvtcli.view.text import remarks, text

        for line in () if self.quiet else remarks(result):
            self._write(self.stderr, line)
        lines = self._painted(self.stdout, text(result, self.width))
        if type(result).__name__ not in _LISTS or not self._page(lines):
            for line in lines:
                print(line, file=self.stdout)
        self.stdout.flush()

    def error(self, error: DvtcliError, at: str | None = None, *, readable: bool = False) -> None:
        """Print a failure: as a document on stdout with --json, else as lines on stderr; *at* is `FILE:LINE`.

        With *readable* it is lines on stderr in any case: for a stdout that takes no documents.
        """
        if self.json and not readable:
            from dvtcli.view.errors import error_document

            self._document(error_document(error, at))
            return
        from dvtcli.view.errors import error_lines

        self.stdout.flush()
        self.lines(error_lines(error, at))

    def lines(self, lines: Iterable[Line]) -> None:
        """Print messages to stderr."""
        for line in lines:
            self._write(self.stderr, line)
        self.stderr.flush()

    def said(self, lines: Iterable[Line], *, error: bool) -> None:
        """Print what a script says itself: to stdout, or to stderr with *error* and where stdout has documents."""
        stream = self.stderr if error or self.json else self.stdout
        for line in lines:
            self._write(stream, line)
        stream.flush()

    def traffic(self, frame: Frame, *, sent: bool, secret: bool = False) -> None:
        """Show a frame as -v and -vv ask, nothing without them; of a *secret* one not what it carries."""
        from dvtcli.view.traffic import traffic_line

        line = traffic_line(frame, self.verbose, sent=sent, secret=secret) if self.verbose else None
        if line is not None:
            self._write(self.stderr, line)

    def note(self, text: str) -> None:
        """Print one message to stderr, unless only errors are wanted."""
        if not self.quiet and not self.json:
            from dvtcli.view.lines import Cell

            self.lines([[Cell("note: ", "cyan"), Cell(text)]])

    def warning(self, text: str) -> None:
        """Print one warning to stderr, also where only errors are wanted."""
        from dvtcli.view.lines import Cell

        self.lines([[Cell("warning: ", "yellow"), Cell(text)]])

    def ask(self, question: str) -> bool:
        """Ask *question* at the terminal; anything but yes is no."""
        from dvtcli.view.paint import painted

        self.stderr.write(painted(f"{question} [y/N]", self.stderr, colored=False, plain=self.plain) + " ")
        self.stderr.flush()
        answer = sys.stdin.readline()
        if not answer.endswith("\n"):
            self.stderr.write("\n")  # Ctrl-D: what comes next begins in a line of its own
        return answer.strip().lower() in ("y", "yes")

    def _document(self, document: Document) -> None:
        import json

        print(json.dumps(document, ensure_ascii=True, separators=(",", ":")), file=self.stdout, flush=True)

    def stream(self, results: Iterable[Result]) -> None:
        """Print many answers of one command as they come: a document or a few lines each."""
        if self.json:
            self.documents(one.document() for one in results)
            return
        from dvtcli.view.text import text

        for one in results:
            for line in text(one, self.width):
                self._write(self.stdout, line)
        self.stdout.flush()

    def documents(self, documents: Iterable[Document]) -> None:
        """Print a stream of documents to stdout, one a line, and hand them over at once."""
        import json

        for one in documents:
            self.stdout.write(json.dumps(one, ensure_ascii=True, separators=(",", ":")) + "\n")
        self.stdout.flush()

    def _page(self, lines: Sequence[str]) -> bool:
        """Show *lines* with the pager where they are more than a screen; whether they were shown."""
        rows = sum(line.count("\n") + 1 for line in lines)
        if self.pager is None or not self.stdout.isatty() or rows < os.get_terminal_size(self.stdout.fileno()).lines:
            return False
        return self.pager("\n".join([*lines, ""]))

    def _write(self, stream: TextIO, line: Line) -> None:
        for text in self._painted(stream, [line]):
            print(text, file=stream)

    def _painted(self, stream: TextIO, lines: Iterable[Line]) -> list[str]:
        from dvtcli.view.paint import painted

        width, colored = _columns(stream), self._colored(stream)
        return [painted(line, stream, colored=colored, plain=self.plain, width=width) for line in lines]

    def _colored(self, stream: TextIO) -> bool:
        if self.color != "auto":
            return self.color == "always"
        if os.environ.get("FORCE_COLOR"):
            return True
        return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def _columns(stream: TextIO) -> int:
    """The width of the terminal that *stream* is, 80 where it does not say; 0 where it is none."""
    if not stream.isatty():
        return 0
    return os.get_terminal_size(stream.fileno()).columns or 80
