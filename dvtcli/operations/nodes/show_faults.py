"""Show a node's errors in words, read and received; clear its error history."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.error_history import clear_history, read_fault_list, read_history, read_register
from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.emergency_codes import emergency_remedy, emergency_text
from dvtcli.operations.results.nodes import FaultRow, Faults

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dvtcli.device.error_history import HistoryEntry
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.ports import ReceivedEmergency
    from dvtcli.operations.session.session_nodes import SessionNodes

_DEVICE_TYPE = 0x1000


def show_faults(session: SessionNodes, node_id: int | None = None) -> Faults:
    """Read the errors of node *node_id*, or the selected node, and add its received EMCY messages.

    Only reads, except for a family's own list, whose positions are selected by a write (not under --dry-run).
    """
    node = session.node(node_id)
    words = ErrorWords(node)
    own, history = node.profile.fault_list, read_history(node.sdo)
    active = () if own is None else read_fault_list(node.access, own, may_choose=not session.dry_run)
    if active and session.dry_run:
        session.reporter.note(
            "in a dry run the node's own list is read only where it stands: to choose a position is a write"
        )
    rows = [words.row("active", code) for code in active]
    rows += words.of_history(history or ())
    rows += [words.received(emergency) for emergency in node.bus.received_emergencies(node.node_id)]
    return Faults(
        node.node_id, node.profile.title, read_register(node.sdo), history is not None, tuple(rows),
        dry_run=session.dry_run,
    )  # fmt: skip


def clear_faults(session: SessionNodes, node_id: int | None = None) -> Faults:
    """Clear the error history of node *node_id*, or the selected node, and verify.

    Errors themselves stay: 0x6040 and all else that could move something is left alone. Raises as `clear_history`.
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
    """Error codes in words, by the family of *node* or the standard; None: unknown node."""

    def __init__(self, node: ReadableNode | None = None) -> None:
        self._known = {} if node is None else node.profile.faults
        self._device_type = None if node is None else read_optional(node.sdo, _DEVICE_TYPE, 0, 4)

    def row(self, source: str, code: int) -> FaultRow:
        """Describe *code* of *source*."""
        known = self._known.get(code)
        if known is not None:
            return FaultRow(source, code, known.text, known.remedy)
        if source == "active":
            return FaultRow(source, code, "an error of the maker's own list: its manual says which")
        return FaultRow(source, code, emergency_text(code, self._device_type), emergency_remedy(code))

    def of_history(self, history: Iterable[HistoryEntry]) -> list[FaultRow]:
        """Describe an error history."""
        return [replace(self.row("history", entry.code), information=entry.information) for entry in history]

    def received(self, one: ReceivedEmergency) -> FaultRow:
        """Describe a received message."""
        last = one.last
        return replace(
            self.row("heard", last.code), count=one.count, first_s=one.first_s, last_s=last.timestamp_s,
            register=last.register, manufacturer=last.manufacturer,
        )  # fmt: skip
