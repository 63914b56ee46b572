"""One line's way: found in the one registry, parsed by click, invoked, answered, and judged by an exit code.

Does not know where lines come from (`main`, `prompt.loop`, `commands.run`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.catalogue import meant, unknown_command
from dvtcli.cli.registry import REGISTRY

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


def parse(words: Sequence[str], session: Conversation) -> click.Context:
    """Find and parse one line's command without running it; usage errors are raised here."""
    root = click.Context(REGISTRY, info_name="", obj=session)
    name, *args = meant(words)
    if name.startswith("-"):
        if name in ("-n", "--node"):
            raise click.UsageError(
                f"{name} is given when dvtcli starts; here `node 5` selects a node, and `read 1:1017 5:1017` names them"
            )
        raise click.UsageError(f"{name} stands before any command; options stand behind it")
    command = REGISTRY.get_command(root, name)
    if command is None:
        raise click.UsageError(unknown_command(name))
    return command.make_context(name, list(args), parent=root)


def run_words(words: Sequence[str], session: Conversation) -> int:
    """Parse and run one line."""
    return boundary(session, lambda: _parse_and_invoke(words, session))


def _parse_and_invoke(words: Sequence[str], session: Conversation) -> Any:
    from dvtcli.files.input_file import forget_pipes

    forget_pipes()
    with parse(words, session) as ctx:
        return ctx.command.invoke(ctx)


def boundary(session: Conversation, run: Callable[[], Any]) -> int:
    """Run something and turn whatever comes of it into an exit code: the one place where errors end."""
    from dvtcli.cli.boundary import guarded

    return guarded(session, run)
