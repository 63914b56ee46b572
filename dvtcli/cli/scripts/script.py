"""Run scripts: parsed whole before the first line runs, then line by line inside one NMT gate; never asks."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.boundary import LEAVE, SIGNALLED, exit_code_of
from dvtcli.cli.scripts.script_changes import ScriptChanges
from dvtcli.cli.scripts.script_parse import Reach, ScriptLine, all_parsed, does_other, final, read_lines
from dvtcli.errors import Bug, DvtcliError, LeftChanged, Restarted, TakenBack, UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.user.session_user import SessionUser


_ALL_BACK = "rolled back: the changes of the script are reverted and verified; nothing was stored"


def run_line(session: Conversation, ctx: click.Context) -> int:
    """Run a parsed line at `session.place` and answer its exit code; results and errors are shown on the way."""
    return exit_code_of(session, lambda: _run_noted(session, ctx))


def _run_noted(session: Conversation, ctx: click.Context) -> Any:
    changes, place = session.script_changes, session.place
    assert changes is not None  # noqa: S101 - a script runs
    assert place is not None  # noqa: S101
    noted = changes.dry_run or not session.dry_run  # what a line does to twins of its own is gone when it ends
    other, ends = does_other(ctx), final(ctx)  # now: running the line takes its options out of it
    try:
        if session.cancellation.requested:  # asked for when the last line's change was complete
            raise KeyboardInterrupt
        if ends is not None and noted:
            changes.begin_final(f"{place} {ends.words}")
        with ctx:
            code = ctx.command.invoke(ctx)
        done = code in (0, None, LEAVE)
        if noted:
            changes.note(place, other=done and other and session.may_have_changed, final=done and ends is not None)
        if not done:
            _refuse_half(ctx, changes, code)
    except BaseException as failed:
        if changes.atomic and not changes.ended:
            if noted and changes.final is None:
                changes.note(place)  # it may have stored before it failed
            _roll_back(session, changes, failed)
        raise
    return code


def check_finished_script(session: Conversation, changes: ScriptChanges) -> None:
    """Check that nodes still hold all values of a finished atomic script; otherwise roll back and fail.

    The outermost script checks again after restoring the nodes' NMT states.
    """
    if not changes.atomic or changes.ended:
        return
    try:
        changes.look_again()
        if len(session.scripts) == 1:
            changes.return_nodes()
    except BaseException as failed:
        _roll_back(session, changes, failed)
        raise


def _refuse_half(ctx: click.Context, changes: ScriptChanges, code: int) -> None:
    """Fail an atomic script if a line ended with *code* without an error, as `verify` may."""
    if not changes.atomic or changes.ended:
        return
    failed = TakenBack(f"{ctx.info_name} ended with {code}: the script's changes are rolled back")
    failed.exit_code = code
    raise failed


def _roll_back(session: SessionUser, changes: ScriptChanges, failed: BaseException) -> None:
    """Roll back the script because of *failed*, which gets the result. Raises LeftChanged if changes remain."""
    undone = changes.changed_anything()
    with session.cancellation.deferred():
        try:
            changes.roll_back(str(failed) or "interrupted", failed if isinstance(failed, LeftChanged) else None)
        except LeftChanged as left:
            if session.dry_run:
                raise _of_twins(left) from None
            if isinstance(failed, LeftChanged):  # who has stored, and who has not
                left.details[:0], left.stores = failed.details, failed.stores
                left.hint = failed.hint if failed.stores is not None else left.hint
            raise
    if not undone or session.dry_run:
        return
    if isinstance(failed, Restarted) or (
        isinstance(failed, DvtcliError) and failed.state in ("unchanged", "rolled_back")
    ):
        failed.state, failed.state_text = "rolled_back", _ALL_BACK


def _of_twins(left: LeftChanged) -> DvtcliError:
    """Convert *left* for twins: no node is changed, and the cause is the lost bus or node."""
    from dvtcli.operations.session.opened import read_in_vain

    left.state, left.state_text = "unchanged", None
    return read_in_vain(left)


def run_script(
    session: Conversation, data: bytes, source: str, *, keep_going: bool, atomic: bool = False, first_line: int = 1
) -> int:
    """Run a script's *data*; *source* names it in messages, *first_line* is the line number of its beginning.

    The first failing line stops the script and gives the exit code. *keep_going*: run on, and return the first
    failure's code, or 7 if any, or a signal's. *atomic*: a failing line rolls back all lines before. Raises UsageError
    if an atomic script changes nodes after a line without undo.
    """
    refuse_own_run(session, source)
    if atomic and keep_going:
        raise UsageError("--atomic and --keep-going exclude each other: a failing line rolls all lines back")
    lines = read_lines(data, source, first_line)
    session.started = True
    session.keep_frames()
    reach = Reach()
    try:
        parsed = all_parsed(lines, session, [*session.scripts, source], {}, reach)
    except DvtcliError as wrong:
        if session.report is not None:
            _report_unreadable(session, source, lines, wrong)
        raise
    if atomic:
        reach.refuse()

    def run() -> int:
        return worst(_run_lines(session, parsed, source, keep_going=keep_going))

    return enclosed(session, source, run, atomic=atomic)


def worst(codes: list[int]) -> int:
    """Return a script's exit code from the *codes* of failing lines."""
    if 7 in codes:
        return 7
    return next((code for code in codes if code in SIGNALLED), codes[0] if codes else 0)


