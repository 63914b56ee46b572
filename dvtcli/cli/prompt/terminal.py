"""Read lines at a terminal: with menu, history and toolbar by prompt_toolkit if capable, else plainly."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from typing import TYPE_CHECKING, Protocol, TextIO, cast

from dvtcli.cli.prompt.line import CONTINUED
from dvtcli.cli.view.output import Output

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.prompt.notices import Notices
    from dvtcli.cli.prompt.status import Status


class Reader(Protocol):
    """A source of lines."""

    #: whether a line can begin with text that was typed before
    edits: bool

    def read(self, begun: str = "") -> str:
        """Return the next line, which begins with *begun*.

        Raises KeyboardInterrupt if it was discarded, EOFError if the user leaves.
        """
        ...

    def left_over(self) -> str:
        """Take the keys received after the last line."""
        ...


def reader(session: Conversation, status: Status, notices: Notices, show_help: Callable[[str], None]) -> Reader:
    """The best reader for this terminal; *show_help* prints help for the line typed so far."""
    if not sys.stdout.isatty() or os.environ.get("TERM", "").lower() in ("dumb", "unknown"):
        return PlainReader(status, notices, session.output)
    return FullReader(session, status, notices, show_help)


class PlainReader:
    """Lines as the terminal itself edits them: for terminals that cannot draw, and for stdout in a pipe."""

    edits = False

    def __init__(self, status: Status, notices: Notices, output: Output) -> None:
        self._status, self._notices, self._output = status, notices, output

    def read(self, begun: str = "") -> str:
        """Prompt on stderr, so that stdout has results only; *begun* is empty."""
        del begun
        with self._notices.shown_by(lambda text: self._output.lines([text])):
            try:
                self._notices.pump()
                line = self._asked(self._status.prompt())
                while line.endswith("\\\n"):
                    line += self._asked(CONTINUED)
            except KeyboardInterrupt:
                self._output.lines([""])
                raise
        if not line:
            self._output.lines([""])
            raise EOFError
        return line

    def left_over(self) -> str:
        """Return nothing: a line-buffered terminal delivers single lines."""
        return ""

    def _asked(self, prompt: str) -> str:
        self._output.stderr.write(prompt)
        self._output.stderr.flush()
        return sys.stdin.readline()


class FullReader:
    """Lines with a menu, history and a toolbar; messages of nodes appear above the prompt."""

    edits = True

    def __init__(
        self, session: Conversation, status: Status, notices: Notices, show_help: Callable[[str], None]
    ) -> None:
        from dvtcli.cli.prompt.full_line import prompt_session

        self._session, self._status, self._notices = session, status, notices
        self._prompt = prompt_session(session, status, show_help)
        self._most_menu = self._prompt.reserve_space_for_menu

    def read(self, begun: str = "") -> str:
        """Ask with everything that prompt_toolkit has and the terminal has rows for; the line begins with *begun*."""
        from prompt_toolkit.patch_stdout import StdoutProxy

        from dvtcli.cli.prompt.full_line import ROWS_OF_TEXT

        # The proxy that patch_stdout(raw=True) makes; a shorter pause, since a command waits for it to close.
        with StdoutProxy(raw=True, sleep_between_writes=0.02) as proxy:
            above = cast(TextIO, proxy)
            output = Output(above, above)
            output.configure("text", self._session.base.color, 0, quiet=False, plain=self._session.base.ascii)
            with (
                redirect_stdout(above),
                redirect_stderr(above),
                self._notices.shown_by(lambda text: output.lines([text])),
            ):
                self._notices.pump()
                rows = self._prompt.output.get_size().rows
                self._prompt.reserve_space_for_menu = max(0, min(self._most_menu, rows - ROWS_OF_TEXT))
                with _held_interrupts() as held:
                    line = self._typed(begun)
        if held or line is None:
            raise KeyboardInterrupt
        return line

    def left_over(self) -> str:
        """Take input read together with the last line, except the terminal's own replies."""
        from prompt_toolkit.input.typeahead import get_typeahead
        from prompt_toolkit.keys import Keys

        keys = get_typeahead(self._prompt.app.input)
        return "".join(key.data for key in keys if key.key is not Keys.CPRResponse)

    def _typed(self, begun: str) -> str | None:
        """Return the typed line, which began with *begun*; None if discarded."""
        from dvtcli.cli.prompt.key_bindings import ThrownAway

        try:
            return self._prompt.prompt(default=begun)
        except ThrownAway:
            return None


@contextmanager
def _held_interrupts() -> Iterator[list[int]]:
    """Collect SIGINT in the list while prompt_toolkit starts and ends, because it would break the event loop.

    While a line is typed, prompt_toolkit handles Ctrl-C itself and discards the line.
    """
    held: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _frame: held.append(number))
    try:
        yield held
    finally:
        signal.signal(signal.SIGINT, before)
