"""`edit`: the screen, then the change in the main thread, then the screen again."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from dvtcli.cli.editor.editor import APPLY, Editor
from dvtcli.cli.screen.full_screen import has_full_screen
from dvtcli.cli.view.answers.change_lines import kept_text
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.text import plural
from dvtcli.errors import DvtcliError, SafetyRefusal, UsageError, ended_with
from dvtcli.operations.pdos.edit_pdos import apply_edited

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.pdo_params import NodePdo
    from dvtcli.domain.pdo import Pdo
    from dvtcli.operations.results import Changed

#: exit codes after which the node was asked in vain, or is not what it was, or a signal came: no screen again
_ENDS = frozenset({5, 7, 129, 130, 143})
_NOT_WHAT_IT_WAS = ("unknown", "left_changed")


def edit(session: Conversation, pdo: NodePdo | None) -> None:
    """Show the editor of the PDO's node, or the selected node, until the user leaves; writes what is applied.

    Raises SafetyRefusal without a terminal, and errors of a change that leaves the node unknown or changed.
    """
    if not has_full_screen(session):
        raise SafetyRefusal("edit is a full screen, and there is no terminal", hint="map and set do the same in lines")
    session.keep_frames()
    node = session.node(None if pdo is None else pdo.node_id)
    chosen = None if pdo is None else pdo.pdo
    if chosen is not None and chosen not in node.pdos():
        raise UsageError(
            f"node {node.node_id} has no {chosen.label}", hint=Hint(Action.SHOW_PDOS, why="shows those that it has")
        )
    editor = Editor(session, node, chosen)
    while editor.run() == APPLY:
        changed = editor.pdos.changed()
        try:
            result = apply_edited(session, editor.node, editor.pdos.held, changed)
        except DvtcliError as failed:
            if failed.exit_code in _ENDS or failed.state in _NOT_WHAT_IT_WAS or session.cancellation.requested:
                raise
            session.output.error(failed)
            editor.say(f"not applied: {error_text(failed)}", bad=True)
        else:
            session.output.result(result)
            editor.say(_said(result, changed))
        session.cancellation.release()
        if session.cancellation.requested:  # asked for when the change was complete already
            ended = ended_with(session.cancellation.exit_code, "edit was ended by a signal", state="left_changed")
            ended.state_text = "applied changes were read back, and stay"
            raise ended
        if note := editor.pdos.read_again(node.pdos()):
            editor.say(f"{editor.view.message}; {note}", bad=True)
    if left := editor.pdos.changed():
        session.reporter.note(f"{', '.join(pdo.label for pdo in left)} left as it was")


def _said(result: Changed, changed: Collection[Pdo]) -> str:
    labels = ", ".join(pdo.label for pdo in changed)
    if result.dry_run:
        return f"dry run: {labels} would be set with {plural(len(result.plan), 'write')}, nothing was written"
    return f"{labels} set: {plural(len(result.plan), 'write')}, read back equal. {kept_text(result)}"
