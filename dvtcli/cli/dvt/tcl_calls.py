"""Commands served to Tcl: the DVT's words, `dvtcli …`, and the few of Tcl's own that reach outside."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.cli.catalogue import command_names
from dvtcli.cli.dvt.words import WORDS, DvtWord, answer, decimal, listed
from dvtcli.cli.parse_line import parse
from dvtcli.cli.run_line import run_words
from dvtcli.errors import DvtcliError, UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import DvtAnswer, Result

_NO_FILE = re.compile(r'invalid command name "([\w./-]+\.(?:tcl|dvt))"')
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


def file_as_command(message: str) -> str:
    """Return the script that was given as a command, if *message* is Tcl's for that; else nothing."""
    found = _NO_FILE.fullmatch(message)
    return found[1] if found else ""


#: Tcl commands that reach outside of the interpreter: all are refused with a message.
REFUSED = ("exec", "socket", "load", "unload", "glob", "cd", "pwd", "fconfigure", "encoding", "interp")
#: Maximum length of an unfinished line, which is kept until its end.
_MOST_ON_A_LINE = 1_000_000
_MOST_EXIT_CODE = 125
_PDO = re.compile(r"(?:\w+:)?[rt]x?pdo\d{1,9}", re.IGNORECASE)
#: `dvtcli` commands allowed in a script: work on nodes only, no other files, programs, servers or questions.
ON_NODES = (
    "clear", "disable", "enable", "link", "login", "map", "nmt", "node", "objects", "pdo", "read",
    "require", "restore", "scan", "set", "store", "sync", "undo", "unlink", "verify", "vpdo", "write",
)  # fmt: skip


class Exit(Exception):
    """The script called `exit` with *code*."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class Commands:
    """The commands for a script in *folder*."""

    def __init__(self, session: Conversation, folder: Path) -> None:
        self._session, self._folder = session, folder
        self._unfinished = {"stdout": "", "stderr": ""}
        self._own: dict[str, Callable[..., str]] = {
            "puts": self._puts, "flush": self._flush, "exit": self._exit, "file": self._file,
            "source": self._source_path, "open": self._open_path,
        }  # fmt: skip

    @property
    def names(self) -> list[str]:
        """Return the names of all served commands."""
        return [*self._own, *REFUSED]

    def run(self, name: str, texts: tuple[str, ...]) -> str:
        """Answer a command. Raises UsageError if refused or misused, Exit for `exit`."""
        if name in REFUSED:
            raise _refused(name)
        return self._own[name](*texts)

    def flush(self) -> None:
        """Print the rest of `puts -nonewline`."""
        for stream in ("stdout", "stderr"):
            if self._unfinished[stream]:
                self._print(stream, "", newline=True)

    def _puts(self, *texts: str) -> str:
        words = list(texts)
        newline = words[:1] != ["-nonewline"]
        if not newline:
            words.pop(0)
        stream = words.pop(0) if len(words) == 2 else "stdout"
        if len(words) != 1:
            raise UsageError("puts: it is: puts [-nonewline] [stdout|stderr] TEXT")
        if stream not in self._unfinished:
            raise UsageError(f"puts: {stream} cannot be written to: a Tcl script prints to stdout and stderr only")
        self._print(stream, words[0], newline=newline)
        return ""

    def _print(self, stream: str, text: str, *, newline: bool) -> None:
        if len(self._unfinished[stream]) + len(text) > _MOST_ON_A_LINE and "\n" not in text:
            raise UsageError(f"puts: more than {_MOST_ON_A_LINE} characters on one line")
        *lines, rest = (self._unfinished[stream] + text + ("\n" if newline else "")).split("\n")
        self._unfinished[stream] = rest
        self._session.output.said(lines, error=stream == "stderr")

    def _flush(self, *_channel: str) -> str:
        return ""  # every line is flushed as it is printed

    def _exit(self, *texts: str) -> str:
        code = " ".join(texts or ("0",))
        if not code.isascii() or not code.isdigit() or int(code) > _MOST_EXIT_CODE:
            raise UsageError(f"exit {code}: an exit code is 0…{_MOST_EXIT_CODE}")
        raise Exit(int(code))

    def _file(self, what: str = "", *names: str) -> str:
        """Tell whether a file exists; functions of names only are answered in Tcl's process."""
        if what != "exists" or len(names) != 1:
            raise _refused(f"file {what}".strip())
        return str(int(self._inside(names[0]).exists()))

    def _source_path(self, *texts: str) -> str:
        if not texts or (len(texts) == 3) != (texts[0] == "-encoding") or len(texts) not in (1, 3):
            raise UsageError("source: it is: source FILE")
        path = self._inside(texts[-1])
        if not path.is_file():
            raise UsageError(f"source: no such file: {texts[-1]}")
        return str(path)

    def _open_path(self, *texts: str) -> str:
        if not texts or texts[1:] not in ((), ("r",)):
            raise UsageError("open: a Tcl script may only read files, of its own folder: open FILE r")
        path = self._inside(texts[0])
        if path.exists() and not path.is_file():  # a pipe would be waited for without end
            raise UsageError(f"open: {texts[0]} is not a file")
        return str(path)

    def _inside(self, name: str) -> Path:
        """Return a path in the script's folder or below. Raises UsageError for any other."""
        try:
            path = (self._folder / name).resolve()
        except (OSError, ValueError) as wrong:
            raise UsageError(f"{name}: {wrong}") from wrong
        if not path.is_relative_to(self._folder):
            raise UsageError(f"{name} is outside the script's folder: a Tcl script reads only files of its own folder")
        return path


def refuse_beyond_nodes(words: Sequence[str], session: Conversation) -> None:
    """Raise UsageError if the `dvtcli` line *words* does more than work on nodes, e.g. opens a file."""
    if not words:
        raise UsageError("dvtcli: a command is missing after it, as in: dvtcli read 6041")
    if words[0] not in ON_NODES:
        raise _refused(f"dvtcli {words[0]}")
    if words[0] in _WITH_FILES and any(map(_WITH_FILES[words[0]], _arguments(words, session))):
        raise _refused(f"dvtcli {words[0]} with a file")


def _arguments(line: Sequence[str], session: Conversation) -> list[str]:
    """Return the words of a command's *line* without global options; empty if not parsable, hence not run."""
    try:
        ctx = parse(line, session)
    except (click.ClickException, click.exceptions.Exit, UsageError):
        return []
    own = [ctx.params[param.name] for param in ctx.command.params if param.name and not getattr(param, "hidden", False)]
    texts = [text for value in own for text in (value if type(value) is tuple else (value,))]
    return [text for text in texts if isinstance(text, str)]


def _names_no_pdo(word: str) -> bool:
    return _PDO.fullmatch(word) is None or Path(word).is_file()


#: Commands of `ON_NODES` that take files, and the position of the file.
_WITH_FILES: dict[str, Callable[[str], bool]] = {
    "verify": _names_no_pdo,
    "read": lambda _file: True,  # -o FILE is its only text
    "write": lambda value: value.startswith("@") and not value.startswith("@@"),
}


def _refused(name: str) -> UsageError:
    return UsageError(
        f"{name} is not available: Tcl scripts run in safe mode, without programs, network and other people's files"
    )