def refuse_own_run(session: Conversation, source: str) -> None:
    """Raise UsageError if the script *source* is already running."""
    if source in session.scripts:
        raise UsageError(f"{source} runs itself: {' runs '.join([*session.scripts, source])}", place=source)


def enclosed(session: Conversation, source: str, run: Callable[[], int], *, atomic: bool = False) -> int:
    """Run a script inside one NMT gate; returns its exit code. *atomic*: keep all changes, or none."""
    outer, outer_changes = session.place, session.script_changes
    session.scripts.append(source)
    changes = outer_changes
    if changes is None or (atomic and not changes.atomic):
        session.script_changes = changes = ScriptChanges(session, source, atomic=atomic, outer=outer_changes)
    try:
        code = exit_code_of(session, run)
        if not code and changes is not outer_changes:
            code = exit_code_of(session, lambda: check_finished_script(session, changes))
        stays = bool(session.staying())
    finally:
        session.scripts.pop()
        session.place, session.script_changes = outer, outer_changes
    if changes is not outer_changes:  # before others may write to the nodes, which they may once these are settled
        code = exit_code_of(session, lambda: changes.end(complete=not code)) or code
    if session.in_script:
        return code
    settled = _settled(session, code, stays=stays)
    return code or settled


def _settled(session: Conversation, code: int, *, stays: bool) -> int:
    """Restore the nodes' NMT states at the end of the outermost script; returns the exit code."""
    # after a failure (a difference is none) of which some stays, the set-up is neither old nor new: its nodes stay
    # PRE-OPERATIONAL
    half = code in (LeftChanged.exit_code, Bug.exit_code) or (stays and code not in (0, 3))
    return exit_code_of(session, lambda: session.end_line(7 if half else 0, alone=not code))


def _run_lines(
    session: Conversation, parsed: list[tuple[ScriptLine, click.Context]], source: str, *, keep_going: bool
) -> list[int]:
    """Run the lines; returns the exit codes of failures."""
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
    """Run a parsed line, and add it to the report if any; returns its exit code."""
    report = session.report
    if report is None:
        return run_line(session, ctx)
    ran = report.begin(source, line.number, _shown(session, line))
    code = run_line(session, ctx)
    report.end(ran, 0 if code == LEAVE else code)
    return code


def _report_unreadable(session: Conversation, source: str, lines: list[ScriptLine], wrong: DvtcliError) -> None:
    """Add all lines to the report: those with errors as failed, the others as not run."""
    assert session.report is not None  # noqa: S101
    faults: dict[str, DvtcliError] = {}
    for fault in (wrong, *wrong.others):
        faults.setdefault(fault.place or source, fault)
    for line in lines:
        place = f"{source}:{line.number}"
        words = _shown(session, line) if line.words else f"run {source}"
        session.report.left_out(source, line.number, words, faults.pop(place) if place in faults else None)
    for place, fault in faults.items():  # in scripts that this one runs
        file, _, number = place.rpartition(":")
        if number.isdecimal():
            session.report.left_out(file, int(number), f"run {file}", fault)


def _shown(session: Conversation, line: ScriptLine) -> str:
    """Return the line for a report; only the command if a passcode is possible."""
    text = " ".join(line.words)
    return line.words[0] if session.is_secret(text) else text
