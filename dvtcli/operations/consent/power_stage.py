"""A drive whose power stage is on is not configured from a file. Reads the statusword, and writes nothing."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from dvtcli.device.seen_state import STATUSWORDS
from dvtcli.domain.drive_state import drive_state
from dvtcli.errors import SafetyRefusal, SdoAborted
from dvtcli.operations.consent.reset_consent import commanded

if TYPE_CHECKING:
    from dvtcli.operations.session.session import Session

#: states of CiA 402-2, 8.4.2 in which the power stage has its supply
_ON = frozenset({"switched on", "operation enabled", "quick stop active", "fault reaction active"})


def refuse_powered(session: Session, node_ids: Iterable[int]) -> None:
    """SafetyRefusal where the statusword of an axis of *node_ids* (0x6041, 0x6841, …) says that its power stage is on.

    A drive of this process comes up as its EDS says, which may be enabled: it counts once this session commanded it.
    """
    for node_id in node_ids:
        if session.bus.simulated and not commanded(session, node_id):
            continue
        for index, sub_index in STATUSWORDS:
            _refuse_axis(session, node_id, index, sub_index)


def _refuse_axis(session: Session, node_id: int, index: int, sub_index: int) -> None:
    try:
        data = session.bus.sdo(node_id).upload(index, sub_index)
    except SdoAborted:
        return  # no axis, or one that does not tell
    statusword = int.from_bytes(data, "little")
    state = drive_state(statusword)
    if state in _ON:
        raise SafetyRefusal(
            f"the power stage of node {node_id} is on: {state} (0x{index:04X} is 0x{statusword:04X})", node=node_id,
            hint="bring the machine to a stand, then 6040 = 0; a file is written to a drive that cannot move",
        )  # fmt: skip
