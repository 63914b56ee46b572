"""Reading a line at a terminal: with menu, history and toolbar where it can draw them, else plainly.

Knows prompt_toolkit. Does not know what a line does.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from typing import TYPE_CHECKING, Protocol, TextIO, cast

from dvtcli.cli.view.output import Output

if TYPE_CHECKING:
    from prompt_toolkit import PromptSession
    from prompt_toolkit.formatted_text import StyleAndTextTuples
    from prompt_toolkit.output import ColorDepth

    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.prompt.notices import Notices
    from dvtcli.cli.prompt.status import Status

STYLE = {
    "bottom-toolbar": "noreverse bg:#303030 #e0e0e0",
    "bottom-toolbar.text": "",
    "good": "#5fd75f bold",
    "careful": "#ffd75f bold",
    "bad": "#ff5f5f bold",
    "command": "ansicyan bold",
    "unknown": "ansired",
    "option": "ansiyellow",
    "number": "ansigreen",
    "validation-toolbar": "bg:#5f0000 #ffffff",
}

#: What stands before a line that a backslash continues.
CONTINUED = "  ... "
#: Rows that a line and what stands below it need; what a terminal has beyond them is for the menu.
ROWS_OF_TEXT = 4
#: On a screen of so many rows what is wrong stands behind the line, too: its foot may be far below.
_TALL = 30


class Reader(Protocol):
    """Where lines come from."""

    def read(self) -> str:
        """The next line; KeyboardInterrupt where it was thrown away, EOFError where the user wants to leave."""
        ...

    def left_over(self) -> int:
        """Forget what came together with the last line, behind it; how many characters that was."""
        ...


def reader(session: Conversation, status: Status, notices: Notices, show_help: Callable[[str], None]) -> Reader:
    """The best reader for this terminal; *show_help* prints help for the line typed so far."""
    if not sys.stdout.isatty() or os.environ.get("TERM", "").lower() in ("dumb", "unknown"):
        return PlainReader(status, notices, session.output)
    return FullReader(session, status, notices, show_help)


class PlainReader:
    """Lines as the terminal itself edits them: for terminals that cannot draw, and for stdout in a pipe."""

    def __init__(self, status: Status, notices: Notices, output: Output) -> None:
        self._status, self._notices, self._output = status, notices, output

    def read(self) -> str:
        """Ask on stderr, so that stdout holds results only."""
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

    def left_over(self) -> int:
        """Nothing: a terminal that edits its lines itself hands them out one at a time."""
        return 0

    def _asked(self, prompt: str) -> str:
        self._output.stderr.write(prompt)
        self._output.stderr.flush()
        return sys.stdin.readline()


class FullReader:
    """Lines with a menu, history and a toolbar; messages of nodes appear above the prompt."""

    def __init__(
        self, session: Conversation, status: Status, notices: Notices, show_help: Callable[[str], None]
    ) -> None:
        self._session, self._status, self._notices = session, status, notices
        self._prompt = _prompt_session(session, status, show_help)
        self._most_menu = self._prompt.reserve_space_for_menu

    def read(self) -> str:
        """Ask with everything that prompt_toolkit has and the terminal has rows for."""
        from prompt_toolkit.patch_stdout import StdoutProxy

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
                    line = self._typed()
        if held or line is None:
            raise KeyboardInterrupt
        return line

    def left_over(self) -> int:
        """Forget what was read of the terminal together with the last line; not what the terminal says of itself."""
        from prompt_toolkit.input.typeahead import get_typeahead
        from prompt_toolkit.keys import Keys

        keys = get_typeahead(self._prompt.app.input)
        return sum(len(one.data) for one in keys if one.key is not Keys.CPRResponse)

    def _typed(self) -> str | None:
        """What was typed, None where it was thrown away."""
        from dvtcli.cli.prompt.key_bindings import ThrownAway

        try:
            return self._prompt.prompt()
        except ThrownAway:
            return None


@contextmanager
def _held_interrupts() -> Iterator[list[int]]:
    """Keep SIGINT out of prompt_toolkit's starting and ending, where it breaks the event loop; the list has what came.

    While the line is typed, prompt_toolkit hears it itself and throws the line away.
    """
    held: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _frame: held.append(number))
    try:
        yield held
    finally:
        signal.signal(signal.SIGINT, before)


def _prompt_session(session: Conversation, status: Status, show_help: Callable[[str], None]) -> PromptSession[str]:
    from prompt_toolkit import PromptSession
    from prompt_toolkit.application import get_app
    from prompt_toolkit.auto_suggest import AutoSuggestFromHistory
    from prompt_toolkit.layout.processors import AfterInput
    from prompt_toolkit.shortcuts import CompleteStyle
    from prompt_toolkit.styles import Style

    from dvtcli.cli.prompt.checking import LineValidator
    from dvtcli.cli.prompt.colours import LineLexer
    from dvtcli.cli.prompt.completer import LineCompleter
    from dvtcli.cli.prompt.history import open_history
    from dvtcli.cli.prompt.key_bindings import bindings
    from dvtcli.cli.prompt.line import expanded

    def columns() -> int:
        return get_app().output.get_size().columns

    def types_tcl() -> bool:
        return session.tcl is not None and session.tcl.on

    def is_secret(line: str) -> bool:
        return session.is_secret(expanded(line, session.aliases))

    prompt: PromptSession[str] = PromptSession(
        message=status.prompt,
        history=open_history(session.output, is_secret),
        auto_suggest=AutoSuggestFromHistory(),
        completer=LineCompleter(session),
        complete_in_thread=True,
        complete_style=CompleteStyle.COLUMN,
        lexer=LineLexer(session.aliases, types_tcl),
        bottom_toolbar=lambda: _toolbar(status, types_tcl=types_tcl()),
        validator=LineValidator(session, columns),
        validate_while_typing=False,
        input_processors=[AfterInput(_said_at_line)],
        prompt_continuation=lambda _width, _number, wrapped: "" if wrapped else CONTINUED,
        refresh_interval=0.5,
        search_ignore_case=True,
        key_bindings=bindings(show_help),
        style=Style.from_dict(STYLE),
        include_default_pygments_style=False,
        color_depth=_color_depth(session.base.color),
    )
    # a terminal that says late, or never, where its cursor is: the foot waits for that, and a warning helps nobody
    prompt.app.renderer.cpr_not_supported_callback = None
    return prompt


def _toolbar(status: Status, *, types_tcl: bool) -> StyleAndTextTuples:
    """The last line, and above it what is wrong with the line that is typed, where there is room for that."""
    from prompt_toolkit.application import get_app

    buffer, size = get_app().current_buffer, get_app().output.get_size()
    low = size.rows <= ROWS_OF_TEXT + 1
    rest = "" if low else getattr(buffer.validation_error, "rest", "")
    wrong: StyleAndTextTuples = [("class:validation-toolbar", f"{rest}\n")] if rest else []
    return wrong + status.toolbar(size.columns, "" if low or types_tcl else buffer.document.text_before_cursor)


def _said_at_line() -> StyleAndTextTuples:
    """What is wrong with the line, behind it, where the foot of the screen is far away."""
    from prompt_toolkit.application import get_app

    application = get_app()
    wrong = application.current_buffer.validation_error
    if wrong is None or application.output.get_size().rows < _TALL:
        return []
    return [("", "  "), ("class:validation-toolbar", wrong.message.partition("\n")[0])]


def _color_depth(color: str) -> ColorDepth | None:
    from prompt_toolkit.output import ColorDepth

    return ColorDepth.DEPTH_1_BIT if color == "never" else None
