"""Which object an SDO frame carries the value of (CiA 301, 7.2.4.3). Knows expedited transfers' frames only."""

from __future__ import annotations

from dvtcli.domain.ports import Frame

_REQUESTS, _ANSWERS = range(0x601, 0x680), range(0x581, 0x600)
_DOWNLOAD, _UPLOADED, _EXPEDITED = 1, 2, 2


def sdo_value_of(frame: Frame) -> tuple[int, int] | None:
    """Index and sub-index of the object whose value *frame* carries; None where it carries none."""
    if frame.extended or frame.remote or len(frame.data) < 8 or not frame.data[0] & _EXPEDITED:
        return None
    command = frame.data[0] >> 5
    carries = (frame.can_id in _REQUESTS and command == _DOWNLOAD) or (
        frame.can_id in _ANSWERS and command == _UPLOADED
    )
    return (int.from_bytes(frame.data[1:3], "little"), frame.data[3]) if carries else None
