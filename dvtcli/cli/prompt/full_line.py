"""The input line at a capable terminal, by prompt_toolkit: history, completion, validation, toolbar."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Container
from pathlib import Path
from typing import TYPE_CHECKING

import click
from prompt_toolkit import PromptSession
from prompt_toolkit.application import get_app
from prompt_toolkit.auto_suggest import AutoSuggestFromHistory
from prompt_toolkit.document import Document
from prompt_toolkit.formatted_text import StyleAndTextTuples
from prompt_toolkit.history import FileHistory, History, InMemoryHistory
from prompt_toolkit.layout.processors import AfterInput
from prompt_toolkit.lexers import Lexer
from prompt_toolkit.output import ColorDepth
from prompt_toolkit.shortcuts import CompleteStyle
from prompt_toolkit.styles import Style
from prompt_toolkit.validation import ValidationError, Validator

from dvtcli.cli.boundary import usage_error
from dvtcli.cli.catalogue import command_names
from dvtcli.cli.corrected_line import corrected, without_suggestion
from dvtcli.cli.lexer import split
from dvtcli.cli.parse_line import parse
from dvtcli.cli.prompt.completer import LineCompleter
from dvtcli.cli.prompt.key_bindings import bindings
from dvtcli.cli.prompt.line import CONTINUED, checked, cut, expanded, quoted, taken_apart, tcl_line
from dvtcli.cli.view.lines import Cell
from dvtcli.cli.view.output import Output
from dvtcli.cli.view.paint import wrapped
from dvtcli.cli.view.typed_hints import error_text, typed
from dvtcli.device.change.private_file import open_private, private_folder
from dvtcli.domain.text import safe
from dvtcli.errors import DvtcliError, SafetyRefusal, UsageError
from dvtcli.files.user_folders import user_folder

if TYPE_CHECKING:
    from prompt_toolkit.data_structures import Size

    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.prompt.status import Status


#: Click's prefix before the message of a parameter's type.
_INVALID = re.compile(r"^Invalid value for [^:]*: ")
#: Options that print and end during parsing.
_ANSWERED_AT_ONCE = frozenset({"-h", "--help", "--version"})


class Refused(ValidationError):
    """An invalid line: *said* is the whole message, *rest* its part beyond prompt_toolkit's single row.

    *line* is the corrected line, None if none is near. On a terminal with _TALL *rows* the message stands at the line
    alone: the toolbar is far away.
    """

    def __init__(self, place: int, text: str, size: Size, line: str | None = None) -> None:
        said = text if line is None else f"corrected to `{line}`, Enter runs it; before: {without_suggestion(text)}"
        self.said = safe(said)
        first, *more = wrapped([Cell(self.said)], size.columns)
        is_tall = size.rows >= _TALL
        super().__init__(place, "" if is_tall else _text(first).rstrip())
        self.rest = "" if is_tall else " ".join(_text(line) for line in more)
        self.line = line


def _text(cells: list[Cell]) -> str:
    return "".join(cell.text for cell in cells)


class LineValidator(Validator):
    """Refuses an invalid line of *session*, with the cursor at the wrong word; *size* returns the terminal's size."""

    def __init__(self, session: Conversation, size: Callable[[], Size]) -> None:
        self._session = session
        self._size = size

    def validate(self, document: Document) -> None:
        """Raise ValidationError for the first typed line that cannot be parsed.

        Detects an unclosed quote, a wrong option, a name unknown to the EDS; nothing that only the device knows.
        """
        lines = document.text.replace("\\\n", " ").splitlines()
        for line in lines:
            wrong = self._wrong(line)
            if wrong is not None:
                better = self._corrected(line) if len(lines) == 1 else None
                raise Refused(_place(document.text, wrong), wrong, self._size(), better)

    def _corrected(self, line: str) -> str | None:
        """Return *line* as it can be read, with its destination; None if nothing is near, or an alias makes it."""
        command, destination = cut(line)
        try:
            words = split(command)
            if not words or words[0] in self._session.aliases:
                return None
            better = corrected(words, self._session)
        except DvtcliError:
            return None  # an unclosed quote, or a file that cannot be read: the message says which
        if better is None:
            return None
        return " ".join(map(quoted, better)) + (f" {line[len(command) :]}" if destination else "")

    def _wrong(self, line: str) -> str | None:
        tcl = self._session.tcl
        if (tcl is not None and tcl.on) or tcl_line(line, self._session.aliases) is not None:
            return None  # Tcl says itself what is wrong
        try:
            command, destination = taken_apart(line, self._session.aliases)
            if destination is not None:
                checked(destination, programs=not self._session.options.no_shell)
            words = split(command)
            if words and not _ANSWERED_AT_ONCE & set(words):
                parse(words, self._session).close()
        except click.ClickException as wrong:
            return _INVALID.sub("", usage_error(wrong).text)
        except UsageError as wrong:
            return "; ".join(filter(None, (error_text(wrong), typed(wrong.hint))))
        except DvtcliError:
            return None  # a file that cannot be read is no fault of the line: running it says which
        return None


def _place(text: str, wrong: str) -> int:
    """Return the position in *text* of the longest word quoted in the message; the end if none."""
    for word in sorted(re.findall(r"'([^']+)'", wrong), key=len, reverse=True):
        if word in text:
            return text.rindex(word) + len(word)
    return len(text)


