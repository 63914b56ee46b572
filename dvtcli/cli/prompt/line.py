"""Preprocess a typed line: expand aliases, and find the destination of results.

Quotes are as in `lexer.split`; after the word `tcl` they are Tcl's. Opens nothing.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, TextIO, cast

from dvtcli.cli.catalogue import command_names
from dvtcli.cli.lexer import split
from dvtcli.cli.view.output import Output
from dvtcli.errors import UsageError
from dvtcli.interpreter import changed_variables

if TYPE_CHECKING:
    from dvtcli.domain.hint import Hint
    from dvtcli.operations.user.settings import Settings


@dataclass(frozen=True, slots=True)
class TypedLine:
    """The finished *words* before the cursor, and the current word: text and start in the line."""

    words: list[str]
    incomplete: str
    start: int


def typed_line(text: str) -> TypedLine | None:
    """Take apart the text before the cursor; None inside a comment."""
    words: list[str] = []
    word: list[str] = []
    start, quote, inside = 0, "", False
    for position, char in enumerate(text):
        if quote:
            if char == quote:
                quote = ""
            else:
                word.append(char)
        elif char.isspace():
            if inside:
                words.append("".join(word))
            word, inside = [], False
        elif char == "#" and not inside:
            return None
        else:
            if not inside:
                start, inside = position, True
            if char == '"' or (char == "'" and start == position):
                quote = char
            else:
                word.append(char)
    return TypedLine(words, "".join(word), start if inside else len(text))


def last_line(text: str) -> str:
    """Return the cursor's line: the last of pasted lines, joined with lines continued by backslashes.

    The result is as long as the corresponding end of *text*, so that positions from the end stay valid.
    """
    return text.replace("\\\n", "  ").rpartition("\n")[2]


def quoted(word: str) -> str:
    """Quote *word* so that it stays one word."""
    if word and not any(char.isspace() or char in "\"'#" for char in word):
        return word
    return f'"{word}"' if '"' not in word else f"'{word}'"


#: The prompt of a line continued by a backslash.
CONTINUED = "  ... "
#: Signs for the destination of results, at the start of a word.
_SIGNS = (">>", ">", "|")


@dataclass(frozen=True, slots=True)
class Destination:
    """The destination of results: *sign* is `|` (a program), `>` (a file) or `>>` (append to a file)."""

    sign: str
    target: str


def taken_apart(line: str, aliases: Mapping[str, str]) -> tuple[str, Destination | None]:
    """Split *line* into command and destination, as `cut`, then expand an alias at its start.

    Cutting first keeps an alias from changing the meaning of typed signs and quotes: if the alias has a sign, all typed
    text belongs to its destination.
    """
    command, destination = cut(line)
    name = _first_word(command)
    if name not in aliases:
        return command, destination
    meant, its_destination = cut(aliases[name])
    if its_destination is None:
        return meant + command.lstrip()[len(name) :], destination
    return meant, Destination(its_destination.sign, its_destination.target + line.lstrip()[len(name) :])


def _first_word(line: str) -> str:
    return (line.split(maxsplit=1) or [""])[0]


def expanded(line: str, aliases: Mapping[str, str]) -> str:
    """Expand an alias at the start of *line*."""
    name = _first_word(line)
    return line if name not in aliases else aliases[name] + line.lstrip()[len(name) :]


def tcl_line(line: str, aliases: Mapping[str, str]) -> str | None:
    """Return the Tcl after the word `tcl` as typed, with quotes and signs; None without `tcl`."""
    name, _, text = expanded(line, aliases).strip().partition(" ")
    return text.strip() or None if name.lower() == "tcl" else None


def cut(line: str) -> tuple[str, Destination | None]:
    """Split *line* into command and destination of results; None for the screen.

    Signs in quotes, words and comments belong to the command.
    """
    quote, before = "", " "
    for position, char in enumerate(line):
        starts, before = before.isspace(), char
        if quote:
            quote = "" if char == quote else quote
        elif char == '"' or (char == "'" and starts):
            quote = char
        elif starts and char == "#":
            break
        elif starts:
            sign = next((sign for sign in _SIGNS if line.startswith(sign, position)), None)
            if sign is not None:
                return line[:position], Destination(sign, line[position + len(sign) :].strip())
    return line, None


def checked(destination: Destination, *, programs: bool) -> Destination:
    """Return *destination* ready to open. Raises UsageError if empty, or a forbidden program."""
    if destination.sign == "|":
        if not programs:
            raise UsageError("`|` is off: dvtcli was started with --no-shell")
        if not destination.target:
            raise UsageError("`|` needs a program after it", hint="pdo --all | grep 0x181")
        return destination
    words = split(destination.target)
    if len(words) != 1:
        raise UsageError(
            f"`{destination.sign}` needs one file after it, not {len(words)}",
            hint='pdo > pdos.txt; write "…" around a name with blanks',
        )
    return Destination(destination.sign, words[0])


#: Common words of other programs: an untrusted alias must not change their meaning.
_COMMON = frozenset(
    {
        "about", "alias", "apt", "awk", "bash", "bg", "bye", "cal", "calc", "call", "candump", "cansend", "cat", "cd",
        "chmod", "chown", "clear", "close", "cls", "cmd", "commit", "config", "configure", "connect", "copy", "cp",
        "curl", "cut", "date", "dd", "debug", "del", "delete", "detach", "dir", "disconnect", "dmesg", "docker", "dump",
        "echo", "edit", "emacs", "end", "env", "erase", "exec", "fg", "file", "find", "format", "get", "git", "grep",
        "halt", "head", "hello", "hi", "history", "id", "ifconfig", "info", "init", "install", "ip", "jobs", "kill",
        "less", "list", "ll", "logout", "ls", "lsusb", "make", "man", "mkdir", "modprobe", "more", "mount", "move",
        "mv", "nano", "network", "new", "nodes", "off", "ok", "on", "open", "options", "pause", "ping", "pip",
        "poweroff", "print", "ps", "put", "pwd", "python", "q", "query", "quit", "reboot", "redo", "refresh", "reload",
        "remove", "rename", "reset", "resume", "rm", "rmdir", "sed", "settings", "setup", "sh", "shell", "show",
        "shutdown", "sleep", "sort", "source", "ssh", "start", "stat", "state", "status", "stop", "su", "sudo",
        "suspend", "tail", "tar", "tee", "test", "time", "top", "touch", "tty", "type", "uname", "unset", "up",
        "update", "upload", "uptime", "usage", "ver", "version", "vi", "view", "vim", "w", "wc", "wget", "what",
        "where", "which", "who", "whoami", "write", "x", "y", "yes", "n", "no",
    }
)  # fmt: skip
_A_PDO = re.compile(r"(?i)(?:\d{1,3}:)?[tr]pdo\d{0,3}")


def usable_aliases(settings: Settings) -> dict[str, str]:
    """Return the usable aliases. Raises UsageError if a trusted file's alias would hide a command."""
    found: dict[str, str] = {}
    for file in settings.files:
        if file.trusted:
            hidden = sorted(word for word in file.aliases if word.lower() in command_names())
            if hidden:
                raise UsageError(
                    f"{file.path}: the alias {hidden[0]!r} is a command already", hint="rename it in [aliases]"
                )
            found |= file.aliases
    withheld = _withheld(settings)
    if settings.project is not None and not settings.project.trusted:
        found |= {word: text for word, text in settings.project.aliases.items() if word not in withheld}
    return found


