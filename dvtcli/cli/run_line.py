"""Run a line: find and parse its command, invoke it, show the answer, return the exit code."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.catalogue import meant, unknown_command
from dvtcli.cli.pasted_line import PROGRAM, without_program
from dvtcli.cli.registry import REGISTRY
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


def parse(words: Sequence[str], session: Conversation) -> click.Context:
    """Find and parse a line's command without running it. Raises usage errors."""
    root = click.Context(REGISTRY, info_name="", obj=session)
    if words[0] == PROGRAM:
        words = without_program(words, session)
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


def _parse_and_invoke(words: Sequence[str], session: Conversation) -> Any:
    from dvtcli.files.input_file import forget_pipes

    forget_pipes()
    try:
        ctx = parse(words, session)
    except (click.ClickException, UsageError) as wrong:
        from dvtcli.cli.corrected_line import with_correction

        raise with_correction(wrong, words, session) from wrong
    with ctx:
        return ctx.command.invoke(ctx)


def boundary(session: Conversation, run: Callable[[], Any]) -> int:
    """Call *run* and convert any outcome to an exit code: the only place where errors end."""
    from dvtcli.cli.boundary import exit_code_of

    return exit_code_of(session, run)
