"""Tcl commands allowed beside the DVT's words: print, exit, read files of the own folder; all else is refused."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.cli.parse_line import parse
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

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
