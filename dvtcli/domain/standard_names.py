"""What CiA 301 calls the parts of its records and arrays, for devices that come without a file. Knows no device."""

from __future__ import annotations

from dvtcli.domain.standard_objects import is_pdo_communication, is_pdo_mapping

_STORED = ("all parameters", "communication parameters", "application parameters")
_PARTS = {
    0x1010: _STORED,
    0x1011: _STORED,
    0x1018: ("vendor-ID", "product code", "revision number", "serial number"),
    0x1029: ("communication error",),
}
_ONE_EACH = {0x1003: "error", 0x1016: "consumer heartbeat time"}
_SDO = ("COB-ID client to server", "COB-ID server to client", "node-ID of the other side")
_COMMUNICATION = ("COB-ID", "transmission type", "inhibit time", "reserved", "event timer", "SYNC start value")


def standard_name(index: int, sub_index: int) -> str:
    """The name of *index*:*sub_index* (1…254) in CiA 301, 7.5.2, empty where it gives none."""
    if index in _ONE_EACH:
        return f"{_ONE_EACH[index]} {sub_index}"
    if is_pdo_mapping(index):
        return f"mapped object {sub_index}"
    names = _PARTS.get(index, ())
    if is_pdo_communication(index):
        names = _COMMUNICATION
    elif 0x1200 <= index <= 0x12FF:
        names = _SDO
    return names[sub_index - 1] if 1 <= sub_index <= len(names) else ""
