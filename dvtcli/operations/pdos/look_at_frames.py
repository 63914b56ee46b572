"""Check real frames of TPDOs: start the node, send SYNC if needed, restore its NMT state."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.operations.pdos.sync import sync_frame

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.operations.session.session import SessionNodes

#: How long a frame is waited for, and how long a heartbeat that tells the node's state, in seconds.
FRAME_TIMEOUT_S = 1.0
HEARTBEAT_S = 1.2

Look = tuple[tuple[str, Frame | None, float], ...]


def look(session: SessionNodes, node: ReadableNode, pdos: list[Pdo]) -> tuple[Look, str]:
    """Return a frame of each enabled PDO of *pdos*, and how the node's state was changed for it.

    Ctrl-C ends the check, but not the return to the initial state.
    """
    found = node.access.state()
    found = node.access.state(HEARTBEAT_S) if found is None else found
    started = found is not NmtState.OPERATIONAL
    with node.cancellation.deferred():
        if started:
            question = f"node {node.node_id} will be started for a moment, and its machine may move; start it?"
            session.consent(question, node.node_id)
            node.access.request(NmtState.OPERATIONAL)
        try:
            frames = tuple(_frames(session, node, pdos))
        finally:
            note = _return(node, found) if started else ""
    if node.cancellation.requested:
        text = f"stopped looking at frames; {note or 'the node is as before'}"
        raise node.cancellation.interrupted(text, node=node.node_id)
    return frames, note


def _return(node: ReadableNode, found: NmtState | None) -> str:
    """Return the node to its initial state; says so, or that the state was unknown."""
    if found is None:
        return (
            "the node was started for this and still runs: it told no state before (no heartbeat); nmt preop stops it"
        )
    if found is NmtState.STOPPED:
        node.bus.send_nmt(NmtCommand.STOP, node.node_id)
    else:
        node.access.insist(NmtState.PRE_OPERATIONAL)
    return "the node was started for this; its NMT state is restored"


def _frames(session: SessionNodes, node: ReadableNode, pdos: list[Pdo]) -> Look:
    enabled = {pdo: config for pdo in pdos if (config := node.pdo(pdo)).enabled}
    sync = sync_frame(node.sdo)
    asked = (enabled_pdo for enabled_pdo in enabled.items() if not node.cancellation.requested)
    return tuple(_frame(session, sync, pdo, config) for pdo, config in asked)


def _frame(session: SessionNodes, sync: Frame, pdo: Pdo, config: PdoConfig) -> tuple[str, Frame | None, float]:
    cob_id, kind = config.communication.cob_id, config.communication.transmission_type
    bus = session.bus
    began_s = bus.now_s()
    for _ in range(kind if kind is not None and 1 <= kind <= 240 else 1):
        if kind is not None and kind <= 240:
            bus.send(sync)
        listen_s = FRAME_TIMEOUT_S if kind is None or kind <= 1 or kind > 240 else 0.02
        for frame in bus.receive(listen_s):
            if frame.can_id == cob_id.can_id and frame.extended == cob_id.extended:
                return pdo.label, frame, (bus.now_s() - began_s) * 1000
    return pdo.label, None, (bus.now_s() - began_s) * 1000
