"""What a line may lead to besides its command: other lines, scripts, the prompt; handed to the registry by `main`.

Commands ask for it through click's context (`ways`), so that none imports what itself runs commands.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import click

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.typed_tcl import TypedTcl
    from dvtcli.device.wish import Wish


class Ways(Protocol):
    """Everything that runs lines."""

    def without_command(self, session: Conversation) -> int:
        """Run the prompt where stdin is a terminal, else stdin as a script; the exit code."""

    def file(
        self,
        session: Conversation,
        file: str,
        *,
        keep_going: bool = False,
        atomic: bool = False,
        most_seconds: float | None = None,
    ) -> int:
        """Run the script *file*, stdin with `-`; the exit code. UsageError where it cannot be read."""

    def tcl(self, session: Conversation) -> TypedTcl:
        """The session's Tcl; its process is started with the first line."""

    def line(self, session: Conversation, words: Sequence[str]) -> int:
        """Run one line as the prompt does; the exit code."""

    def rehearsed(self, session: Conversation, file: str, node_id: int | None = None) -> dict[int, Wish]:
        """What the script *file* wishes of each node; *node_id* is selected when it begins."""

    def parsed(self, session: Conversation, path: Path) -> None:
        """Parse every line of the script at *path*, and run none; DvtcliError for a line that is none."""


class Root(click.Group):
    """The set of all commands, with the ways in that `main` handed to it."""

    ways: Ways


def root(ctx: click.Context) -> Root:
    """The set of all commands, of any line's context."""
    found = ctx.find_root().command
    assert isinstance(found, Root)  # noqa: S101 - argv, prompt and scripts parse every line below it
    return found


def ways(ctx: click.Context) -> Ways:
    """The ways in, of any line's context."""
    return root(ctx).ways