def withheld_aliases(settings: Settings) -> Hint | None:
    """Return the warning about aliases ignored for lack of trust; None if all are usable."""
    withheld = _withheld(settings)
    if not withheld or settings.project is None:
        return None
    commands = [word for word in withheld if word.lower() in command_names()]
    others = [word for word in withheld if word not in commands]
    said: list[Hint] = []
    if others:
        why = "an alias with | or >, with --yes or --force, or with the name of a common word, needs a trusted file"
        said.append(settings.untrusted(f"{_words(others)} not count: {why}"))
    if commands:
        from dvtcli.domain.hint import as_hint

        what = "the name of a command" if len(commands) == 1 else "names of commands"
        said.append(as_hint(f"{settings.project.path}: {_words(commands)} not count: rename aliases that are {what}"))
    return said[0] if len(said) == 1 else said[0] + "; " + said[1]


def _words(words: list[str]) -> str:
    return f"{', '.join(words)} in [aliases] {'does' if len(words) == 1 else 'do'}"


def _withheld(settings: Settings) -> list[str]:
    project = settings.project
    if project is None or project.trusted:
        return []
    own = settings.user.aliases if settings.user is not None else {}
    return [word for word, text in project.aliases.items() if word in own or _misleads(word, text)]


def _misleads(word: str, text: str) -> bool:
    """Whether *word* has a common other meaning, or its line contains redirections, --yes or --force."""
    from dvtcli.cli.dvt.words import WORDS

    known = word.lower()
    return (
        any(sign in text for sign in "|>")
        or any(map(_answers, re.sub(r"[\"'\\{}\[\]]", "", text.lower()).split()))
        or known in _COMMON
        or known in command_names()
        or known in {name.lower() for name in WORDS}
        or _A_PDO.fullmatch(known) is not None
    )


