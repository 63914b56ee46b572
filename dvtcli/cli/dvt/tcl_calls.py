"""Commands served to Tcl: the DVT's words, `dvtcli …`, and the few Tcl commands that reach outside."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.cli.catalogue import command_names
from dvtcli.cli.dvt.notation import decimal, listed
from dvtcli.cli.dvt.tcl_safe import Commands, refuse_beyond_nodes
from dvtcli.cli.dvt.word import DvtWord
from dvtcli.cli.dvt.words import WORDS, answer
from dvtcli.cli.run_line import run_words
from dvtcli.errors import DvtcliError, UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import DvtAnswer, Result

_NO_COMMAND = re.compile(r'invalid command name "(\w+)"')


class Ended(Exception):
    """A command of dvtcli failed and was shown; *code* is its exit code."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class TclCalls:
    """The calls of *source*, a script or a line in *folder*; *failures* are refused words with places."""

    def __init__(self, session: Conversation, source: str, folder: Path) -> None:
        self._session, self._source = session, source
        self._commands = Commands(session, folder)
        self.failures: list[tuple[str, DvtAnswer]] = []

    @property
    def served(self) -> tuple[str, ...]:
        """The names of all served commands."""
        words = (name for name, word in WORDS.items() if word.run is not None)
        return tuple(sorted({*words, "dvtcli", *self._commands.names}))

    def run(self, name: str, texts: tuple[str, ...], place: str) -> str:
        """Return the result of calling *name* at *place*.

        Raises UsageError if misused, Ended and Exit if the script ends, and the errors of a word.
        """
        if name == "dvtcli":
            return self._command(texts)
        if name in self._commands.names:
            return self._commands.run(name, texts)
        if name not in self.served:
            raise DvtcliError(f"{self._source}: Tcl's process asked for {name[:40]!r}, which is not served")
        return self._word(WORDS[name], texts, place)

    def flush(self) -> None:
        """Print an unfinished line."""
        self._commands.flush()

    def _command(self, texts: tuple[str, ...]) -> str:
        """Run a line of dvtcli; returns the value read, a list of several, else `OK`."""
        from dvtcli.operations.results import ValuesRead

        refuse_beyond_nodes(texts, self._session)
        values: list[str] = []

        def take(result: Result) -> bool:
            if hasattr(result, "value"):
                values.append(decimal(result.value))
            elif isinstance(result, ValuesRead):
                values.append(listed(value.value for value in result.values))
            else:
                return False
            return True

        with self._session.output.offered_to(take):
            code = run_words(texts, self._session)
        if code:
            raise Ended(code)
        return values[0] if values else "OK"

    def _word(self, word: DvtWord, texts: tuple[str, ...], place: str) -> str:
        try:
            values = word.bind(texts)
        except ValueError as wrong:
            raise UsageError(f"{word.name}: {wrong}") from wrong
        said, output = answer(word, self._session, values), self._session.output
        if output.json:
            output.result(said)
        for finding in said.findings:
            output.note(f"{place}: {finding.text}")
        if said.exit_code:
            self.failures.append((place, said))
            output.note(f"{place}: {word.name} answered {said.answer}: {said.reasons[0]}")
        return said.answer


def modern(message: str) -> str:
    """Return how to call a dvtcli command in Tcl, if *message* is Tcl's for an unknown command."""
    found = _NO_COMMAND.fullmatch(message)
    return f"in Tcl it is `dvtcli {found[1]} …`" if found and found[1] in command_names() else ""
