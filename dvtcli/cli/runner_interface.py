"""The ways for a command to run lines, scripts or the prompt; `main` hands them to the registry.

Commands get them through click's context (`runners`): a command that imported the prompt or scripts, even on use, would
make a circle, since these import the registry of commands.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import click

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.cli.conversation import Conversation, TypedTcl
    from dvtcli.device.target_config import TargetConfig


class LineRunners(Protocol):
    """All runners of lines."""

    def without_command(self, session: Conversation) -> int:
        """Run the prompt if stdin is a terminal, else stdin as a script; returns the exit code."""

    def file(
        self,
        session: Conversation,
        file: str,
        *,
        keep_going: bool = False,
        atomic: bool = False,
        most_seconds: float | None = None,
    ) -> int:
        """Run the script *file* (`-`: stdin); returns the exit code. Raises UsageError if unreadable."""

    def tcl(self, session: Conversation) -> TypedTcl:
        """Return the session's Tcl; the first line starts its process."""

    def line(self, session: Conversation, words: Sequence[str]) -> int:
        """Run a line as at the prompt; returns the exit code."""

    def rehearsed(self, session: Conversation, file: str, node_id: int | None = None) -> dict[int, TargetConfig]:
        """Return the script's configuration of each node; *node_id* is selected at the script's beginning."""

    def parsed(self, session: Conversation, path: Path) -> None:
        """Parse every line of the script at *path* without running any. Raises DvtcliError if malformed."""


class CommandGroup(click.Group):
    """The set of all commands, with the runners from `main`."""

    runners: LineRunners

    def long_help(self, ctx: click.Context) -> str:
        """Return the help of every command and of all global options."""
        raise NotImplementedError


def root(ctx: click.Context) -> CommandGroup:
    """Return the set of all commands from a line's context."""
    found = ctx.find_root().command
    assert isinstance(found, CommandGroup)  # noqa: S101 - argv, prompt and scripts parse every line below it
    return found


def runners(ctx: click.Context) -> LineRunners:
    """Return the runners from a line's context."""
    return root(ctx).runners
