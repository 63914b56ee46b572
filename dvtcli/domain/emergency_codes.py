"""Emergency error codes in words (CiA 301, table 26). Does not know how they travel."""

from __future__ import annotations

#: Emergency error codes of CiA 301, table 26, and their classes.
_CODES = {
    0x8110: "CAN overrun",
    0x8120: "CAN error passive",
    0x8130: "life guard or heartbeat error",
    0x8140: "recovered from bus-off",
    0x8150: "CAN-ID collision",
    0x8210: "PDO not processed: too short",
    0x8220: "PDO length exceeded",
    0x8250: "RPDO time-out",
}
_CLASSES = {
    0x00: "error reset",
    0x10: "generic error",
    0x20: "current",
    0x30: "voltage",
    0x40: "temperature",
    0x50: "device hardware",
    0x60: "device software",
    0x70: "additional modules",
    0x80: "monitoring",
    0x81: "communication",
    0x82: "protocol",
    0x90: "external error",
    0xF0: "additional functions",
    0xFF: "device specific",
}


def emergency_text(code: int) -> str:
    """What an emergency error code means, as far as the standard says."""
    high = code >> 8
    return _CODES.get(code) or _CLASSES.get(high) or _CLASSES.get(high & 0xF0) or "reserved"
