"""The ways into the program that run lines, each imported when it is taken; `main` hands them to the registry."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dvtcli.cli.registry import REGISTRY

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.typed_tcl import TypedTcl
    from dvtcli.device.wish import Wish


class WaysIn:
    """`ways.Ways`, on prompt, scripts and lines."""

    def without_command(self, session: Conversation) -> int:
        """Run the prompt where stdin is a terminal, else stdin as a script; the exit code."""
        from dvtcli.cli.without_command import without_command

        return without_command(session)

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
        from dvtcli.cli.scripts.run_file import run_file

        return run_file(session, file, keep_going=keep_going, atomic=atomic, most_seconds=most_seconds)

    def tcl(self, session: Conversation) -> TypedTcl:
        """The session's Tcl; its process is started with the first line."""
        from dvtcli.cli.dvt.tcl_mode import tcl_of

        return tcl_of(session)

    def line(self, session: Conversation, words: Sequence[str]) -> int:
        """Run one line as the prompt does; the exit code."""
        from dvtcli.cli.run_line import run_words

        return run_words(words, session)

    def rehearsed(self, session: Conversation, file: str, node_id: int | None = None) -> dict[int, Wish]:
        """What the script *file* wishes of each node; *node_id* is selected when it begins."""
        from dvtcli.cli.scripts.rehearsal import rehearsed

        return rehearsed(session, file, node_id)

    def parsed(self, session: Conversation, path: Path) -> None:
        """Parse every line of the script at *path*, and run none; DvtcliError for a line that is none."""
        from dvtcli.cli.scripts.atomic import Reach
        from dvtcli.cli.scripts.script_lines import script_lines
        from dvtcli.cli.scripts.script_parse import all_parsed

        all_parsed(script_lines(path.read_bytes(), path.name), session, [path.name], {}, Reach())


def install() -> None:
    """Hand the ways in to the registry, so that its commands may take them."""
    REGISTRY.ways = WaysIn()
