"""Emergency error codes and the error register in words (CiA 301, tables 26 and 48; CiA 402-2 for drives).

Manufacturer-specific codes are not included.
"""

from __future__ import annotations

from dvtcli.domain.hint import Action, Hint

#: Emergency error codes of CiA 301, table 26, and their classes.
_CODES = {
    0x8110: "CAN overrun",
    0x8120: "CAN error passive",
    0x8130: "life guard or heartbeat error",
    0x8140: "recovered from bus-off",
    0x8150: "CAN-ID collision",
    0x8210: "PDO not processed: too short",
    0x8220: "PDO length exceeded",
    0x8230: "MPDO not processed: no such object",
    0x8240: "SYNC of unexpected length",
    0x8250: "RPDO time-out",
}
_CLASSES = {
    0x00: "error reset",
    0x10: "generic error",
    0x20: "current",
    0x21: "current, input side",
    0x22: "current, inside the device",
    0x23: "current, output side",
    0x30: "voltage",
    0x31: "mains voltage",
    0x32: "voltage inside the device",
    0x33: "output voltage",
    0x40: "temperature",
    0x41: "ambient temperature",
    0x42: "device temperature",
    0x50: "device hardware",
    0x60: "device software",
    0x61: "internal software",
    0x62: "user software",
    0x63: "data set",
    0x70: "additional modules",
    0x80: "monitoring",
    0x81: "communication",
    0x82: "protocol",
    0x90: "external error",
    0xF0: "additional functions",
    0xFF: "device specific",
}
#: meanings for drives of codes that CiA 301 leaves to device profiles (CiA 402-2, error codes)
_DRIVE_CODES = {
    0x2310: "continuous over-current at the output",
    0x2320: "short circuit or earth leakage at the output",
    0x3110: "mains over-voltage",
    0x3120: "mains under-voltage",
    0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage",
    0x4110: "ambient temperature too high",
    0x4210: "device temperature too high",
    0x4310: "drive temperature too high",
    0x7121: "motor blocked",
    0x8400: "velocity control",
    0x8500: "position control",
    0x8611: "following error",
}
#: remedies, if the standard itself names the cause
_REMEDIES: dict[int, Hint | str] = {
    0x8110: Hint(
        Action.SHOW_LOAD, why="frames were received faster than it can process them: reduce the bus load ({})"
    ),
    0x8120: "check wiring, termination and bit rate",
    0x8130: Hint(
        Action.FIND_NODES, why="a node that it monitors (0x1016) sends no heartbeat: {}, and check 0x1017 of that node"
    ),
    0x8140: "check wiring, termination and bit rate",
    0x8150: Hint(Action.FIND_NODES, why="two nodes send the same CAN-ID: {}")
    + Hint(Action.SHOW_PDOS, {"all": True}, ", and compare the COB-IDs ({})"),
    0x8210: Hint(Action.SHOW_PDOS, why="the producer sends fewer bytes than the RPDO maps: compare both mappings ({})"),
    0x8220: Hint(Action.SHOW_PDOS, why="the producer sends more bytes than the RPDO maps: compare both mappings ({})"),
    0x8240: Hint(Action.CHECK_SYNC, why="compare 0x1019 with the counter of the SYNC producer ({})"),
    0x8250: Hint(Action.SHOW_PDOS, why="the producer of an RPDO is silent: {} shows the event timer")
    + Hint(Action.MONITOR, why=", {} who sends"),
}
_REGISTER = (
    "generic", "current", "voltage", "temperature", "communication", "device profile", "reserved", "manufacturer",
)  # fmt: skip
#: the low half of 0x1000 of drives (CiA 402-1)
_DRIVE = 402


def emergency_text(code: int, device_type: int | None = None) -> str:
    """Meaning of an emergency error code (0x0000..0xFFFF) according to the standard.

    With the *device_type* (0x1000) of a drive, also according to the drive profile.
    """
    if device_type is not None and device_type & 0xFFFF == _DRIVE and code in _DRIVE_CODES:
        return _DRIVE_CODES[code]
    high = code >> 8
    return _CODES.get(code) or _CLASSES.get(high) or _CLASSES.get(high & 0xF0) or "reserved"


def emergency_remedy(code: int) -> Hint | str:
    """Remedy for an emergency error code; empty if the standard does not name the cause."""
    return _REMEDIES.get(code, "")


def register_words(register: int) -> tuple[str, ...]:
    """Errors named by the set bits of an error register (0x1001)."""
    return tuple(word for bit, word in enumerate(_REGISTER) if register >> bit & 1)
