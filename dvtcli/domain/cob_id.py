"""COB-ID words of PDO communication parameters: the 32-bit layout and the pre-defined connection set."""

from __future__ import annotations

from dataclasses import dataclass, replace

INVALID_BIT = 1 << 31
NO_RTR_BIT = 1 << 30
FRAME_BIT = 1 << 29
CAN_ID_MASK = 0x1FFF_FFFF
HIGHEST_BASE_CAN_ID = 0x7FF


@dataclass(frozen=True, slots=True)
class CobId:
    """A PDO's COB-ID, decoded (CiA 301, 7.5.2.35 and 7.5.2.37).

    *can_id* is bits 28..0 exactly as the device holds them: `CobId.from_raw(x).raw == x` for every 32-bit x.
    `fits_frame` tells whether an 11-bit identifier fits. *valid* is bit 31 **clear**, *rtr_allowed* bit 30
    **clear**, *extended* bit 29 set (29-bit CAN-ID).
    """

    can_id: int
    valid: bool = True
    rtr_allowed: bool = True
    extended: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.can_id <= CAN_ID_MASK:
            raise ValueError(f"CAN-ID 0x{self.can_id:X} is not within 0x0..0x1FFFFFFF")

    @classmethod
    def from_raw(cls, raw: int) -> CobId:
        """Take a 32-bit COB-ID word apart."""
        if not 0 <= raw <= 0xFFFF_FFFF:
            raise ValueError(f"COB-ID 0x{raw:X} does not fit 32 bits")
        return cls(
            can_id=raw & CAN_ID_MASK,
            valid=not raw & INVALID_BIT,
            rtr_allowed=not raw & NO_RTR_BIT,
            extended=bool(raw & FRAME_BIT),
        )

    @property
    def raw(self) -> int:
        """The 32-bit word as stored in the device."""
        return (
            self.can_id
            | (0 if self.valid else INVALID_BIT)
            | (0 if self.rtr_allowed else NO_RTR_BIT)
            | (FRAME_BIT if self.extended else 0)
        )

    @property
    def fits_frame(self) -> bool:
        """Whether the CAN-ID fits its frame format: 11 bits, or 29 with bit 29 set."""
        return self.extended or self.can_id <= HIGHEST_BASE_CAN_ID

    def enabled(self) -> CobId:
        """The same COB-ID with bit 31 clear; bits 30 and 29 survive."""
        return replace(self, valid=True)

    def disabled(self) -> CobId:
        """The same COB-ID with bit 31 set; bits 30 and 29 survive."""
        return replace(self, valid=False)

    def __str__(self) -> str:
        return can_id_text(self.can_id, extended=self.extended)


def can_id_text(can_id: int, *, extended: bool) -> str:
    """A CAN-ID as printed: three digits, or eight if it has 29 bits."""
    return f"0x{can_id:08X}" if extended else f"0x{can_id:03X}"


def fits(can_id: int, *, extended: bool) -> bool:
    """Whether a CAN-ID fits into 11 bits, or 29 bits if *extended* (ISO 11898-1)."""
    return 0 <= can_id <= (CAN_ID_MASK if extended else HIGHEST_BASE_CAN_ID)
