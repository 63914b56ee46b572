"""The commands' names and what their files say of them, read without importing any; and what is near a wrong name."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    pass

_COMMANDS = os.path.join(os.path.dirname(__file__), "commands")  # noqa: PTH118, PTH120 - pathlib costs 7 ms


def command_names() -> list[str]:
    """Names of all commands, sorted."""
    names = (name for name in os.listdir(_COMMANDS) if name.endswith(".py"))  # noqa: PTH208
    return sorted(name.removesuffix(".py") for name in names if not name.startswith("_"))


def summary(name: str) -> str:
    """A command's one-line help: the first line of its file, read without importing it."""
    with open(os.path.join(_COMMANDS, f"{name}.py"), encoding="utf-8") as file:  # noqa: PTH118, PTH123
        return file.readline().strip().strip('"').strip()


def task(name: str) -> tuple[str, int]:
    """What a command is for, one of `help.guide.TASKS`, and its place among the commands for that.

    Its file says `TASK = ("See", 30)`, which is read without importing it; LookupError where it says none.
    """
    with open(os.path.join(_COMMANDS, f"{name}.py"), encoding="utf-8") as file:  # noqa: PTH118, PTH123
        for line in file:
            if line.startswith("TASK = "):
                said, _, place = line.removeprefix("TASK = ").strip(" ()\n").rpartition(",")
                return said.strip(' "'), int(place)
    raise LookupError(f"dvtcli/cli/commands/{name}.py declares no TASK")


_TCL_WORDS = frozenset(("proc", "puts", "foreach", "for", "while", "if", "expr", "incr", "catch", "after"))


def unknown_command(name: str, others: Sequence[str] = ()) -> str:
    """What to say of a word that is no command, nor one of *others*."""
    from difflib import get_close_matches

    if name.lower() in ("quit", "q", "bye", "logout"):
        return f"no command is called {name!r}; did you mean 'exit'?"
    from dvtcli.cli.dvt.words import WORDS

    if name in _TCL_WORDS:
        return f"no command is called {name!r}: it is Tcl's, and a Tcl script is a file whose name ends in .tcl"
    close = get_close_matches(name.lower(), [*command_names(), *others, *WORDS], n=1)
    return f"no command is called {name!r}" + (f"; did you mean {close[0]!r}?" if close else "; help lists them")
