"""Frames that nodes act on, in words, for whoever loses the bus before it shows that they did.

Does not know SDO, nor who sent a frame.
"""

from __future__ import annotations

from dvtcli.domain.lss_services import (
    ACTIVATE_BIT_TIMING,
    CONFIGURE_BIT_TIMING,
    CONFIGURE_NODE_ID,
    REQUEST_ID,
    STORE_CONFIGURATION,
)
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame

_NMT_CAN_ID = 0x000
#: what an LSS master asks that changes a slave (CiA 305); to find and to select slaves changes none
_LSS = {
    CONFIGURE_NODE_ID: "LSS configure node-ID",
    CONFIGURE_BIT_TIMING: "LSS configure bit timing",
    ACTIVATE_BIT_TIMING: "LSS activate bit timing",
    STORE_CONFIGURATION: "LSS store configuration",
}


def act_of(frame: Frame) -> str | None:
    """What *frame* makes nodes do, None where it only asks."""
    if frame.remote:
        return None
    if frame.can_id == REQUEST_ID:
        return _LSS.get(frame.data[0]) if frame.data else None
    if frame.can_id == _NMT_CAN_ID and len(frame.data) == 2 and frame.data[0] in list(NmtCommand):
        return command_text(NmtCommand(frame.data[0]), frame.data[1])
    return f"frame 0x{frame.can_id:03X}"


def command_text(command: NmtCommand, node_id: int) -> str:
    """An NMT *command* to *node_id*, or to all nodes with 0."""
    return f"NMT {command.word} to {f'node {node_id}' if node_id else 'all nodes'}"