def _answers(option: str) -> bool:
    """Whether *option* is, or is short for, --yes or --force; also among other letters, as in `-qy`."""
    name = option.partition("=")[0]
    if name.startswith("--"):
        return len(name) > 2 and any(full.startswith(name) for full in ("--yes", "--force"))
    return re.match(r"-[a-z]*y", name) is not None


#: How `less` shows results if the user says nothing else: colours, long lines cut, gone if one screen is enough.
LESS = "-SRXF"


@contextmanager
def sent(output: Output, destination: Destination | None) -> Iterator[None]:
    """Send results to *destination* during the block (None: unchanged).

    Raises UsageError if a file cannot be written.
    """
    if destination is None:
        yield
        return
    opened = _program(destination.target) if destination.sign == "|" else _file(destination)
    with opened as stream, redirect_stdout(stream):
        screen, output.stdout = output.stdout, stream
        screen.flush()
        try:
            yield
        finally:
            output.stdout = screen


@contextmanager
def _file(destination: Destination) -> Iterator[TextIO]:
    path = Path(destination.target).expanduser()
    try:
        stream = path.open("a" if destination.sign == ">>" else "w", encoding="utf-8")
    except OSError as failed:
        raise UsageError(
            f"{path}: {failed.strerror or failed}", hint="results can go to a file: pdo > FILE"
        ) from failed
    with stream:
        yield stream


def _program(command: str) -> AbstractContextManager[TextIO]:
    """Start a program by the user's shell; yields its stdin, and waits for its end."""
    shell = ["cmd", "/c"] if os.name == "nt" else [os.environ.get("SHELL") or "/bin/sh", "-c"]
    return _fed(_started([*shell, command]))


def _started(words: list[str], **variables: str) -> subprocess.Popen[str]:
    """Start a program that reads its input, with *variables* unless they are set. Raises UsageError on failure."""
    environment = variables | dict(os.environ) | changed_variables()
    try:
        return subprocess.Popen(  # noqa: S603 - the user's own program, from the user's own keyboard
            words, stdin=subprocess.PIPE, text=True, encoding="utf-8", errors="backslashreplace", env=environment
        )
    except OSError as failed:
        raise UsageError(f"{words[0]} cannot be started: {failed.strerror}") from failed


@contextmanager
def _fed(process: subprocess.Popen[str]) -> Iterator[TextIO]:
    stream = cast(IO[str], process.stdin)
    try:
        yield cast(TextIO, stream)
    finally:
        with suppress(BrokenPipeError):  # it has read enough, as `head` does
            stream.close()
        with _ctrl_c_is_the_programs():
            process.wait()


@contextmanager
def _ctrl_c_is_the_programs() -> Iterator[None]:
    """Leave Ctrl-C, which all programs of a terminal receive, to the awaited program."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _program_words(command: str) -> list[str]:
    r"""Split the user's *command*; `\` separates folders on Windows. Raises ValueError as shlex.split."""
    if os.name != "nt":
        return shlex.split(command)
    return [word.strip('"') for word in shlex.split(command, posix=False)]


def paged(text: str) -> bool:
    """Show *text* in the user's pager ($PAGER, else `less`); returns False if not shown, or no keyboard can quit.

    `PAGER=cat` or empty disables paging.
    """
    try:
        words = _program_words(os.environ.get("PAGER", "less"))
    except ValueError:  # a quote that is not closed
        return False
    program = shutil.which(words[0]) if words and words[0] != "cat" else None
    if program is None or not sys.stdin.isatty():
        return False
    process = _started([program, *words[1:]], LESS=LESS)
    with suppress(BrokenPipeError), _fed(process) as stream:
        stream.write(text)
    return process.returncode == 0
