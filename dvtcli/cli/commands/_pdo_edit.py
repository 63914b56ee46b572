"""`pdo edit PDO`: a PDO as text in the user's own editor; what is saved goes the way of `map`."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from dvtcli.cli.params import EntryWord
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import DvtcliError, InputFileError, RuleError, SafetyRefusal, UsageError
from dvtcli.files.pdo_yaml import PdoText, Word, read_pdo_yaml, write_pdo_yaml, wrong_at
from dvtcli.operations.change import configure_pdo
from dvtcli.operations.results import Facts

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.device.node import Node
    from dvtcli.domain.mapping import PdoMappingEntry
    from dvtcli.domain.object_syntax import MappedObject, Skipped
    from dvtcli.domain.pdo import Pdo
    from dvtcli.operations.results import Changed


def edit(session: Conversation, node: Node, pdo: Pdo) -> Changed | Facts:
    """Open *pdo* in the editor until what is saved can be carried out, or is given up.

    SafetyRefusal without a terminal. A text that is wrong and was given up ends with the error's own exit code.
    """
    if session.in_script or not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise SafetyRefusal(
            "pdo edit opens an editor, and there is no terminal", hint="map and set do the same in scripts"
        )
    config = node.pdo(pdo)
    if config.mpdo is not None:
        raise UsageError(f"{pdo.label} is a multiplexed PDO, which is shown and never written", node=node.node_id)
    names = [_name(node, entry) for entry in config.mapping]
    before = text = write_pdo_yaml(pdo, config, names, f'node {node.node_id} "{node.title}"')
    while True:
        edited = _edited(text)
        if edited is None or edited == before:
            return _left(pdo)
        text = edited
        try:
            return _carried_out(session, node, pdo, read_pdo_yaml(text, pdo))
        except DvtcliError as wrong:
            if wrong.exit_code not in (2, 4) and not isinstance(wrong, RuleError):
                raise  # the device was asked: another text changes nothing about it
            session.output.error(wrong)
            if not session.output.ask("Edit it again?"):
                return _left(pdo, wrong.exit_code)


def _edited(text: str) -> str | None:
    """*text* as the user's editor leaves it; UsageError where there is no editor, or none that works."""
    try:
        return click.edit(text, extension=".yaml", require_save=False)
    except UnicodeDecodeError as wrong:
        raise InputFileError("what the editor saved is no UTF-8 text; the PDO is left as it is") from wrong
    except (click.ClickException, ValueError) as failed:
        why = failed.format_message() if isinstance(failed, click.ClickException) else f"$EDITOR: {failed}"
        raise UsageError(why, hint="EDITOR names your editor: EDITOR=nano dvtcli") from failed


def _left(pdo: Pdo, exit_code: int = 0) -> Facts:
    rows = (("pdo", str(pdo)), ("changed", False))
    return Facts("edit", rows, (f"{pdo.label} is left as it is.",), exit_code)


def _name(node: Node, entry: PdoMappingEntry) -> str:
    known = node.dictionary is not None and not entry.is_dummy
    return node.dictionary.display_name(entry.index, entry.sub_index) if known and node.dictionary else ""


def _carried_out(session: Conversation, node: Node, pdo: Pdo, asked: PdoText) -> Changed:
    want = PdoRequest(
        asked.cob_id, asked.transmission_type, asked.inhibit_time, asked.event_timer, asked.sync_start_value,
        asked.rtr_allowed, asked.extended, asked.enabled,
        objects=None if asked.mapping is None else tuple(_resolved(word, node) for word in asked.mapping),
    )  # fmt: skip
    return configure_pdo(session, node.node_id, pdo, want)


def _resolved(word: Word, node: Node) -> MappedObject | Skipped:
    try:
        return EntryWord(word.text).resolve(node)
    except UsageError as wrong:
        error = wrong_at(word.line, wrong.text)
        error.hint = wrong.hint
        raise error from wrong
