"""A frame's service by its CAN-ID (CiA 301, 7.3.3: the pre-defined connection set).

For the devices' real configuration see `decoder`.
"""

from __future__ import annotations

from typing import NamedTuple

from dvtcli.domain.can_ids import (
    EMCY_BASE,
    HEARTBEAT_BASE,
    LSS_REQUEST_ID,
    LSS_RESPONSE_ID,
    NMT_ID,
    SDO_REQUEST_BASE,
    SDO_RESPONSE_BASE,
    SYNC_ID,
    TIME_ID,
)


class Service(NamedTuple):
    """A frame's service: *kind* for machines, *label* for people, and the *node* (None: all, or unknown)."""

    kind: str
    label: str
    node: int | None = None


_FIXED = {
    NMT_ID: Service("nmt", "NMT"),
    SYNC_ID: Service("sync", "SYNC"),
    TIME_ID: Service("time", "TIME"),
    LSS_RESPONSE_ID: Service("lss", "LSS answer"),
    LSS_REQUEST_ID: Service("lss", "LSS"),
}
_BY_FUNCTION = {
    EMCY_BASE: ("emcy", "EMCY"),
    SDO_RESPONSE_BASE: ("sdo", "SDO answer"),
    SDO_REQUEST_BASE: ("sdo", "SDO request"),
    HEARTBEAT_BASE: ("heartbeat", "heartbeat"),
}
_PDO_FUNCTIONS = range(0x180, 0x580, 0x80)


def service_of(can_id: int, *, extended: bool) -> Service:
    """The service of *can_id* in the pre-defined connection set; `other` if it has none."""
    if extended:
        return Service("other", "29-bit frame")
    if can_id in _FIXED:
        return _FIXED[can_id]
    function, node = can_id & 0x780, can_id & 0x7F
    if node and function in _BY_FUNCTION:
        return Service(*_BY_FUNCTION[function], node)
    if node and function in _PDO_FUNCTIONS:
        way = "TPDO" if function & 0x80 else "RPDO"
        return Service("pdo", f"{way}{(function - 0x180) // 0x100 + 1}?", node)  # a guess: may be configured otherwise
    return Service("other", "frame")
