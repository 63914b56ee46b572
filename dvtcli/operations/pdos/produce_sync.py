"""Send SYNC, and list the frames in response."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import Frame
from dvtcli.domain.text import join_some
from dvtcli.operations.pdos.sync import DEFAULT, sync_frame
from dvtcli.operations.results import Synced

if TYPE_CHECKING:
    from dvtcli.operations.session.session import SessionNodes

#: How long frames are waited for after the last SYNC, in seconds.
_LISTEN_S = 0.05


def produce_sync(session: SessionNodes, count: int = 1, period_s: float = 0.02, node_id: int | None = None) -> Synced:
    """Send *count* SYNC messages, *period_s* seconds apart, and list frames of synchronous PDOs.

    The CAN-ID is by 0x1005 of the node *node_id* (None: the selected node), 0x080 if there is none.
    """
    seen: dict[int, tuple[Frame, int]] = {}
    bus = session.bus
    selected = session.selected_id() if node_id is None else node_id
    sync = DEFAULT if selected is None else sync_frame(bus.sdo(selected))
    began = time.monotonic()
    for number in range(count):
        bus.send(sync)
        due = began + (number + 1) * period_s
        for frame in bus.receive(_LISTEN_S if number == count - 1 else max(0.0, due - time.monotonic())):
            if 0x181 <= frame.can_id <= 0x57F or 0x680 <= frame.can_id < 0x700 or frame.extended:
                seen[frame.can_id] = (frame, seen.get(frame.can_id, (frame, 0))[1] + 1)
    labels = _labels(session)
    rows = tuple((frame, number, labels.get(can_id, "")) for can_id, (frame, number) in sorted(seen.items()))
    return Synced(
        count, period_s * 1000, rows, session.dry_run, sync.can_id, extended=sync.extended, note=_held_back(session)
    )


def _held_back(session: SessionNodes) -> Hint | str:
    """Report nodes that send no PDOs as the script keeps them PRE-OPERATIONAL."""
    held = [node.node_id for node in session.network.nodes.values() if node.gate.found is not None]
    if not held:
        return ""
    named = join_some(f"node {node_id}" for node_id in held)
    return Hint(
        Action.START_NODE,
        why=f"{named} sent none: this script changes PDOs, so it stays PRE-OPERATIONAL until the last line; "
        "{} before sync starts it now",
    )


def _labels(session: SessionNodes) -> dict[int, str]:
    """Map CAN-IDs to the TPDOs of nodes read so far."""
    return {
        config.communication.cob_id.can_id: f"{pdo.label} node {node.node_id}"
        for node in session.network.nodes.values()
        for pdo, config in {**node.last_read, **node.wanted}.items()
        if pdo.is_tpdo and config.enabled
    }
