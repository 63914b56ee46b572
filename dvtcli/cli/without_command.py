"""dvtcli without a command: the prompt at a terminal, a script from a pipe."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


def without_command(session: Conversation) -> int:
    """Run the prompt if stdin is a terminal, else stdin as a script, a program's line by line; returns its code."""
    if sys.stdin.isatty():
        from dvtcli.cli.prompt.loop import run_prompt

        return run_prompt(session)
    from dvtcli.cli.live_lines import answer_lines, is_a_program

    if is_a_program(session):
        return answer_lines(session)
    from dvtcli.cli.scripts.script import run_script
    from dvtcli.cli.scripts.script_parse import MOST_BYTES

    return run_script(session, sys.stdin.buffer.read(MOST_BYTES + 1), "<stdin>", keep_going=False)
