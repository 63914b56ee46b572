"""The errors of a node in words: what it holds, and what was heard of it; emptying its history."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.error_history import clear_history, read_fault_list, read_history, read_register
from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.emergency_codes import emergency_remedy, emergency_text
from dvtcli.operations.results.node_errors import FaultRow, Faults

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dvtcli.device.error_history import HistoryEntry
    from dvtcli.device.node import Node
    from dvtcli.domain.ports import HeardEmergency
    from dvtcli.operations.session.session import Session

_DEVICE_TYPE = 0x1000


def show_faults(session: Session, node_id: int | None = None) -> Faults:
    """What node *node_id*, or the selected one, says of its errors, and the EMCY messages that were heard of it.

    Only reads, but for a family's own list, of which each position is chosen by a write (not under --dry-run).
    """
    node = session.node(node_id)
    words = ErrorWords(node)
    own, history = node.profile.fault_list, read_history(node.sdo)
    active = () if own is None else read_fault_list(node.access, own, may_choose=not session.dry_run)
    if active and session.dry_run:
        session.tell.note(
            "in a dry run the node's own list is read only where it stands: to choose a position is a write"
        )
    rows = [words.row("active", code) for code in active]
    rows += words.of_history(history or ())
    rows += [words.heard(emergency) for emergency in node.bus.heard_emergencies(node.node_id)]
    return Faults(
        node.node_id, node.profile.title, read_register(node.sdo), history is not None, tuple(rows),
        dry_run=session.dry_run,
    )  # fmt: skip


def clear_faults(session: Session, node_id: int | None = None) -> Faults:
    """Empty the error history of node *node_id*, or of the selected one, and read back that it is empty.

    What is wrong stays wrong: 0x6040 and all else that could move something is left alone. Raises as `clear_history`.
    """
    node = session.node(node_id)
    words = ErrorWords(node)
    with session.cancellation.guard():
        before = clear_history(node.access)
    rows = tuple(words.of_history(before))
    return Faults(
        node.node_id, node.profile.title, read_register(node.sdo), True, rows, cleared=True, dry_run=session.dry_run
    )  # fmt: skip


class ErrorWords:
    """Error codes of one node in words: as its family says, else as the standard does; *node* None: nobody is known."""

    def __init__(self, node: Node | None = None) -> None:
        self._known = {} if node is None else node.profile.faults
        self._device_type = None if node is None else read_optional(node.sdo, _DEVICE_TYPE, 0, 4)

    def row(self, source: str, code: int) -> FaultRow:
        """*code* as *source* has it."""
        known = self._known.get(code)
        if known is not None:
            return FaultRow(source, code, known.text, known.remedy)
        if source == "active":
            return FaultRow(source, code, "an error of the maker's own list: its manual says which")
        return FaultRow(source, code, emergency_text(code, self._device_type), emergency_remedy(code))

    def of_history(self, history: Iterable[HistoryEntry]) -> list[FaultRow]:
        """The entries of an error history."""
        return [replace(self.row("history", entry.code), information=entry.information) for entry in history]

    def heard(self, one: HeardEmergency) -> FaultRow:
        """Messages that were heard."""
        last = one.last
        return replace(
            self.row("heard", last.code), count=one.count, first_s=one.first_s, last_s=last.timestamp_s,
            register=last.register, manufacturer=last.manufacturer,
        )  # fmt: skip
