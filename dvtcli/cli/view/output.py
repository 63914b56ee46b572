"""Write results to stdout, and messages and questions to stderr.

Handles colour, ASCII and JSON. If a reader leaves, output is dropped and the command continues, because a device may be
in the middle of a change.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TextIO

from dvtcli.operations.user.options import CASE_FORMATS

if TYPE_CHECKING:
    from dvtcli.cli.view.lines import Line
    from dvtcli.cli.view.typed_hints import TypedCall, TypedHints
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.ports import Frame
    from dvtcli.errors import DvtcliError
    from dvtcli.operations.results import Document, Result

#: free columns after a question: a blank, and a letter
_ANSWER = 2
#: exit code of usage errors, which make no report
_USAGE = 2
#: the writers of errors in CI formats
_ERROR_LINES = {"github": "github_error_lines", "junit": "junit_error_lines"}


class Output:
    """A pair of streams with output options."""

    def __init__(self, stdout: TextIO | None = None, stderr: TextIO | None = None) -> None:
        self.stdout = stdout or sys.stdout
        self.stderr = stderr or sys.stderr
        self.format = "text"
        self.color = "auto"
        self.verbose = 0
        self.quiet = False
        self.plain = False
        #: shows a text longer than a screen; returns whether shown
        self.pager: Callable[[str], bool] | None = None
        self.progress_line = ProgressLine(self.stderr)
        #: the last error shown
        self.failed: DvtcliError | None = None
        #: the call before hints, None if none
        self.call: Callable[[], TypedCall] | None = None
        #: the node of the shown error
        self._node: int | None = None
        #: accepts results instead of printing; returns whether accepted
        self._taker: Callable[[Result], bool] = lambda _result: False
        #: keys typed before questions, for the next line; None where no line can begin with them
        self.typed_ahead: list[str] | None = None
        #: messages held until the screen is free, None if free
        self._held: list[Line] | None = None

    def configure(self, format_name: str, color: str, verbose: int, *, quiet: bool, plain: bool) -> None:
        """Set the options from now on."""
        self.format, self.color, self.verbose = format_name, color, verbose
        self.quiet, self.plain = quiet, plain
        self.progress_line.end()

    @property
    def json(self) -> bool:
        """Whether results are JSON documents."""
        return self.format in ("json", "jsonl")

    @property
    def width(self) -> int:
        """Columns of the terminal, at most 100; 100 if stdout is not a terminal."""
        from dvtcli.cli.view.lines import MAX_WIDTH

        return min(MAX_WIDTH, _columns(self.stdout) or MAX_WIDTH)

    @contextmanager
    def offered_to(self, taker: Callable[[Result], bool]) -> Iterator[None]:
        """Offer every result to *taker* during the block; results it accepts (True) are not printed as text."""
        before, self._taker = self._taker, taker
        try:
            yield
        finally:
            self._taker = before

    def result(self, result: Result) -> None:
        """Print a command's answer. Raises OSError if the disk is full."""
        if self.json:
            self._document(result.document())
            self._taker(result)
            return
        if self._taker(result):
            return
        from dvtcli.cli.view.renderers import remarks, text

        if self.format in result.formats:
            self.machine_lines(text(result, 0, self.format))
            return
        if not self.quiet:
            self.lines(remarks(result))
        lines = [*map(self._painter(self.stdout), text(result, self.width))]
        if not result.use_pager or not self._page(lines):
            with self._answering():
                for line in lines:
                    print(line, file=self.stdout)
                self.stdout.flush()

    def machine_lines(self, lines: Iterable[Line]) -> None:
        """Print lines for programs: no colours, no wrapping, no pager."""
        from dvtcli.cli.view.lines import painted, with_hints

        with self._answering():
            for line in lines:
                text = painted(with_hints(line, self.hints), self.stdout, colored=False, plain=self.plain)
                print(text, file=self.stdout)
            self.stdout.flush()

    @contextmanager
    def _answering(self) -> Iterator[None]:
        """Write to stdout in the block, which ends early if the reader is gone."""
        self.progress_line.erase()
        try:
            yield
        except OSError as failed:
            from dvtcli.cli.view.streams import nobody_reads, silence

            gone = nobody_reads(self.stdout, failed)
            silence(self.stdout)
            if not gone:
                raise

    @contextmanager
    def _saying(self) -> Iterator[None]:
        """Write to stderr in the block, which ends early if stderr fails: the exit code tells the outcome."""
        self.progress_line.erase()
        try:
            yield
        except OSError:
            from dvtcli.cli.view.streams import silence

            silence(self.stderr)

    def error(self, error: DvtcliError, at: str | None = None, *, readable: bool = False) -> None:
        """Print an error: as a document on stdout with --json, else as lines on stderr; *at* is `FILE:LINE`.

        *readable*: always lines on stderr, for a stdout without documents. CI formats include the error too.
        """
        self.failed, self._node = error, error.node
        if error.abort is not None:
            from dvtcli.operations.user.usual_cause import add_usual_cause

            add_usual_cause(error)
        if self.json and not readable:
            from dvtcli.cli.view.error_lines import error_document, error_lines
            from dvtcli.cli.view.lines import painted, with_hints

            shown = (with_hints(line, self.hints) for line in error_lines(error, at))
            message = "\n".join(painted(line, self.stdout, colored=False, plain=self.plain) for line in shown)
            self._document({**error_document(error, at), "message": message})
            self._node = None
            return
        from dvtcli.cli.view.error_lines import error_lines

        if self.format in CASE_FORMATS and not readable and error.exit_code != _USAGE:
            from dvtcli.cli.view import reports

            self.machine_lines(getattr(reports, _ERROR_LINES[self.format])(error))
        with self._answering():
            self.stdout.flush()
        self.lines(error_lines(error, at))
        self._node = None

    def lines(self, lines: Iterable[Line]) -> None:
        """Print messages to stderr, or keep them while the screen is not to be written to."""
        if self._held is not None:
            self._held += lines
            return
        with self._saying():
            for line in lines:
                self._write(self.stderr, line)
            self.stderr.flush()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold messages during the block, while the screen is drawn by others; print them afterwards."""
        self._held = []
        try:
            yield
        finally:
            held, self._held = self._held, None
            self.lines(held)

    def said(self, lines: Iterable[Line], *, error: bool) -> None:
        """Print a script's own output: to stdout, or to stderr with *error* or if stdout has documents."""
        if error or self.json:
            self.lines(lines)
            return
        with self._answering():
            for line in lines:
                self._write(self.stdout, line)
            self.stdout.flush()

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None = None) -> None:
        """Show a frame as -v and -vv ask, nothing without them; no byte of *secret*."""
        from dvtcli.cli.view.answers.frame_lines import traffic_line

        line = traffic_line(frame, self.verbose, sent=sent, secret=secret) if self.verbose else None
        if line is not None:
            with self._saying():
                self._write(self.stderr, line)

    def progress(self, text: str, done: int, total: int) -> None:
        """Show progress of long work, unless --quiet, or traffic is shown."""
        if not self.quiet and not self.json and not self.verbose and self._held is None:
            from dvtcli.domain.text import safe

            self.progress_line.show(safe(text), done, total)

    def note(self, text: Hint | str) -> None:
        """Print a message to stderr, unless --quiet."""
        if not self.quiet:
            from dvtcli.cli.view.lines import Cell, part

            self.lines([[Cell("note: ", "cyan"), part(text)]])

    def warning(self, text: Hint | str) -> None:
        """Print a warning to stderr, also with --quiet."""
        from dvtcli.cli.view.lines import Cell, part

        self.lines([[Cell("warning: ", "yellow"), part(text)]])

    def ask(self, question: str, word: str | None = None) -> bool:
        """Ask *question* at the terminal; any answer but yes, or *word*, is no, and earlier input is discarded.

        A request for help is answered, and the question repeated. Raises KeyboardInterrupt after Ctrl-C.
        """
        from dvtcli.cli.view.lines import painted
        from dvtcli.cli.view.streams import thrown_away, typed_ahead

        width = max(_columns(self.stderr) - _ANSWER, 0)
        wanted = "y/N" if word is None else f"type {word}"
        text = painted(f"{question} [{wanted}]", self.stderr, colored=False, plain=self.plain, width=width)
        keys = typed_ahead(sys.stdin)
        if keys and self.typed_ahead is not None:
            self.typed_ahead.append(keys)
            self.warning("input typed before this question does not answer it; it is kept for the next line")
        elif said := thrown_away(keys):
            self.warning(said)
        while (answer := self._answer(text)) in ("help", "?", "h"):
            yes = "y" if word is None else word
            self.lines(
                [
                    f"{yes} and Enter is yes; Enter alone, or any other answer, is no; Ctrl-C is no and cancels the "
                    "command"
                ]
            )
        return answer in (("y", "yes") if word is None else (word.lower(),))

    def _answer(self, text: str) -> str:
        """Return the line typed after *text*, in lower case."""
        with self._saying():
            self.stderr.write(text + " ")
            self.stderr.flush()
        answer = ""
        try:
            answer = sys.stdin.readline()
        finally:
            if not answer.endswith("\n"):  # Ctrl-C, Ctrl-D: what comes next begins in a line of its own
                self.lines([""])
        return answer.strip().lower()

    def _document(self, document: Document) -> None:
        import json

        with self._answering():
            text = json.dumps(document, ensure_ascii=True, separators=(",", ":"), default=self._as_json)
            print(text, file=self.stdout, flush=True)

    def stream(self, results: Iterable[Result]) -> None:
        """Print a command's many answers as they arrive. Raises ReaderLeft as `documents`."""
        if self.json:
            self.documents(result.document() for result in results)
            return
        from dvtcli.cli.view.renderers import renderer_of

        width, paint, write = self.width, self._painter(self.stdout), self.stdout.write
        kind, lines = None, None
        with self._streaming():
            for result in results:
                if type(result) is not kind or lines is None:
                    kind, lines = type(result), renderer_of(result)
                for line in lines(result, width):
                    write(paint(line) + "\n")
            self.stdout.flush()

    def documents(self, documents: Iterable[Document]) -> None:
        """Print documents to stdout, one per line, flushed at once.

        Raises ReaderLeft if the reader is gone: the producer only reads, and may stop.
        """
        self.json_lines(map(self.encoder(), documents))

    def json_lines(self, texts: Iterable[str]) -> None:
        """Print *texts* of `encoder` to stdout as `documents` does."""
        write = self.stdout.write
        with self._streaming():
            for text in texts:
                write(text + "\n")
            self.stdout.flush()

    def encoder(self) -> Callable[[Any], str]:
        """What makes the JSON text of a document or a part of it."""
        return _encoder(self._as_json)

    def told(self, document: Document) -> None:
        """Print a document to stderr on one line, for events beside the answers."""
        import json

        text = json.dumps(document, ensure_ascii=True, separators=(",", ":"), default=self._as_json)
        with self._saying():
            self.stderr.write(text + "\n")
            self.stderr.flush()

    @contextmanager
    def _streaming(self) -> Iterator[None]:
        try:
            yield
        except OSError as failed:
            from dvtcli.cli.view.streams import ReaderLeft, nobody_reads, silence

            if not nobody_reads(self.stdout, failed):
                raise
            silence(self.stdout)
            raise ReaderLeft from failed

    def _page(self, lines: Sequence[str]) -> bool:
        """Show *lines* in the pager if longer than a screen; returns whether shown."""
        rows = sum(line.count("\n") + 1 for line in lines)
        if self.pager is None or not self.stdout.isatty() or rows < os.get_terminal_size(self.stdout.fileno()).lines:
            return False
        return self.pager("\n".join([*lines, ""]))

    def _write(self, stream: TextIO, line: Line) -> None:
        print(self._painter(stream)(line), file=stream)

    def _painter(self, stream: TextIO) -> Callable[[Line], str]:
        """Return the converter from lines to text for the present width and colours of *stream*."""
        from dvtcli.cli.view.lines import painted, with_hints

        width, colored, plain = _columns(stream), self._colored(stream), self.plain
        return lambda line: painted(with_hints(line, self.hints), stream, colored=colored, plain=plain, width=width)

    def hints(self, node: int | None = None) -> TypedHints:
        """Return the writer of hints for this call, and for the failed *node*."""
        from dvtcli.cli.view.typed_hints import TypedCall, TypedHints

        return TypedHints(self.call or TypedCall, node or self._node)

    def _as_json(self, value: Any) -> Any:
        """Convert a hint or a next step for a document."""
        from dvtcli.domain.hint import Hint, NextStep

        if isinstance(value, Hint):
            return self.hints().text(value)
        if isinstance(value, NextStep):
            return self.hints().words(value.hint)
        raise TypeError(f"{type(value).__name__} cannot be part of a document")

    def _colored(self, stream: TextIO) -> bool:
        if self.color != "auto":
            return self.color == "always"
        if os.environ.get("FORCE_COLOR"):
            return True
        return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def _encoder(default: Callable[[Any], Any]) -> Callable[[Any], str]:
    """Return what makes a document's text; of many documents it makes each in half the time of `json.dumps`."""
    import json.encoder

    make = getattr(json.encoder, "c_make_encoder", None)
    if make is None:  # a Python without the parts in C
        return json.JSONEncoder(ensure_ascii=True, separators=(",", ":"), default=default).encode
    parts = make(None, default, json.encoder.encode_basestring_ascii, None, ":", ",", False, False, True)
    return lambda document: "".join(parts(document, 0))


