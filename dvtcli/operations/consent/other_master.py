"""Detect another master on the bus: foreign NMT, LSS and SDO requests. Sends nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.session.session_nodes import SessionNodes

#: How long the bus is listened to before several nodes are written to, in seconds.
LISTEN_S = 2.0
_NMT, _LSS_MASTER = 0x000, 0x7E5
_SDO_REQUESTS = range(0x601, 0x680)


def refuse_other_master(session: SessionNodes) -> None:
    """Record the bus for `LISTEN_S`; raises SafetyRefusal for a foreign request, unless forced.

    Skipped if nobody else can be there: nodes of this process, twins, an interface without frames.
    """
    bus = session.bus
    if session.dry_run or session.options.force or bus.simulated or not bus.carries_frames:
        return
    session.tell.progress(f"listening for another master, {LISTEN_S:g} s", 0, 0)
    for frame in bus.receive(LISTEN_S):
        said = _request(frame)
        if said:
            raise SafetyRefusal(
                f"another master is active: {said} was received",
                why=f"0x{frame.can_id:03X} [{len(frame.data)}] {frame.data.hex(' ').upper()}",
                hint=Hint(Action.FORCE, why="stop it while the network is changed; {} goes on beside it"),
            )


def _request(frame: Frame) -> str:
    """Describe *frame* as a master's request; empty if it is none."""
    if frame.extended or frame.remote:
        return ""
    if frame.can_id == _NMT:
        return "an NMT command"
    if frame.can_id == _LSS_MASTER:
        return "an LSS command"
    return f"an SDO request to node {frame.can_id - 0x600}" if frame.can_id in _SDO_REQUESTS else ""
