"""Observe a node: its NMT state, especially after an NMT command, and its error control. Sends no command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from dvtcli.device.nmt_gate import NodeAccess
from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.abort import Abort
from dvtcli.domain.can_ids import HEARTBEAT_BASE
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.objects import (
    CONSUMER_HEARTBEAT,
    GUARD_TIME,
    LIFE_TIME_FACTOR,
    LOGICAL_DEVICE,
    PRODUCER_HEARTBEAT,
)
from dvtcli.domain.ports import CanopenBus, Frame
from dvtcli.domain.process_data import drive_state
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError

if TYPE_CHECKING:
    from dvtcli.domain.ports import SdoReader

STATUSWORD = (0x6041, 0)
#: How many axes a drive may have (CiA 402-2, 6.2).
_AXES = 8
#: What tells the state of an axis, of each of them.
STATUSWORDS = tuple((STATUSWORD[0] + axis * LOGICAL_DEVICE, STATUSWORD[1]) for axis in range(_AXES))
#: What commands an axis to enable its operation, of each of them.
CONTROLWORDS = frozenset((0x6040 + axis * LOGICAL_DEVICE, 0) for axis in range(_AXES))
#: Longest wait for a sign of life that confirms a state, where nothing says when the next one comes, in seconds.
CONFIRM_S = 1.5
#: How long a node may take to answer a node guarding request, in seconds.
GUARD_S = 0.2
#: Aborts of an object that is there: it cannot be read now, or in this state.
_NOT_NOW = frozenset({Abort.TIME_OUT, Abort.CANNOT_STORE, Abort.LOCAL_CONTROL, Abort.DEVICE_STATE})
#: Longest wait for a heartbeat of a node that was not commanded, in seconds.
_LISTEN_S = 10.0
#: What a heartbeat may be late, in seconds.
_LATE_S = 0.5


def seen_state(access: NodeAccess, wanted: NmtState) -> NmtState | None:
    """The observed state of a node just commanded to *wanted*; None if unobservable.

    By boot-up, heartbeat or the family's state object; waits for a slow heartbeat (0x1017). By node guarding only
    without heartbeats and without life guarding, which the first request would start (CiA 301, 7.2.8.3.2.1).
    """
    return _settled(access, wanted, access.confirmed(wanted, CONFIRM_S))


def _settled(access: NodeAccess, wanted: NmtState, state: NmtState | None) -> NmtState | None:
    """The state observed in the `CONFIRM_S` after *state* (None: no state so far)."""
    if state is wanted or (state is None and wanted is NmtState.STOPPED):
        return state  # a stopped node answers no SDO: it cannot be asked how it could be seen
    period_s = _heartbeat_s(access)
    if period_s:
        longer_s = 2 * period_s + _LATE_S - CONFIRM_S
        return access.confirmed(wanted, longer_s) if longer_s > 0 else state
    return _guarded(access) if state is None and period_s == 0 else state


def present_state(access: NodeAccess) -> NmtState | None:
    """The present state of a node without a command; None if unobservable.

    If no state was received and no object has it, waits for the next heartbeat (for the time in 0x1017), or sends a
    single node guarding request, as `seen_state` does.
    """
    state = access.state()
    if state is not None:
        return state
    period_s = _heartbeat_s(access)
    if period_s:
        return access.bus.nmt_state(access.node_id, min(2 * period_s + _LATE_S, _LISTEN_S))
    return _guarded(access) if period_s == 0 else None


def _heartbeat_s(access: NodeAccess) -> float | None:
    """The heartbeat period (s), 0 for none; None without an answer."""
    try:
        return (read_optional(access.bus.sdo(access.node_id), PRODUCER_HEARTBEAT, 0, 2) or 0) / 1000
    except (NoAnswer, SdoAborted, SdoProtocolError):
        return None  # not to be asked is no state either: the caller says "not confirmed"


def _guarded(access: NodeAccess) -> NmtState | None:
    """The answer to one node guarding request; None if forbidden or unanswered."""
    bus, sdo = access.bus, access.bus.sdo(access.node_id)
    try:
        life = [read_optional(sdo, index, 0, 2) or 0 for index in (GUARD_TIME, LIFE_TIME_FACTOR)]
    except (NoAnswer, SdoAborted, SdoProtocolError):
        return None
    if all(life) or not bus.carries_remote_frames:
        return None
    bus.send(Frame(HEARTBEAT_BASE + access.node_id, b"", remote=True))
    deadline_s = bus.now_s() + GUARD_S
    while (state := bus.nmt_state(access.node_id)) is None and bus.now_s() < deadline_s:
        bus.sleep(0.005)
    return state


def seen_states(accesses: Mapping[int, NodeAccess], wanted: NmtState) -> dict[int, NmtState | None]:
    """As `seen_state` for many nodes commanded at once, with a common wait."""
    if not accesses:
        return {}
    bus = next(iter(accesses.values())).bus
    deadline_s = bus.now_s() + CONFIRM_S
    by_heartbeat = [node_id for node_id, access in accesses.items() if access.profile.state_object is None]
    while bus.now_s() < deadline_s and any(bus.nmt_state(node_id) is not wanted for node_id in by_heartbeat):
        bus.sleep(0.005)
    return {
        node_id: _settled(access, wanted, bus.nmt_state(node_id))
        if node_id in by_heartbeat
        else seen_state(access, wanted)
        for node_id, access in accesses.items()
    }


def why_it_may_move(bus: CanopenBus, node_id: int) -> str:
    """Why a reset of *node_id* may release a motor: an axis is "operation enabled", or unknown; else empty.

    A drive has up to eight axes (CiA 402-2, 6.2). Each is read with the usual retries, since one lost
    answer does not mean standstill; a STOPPED node answers no SDO and is not asked.
    """
    if bus.nmt_state(node_id) is NmtState.STOPPED:
        return "is STOPPED, so its statusword cannot be read"
    for axis in range(_AXES):
        index = STATUSWORD[0] + axis * LOGICAL_DEVICE
        try:
            data = bus.sdo(node_id).upload(index, STATUSWORD[1])
        except SdoAborted as aborted:
            if aborted.code in _NOT_NOW:
                return f"does not show whether its operation is enabled (0x{index:04X}: abort 0x{aborted.code:08X})"
            continue
        except (NoAnswer, SdoProtocolError):
            return f"does not answer a read of its statusword (0x{index:04X})"
        statusword = int.from_bytes(data, "little")
        if drive_state(statusword) == "operation enabled":
            return f"has operation enabled (0x{index:04X} is 0x{statusword:04X})"
    return ""


def heartbeat_ms(sdo: SdoReader) -> int | None:
    """The producer heartbeat time in ms (0x1017); 0 for none, None without the object."""
    return read_optional(sdo, PRODUCER_HEARTBEAT, 0, 2)


def heartbeat_slots(sdo: SdoReader) -> dict[int, int]:
    """The entries of the node's 0x1016 by sub-index; empty without the object."""
    count = read_optional(sdo, CONSUMER_HEARTBEAT, 0, 1) or 0
    held = {sub_index: read_optional(sdo, CONSUMER_HEARTBEAT, sub_index, 4) for sub_index in range(1, count + 1)}
    return {sub_index: value for sub_index, value in held.items() if value is not None}


def is_guarded(sdo: SdoReader) -> bool:
    """True if the node is guarded: its life time, 0x100C times 0x100D, is not 0 (CiA 301, 7.5.2.11 and 7.5.2.12)."""
    return bool((read_optional(sdo, GUARD_TIME, 0, 2) or 0) * (read_optional(sdo, LIFE_TIME_FACTOR, 0, 1) or 0))
