"""The line that is typed at a terminal that can draw: what it knows, and what stands around it.

Knows prompt_toolkit. Does not know where a line goes, nor when the next one is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from prompt_toolkit import PromptSession
from prompt_toolkit.application import get_app
from prompt_toolkit.auto_suggest import AutoSuggestFromHistory
from prompt_toolkit.layout.processors import AfterInput
from prompt_toolkit.output import ColorDepth
from prompt_toolkit.shortcuts import CompleteStyle
from prompt_toolkit.styles import Style

from dvtcli.cli.prompt.checking import LineValidator
from dvtcli.cli.prompt.colours import LineLexer
from dvtcli.cli.prompt.completer import LineCompleter
from dvtcli.cli.prompt.history import open_history
from dvtcli.cli.prompt.key_bindings import bindings
from dvtcli.cli.prompt.line import CONTINUED, expanded

if TYPE_CHECKING:
    from prompt_toolkit.formatted_text import StyleAndTextTuples

    from dvtcli.cli.conversation import Conversation
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

#: Rows that a line and what stands below it need; what a terminal has beyond them is for the menu.
ROWS_OF_TEXT = 4
#: On a screen of so many rows what is wrong stands behind the line, too: its foot may be far below.
_TALL = 30


def prompt_session(session: Conversation, status: Status, show_help: Callable[[str], None]) -> PromptSession[str]:
    """A line for *session* with all that it has; *show_help* prints help for the line typed so far."""

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
    buffer, size = get_app().current_buffer, get_app().output.get_size()
    low = size.rows <= ROWS_OF_TEXT + 1
    rest = "" if low else getattr(buffer.validation_error, "rest", "")
    wrong: StyleAndTextTuples = [("class:validation-toolbar", f"{rest}\n")] if rest else []
    return wrong + status.toolbar(size.columns, "" if low or types_tcl else buffer.document.text_before_cursor)


def _said_at_line() -> StyleAndTextTuples:
    """What is wrong with the line, behind it, where the foot of the screen is far away."""
    application = get_app()
    wrong = application.current_buffer.validation_error
    if wrong is None or application.output.get_size().rows < _TALL:
        return []
    return [("", "  "), ("class:validation-toolbar", wrong.message.partition("\n")[0])]


def _color_depth(color: str) -> ColorDepth | None:
    return ColorDepth.DEPTH_1_BIT if color == "never" else None
