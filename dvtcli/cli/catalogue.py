"""The commands' names, by task, and what their files say, read without importing any; and what is near a wrong name."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from functools import cache

_COMMANDS = os.path.join(os.path.dirname(__file__), "commands")  # noqa: PTH118, PTH120 - pathlib costs 7 ms

#: Within so many bytes of a command's file its task is declared.
_MOST_BYTES = 8_000
#: Tasks in the order in which they come up; which one a command belongs to, and where in it, its own file says.
TASKS = (
    "Begin",
    "Find nodes",
    "See",
    "Frames",
    "Change PDOs",
    "Check and keep",
    "Whole devices",
    "Networks",
    "Scripts and files",
    "Programs around",
)


def command_names() -> list[str]:
    """Names of all commands, sorted."""
    return list(_command_names())


@cache
def _command_names() -> tuple[str, ...]:
    names = (name for name in os.listdir(_COMMANDS) if name.endswith(".py"))  # noqa: PTH208
    return tuple(sorted(name.removesuffix(".py") for name in names if not name.startswith("_")))


def summary(name: str) -> str:
    """A command's one-line help: the first line of its file."""
    return _declared(name)[0]


def task(name: str) -> tuple[str, int]:
    """What a command is for, one of `TASKS`, and its place among the commands for that.

    Its file says `TASK = ("See", 30)`; LookupError where it says none.
    """
    if declared := _declared(name)[1]:
        said, _, place = declared.strip(" ()").rpartition(",")
        return said.strip(' "'), int(place)
    raise LookupError(f"dvtcli/cli/commands/{name}.py declares no TASK")


def by_task(names: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """*names* in groups, each with its task, in the order of `TASKS` and in each of the places that their files say."""
    declared = sorted((*task(name), name) for name in names)
    for one in TASKS:
        group = [name for named, _, name in declared if named == one]
        if group:
            yield one, group


def task_sections() -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Every command with its one-line help, by task."""
    for name_of_task, group in by_task(command_names()):
        yield name_of_task, [(name, summary(name)) for name in group]


@cache
def _declared(name: str) -> tuple[str, str]:
    """A command's summary, and what its file says of its task, empty where it says none.

    `--help` does this with every command, hence the plainest way to a file's beginning.
    """
    file = os.open(os.path.join(_COMMANDS, f"{name}.py"), os.O_RDONLY)  # noqa: PTH118
    try:
        text = os.read(file, _MOST_BYTES)
    finally:
        os.close(file)
    _, _, behind = text.partition(b"\nTASK = ")
    first, task = (line.partition(b"\n")[0].decode().strip() for line in (text, behind))
    return first.strip('"').strip(), task


#: What people type who come from other programs, for the command that it is.
_ALSO = {"quit": "exit"}
_A_PDO = r"(?i)(?:\d{1,3}:)?[tr]pdo\d{1,3}"


def meant(words: Sequence[str]) -> list[str]:
    """A line's *words* with the command that is meant: `MAP` is `map`, `quit` is `exit`, a PDO alone is shown."""
    name, *rest = words
    if not rest and re.fullmatch(_A_PDO, name):
        return ["pdo", name]
    lower = _ALSO.get(name.lower(), name.lower())
    return [lower if lower in command_names() else name, *rest]


_TCL_WORDS = frozenset(("proc", "puts", "foreach", "for", "while", "if", "expr", "incr", "catch", "after"))


#: How much of a word must be a command's (0…1) for that to be offered: `trace` and `history` are no `store`.
_NEAR = 0.7
#: In words up to so many letters a single one is much: `mpa` is `map`.
_SHORT = 3


def with_a_swap(word: str) -> Iterator[str]:
    """*word* with two neighbours swapped, one pair after the other: `mpa` may be `map`; nothing of a short one."""
    if len(word) >= _SHORT:
        for at in range(len(word) - 1):
            yield word[:at] + word[at + 1] + word[at] + word[at + 2 :]


def unknown_command(name: str, others: Sequence[str] = ()) -> str:
    """What to say of a word that is no command, nor one of *others*."""
    from difflib import get_close_matches

    if name.lower() in ("q", "bye", "logout"):
        return f"no command is called {name!r}; did you mean 'exit'?"
    from dvtcli.cli.dvt.words import WORDS

    if re.fullmatch(_A_PDO, name):
        return f"no command is called {name!r}: pdo {name} shows it, map {name} OBJECT... sets what it carries"
    if name in _TCL_WORDS:
        script = "a Tcl script is a file whose name ends in .tcl"
        return f"no command is called {name!r}: it is Tcl's, at the prompt `tcl {name} …`; {script}"
    close = get_close_matches(
        name.lower(), [*command_names(), *others, *WORDS], n=1, cutoff=_NEAR if len(name) > _SHORT else 0.6
    )
    return f"no command is called {name!r}" + (f"; did you mean {close[0]!r}?" if close else "; help lists them")
