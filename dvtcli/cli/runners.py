"""The runners of lines, imported on use; `main` hands them to the registry."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.cli.catalogue import command_names
from dvtcli.cli.registry import REGISTRY
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation, TypedTcl
    from dvtcli.device.target_config import TargetConfig


class ImportedRunners:
    """`LineRunners` of `runner_interface`: prompt, scripts and lines."""

    def without_command(self, session: Conversation) -> int:
        """Run the prompt if stdin is a terminal, else stdin as a script, a program's line by line; returns its code.

        Raises UsageError if stdin is empty, or `--sim` has a command's name as its family.
        """
        for word in session.options.sim:
            if word in command_names() and not Path(word).exists():
                raise UsageError(f"--sim {word}: {word} is a command, not a family", hint=f"`dvtcli --sim gen4 {word}`")
        if sys.stdin.isatty():
            from dvtcli.cli.prompt.loop import run_prompt

            return run_prompt(session)
        from dvtcli.cli.live_lines import answer_lines, is_a_program

        if is_a_program(session):
            return answer_lines(session)
        from dvtcli.cli.scripts.script import run_script
        from dvtcli.cli.scripts.script_parse import MOST_BYTES

        text = sys.stdin.buffer.read(MOST_BYTES + 1)
        if not text.strip():
            raise UsageError("no command: standard input is empty", hint="`dvtcli --help`")
        return run_script(session, text, "<stdin>", keep_going=False)

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
        from dvtcli.cli.scripts.run_file import run_file

        return run_file(session, file, keep_going=keep_going, atomic=atomic, most_seconds=most_seconds)

    def tcl(self, session: Conversation) -> TypedTcl:
        """Return the session's Tcl; the first line starts its process."""
        from dvtcli.cli.dvt.tcl_mode import tcl_of

        return tcl_of(session)

    def line(self, session: Conversation, words: Sequence[str]) -> int:
        """Run a line as at the prompt; returns the exit code."""
        from dvtcli.cli.run_line import run_words

        return run_words(words, session)

    def rehearsed(self, session: Conversation, file: str, node_id: int | None = None) -> dict[int, TargetConfig]:
        """Return the script's configuration of each node; *node_id* is selected at the script's beginning."""
        from dvtcli.cli.scripts.rehearsal import rehearsed

        return rehearsed(session, file, node_id)

    def parsed(self, session: Conversation, path: Path) -> None:
        """Parse every line of the script at *path* without running any. Raises DvtcliError if malformed."""
        from dvtcli.cli.scripts.atomic import Reach
        from dvtcli.cli.scripts.script_parse import all_parsed, script_lines

        all_parsed(script_lines(path.read_bytes(), path.name), session, [path.name], {}, Reach())


def install() -> None:
    """Hand the runners to the registry for its commands."""
    REGISTRY.runners = ImportedRunners()
