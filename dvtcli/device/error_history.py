"""The errors of one device: error register, error history and family fault list (CiA 301, 7.5.2.2, 7.5.2.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import ABSENT, read_number, read_optional
from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.objects import ERROR_FIELD, ERROR_REGISTER
from dvtcli.errors import DeviceRefused, DvtcliError, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.nmt_gate import NodeAccess
    from dvtcli.domain.ports import SdoTransport
    from dvtcli.domain.profile import FaultList

#: what a field of the history answers that holds no error, besides that it does not exist
_EMPTY = ABSENT | {Abort.NO_DATA, 0x0800_0024}


@dataclass(frozen=True, slots=True)
class HistoryEntry:
    """A standard error field: the error *code*, and the manufacturer's addition in the upper 16 bits."""

    code: int
    information: int


def read_register(sdo: SdoTransport) -> int | None:
    """The error register (0x1001), None if the device has none."""
    return read_optional(sdo, ERROR_REGISTER, 0, 1)


def read_history(sdo: SdoTransport) -> tuple[HistoryEntry, ...] | None:
    """The error history (0x1003), newest first; None if the device has none."""
    count = read_optional(sdo, ERROR_FIELD, 0, 1)
    if count is None:
        return None
    entries = []
    for number in range(1, count + 1):
        try:
            raw = read_number(sdo, ERROR_FIELD, number, 4)
        except SdoAborted as aborted:
            if aborted.code in _EMPTY:  # the count exceeds the entries
                break
            raise
        entries.append(HistoryEntry(raw & 0xFFFF, raw >> 16))
    return tuple(entries)


def clear_history(access: NodeAccess) -> tuple[HistoryEntry, ...]:
    """Clear the error history (0 to 0x1003:00), verify, and return the former entries.

    Raises DeviceRefused if the device has no history, SdoAborted if the device refuses, DvtcliError if entries remain.
    """
    sdo, place = access.bus.sdo(access.node_id), f"{ERROR_FIELD:04X}:00"
    before = read_history(sdo)
    if before is None:
        raise _nothing_to_clear(access)
    try:
        sdo.download(ERROR_FIELD, 0, b"\0")
    except SdoAborted as aborted:
        access.explain(aborted)
        raise
    after = read_history(sdo)
    if after:
        codes = ", ".join(f"0x{entry.code:04X}" for entry in after)
        raise DvtcliError(
            f"the error history of node {access.node_id} was cleared, but has {codes}",
            node=access.node_id,
            place=place,
            why="the device did not empty it" if after == before else "the error occurred again",
            hint=Hint(Action.SHOW_FAULTS, why="shows the errors; remove their causes first"),
            state="unchanged" if after == before else "unknown",
        )
    return before


def _nothing_to_clear(access: NodeAccess) -> DeviceRefused:
    own = access.profile.fault_list
    what = "see its manual for clearing errors"
    if own is not None:
        what = f"its own list (0x{own.code[0]:04X}) lists the present errors; an error disappears with its cause"
    return DeviceRefused(
        f"node {access.node_id} has no error history to clear",
        node=access.node_id,
        place=f"{ERROR_FIELD:04X}:00",
        abort=int(Abort.NO_OBJECT),
        why="it has no 0x1003",
        hint=what,
    )


def read_fault_list(access: NodeAccess, own: FaultList, *, may_choose: bool) -> tuple[int, ...]:
    """The codes in the family's *own* fault list, in its order.

    Reading writes a position selector, restored afterwards; without *may_choose* only the code at the selected position
    is read.
    """
    sdo = access.bus.sdo(access.node_id)
    count = read_optional(sdo, *own.count, 2)
    if not count:
        return ()
    if not may_choose:
        return (read_number(sdo, *own.code, 2),)
    before = sdo.upload(*own.position)
    try:
        return tuple(_at(sdo, own, position, len(before)) for position in range(count))
    finally:
        sdo.download(*own.position, before)


def _at(sdo: SdoTransport, own: FaultList, position: int, size: int) -> int:
    sdo.download(*own.position, position.to_bytes(size, "little"))
    return read_number(sdo, *own.code, 2)
