"""Find the command of a line, and parse the line without running it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from dvtcli.cli.catalogue import meant, unknown_command
from dvtcli.cli.lexer import SHELL_WORDS, without_program
from dvtcli.cli.registry import REGISTRY

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


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