def _columns(stream: TextIO) -> int:
    """Return the terminal's width, 80 if unknown; 0 if *stream* is not a terminal."""
    if not stream.isatty():
        return 0
    return os.get_terminal_size(stream.fileno()).columns or 80


#: Time before progress is shown (s): at a terminal, and elsewhere.
TERMINAL_S, PIPE_S = 0.3, 5.0
_ERASE = "\r\x1b[K"


class ProgressLine:
    """Progress on *stream*, shown once the work took *terminal_s* or, off a terminal, *pipe_s* seconds."""

    def __init__(self, stream: TextIO, *, terminal_s: float = TERMINAL_S, pipe_s: float = PIPE_S) -> None:
        self._stream = stream
        self._terminal_s, self._pipe_s = terminal_s, pipe_s
        self._since_s: float | None = None
        self._is_terminal = False
        self._tenth = 0
        self._said: set[str] = set()
        self._said_s = float("-inf")
        self._is_shown = False

    def show(self, text: str, done: int, total: int) -> None:
        """Show *text*, and *done* of *total* (0: unknown) parts."""
        now_s = time.monotonic()
        if self._since_s is None:
            self._since_s = now_s
            self._is_terminal = self._stream.isatty() and os.environ.get("TERM") != "dumb"
        if now_s - self._since_s < (self._terminal_s if self._is_terminal else self._pipe_s):
            return
        try:
            if self._is_terminal:
                columns = os.get_terminal_size(self._stream.fileno()).columns or 80
                self._stream.write(f"{_ERASE}{text[: columns - 1]}")
                self._is_shown = True
            elif total and 10 * done // total != self._tenth:
                self._tenth = 10 * done // total
                self._say(text, now_s)
            self._stream.flush()
        except OSError:
            self._nobody_reads()

    def _say(self, text: str, now_s: float) -> None:
        """Write a new line."""
        if text not in self._said and now_s - self._said_s >= self._pipe_s:
            self._stream.write(f"{text}\n")
            self._said.add(text)
            self._said_s = now_s

    def erase(self) -> None:
        """Make room for something else; the work goes on."""
        if self._is_shown:
            self._is_shown = False
            try:
                self._stream.write(_ERASE)
                self._stream.flush()
            except OSError:
                self._nobody_reads()

    def _nobody_reads(self) -> None:
        from dvtcli.cli.view.streams import silence

        silence(self._stream)

    def end(self) -> None:
        """The work is done."""
        self.erase()
        self._since_s, self._tenth, self._said_s = None, 0, float("-inf")
        self._said.clear()
