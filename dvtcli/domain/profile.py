"""What a family of devices allows and asks for, as data named by behaviour.

A profile file is TOML with exactly these keys. Knows no vendor, and not where profiles are kept.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from dvtcli.domain.pdo import Direction


class BitPolicy(StrEnum):
    """What becomes of bit 30 or 29 of a COB-ID when it is written."""

    KEEP = "keep"
    SET = "set"
    CLEAR = "clear"


class Severity(StrEnum):
    """How strongly a finding is meant: an error stops, a warning is shown, a note explains."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True, slots=True)
class StorePolicy:
    """How a device is told to keep its settings: sub-indices of 0x1010 in order of preference, time-out in s."""

    sub_indices: tuple[int, ...] = (1,)
    timeout_s: float = 20.0
    only_pre_operational: bool = False


@dataclass(frozen=True, slots=True)
class DeviceProfile:
    """A device family's behaviours; None means: as the EDS says, or the standard where it is silent.

    *pdo_count* PDOs each way; *max_entries* a mapping; *max_entry_bits* an entry; *granularity* bits;
    *rtr_bit* the policy for bit 30 by direction; *extended_ids* whether 29-bit CAN-IDs are allowed;
    *transmission_types* the allowed values; *partial_entries* whether an entry may be shorter than its object;
    *rw_in_tpdo*/*rw_in_rpdo* how an object of access rw is judged; *pre_operational_gate* whether PDO writes
    need PRE-OPERATIONAL; *state_object*/*state_request* where the device tells and takes its state;
    *extended_error* where the reason after 0x08000000 stands and *reasons* its texts; *dummies* the supported
    dummy indices; *aliases* names a human types → objects; *warn_mapped* object → why not to map it into a TPDO.
    """

    name: str = "generic"
    title: str = "CiA 301 device"
    vendor_ids: tuple[int, ...] = ()
    product_codes: tuple[int, ...] = ()
    pdo_count: int | None = None
    max_entries: int | None = None
    max_entry_bits: int = 64
    granularity: int | None = None
    rtr_bit: dict[Direction, BitPolicy] = field(
        default_factory=lambda: {Direction.TPDO: BitPolicy.KEEP, Direction.RPDO: BitPolicy.KEEP}
    )
    extended_ids: bool = True
    transmission_types: tuple[tuple[int, int], ...] = ((0, 255),)
    partial_entries: bool = False
    rw_in_tpdo: Severity | None = Severity.WARNING
    rw_in_rpdo: Severity | None = None
    pre_operational_gate: bool = False
    state_object: tuple[int, int] | None = None
    state_request: tuple[int, int] | None = None
    master_object: tuple[int, int] | None = None
    extended_error: tuple[int, int] | None = None
    reasons: dict[int, str] = field(default_factory=dict)
    dummies: frozenset[int] | None = None
    store: StorePolicy = StorePolicy()
    aliases: dict[str, str] = field(default_factory=dict)
    type_texts: dict[int, str] = field(default_factory=dict)
    type_notes: dict[int, str] = field(default_factory=dict)


GENERIC = DeviceProfile()
