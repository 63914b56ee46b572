"""The input line at a capable terminal, by prompt_toolkit: history, completion menu, validation, toolbar.

Completion is click's completion of the typed command, with descriptions; it uses no bus.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Container, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem, ShellComplete
from prompt_toolkit import PromptSession
from prompt_toolkit.application import get_app, run_in_terminal
from prompt_toolkit.auto_suggest import AutoSuggestFromHistory
from prompt_toolkit.completion import CompleteEvent, Completer, Completion, PathCompleter
from prompt_toolkit.document import Document
from prompt_toolkit.enums import DEFAULT_BUFFER
from prompt_toolkit.filters import Condition, completion_is_selected, has_completions, has_focus
from prompt_toolkit.formatted_text import StyleAndTextTuples
from prompt_toolkit.history import FileHistory, History, InMemoryHistory
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.layout.processors import AfterInput
from prompt_toolkit.lexers import Lexer
from prompt_toolkit.output import ColorDepth
from prompt_toolkit.shortcuts import CompleteStyle
from prompt_toolkit.styles import Style
from prompt_toolkit.validation import ValidationError, Validator

from dvtcli.cli.catalogue import command_names, summary, with_a_swap
from dvtcli.cli.corrected_line import corrected, without_suggestion
from dvtcli.cli.dvt.words import WORDS
from dvtcli.cli.global_options import PREFIX, global_options
from dvtcli.cli.lexer import split
from dvtcli.cli.name_completion import safe_items
from dvtcli.cli.parse_line import SHELL_WORDS, parse
from dvtcli.cli.prompt.line import (
    CONTINUED,
    TypedLine,
    checked,
    cut,
    expanded,
    last_line,
    quoted,
    taken_apart,
    tcl_line,
    typed_line,
)
from dvtcli.cli.registry import REGISTRY
from dvtcli.cli.usage_errors import usage_error
from dvtcli.cli.view.lines import Cell, columns, wrapped
from dvtcli.cli.view.output import Output
from dvtcli.cli.view.typed_hints import error_text, typed
from dvtcli.device.change.private_file import open_private, private_folder
from dvtcli.domain.text import safe
from dvtcli.errors import DvtcliError, SafetyRefusal, UsageError
from dvtcli.files.user_folders import user_folder
from dvtcli.operations.user.options import START_ONLY

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
        said = text if line is None else f"{without_suggestion(text)}: corrected, Enter runs the line"
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
        for number, line in enumerate(lines, 1):
            wrong = self._wrong(line)
            if wrong is not None:
                better = self._corrected(line) if len(lines) == 1 else None
                text = f"line {number}: {wrong}" if len(lines) > 1 else wrong
                raise Refused(_place(document.text, wrong), text, self._size(), better)

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

    def remember(self, string: str) -> None:
        """Add *string* for this session only: a line that cannot be read may have a passcode in any place."""
        if not self._is_secret(string):
            self._loaded_strings.insert(0, string)

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
        input_processors=[AfterInput(lambda: _said_at_line(status.prompt()))],
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


def _said_at_line(prompt: str) -> StyleAndTextTuples:
    """Return the line's error after the line, behind *prompt*, if it does not stand in the toolbar."""
    buffer = get_app().current_buffer
    wrong = buffer.validation_error
    if not isinstance(wrong, Refused) or wrong.message:
        return []
    before = buffer.text.rpartition("\n")
    width = get_app().output.get_size().columns
    used = (columns(CONTINUED if before[1] else prompt) + columns(before[2]) + 2) % width
    return [("", "  "), ("class:validation-toolbar", broken_by_blanks(wrong.said, used, width))]


def broken_by_blanks(text: str, used: int, width: int) -> str:
    """Return *text* for a line of *width* columns, *used* of them, that a terminal breaks: blanks keep words whole."""
    out: list[str] = []
    for word in text.split(" "):
        size = columns(word)
        if out and used < width:
            out.append(" ")
            used += 1
        if used + size > width and size <= width:
            out.append(" " * (width - used))
            used = 0
        out.append(word)
        used = (used + size) if used + size <= width else (used + size) % width
    return "".join(out)


def _color_depth(color: str) -> ColorDepth | None:
    return ColorDepth.DEPTH_1_BIT if color == "never" else None


