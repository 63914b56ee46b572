"""`pdo edit PDO`: edit a PDO as text in the user's editor, then apply it like `map`."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from dvtcli.errors import DvtcliError, InputFileError, RuleError, SafetyRefusal, UsageError
from dvtcli.interpreter import changed_variables
from dvtcli.operations.pdos.edit_pdos import configure_from_text, pdo_as_text, save_text
from dvtcli.operations.results import Facts

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.domain.pdo import Pdo
    from dvtcli.operations.results import Changed


def edit(session: Conversation, pdo: Pdo, node_id: int | None) -> Changed | Facts:
    """Open *pdo* in the editor until the saved text is valid, or the user gives up.

    Raises SafetyRefusal without a terminal. After giving up, the error of the text remains.
    """
    if session.in_script or not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise SafetyRefusal(
            "pdo edit opens an editor, and there is no terminal", hint="map and set do the same in scripts"
        )
    before = text = pdo_as_text(session, pdo, node_id)
    while True:
        edited = _edited(text)
        if edited is None or edited == before:
            return _left(pdo)
        text = edited
        try:
            return configure_from_text(session, pdo, text, node_id, seen=before)
        except DvtcliError as wrong:
            if wrong.exit_code not in (2, 4) and not isinstance(wrong, RuleError):
                wrong.details.append(("edited", save_text(pdo, text)))
                raise  # the device was asked: another text changes nothing about it
            session.output.error(wrong)
            if not session.output.ask("Edit it again?"):
                return _left(pdo, wrong)


def _edited(text: str) -> str | None:
    """Return *text* after editing. Raises UsageError if no editor works."""
    try:
        return click.edit(text, env=changed_variables(), extension=".yaml", require_save=False)
    except UnicodeDecodeError as wrong:
        raise InputFileError("the saved file is not UTF-8 text; the PDO is unchanged") from wrong
    except (click.ClickException, ValueError) as failed:
        why = failed.format_message() if isinstance(failed, click.ClickException) else f"$EDITOR: {failed}"
        raise UsageError(why, hint="EDITOR names your editor: EDITOR=nano dvtcli") from failed


def _left(pdo: Pdo, wrong: DvtcliError | None = None) -> Facts:
    rows = (("pdo", str(pdo)), ("changed", False))
    return Facts("edit", rows, (f"{pdo.label} is not changed.",), wrong)
