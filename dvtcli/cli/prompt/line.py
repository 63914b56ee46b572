"""What a typed line means before any command sees it: aliases, and where its results go.

Knows quotes as `lexer.split` does, and the word behind which they are Tcl's. Does not know commands, and opens nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dvtcli.cli.lexer import split
from dvtcli.errors import UsageError

#: What stands before a line that a backslash continues.
CONTINUED = "  ... "
#: What sends results elsewhere, where it begins a word.
_SIGNS = (">>", ">", "|")


@dataclass(frozen=True, slots=True)
class Destination:
    """Where results go: *sign* is `|` (a program), `>` (a file) or `>>` (the end of a file)."""

    sign: str
    target: str


def taken_apart(line: str, aliases: Mapping[str, str]) -> tuple[str, Destination | None]:
    """The command in *line*, and where its results go, as `cut`; an alias at its start stands for its own line.

    The line is cut before the alias is put in, so that no alias changes what the typed signs and quotes mean: behind a
    sign of the alias, all that was typed belongs to its destination.
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
    """*line* with an alias at its start replaced by what it stands for."""
    name = _first_word(line)
    return line if name not in aliases else aliases[name] + line.lstrip()[len(name) :]


def tcl_line(line: str, aliases: Mapping[str, str]) -> str | None:
    """The Tcl behind the word `tcl`, as it was typed: its quotes and signs are Tcl's; None where there is none."""
    name, _, text = expanded(line, aliases).strip().partition(" ")
    return text.strip() or None if name.lower() == "tcl" else None


def cut(line: str) -> tuple[str, Destination | None]:
    """The command in *line*, and where its results go; None where they stay on the screen.

    Quoted signs, and signs inside words, belong to the command, as does what stands in a comment.
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
    """*destination* as it can be opened; UsageError where it names nothing, or a forbidden program."""
    if destination.sign == "|":
        if not programs:
            raise UsageError("`|` is off: dvtcli was started with --no-shell")
        if not destination.target:
            raise UsageError("`|` needs a program behind it", hint="pdo --all | grep 0x181")
        return destination
    words = split(destination.target)
    if len(words) != 1:
        raise UsageError(
            f"`{destination.sign}` needs one file behind it, not {len(words)}",
            hint='pdo > pdos.txt; write "…" around a name with blanks',
        )
    return Destination(destination.sign, words[0])
