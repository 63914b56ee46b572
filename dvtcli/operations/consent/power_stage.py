"""Refuse to configure a drive with an enabled power stage from a file. Reads the statusword."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from dvtcli.device.seen_state import STATUSWORDS
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.process_data import drive_state
from dvtcli.domain.rules.finding import WARNING, Rule, warning
from dvtcli.errors import SafetyRefusal, SdoAborted

if TYPE_CHECKING:
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.operations.session.session_nodes import SessionNodes

#: states of CiA 402-2, 8.4.2 with a supplied power stage
_ON = frozenset({"switched on", "operation enabled", "quick stop active", "fault reaction active"})


RULES = (
    Rule("power-stage-on", WARNING, "a file is to be written to a drive whose power stage is on: `apply` refuses",
         "the statusword of each axis; CiA 402-2, 8.4.2"),
)  # fmt: skip
#: a controlword is right before its statusword (CiA 402-2), for further axes as well
_CONTROLWORD = -1


def refuse_powered(session: SessionNodes, node_ids: Iterable[int]) -> None:
    """Raises SafetyRefusal if a statusword (0x6041, 0x6841, …) of *node_ids* shows an enabled power stage."""
    for node_id in node_ids:
        for index, _, state in _powered(session, node_id):
            off = Hint(
                Action.WRITE, {"object": f"{index + _CONTROLWORD:04X}", "value": 0},
                "bring the machine to a stand, then {}; a file is written to a drive that cannot move",
            )  # fmt: skip
            raise SafetyRefusal(f"the power stage of node {node_id} is {state}", node=node_id, hint=off)


def powered_findings(session: SessionNodes, node_id: int) -> tuple[Finding, ...]:
    """Report, when planning, each axis whose power stage would make `refuse_powered` refuse."""
    return tuple(
        warning("power-stage-on", place, f"the power stage is {state}: apply refuses to write until it is off")
        for _, place, state in _powered(session, node_id)
    )


def _powered(session: SessionNodes, node_id: int) -> Iterator[tuple[int, str, str]]:
    """Yield statuswords with an enabled power stage: index, place, meaning."""
    for index, sub_index in STATUSWORDS:
        try:
            data = session.bus.sdo(node_id).upload(index, sub_index)
        except SdoAborted:
            continue  # no axis, or one that does not tell
        statusword = int.from_bytes(data, "little")
        state = drive_state(statusword)
        if state in _ON:
            yield index, f"0x{index:04X}:{sub_index:02X}", f"on: {state} (0x{index:04X} is 0x{statusword:04X})"
