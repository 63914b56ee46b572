"""Run a line: find and parse its command, invoke it, show the answer, return the exit code."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.catalogue import meant, unknown_command
from dvtcli.cli.registry import REGISTRY

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.user.session_user import SessionUser


def parse(words: Sequence[str], session: SessionUser) -> click.Context:
    """Find and parse a line's command without running it. Raises usage errors."""
    root = click.Context(REGISTRY, info_name="", obj=session)
    name, *args = meant(words)
    if name.startswith("-"):
        if name in ("-n", "--node"):
            raise click.UsageError(
                f"{name} is given when dvtcli starts; here `node 5` selects a node, and `read 1:1017 5:1017` names them"
            )
        raise click.UsageError(f"{name} comes before any command; options come after it")
    command = REGISTRY.get_command(root, name)
    if command is None:
        raise click.UsageError(unknown_command(name))
    return command.make_context(name, list(args), parent=root)


def run_words(words: Sequence[str], session: Conversation) -> int:
    """Parse and run a line."""
    return boundary(session, lambda: _parse_and_invoke(words, session))


def _parse_and_invoke(words: Sequence[str], session: SessionUser) -> Any:
    from dvtcli.files.input_file import forget_pipes

    forget_pipes()
    with parse(words, session) as ctx:
        return ctx.command.invoke(ctx)


def boundary(session: Conversation, run: Callable[[], Any]) -> int:
    """Call *run* and convert any outcome to an exit code: the only place where errors end."""
    from dvtcli.cli.boundary import exit_code_of

    return exit_code_of(session, run)
