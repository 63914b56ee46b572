"""What a Tcl script may do besides the DVT's words: print, end, and read files of its own folder; all else is refused.

Knows Tcl's own commands. Does not know the DVT's words.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.cli.run_line import parse
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

#: Tcl's commands that reach outside of the interpreter: none of them is there, and each says so.
REFUSED = ("exec", "socket", "load", "unload", "glob", "cd", "pwd", "fconfigure", "encoding", "interp")
#: More than that on one line is no text for people; it would be kept until the line's end comes.
_MOST_ON_A_LINE = 1_000_000
_MOST_EXIT_CODE = 125
_PDO = re.compile(r"(?:\w+:)?[rt]x?pdo\d{1,9}", re.IGNORECASE)
#: What `dvtcli` may do in a script: work on nodes. Not: write other files, run programs, serve, or wait for a person.
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
    """These commands for one script in *folder*."""

    def __init__(self, session: Conversation, folder: Path) -> None:
        self._session, self._folder = session, folder
        self._unfinished = {"stdout": "", "stderr": ""}
        self._own: dict[str, Callable[..., str]] = {
            "puts": self._puts, "flush": self._flush, "exit": self._exit, "file": self._file,
            "source": self._source_path, "open": self._open_path,
        }  # fmt: skip

    @property
    def names(self) -> list[str]:
        """Every command that is ours to answer."""
        return [*self._own, *REFUSED]

    def run(self, name: str, texts: tuple[str, ...]) -> str:
        """Answer one command; UsageError where it is refused or misused, Exit for `exit`."""
        if name in REFUSED:
            raise _refused(name)
        return self._own[name](*texts)

    def flush(self) -> None:
        """Print what `puts -nonewline` left unfinished."""
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
        """Whether a file exists; what only works on names was answered where Tcl runs."""
        if what != "exists" or len(names) != 1:
            raise _refused(f"file {what}".strip())
        return str(int(self._inside(names[0]).exists()))

    def _source_path(self, *texts: str) -> str:
        if not texts or (len(texts) == 3) != (texts[0] == "-encoding") or len(texts) not in (1, 3):
            raise UsageError("source: it is: source FILE")
        path = self._inside(texts[-1])
        if not path.is_file():
            raise UsageError(f"source: there is no file {texts[-1]}")
        return str(path)

    def _open_path(self, *texts: str) -> str:
        if not texts or texts[1:] not in ((), ("r",)):
            raise UsageError("open: a Tcl script may only read files, of its own folder: open FILE r")
        path = self._inside(texts[0])
        if path.exists() and not path.is_file():  # a pipe would be waited for without end
            raise UsageError(f"open: {texts[0]} is no file")
        return str(path)

    def _inside(self, name: str) -> Path:
        """The path of a file in the script's folder or below; UsageError where it is anywhere else."""
        try:
            path = (self._folder / name).resolve()
        except (OSError, ValueError) as wrong:
            raise UsageError(f"{name}: {wrong}") from wrong
        if not path.is_relative_to(self._folder):
            raise UsageError(f"{name} is outside of the script's folder: a Tcl script reads no file elsewhere")
        return path


def refuse_beyond_nodes(words: Sequence[str], session: Conversation) -> None:
    """Raise UsageError where the line *words* of `dvtcli` would do more than work on nodes, such as open a file."""
    if not words:
        raise UsageError("dvtcli: a command is missing behind it, as in: dvtcli read 6041")
    if words[0] not in ON_NODES:
        raise _refused(f"dvtcli {words[0]}")
    if words[0] in _WITH_FILES and any(map(_WITH_FILES[words[0]], _arguments(words, session))):
        raise _refused(f"dvtcli {words[0]} with a file")


def _arguments(line: Sequence[str], session: Conversation) -> list[str]:
    """The texts on a command's *line* that are no global options; none where it cannot be parsed, and so not run."""
    try:
        ctx = parse(line, session)
    except (click.ClickException, click.exceptions.Exit, UsageError):
        return []
    own = [ctx.params[param.name] for param in ctx.command.params if param.name and not getattr(param, "hidden", False)]
    texts = [text for value in own for text in (value if isinstance(value, tuple) else (value,))]
    return [text for text in texts if isinstance(text, str)]


def _names_no_pdo(word: str) -> bool:
    return _PDO.fullmatch(word) is None or Path(word).is_file()


#: Commands of `ON_NODES` that take files, and which text of theirs is one.
_WITH_FILES: dict[str, Callable[[str], bool]] = {
    "verify": _names_no_pdo,
    "read": lambda _file: True,  # -o FILE is its only text
    "write": lambda value: value.startswith("@") and not value.startswith("@@"),
}


def _refused(name: str) -> UsageError:
    return UsageError(
        f"{name} is not available: Tcl scripts run in safe mode, without programs, network and other people's files"
    )