class LineCompleter(Completer):
    """Completes a line of the prompt for *session*."""

    def __init__(self, session: Conversation) -> None:
        self._session = session
        self._paths = PathCompleter(expanduser=True)
        # Summaries are read from the commands' files once: a menu is drawn with every key.
        self._own = {name: summary(name) for name in command_names()}
        self._words = {name: f"{word.summary}: {word.grammar}" for name, word in WORDS.items()}
        self._global = list(_global_items())

    @property
    def _commands(self) -> dict[str, str]:
        """Return the first words of lines, with their descriptions; `alias` adds some."""
        return self._own | {word: f"alias of: {text}" for word, text in self._session.aliases.items()}

    def get_completions(self, document: Document, complete_event: CompleteEvent) -> Iterable[Completion]:
        """Return completions of the word before the cursor."""
        if (tcl := self._session.tcl) is not None and tcl.on:
            return
        before = last_line(document.text_before_cursor)
        line, destination = self._taken_apart(before)
        if line is None or destination == "|":
            return
        items = safe_items(self._items(line)) if destination is None else [CompletionItem(line.incomplete, type="file")]
        if any(item.type in ("file", "dir") for item in items):
            yield from self._paths.get_completions(Document(line.incomplete), complete_event)
            return
        start = line.start - len(before)
        room = get_app().output.get_size().columns - _BORDERS - max((len(item.value) for item in items), default=0)
        for item, meta in zip(items, _aligned([item.help or "" for item in items], room), strict=True):
            yield Completion(quoted(item.value), start, display=item.value, display_meta=meta)

    def _taken_apart(self, before: str) -> tuple[TypedLine | None, str | None]:
        """Return the line's words with an alias expanded, or the file after `>` with its sign."""
        command, destination = cut(before)
        if destination is not None:
            line = typed_line(before[len(command) + len(destination.sign) :])
            moved = len(command) + len(destination.sign)
            return line and TypedLine([], line.incomplete, line.start + moved), destination.sign
        line = typed_line(before)
        while line is not None and line.words and line.words[0] in SHELL_WORDS:
            line = TypedLine(line.words[1:], line.incomplete, line.start)
        if line is not None and line.words and line.words[0] in self._session.aliases:
            words = typed_line(self._session.aliases[line.words[0]] + " ")
            line = TypedLine([*(words.words if words else []), *line.words[1:]], line.incomplete, line.start)
        return line, None

    def _items(self, line: TypedLine) -> list[CompletionItem]:
        if not line.words:
            return [CompletionItem(name, help=text) for name, text in self._matching(line.incomplete)]
        command = REGISTRY.get_command(click.Context(REGISTRY), line.words[0].lower())
        if command is None:
            return []
        try:
            return list(self._command_items(command, line))
        except (DvtcliError, click.ClickException):
            return []  # nothing to offer; the error is said once the line is run

    def _matching(self, incomplete: str) -> Iterator[tuple[str, str]]:
        wanted = incomplete.lower()
        yield from ((name, text) for name, text in self._commands.items() if name.startswith(wanted))
        if wanted:  # the DVT's words, and parts of names, only for who begins to type one
            if not any(name.startswith(wanted) for name in self._commands):
                swapped = tuple(with_a_swap(wanted))
                yield from ((name, text) for name, text in self._commands.items() if name.startswith(swapped))
            others = {name: text for name, text in self._words.items() if name not in self._commands}
            yield from ((name, text) for name, text in others.items() if name.startswith(wanted))
            for name, text in self._commands.items():
                if wanted in name and not name.startswith(wanted):
                    yield name, text

    def _command_items(self, command: click.Command, line: TypedLine) -> Iterator[CompletionItem]:
        name, *words = line.words
        root = click.Context(REGISTRY, info_name="", obj=self._session)
        bridge = ShellComplete(command, {"parent": root}, name, "")
        items = bridge.get_completions(words, line.incomplete)
        yield from items
        if not items and not line.incomplete:
            yield from bridge.get_completions(words, "-")
        if line.incomplete.startswith("-"):
            own = {item.value for item in items}
            for item in self._global:
                if item.value.startswith(line.incomplete) and item.value not in own and item.value not in words:
                    yield item


def _global_items() -> Iterator[CompletionItem]:
    """Return the global options allowed on a single line."""
    for option in global_options(hidden=False):
        if option.name is None or option.hidden or option.name.removeprefix(PREFIX) in START_ONLY:
            continue
        yield CompletionItem(max(option.opts, key=len), help=option.help)


#: columns of a menu beside its words and their descriptions
_BORDERS = 6
#: least and most columns of an object's name: with most, all else is seen at 80 columns, even after a resize
_LEAST, _MOST = 8, 40


