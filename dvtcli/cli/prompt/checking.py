"""Whether a line can be run at all, said before Enter takes it away: the command is parsed, nothing is run.

Knows shell's grammar. Never touches a bus: only what files say is looked up.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING

import click
from prompt_toolkit.document import Document
from prompt_toolkit.validation import ValidationError, Validator

from dvtcli.cli.boundary import usage_error
from dvtcli.cli.lexer import split
from dvtcli.cli.prompt.line import checked, taken_apart, tcl_line
from dvtcli.cli.run_line import parse
from dvtcli.cli.view.lines import Cell
from dvtcli.cli.view.typed_hints import error_text, typed
from dvtcli.cli.view.wrap import wrapped
from dvtcli.domain.safe_text import safe
from dvtcli.errors import DvtcliError, UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

#: What click puts before the message of a parameter's type, which says it better.
_INVALID = re.compile(r"^Invalid value for [^:]*: ")
#: These print and end while a line is parsed.
_ANSWERED_AT_ONCE = frozenset({"-h", "--help", "--version"})


class Refused(ValidationError):
    """A line that no command takes; *rest* is what the one row that prompt_toolkit has for it cannot hold."""

    def __init__(self, place: int, text: str, columns: int) -> None:
        first, *more = wrapped([Cell(safe(text))], columns)
        super().__init__(place, _text(first).rstrip())
        self.rest = " ".join(_text(line) for line in more)


def _text(cells: list[Cell]) -> str:
    return "".join(cell.text for cell in cells)


class LineValidator(Validator):
    """Refuses a line of *session* that no command takes, with the cursor at the word that is wrong.

    *columns* tells the terminal's width.
    """

    def __init__(self, session: Conversation, columns: Callable[[], int]) -> None:
        self._session = session
        self._columns = columns

    def validate(self, document: Document) -> None:
        """Raise ValidationError for the first of the typed lines that cannot be parsed.

        An unclosed quote, a wrong option, a name that the known EDS lacks are found; what only the device can tell
        is not.
        """
        for line in document.text.replace("\\\n", " ").splitlines():
            wrong = self._wrong(line)
            if wrong is not None:
                raise Refused(_place(document.text, wrong), wrong, self._columns())

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
    """Where the longest word that the message quotes stands in *text*; its end where none does."""
    for word in sorted(re.findall(r"'([^']+)'", wrong), key=len, reverse=True):
        if word in text:
            return text.rindex(word) + len(word)
    return len(text)
