"""Scripts: parsed whole before the first line runs, then run line by line inside one NMT gate.

Does not know where the text came from, and never asks anything.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import click

from dvtcli.cli.boundary import LEAVE, SIGNALLED
from dvtcli.cli.run_line import boundary
from dvtcli.cli.scripts.atomic import Reach
from dvtcli.cli.scripts.script_changes import ScriptChanges
from dvtcli.cli.scripts.script_lines import ScriptLine, script_lines
from dvtcli.cli.scripts.script_parse import all_parsed
from dvtcli.cli.scripts.script_run import look_again, run_line
from dvtcli.errors import Bug, LeftChanged, UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


def run_script(
    session: Conversation, data: bytes, source: str, *, keep_going: bool, atomic: bool = False, first_line: int = 1
) -> int:
    """Run a script's *data*; *source* names it in messages, *first_line* is where the data begins in it.

    The first failing line stops it and gives the exit code; with *keep_going* it runs on and ends with the
    first failure's code, or 7 where there was one, or that of the signal that ended it. With *atomic* a failing line
    takes back all lines before it; UsageError where a line could not be.
    """
    refuse_own_run(session, source)
    if atomic and keep_going:
        raise UsageError("--atomic and --keep-going exclude each other: a failing line takes all lines back")
    lines = script_lines(data, source, first_line)
    session.started = True
    session.keep_frames()
    reach = Reach()
    parsed = all_parsed(lines, session, [*session.scripts, source], {}, reach)
    if atomic:
        reach.refuse()

    def run() -> int:
        return worst(_run_lines(session, parsed, source, keep_going=keep_going))

    return enclosed(session, source, run, atomic=atomic)


def worst(codes: list[int]) -> int:
    """The exit code of a script whose failing lines ended with *codes*."""
    if 7 in codes:
        return 7
    return next((code for code in codes if code in SIGNALLED), codes[0] if codes else 0)


def refuse_own_run(session: Conversation, source: str) -> None:
    """Raise UsageError where the script *source* is under way already."""
    if source in session.scripts:
        raise UsageError(f"{source} runs itself: {' runs '.join([*session.scripts, source])}", place=source)


def enclosed(session: Conversation, source: str, run: Callable[[], int], *, atomic: bool = False) -> int:
    """Run a script's content inside one NMT gate; its exit code. *atomic* keeps all of its changes, or none."""
    outer, outer_changes = session.place, session.script_changes
    session.scripts.append(source)
    changes = outer_changes
    if changes is None or (atomic and not changes.atomic):
        session.script_changes = changes = ScriptChanges(session, source, atomic=atomic, outer=outer_changes)
    try:
        code = boundary(session, run)
        if not code and changes is not outer_changes:
            code = boundary(session, lambda: look_again(session, changes))
        stays = bool(session.staying())
    finally:
        session.scripts.pop()
        session.place, session.script_changes = outer, outer_changes
    if changes is not outer_changes:  # before others may write to the nodes, which they may once these are settled
        code = boundary(session, lambda: changes.end(complete=not code)) or code
    if session.in_script:
        return code
    settled = _settled(session, code, stays=stays)
    return code or settled


def _settled(session: Conversation, code: int, *, stays: bool) -> int:
    """Bring the nodes to the NMT state they were found in, at the end of the outermost script; the exit code."""
    # after a failure (a difference is none) of which some stays, the set-up is neither old nor new: its nodes stay
    # PRE-OPERATIONAL
    half = code in (LeftChanged.exit_code, Bug.exit_code) or (stays and code not in (0, 3))
    return boundary(session, lambda: session.end_line(7 if half else 0, alone=not code))


def _run_lines(
    session: Conversation, parsed: list[tuple[ScriptLine, click.Context]], source: str, *, keep_going: bool
) -> list[int]:
    """Run the lines and answer the exit codes of those that failed."""
    codes: list[int] = []
    lines = iter(parsed)
    for line, ctx in lines:
        session.place = f"{source}:{line.number}"
        code = _reported(session, source, line, ctx)
        if code == LEAVE:
            session.left = len(session.scripts) == 1  # a nested script ends alone
            break
        if code:
            codes.append(code)
            if not keep_going or code in SIGNALLED:
                break
    if session.report is not None:
        for line, _ in lines:
            session.report.left_out(source, line.number, _shown(session, line))
    return codes


def _reported(session: Conversation, source: str, line: ScriptLine, ctx: click.Context) -> int:
    """Run a parsed line and answer its exit code, which a report learns."""
    report = session.report
    if report is None:
        return run_line(session, ctx)
    ran = report.begin(source, line.number, _shown(session, line))
    code = run_line(session, ctx)
    report.end(ran, 0 if code == LEAVE else code)
    return code


def _shown(session: Conversation, line: ScriptLine) -> str:
    """The line as a report names it; of one that may hold a passcode the command only."""
    text = " ".join(line.words)
    return line.words[0] if session.is_secret(text) else text
