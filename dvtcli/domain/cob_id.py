"""COB-IDs: the 32-bit layout, the pre-defined connection set, and the CAN-IDs taken by a node's services."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from dvtcli.domain.can_ids import EMCY_BASE, SYNC_ID
from dvtcli.domain.objects import FURTHER_SDO_CHANNELS, FURTHER_SDO_SERVERS, SRDO_COMMUNICATION

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


#: Sub-indices of SRDOs (EN 50325-5): the direction, 0 for none, and both COB-IDs.
SRDO_DIRECTION, SRDO_COB_IDS = 1, (5, 6)
#: Default CAN-ID of SYNC, with 11 bits (CiA 301, 7.5.2.5).
SYNC_BY_DEFAULT = (SYNC_ID, False)
_FRAME = 1 << 29
#: Bit 30 of 0x1005 and 0x1012: the node produces it; bit 31 of 0x1014 and of SDO channels: disabled.
PRODUCES, OFF = 1 << 30, 1 << 31


def is_channel_place(index: int, sub_index: int) -> bool:
    """Whether a further SDO channel or an SRDO has its COB-ID, or its direction, at *index*:*sub_index*."""
    if index in SRDO_COMMUNICATION:
        return sub_index == SRDO_DIRECTION or sub_index in SRDO_COB_IDS
    return index in FURTHER_SDO_CHANNELS and sub_index in (1, 2)


def taken_by_services(
    node_id: int,
    sync: int | None,
    emcy: int | None,
    channels: Mapping[tuple[int, int], int],
    time: int | None = None,
) -> dict[tuple[int, bool], str]:
    """CAN-IDs in use, and whether they have 29 bits, each with its use; all but *node_id* are raw COB-IDs.

    *sync* is None if the node has no 0x1005, *emcy* if it has no 0x1014: the standard's defaults count. *time* (0x1012)
    occupies a CAN-ID if the node sends the time stamp.
    """
    found = taken_by_channels(node_id, channels) | _taken_by_time(time)
    if emcy is None:
        found[EMCY_BASE + node_id, False] = "this node's EMCY by default"
    elif not emcy & OFF:
        found[_identifier(emcy)] = "this node's EMCY"
    found[SYNC_BY_DEFAULT if sync is None else _identifier(sync)] = "SYNC"
    return found


def taken_on_another(
    node_id: int,
    sync: int | None,
    emcy: int | None,
    channels: Mapping[tuple[int, int], int],
    time: int | None = None,
) -> dict[tuple[int, bool], str]:
    """CAN-IDs in use by another node; unreadable values occupy nothing."""
    found = taken_by_channels(node_id, channels) | _taken_by_time(time)
    if emcy is not None and not emcy & OFF:
        found[_identifier(emcy)] = f"EMCY of node {node_id}"
    if sync is not None:
        found[_identifier(sync)] = "SYNC"
    return found


def _taken_by_time(time: int | None) -> dict[tuple[int, bool], str]:
    return {} if time is None or not time & PRODUCES else {_identifier(time): "TIME"}


def taken_by_channels(node_id: int, channels: Mapping[tuple[int, int], int]) -> dict[tuple[int, bool], str]:
    """CAN-IDs of further SDO servers and clients, and of SRDOs, with COB-IDs *channels*; a disabled one has none."""
    found: dict[tuple[int, bool], str] = {}
    for (index, sub_index), raw in channels.items():
        if index in SRDO_COMMUNICATION:
            if sub_index in SRDO_COB_IDS and raw and channels.get((index, SRDO_DIRECTION), 1):
                number = index - SRDO_COMMUNICATION.start + 1
                found[_identifier(raw)] = f"SRDO{number} of node {node_id} ({index:04X}:{sub_index:02X})"
        elif not raw & OFF and not channels.get((index, 3 - sub_index), 0) & OFF:
            what = "server" if index in FURTHER_SDO_SERVERS else "client"
            found[_identifier(raw)] = f"an SDO {what} of node {node_id} ({index:04X}:{sub_index:02X})"
    return found


def _identifier(raw: int) -> tuple[int, bool]:
    extended = bool(raw & _FRAME)
    return raw & (0x1FFF_FFFF if extended else 0x7FF), extended
