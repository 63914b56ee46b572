"""Looking at real frames of TPDOs: start the node, give SYNC where needed, restore its state."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import Frame

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.session import Session

#: How long a frame is waited for, in seconds.
FRAME_TIMEOUT_S = 1.0

Look = tuple[tuple[str, Frame | None, float], ...]


def look(session: Session, node: Node, pdos: list[Pdo]) -> tuple[Look, str]:
    """A frame of each enabled one of *pdos*, and what was done to the node's state for that."""
    found = node.access.state()
    started = found is not NmtState.OPERATIONAL
    if started:
        session.consent(f"node {node.node_id} will be started for a moment, its machine may move; start it?")
        node.access.request(NmtState.OPERATIONAL)
    try:
        enabled = {pdo: config for pdo in pdos if (config := node.pdo(pdo)).enabled}
        frames = tuple(_frame(session, pdo, config) for pdo, config in enabled.items())
    finally:
        if started:
            node.access.request(NmtState.PRE_OPERATIONAL)
    return frames, "the node was started for this; its NMT state is restored" if started else ""


def _frame(session: Session, pdo: Pdo, config: PdoConfig) -> tuple[str, Frame | None, float]:
    cob_id, kind = config.communication.cob_id, config.communication.transmission_type
    began = time.monotonic()
    for _ in range(kind if kind is not None and 1 <= kind <= 240 else 1):
        if kind is not None and kind <= 240:
            session.bus.send(Frame(0x080, b""))
        listen_s = FRAME_TIMEOUT_S if kind is None or kind <= 1 or kind > 240 else 0.02
        for frame in session.bus.receive(listen_s):
            if frame.can_id == cob_id.can_id and frame.extended == cob_id.extended:
                return pdo.label, frame, (time.monotonic() - began) * 1000
    return pdo.label, None, (time.monotonic() - began) * 1000
