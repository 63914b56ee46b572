"""Recorded changes, of any process, present in a node but not stored by dvtcli. Writes nothing to the node."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

from dvtcli.device.wish import differences, unlike_values
from dvtcli.domain.plan import PdoChange, alters
from dvtcli.errors import InputFileError, SdoAborted, UsageError

if TYPE_CHECKING:
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.change_history import ChangeHistory
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.plan import Change


def held_unstored(node: ReadableNode, past: ChangeHistory, identity: Identity) -> Mapping[str, int]:
    """Labels of changes present in *node* and not known to be stored, each with its index.

    *past* is the history of the device with this *identity* (0x1018). Reads the node, to exclude changes lost by a
    restart or replaced by others. Empty if the file is damaged; the next change reports the damage.
    """
    return {
        label: change.steps[0].index
        for label, change in last_unstored(node, past, identity).items()
        if _is_held(node, change)
    }


def is_remembered(node: ReadableNode, past: ChangeHistory) -> bool:
    """True if *past* has a change of *node* not known to be stored; does not read the PDOs or objects."""
    return bool(last_unstored(node, past, node.identity()))


def last_unstored(node: NodeDescription, past: ChangeHistory, identity: Identity) -> dict[str, Change]:
    """The last recorded change of each PDO and object, if not stored; oldest first."""
    try:
        entries = past.all_of(node.node_id, identity)
    except InputFileError:
        return {}
    last: dict[str, Change | None] = {}
    for entry in entries:
        for change in entry.plan.changes:
            if alters(change) and node.profile.store.needed_for(change.steps[0].index):
                last.pop(change.label, None)
                last[change.label] = None if change.label in entry.stored else change
    return {label: change for label, change in last.items() if change is not None}


def _is_held(node: ReadableNode, change: Change) -> bool:
    with suppress(SdoAborted, UsageError):  # what cannot be read is not claimed
        if isinstance(change, PdoChange):
            return not list(differences(change.pdo, change.after, node.pdo(change.pdo)))
        place = change.step.index, change.step.sub_index
        return change.step.before is not None and not list(unlike_values(node, {place: change.step.after}))
    return False
