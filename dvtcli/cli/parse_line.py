"""Find the command of a line, also of a shell's, and parse the line without running it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from dvtcli.cli.catalogue import meant, unknown_command
from dvtcli.cli.registry import REGISTRY

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.view.typed_hints import TypedCall


#: the name of the program, as shells have it
PROGRAM = "dvtcli"
#: how a shell's line begins: with the program, or with the prompt before it, as in documentation
SHELL_WORDS = (PROGRAM, "$")


def parse(words: Sequence[str], session: Conversation, *, in_file: bool = False) -> click.Context:
    """Find and parse a line's command without running it. Raises usage errors."""
    root = click.Context(REGISTRY, info_name="", obj=session)
    if words[0] in SHELL_WORDS:
        words = without_program(words, session, in_file=in_file)
    name, *args = meant(words)
    if name.startswith("-"):
        if name in ("-n", "--node"):
            raise click.UsageError(
                f"{name} is an option for the start of dvtcli; here `node 5` selects a node, and `read 1:1017 "
                f"5:1017` reads several"
            )
        raise click.UsageError(f"{name} belongs before the command; options belong after it")
    command = REGISTRY.get_command(root, name)
    if command is None:
        raise click.UsageError(unknown_command(name))
    return command.make_context(name, list(args), parent=root)


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