def _aligned(texts: list[str], room: int) -> list[str]:
    """Align parts of descriptions, separated by two blanks, in *room* columns: names give way, all else is seen."""
    rows = [text.split("  ") for text in texts]
    columns = max((len(row) for row in rows), default=0)
    others = [max(len(row[i]) for row in rows if i < len(row)) for i in range(1, columns)]
    most = max(_LEAST, min(_MOST, room - sum(width + 2 for width in others)) if others else room)
    rows = [[_shortened(name, most, of_object=bool(rest)), *rest] for name, *rest in rows]
    widths = [max((len(row[0]) for row in rows), default=0), *others]
    return ["  ".join(part.ljust(width) for part, width in zip(row, widths, strict=False)).rstrip() for row in rows]


def _shortened(text: str, most: int, *, of_object: bool) -> str:
    """Return *text* in at most *most* columns; the name *of_object* loses that of its record first."""
    _, _, last = text.partition(".")
    if of_object and last and len(text) > most:
        text = f"…{last}"
    return text if len(text) <= most else text[: most - 1] + "…"


#: how long a corrected line is shown before Enter runs it (s): who presses Enter twice by habit has not seen it
_SEEN_S = 0.5


class ThrownAway(Exception):
    """The user discarded the line; a KeyboardInterrupt would break out of prompt_toolkit's event loop."""


@Condition
def _no_text() -> bool:
    """A question mark in quotes or in a comment is one; elsewhere no word has any."""
    text = last_line(get_app().current_buffer.document.text_before_cursor)
    line = typed_line(text)
    return line is not None and not any(quote in text[line.start :] for quote in "\"'")


@Condition
def _continued() -> bool:
    """Whether the line ends with a backslash."""
    document = get_app().current_buffer.document
    return document.is_cursor_at_the_end and document.text.endswith("\\")


@dataclass(slots=True)
class _Correction:
    """The last corrected *line*, and when it was shown (s, monotonic)."""

    line: str = ""
    shown_s: float = 0.0


def _end_unread(event: KeyPressEvent) -> None:
    """End the input with a line that cannot be read: its error is printed when it runs, and ↑ brings it back."""
    buffer = event.current_buffer
    buffer.validation_error = None
    if isinstance(buffer.history, KeptHistory):
        buffer.history.remember(buffer.text)
    else:
        buffer.append_to_history()
    event.app.exit(result=buffer.text)


def bindings(show_help: Callable[[str], None]) -> KeyBindings:
    """Return the additional keys; *show_help* prints help for the line so far."""
    keys, correction = KeyBindings(), _Correction()

    @keys.add("enter", filter=has_focus(DEFAULT_BUFFER))
    def _run(event: KeyPressEvent) -> None:
        """Run the line; one that cannot be read is replaced by the corrected line, which the next Enter runs.

        Not if more was typed already, and not within `_SEEN_S`: a second Enter would run a line that nobody saw.
        Without a correction a single line ends with its error, as in a shell; several pasted lines stay for editing.
        """
        buffer = event.current_buffer
        if buffer.text == correction.line and monotonic() - correction.shown_s < _SEEN_S:
            return
        buffer.validate_and_handle()
        refused = buffer.validation_error
        corrected: str | None = getattr(refused, "line", None)
        if corrected is not None and not event.key_processor.input_queue:
            buffer.save_to_undo_stack()
            buffer.document = Document(corrected)
            buffer.validation_error = refused
            correction.line, correction.shown_s = corrected, monotonic()
        elif refused is not None and corrected is None and len(buffer.text.splitlines()) == 1:
            _end_unread(event)

    @keys.add("enter", filter=has_completions & completion_is_selected)
    def _accept(event: KeyPressEvent) -> None:
        """Take the chosen word; the line is run by the next Enter."""
        event.current_buffer.complete_state = None

    @keys.add("enter", filter=_continued & has_focus(DEFAULT_BUFFER))
    def _continue(event: KeyPressEvent) -> None:
        """A backslash at the end: the command goes on in the next line."""
        event.current_buffer.newline(copy_margin=False)

    @keys.add("f1")
    @keys.add("?", filter=_no_text)
    def _help(event: KeyPressEvent) -> None:
        """Print help for the line so far, and keep the line."""
        line = event.current_buffer.text
        run_in_terminal(lambda: show_help(line))

    @keys.add("c-c", filter=has_focus(DEFAULT_BUFFER))
    @keys.add("<sigint>")
    def _throw_away(event: KeyPressEvent) -> None:
        """Discard the line; a second Ctrl-C in the meantime has no effect."""
        if event.app.is_running and not event.app.is_done:
            event.app.exit(exception=ThrownAway, style="class:aborting")

    return keys
