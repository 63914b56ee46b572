"""The completion menu of the prompt: click's completion of the typed command, with descriptions; uses no bus."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem, ShellComplete
from prompt_toolkit.completion import CompleteEvent, Completer, Completion, PathCompleter
from prompt_toolkit.document import Document

from dvtcli.cli.catalogue import command_names, summary, with_a_swap
from dvtcli.cli.dvt.words import WORDS
from dvtcli.cli.global_options import PREFIX, global_options
from dvtcli.cli.lexer import SHELL_WORDS
from dvtcli.cli.name_completion import safe_items
from dvtcli.cli.prompt.line import TypedLine, cut, last_line, quoted, typed
from dvtcli.cli.registry import REGISTRY
from dvtcli.errors import DvtcliError
from dvtcli.operations.user.options import START_ONLY

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


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
        for item, meta in zip(items, _aligned([item.help or "" for item in items]), strict=True):
            yield Completion(quoted(item.value), start, display=item.value, display_meta=meta)

    def _taken_apart(self, before: str) -> tuple[TypedLine | None, str | None]:
        """Return the line's words with an alias expanded, or the file after `>` with its sign."""
        command, destination = cut(before)
        if destination is not None:
            line = typed(before[len(command) + len(destination.sign) :])
            moved = len(command) + len(destination.sign)
            return line and TypedLine([], line.incomplete, line.start + moved), destination.sign
        line = typed(before)
        while line is not None and line.words and line.words[0] in SHELL_WORDS:
            line = TypedLine(line.words[1:], line.incomplete, line.start)
        if line is not None and line.words and line.words[0] in self._session.aliases:
            words = typed(self._session.aliases[line.words[0]] + " ")
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


#: Columns of a description: names get no more, so that type and access are seen on a narrow terminal too.
WIDEST = 40


def _aligned(texts: list[str]) -> list[str]:
    """Align parts of descriptions, separated by two blanks, in columns."""
    rows = [[_shortened(part) for part in text.split("  ")] for text in texts]
    columns = max((len(row) for row in rows), default=0)
    widths = [max(len(row[i]) for row in rows if i < len(row)) for i in range(columns)]
    return ["  ".join(part.ljust(width) for part, width in zip(row, widths, strict=False)).rstrip() for row in rows]


def _shortened(text: str) -> str:
    return text if len(text) <= WIDEST else text[: WIDEST - 1] + "…"
