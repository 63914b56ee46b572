"""What a node says of itself: device type, identity, name; shared by `node`, `scan` and `require`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_identity, read_optional
from dvtcli.errors import DvtcliError, SdoAborted
from dvtcli.operations.results import NodeListing, NodeRow

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.ports import SdoTransport
    from dvtcli.operations.session.session import Session


def device_name(sdo: SdoTransport) -> str:
    """The manufacturer's device name (0x1008), empty where there is none."""
    try:
        return sdo.upload(0x1008, 0).rstrip(b"\0").decode("latin-1")
    except SdoAborted:
        return ""


def identify(session: Session, node_id: int | None = None) -> NodeListing:
    """Ask a node what it is: *node_id*, which is selected then, or the selected one.

    UsageError where none is selected, NoAnswer where it is silent.
    """
    if node_id is not None and not session.in_script:
        session.network.accept(node_id)
    row = _row(session.node(node_id))
    if node_id is not None:
        session.selected = node_id
    return NodeListing(session.bus.name, (row,), detail=True)


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
