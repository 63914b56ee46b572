"""Read a line that was written for a shell, with `dvtcli` and its options before the command."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

#: the name of the program, as shells have it
PROGRAM = "dvtcli"


def without_program(words: Sequence[str], session: Conversation) -> list[str]:
    """Return the command in a shell's line: `dvtcli -n 5 store` is `store` if node 5 is selected.

    Options before the command are left out if they are those of this call. Raises UsageError for others, which mean
    another bus or another node.
    """
    rest = list(words[1:])
    call = session.typed_call()
    known = [call.bus[at : at + 2] for at in range(0, len(call.bus), 2)]
    known += [(name, str(session.selected_id())) for name in ("-n", "--node")]
    while rest and rest[0].startswith("-"):
        if tuple(rest[:2]) not in known:
            raise click.UsageError(
                f"{' '.join(rest[:2])} was chosen when dvtcli started, and is another here: "
                "run the line in a shell, or leave out what stands before the command"
            )
        del rest[:2]
    if not rest:
        raise click.UsageError("dvtcli runs already: a command comes here; help lists them")
    return rest
