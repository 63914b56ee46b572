"""Split lines into words: quotes group, `#` begins a comment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.view.typed_hints import TypedCall


def split(line: str) -> list[str]:
    """Split a line into words: quotes group, `#` at the start of a word begins a comment.

    An apostrophe inside a word is a letter; directly after a closing quote it opens another, as in a shell. Raises
    UsageError for an unclosed quote, and for more words than any command takes.
    """
    from dvtcli.errors import UsageError

    if "\0" in line:
        raise UsageError("a command must not contain a NUL character")
    try:
        words = _split(line)
    except ValueError as wrong:
        shown = line.strip() if len(line) <= _SHOWN else line.strip()[:_SHOWN] + "…"
        raise UsageError(f"a quote is not closed: {shown}", hint='write "…" around a name with blanks') from wrong
    if len(words) > _MOST_WORDS:
        raise UsageError(f"{len(words)} words are too many for a command")
    return words


_BLANKS = " \t\r\n"
_SHOWN = 200
#: click takes words off the front of a list, in time that grows with the square of their number
_MOST_WORDS = 10_000


def _split(line: str) -> list[str]:
    """Split *line* in one pass (shlex takes 19 s for a word of 1 MB). Raises ValueError for an unclosed quote."""
    words: list[str] = []
    word: list[str] = []
    inside, quote, before, closed = False, "", " ", False
    for char in line:
        starts, before = before.isspace(), char
        behind_quote, closed = closed, False
        if quote:
            if char == quote:
                quote, closed = "", True
            else:
                word.append(char)
        elif char in _BLANKS:
            if inside:
                words.append("".join(word))
            word, inside = [], False
        elif char == "#" and starts:
            break
        else:
            inside = True
            if char == '"' or (char == "'" and (starts or behind_quote)):
                quote = char
            else:
                word.append(char)
    if quote:
        raise ValueError("a quote is not closed")
    return [*words, "".join(word)] if inside else words


#: the name of the program, as shells have it
PROGRAM = "dvtcli"
#: how a shell's line begins: with the program, or with the prompt before it, as in documentation
SHELL_WORDS = (PROGRAM, "$")


def without_program(words: Sequence[str], session: Conversation, *, in_file: bool = False) -> list[str]:
    """Return the command in a shell's line: `dvtcli -n 5 store` and `$ dvtcli …` are `store` if node 5 is selected.

    Options before the command are left out if they are the bus of this call, all of it, and the selected node. Raises
    UsageError for others, which mean another bus or another node, and for any if *in_file*: a script is parsed before
    its lines select nodes.
    """
    rest = list(words[2 if tuple(words[:2]) == ("$", PROGRAM) else 1 :])
    if in_file and rest and rest[0].startswith("-"):
        raise click.UsageError(
            f"{rest[0]} is before the command, but a script sets the bus and the node in its own lines: remove the "
            f"part before the command"
        )
    call = session.typed_call()
    known = [call.bus[at : at + 2] for at in range(0, len(call.bus), 2)]
    bus = {tuple(pair) for pair in known}
    known += [(name, str(session.selected_id())) for name in ("-n", "--node")]
    said: set[tuple[str, ...]] = set()
    while rest and rest[0].startswith("-"):
        if tuple(rest[:2]) not in known:
            raise click.UsageError(
                f"this session runs on {_where(call)}; {' '.join(rest[:2])} is an option for the start of dvtcli: "
                f"run the line in a shell, or remove the part before the command"
            )
        said.add(tuple(rest[:2]))
        del rest[:2]
    if said & bus and not bus <= said:
        lacking = " ".join(word for pair in sorted(bus - said) for word in pair)
        raise click.UsageError(f"the line has only a part of this session's bus, without {lacking}: leave it out")
    if not rest:
        raise click.UsageError("dvtcli is already running: enter a command; help lists them")
    return rest


def _where(call: TypedCall) -> str:
    """Return bus and node of *call* as typed."""
    node = () if call.selected is None else ("-n", str(call.selected))
    return " ".join((*call.bus, *node)) or "the bus of its settings"
