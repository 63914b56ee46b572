"""Drive states in words (CiA 402-2)."""

from __future__ import annotations

#: (mask, bits, state): CiA 402-2, 8.4.2
STATES = (
    (0x4F, 0x00, "not ready to switch on"),
    (0x4F, 0x40, "switch on disabled"),
    (0x6F, 0x21, "ready to switch on"),
    (0x6F, 0x23, "switched on"),
    (0x6F, 0x27, "operation enabled"),
    (0x6F, 0x07, "quick stop active"),
    (0x4F, 0x0F, "fault reaction active"),
    (0x4F, 0x08, "fault"),
)


def drive_state(statusword: int) -> str:
    """Drive state in words for *statusword* (0…0xFFFF); empty if not in the standard."""
    return next((text for mask, bits, text in STATES if statusword & mask == bits), "")
