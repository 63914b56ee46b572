"""Send results to a file, a program or a pager instead of the screen."""

from __future__ import annotations

import os
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import IO, TextIO, cast

from dvtcli.cli.prompt.line import Destination
from dvtcli.cli.view.output import Output
from dvtcli.errors import UsageError
from dvtcli.interpreter import changed_variables

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


def _words(command: str) -> list[str]:
    r"""Split the user's *command*; `\` separates folders on Windows. Raises ValueError as shlex.split."""
    if os.name != "nt":
        return shlex.split(command)
    return [word.strip('"') for word in shlex.split(command, posix=False)]


def paged(text: str) -> bool:
    """Show *text* in the user's pager ($PAGER, else `less`); returns False if not shown, or no keyboard can quit.

    `PAGER=cat` or empty disables paging.
    """
    try:
        words = _words(os.environ.get("PAGER", "less"))
    except ValueError:  # a quote that is not closed
        return False
    program = shutil.which(words[0]) if words and words[0] != "cat" else None
    if program is None or not sys.stdin.isatty():
        return False
    process = _started([program, *words[1:]], LESS=LESS)
    with suppress(BrokenPipeError), _fed(process) as stream:
        stream.write(text)
    return process.returncode == 0
