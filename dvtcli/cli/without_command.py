"""dvtcli without a command: the prompt at a terminal, a script from a pipe."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.cli.catalogue import command_names
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


def without_command(session: Conversation) -> int:
    """Run the prompt if stdin is a terminal, else stdin as a script, a program's line by line; returns its code.

    Raises UsageError if stdin is empty, or `--sim` has a command's name as its family.
    """
    for word in session.options.sim:
        if word in command_names() and not Path(word).exists():
            raise UsageError(f"--sim {word}: {word} is a command, no family", hint=f"`dvtcli --sim gen4 {word}`")
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
        raise UsageError("there is no command: standard input is empty", hint="`dvtcli --help`")
    return run_script(session, text, "<stdin>", keep_going=False)
