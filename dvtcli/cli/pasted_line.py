"""Read a line that was written for a shell, with `dvtcli` and its options before the command."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.view.typed_hints import TypedCall

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
            f"{rest[0]} stands before the command, and a script runs on the bus and the node of its own lines: "
            "leave out what stands before the command"
        )
    call = session.typed_call()
    known = [call.bus[at : at + 2] for at in range(0, len(call.bus), 2)]
    bus = {tuple(pair) for pair in known}
    known += [(name, str(session.selected_id())) for name in ("-n", "--node")]
    said: set[tuple[str, ...]] = set()
    while rest and rest[0].startswith("-"):
        if tuple(rest[:2]) not in known:
            raise click.UsageError(
                f"this session runs on {_where(call)}; {' '.join(rest[:2])} is given when dvtcli starts: "
                "run the line in a shell, or leave out what stands before the command"
            )
        said.add(tuple(rest[:2]))
        del rest[:2]
    if said & bus and not bus <= said:
        lacking = " ".join(word for pair in sorted(bus - said) for word in pair)
        raise click.UsageError(f"the line has only a part of this session's bus, without {lacking}: leave it out")
    if not rest:
        raise click.UsageError("dvtcli runs already: a command comes here; help lists them")
    return rest


def _where(call: TypedCall) -> str:
    """Return bus and node of *call* as typed."""
    node = () if call.selected is None else ("-n", str(call.selected))
    return " ".join((*call.bus, *node)) or "the bus of its settings"
