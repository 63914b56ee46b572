"""One line of a script: run, noted with what it changed, and in an atomic script answered by taking everything back.

Does not know how it was parsed, nor what comes after it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dvtcli.cli.boundary import LEAVE
from dvtcli.cli.run_line import boundary
from dvtcli.cli.scripts.atomic import does_other, final
from dvtcli.errors import DvtcliError, LeftChanged, Restarted, TakenBack

if TYPE_CHECKING:
    import click

    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.scripts.script_changes import ScriptChanges

_ALL_BACK = "rolled back: what the script changed is as it was, read back equal; nothing was stored"


def run_line(session: Conversation, ctx: click.Context) -> int:
    """Run a parsed line at `session.place` and answer its exit code; results and errors are shown on the way."""
    return boundary(session, lambda: _run_noted(session, ctx))


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
            _take_back(session, changes, failed)
        raise
    return code


def look_again(session: Conversation, changes: ScriptChanges) -> None:
    """All lines of an atomic script have worked: it fails all the same if a node lost what one of them had set.

    The outermost script looks once more when its nodes are in the NMT state in which they were found.
    """
    if not changes.atomic or changes.ended:
        return
    try:
        changes.look_again()
        if len(session.scripts) == 1:
            changes.return_nodes()
    except BaseException as failed:
        _take_back(session, changes, failed)
        raise


def _refuse_half(ctx: click.Context, changes: ScriptChanges, code: int) -> None:
    """A line of an atomic script that ended with *code* but raised nothing, as `verify` does, fails all the same."""
    if not changes.atomic or changes.ended:
        return
    failed = TakenBack(f"{ctx.info_name} ended with {code}: the script's changes are taken back")
    failed.exit_code = code
    raise failed


def _take_back(session: Conversation, changes: ScriptChanges, failed: BaseException) -> None:
    """Take the script's changes back because of *failed*, which learns of it; LeftChanged where some of them stay."""
    undone = changes.changed_anything()
    with session.cancellation.guard():
        try:
            changes.take_back(str(failed) or "interrupted", failed if isinstance(failed, LeftChanged) else None)
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
    """What *left* tells of twins: no node is changed, and a bus or node that is gone is what is wrong."""
    from dvtcli.operations.opening.lost_bus import read_in_vain

    left.state, left.state_text = "unchanged", None
    return read_in_vain(left)
