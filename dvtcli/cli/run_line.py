"""Run a line: parse it, invoke its command, show the answer, return the exit code."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.boundary import exit_code_of
from dvtcli.cli.parse_line import parse
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


def run_words(words: Sequence[str], session: Conversation) -> int:
    """Parse and run a line."""
    return exit_code_of(session, lambda: _parse_and_invoke(words, session))


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
