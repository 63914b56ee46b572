"""Frames for `-v` and `-vv`: each SDO in words, or every frame as bytes."""

from __future__ import annotations

from dvtcli.domain.abort import abort_text
from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.ports import Frame

_REQUEST, _ANSWER = 0x600, 0x580
#: start of an expedited value (bytes); segments of longer values start earlier
_VALUE = 4


def traffic_line(frame: Frame, verbose: int, *, sent: bool, secret: slice | None = None) -> str | None:
    """The line for *frame*: with *verbose* 1 only what begins or ends an SDO, from 2 on every frame.

    The bytes *secret* are not shown.
    """
    if verbose > 1:
        way = "->" if sent else "<-"
        kind = " remote" if frame.remote else ""
        length = frame.dlc if frame.remote else len(frame.data)
        hidden = range(8)[secret] if secret is not None else ()
        shown = " ".join("**" if at in hidden else f"{byte:02X}" for at, byte in enumerate(frame.data))
        return f"{way} {can_id_text(frame.can_id, extended=frame.extended)} [{length}]{kind} {shown}"
    base, node_id = frame.can_id & 0x780, frame.can_id & 0x7F
    if frame.extended or len(frame.data) < 8 or base not in (_REQUEST, _ANSWER):
        return None
    if secret is not None:
        return f"sdo {node_id}  {_object(frame.data)} <- (not shown)" if secret.start == _VALUE else None
    words = _request(frame.data) if base == _REQUEST else _answer(frame.data)
    return None if words is None else f"sdo {node_id}  {words}"


def _object(data: bytes) -> str:
    return f"0x{int.from_bytes(data[1:3], 'little'):04X}:{data[3]:02X}"


def _payload(data: bytes) -> str:
    """Return the bytes of an expedited transfer, or the length of a segmented transfer (CiA 301, 7.2.4.3)."""
    command = data[0]
    if not command & 2:
        return f"{int.from_bytes(data[4:8], 'little')} bytes in segments" if command & 1 else "in segments"
    size = 4 - (command >> 2 & 3) if command & 1 else 4
    return data[4 : 4 + size].hex(" ").upper()


def _request(data: bytes) -> str | None:
    match data[0] >> 5:
        case 1:
            return f"{_object(data)} <- {_payload(data)}"
        case 2:
            return f"{_object(data)} ?"
        case 4:
            return f"{_object(data)} aborted: {abort_text(int.from_bytes(data[4:8], 'little'))}"
    return None


def _answer(data: bytes) -> str | None:
    match data[0] >> 5:
        case 2:
            return f"{_object(data)} =  {_payload(data)}"
        case 3:
            return f"{_object(data)} written"
        case 4:
            code = int.from_bytes(data[4:8], "little")
            return f"{_object(data)} abort 0x{code:08X}: {abort_text(code)}"
    return None
