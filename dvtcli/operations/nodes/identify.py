"""What a node says of itself: device type, identity, name; shared by `node`, `scan` and `require`."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import ABSENT, IDENTITY, read_identity, read_optional
from dvtcli.domain.abort import Abort
from dvtcli.errors import DvtcliError, SdoAborted
from dvtcli.operations.results import NodeListing, NodeRow

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.ports import SdoTransport
    from dvtcli.operations.session.session import Session


def device_name(sdo: SdoTransport) -> str:
    """The manufacturer's device name (0x1008), empty if there is none, or its upload is aborted twice.

    It takes segments: a device may abort these for a reason that has passed by now.
    """
    for _ in range(2):
        try:
            return sdo.upload(0x1008, 0).rstrip(b"\0").decode("latin-1")
        except SdoAborted as aborted:
            if aborted.code in ABSENT:
                break
    return ""


class SaidOfItself:
    """What the node of *row* said of its identity (0x1018), read like its SDO channel; the rest it refuses."""

    def __init__(self, row: NodeRow) -> None:
        parts = enumerate((row.vendor_id, row.product_code, row.revision, row.serial), 1)
        self._node = row.node
        self._said = {(IDENTITY, sub): part.to_bytes(4, "little") for sub, part in parts if part is not None}

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """What it said; SdoAborted where it said nothing."""
        del timeout_s, retries
        if (index, sub_index) not in self._said:
            raise SdoAborted(index, sub_index, Abort.NO_OBJECT, node=self._node)
        return self._said[index, sub_index]


def identify(session: Session, node_id: int | None = None) -> NodeListing:
    """Ask a node what it is: *node_id*, which is selected then, or the selected one.

    UsageError where none is selected, NoAnswer where it is silent.
    """
    if node_id is not None and not session.in_script:
        session.network.accept(node_id)
    row = _described(session, _row(session.node(node_id)))
    if node_id is not None:
        session.selected = node_id
    return NodeListing(session.bus.name, (row,), detail=True)


def _described(session: Session, row: NodeRow) -> NodeRow:
    """*row* with why its file describes the node."""
    chosen = session.network.files.choice(row.node)
    if chosen is None or chosen.path.name != row.source:
        return row
    return replace(row, eds_why=chosen.why, eds_note=chosen.note)


def _row(node: Node) -> NodeRow:
    sdo = node.sdo
    vendor, product, revision, serial = (read_identity(sdo, sub) for sub in (1, 2, 3, 4))
    state = node.access.state()
    return NodeRow(
        node.node_id, state.label if state is not None else "state unknown", read_optional(sdo, 0x1000, 0, 4),
        vendor, product, revision, serial, device_name(sdo), node.profile.name,
        node.dictionary.source if node.dictionary else "",
    )  # fmt: skip


def silent(node_id: int, error: DvtcliError, state: str) -> NodeRow:
    """A node that was heard but does not answer SDO, or answers nonsense."""
    return NodeRow(node_id, state, note=error.text)