class KeptHistory(FileHistory):
    """A history file; if writing fails, the session continues in memory."""

    def __init__(self, filename: str, is_secret: Callable[[str], bool]) -> None:
        super().__init__(filename)
        self._is_secret = is_secret

    def append_string(self, string: str) -> None:
        """Add *string*, unless it may have a passcode."""
        if not self._is_secret(string):
            super().append_string(string)

    def store_string(self, string: str) -> None:
        """Append *string* to the file if possible."""
        try:
            super().store_string(string)
        except OSError:
            return  # a full disk must not take the prompt away


def open_history(output: Output, is_secret: Callable[[str], bool]) -> History:
    """Open the history file, created if absent; in memory only, with a note, on failure.

    Lines for which *is_secret* returns true are not kept.
    """
    path = user_folder("state") / "history"
    try:
        _prepare(path)
    except OSError as failed:
        output.note(f"the lines of this session are not saved: {path}: {failed.strerror or failed}")
        return InMemoryHistory()
    except SafetyRefusal as refused:
        output.warning(f"the lines of this session are not saved: {refused.text}; {typed(refused.hint)}")
        return InMemoryHistory()
    return KeptHistory(str(path), is_secret)


def _prepare(path: Path) -> None:
    """Create file and folder with the user's rights only. Raises SafetyRefusal if others have access."""
    private_folder(path.parent)
    os.close(open_private(path, os.O_RDWR | os.O_CREAT | os.O_APPEND))


_WORDS = re.compile(r"\s+|\S+")
_HEXADECIMAL = re.compile(r"0x[0-9a-f]+(:[0-9a-fx]+)?|[0-9a-f]{4}(:[0-9a-f]{1,2})?", re.IGNORECASE)


class LineLexer(Lexer):
    """Styles the words of a line; *aliases* are known as commands are. While *is_plain*() nothing is styled."""

    def __init__(self, aliases: Container[str], is_plain: Callable[[], bool] = lambda: False) -> None:
        self._is_plain = is_plain
        self._aliases = aliases
        self._commands = frozenset(command_names())

    def lex_document(self, document: Document) -> Callable[[int], StyleAndTextTuples]:
        """Return the styled words of each line of *document*."""
        lines = document.lines

        def styled(number: int) -> StyleAndTextTuples:
            if self._is_plain():
                return [("", lines[number])]
            return self._styled(lines[number], first=not number or not lines[number - 1].endswith("\\"))

        return styled

    def _styled(self, line: str, *, first: bool) -> StyleAndTextTuples:
        styled: StyleAndTextTuples = []
        for word in _WORDS.findall(line):
            styled.append((self._style(word, first=first), word))
            first = first and word.isspace()
        return styled

    def _style(self, word: str, *, first: bool) -> str:
        if word.isspace():
            return ""
        if first:
            return "class:command" if word in self._commands or word in self._aliases else "class:unknown"
        if word.startswith("--") or word in ("|", ">", ">>"):
            return "class:option"
        return "class:number" if _HEXADECIMAL.fullmatch(word) else ""


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

#: Rows for the line and the toolbar; further rows are for the menu.
ROWS_OF_TEXT = 4
#: From this many rows on, the error is repeated after the line: the toolbar may be far below.
_TALL = 30


def prompt_session(session: Conversation, status: Status, show_help: Callable[[str], None]) -> PromptSession[str]:
    """Return the input line for *session*; *show_help* prints help for the line so far."""

    def size() -> Size:
        return get_app().output.get_size()

    def types_tcl() -> bool:
        return session.tcl is not None and session.tcl.on

    def is_secret(line: str) -> bool:
        return session.is_secret(expanded(line, session.aliases))

    history = open_history(session.output, is_secret)
    session.recent_lines = history.get_strings
    prompt: PromptSession[str] = PromptSession(
        message=status.prompt,
        history=history,
        auto_suggest=AutoSuggestFromHistory(),
        completer=LineCompleter(session),
        complete_in_thread=True,
        complete_style=CompleteStyle.COLUMN,
        lexer=LineLexer(session.aliases, types_tcl),
        bottom_toolbar=lambda: _toolbar(status, types_tcl=types_tcl()),
        validator=LineValidator(session, size),
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
    """Return the toolbar, with the line's error above if space permits."""
    buffer, size = get_app().current_buffer, get_app().output.get_size()
    low = size.rows <= ROWS_OF_TEXT + 1
    rest = "" if low else getattr(buffer.validation_error, "rest", "")
    wrong: StyleAndTextTuples = [("class:validation-toolbar", f"{rest}\n")] if rest else []
    return wrong + status.toolbar(size.columns, "" if low or types_tcl else buffer.document.text_before_cursor)


def _said_at_line() -> StyleAndTextTuples:
    """Return the line's error after the line, if it does not stand in the toolbar."""
    wrong = get_app().current_buffer.validation_error
    if not isinstance(wrong, Refused) or wrong.message:
        return []
    return [("", "  "), ("class:validation-toolbar", wrong.said)]


def _color_depth(color: str) -> ColorDepth | None:
    return ColorDepth.DEPTH_1_BIT if color == "never" else None
