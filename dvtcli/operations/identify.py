"""What a node says of itself: device type, identity, name; shared by `node`, `scan` and `require`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_identity, read_optional
from dvtcli.errors import DvtcliError, SdoAborted
from dvtcli.operations.results import NodeRow

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.ports import SdoTransport


def device_name(sdo: SdoTransport) -> str:
    """The manufacturer's device name (0x1008), empty where there is none."""
    try:
        return sdo.upload(0x1008, 0).rstrip(b"\0").decode("latin-1")
    except SdoAborted:
        return ""


def identify(node: Node) -> NodeRow:
    """Everything `node` shows."""
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
