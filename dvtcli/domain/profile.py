"""What a family of devices allows and asks for, as data named by behaviour.

Knows no vendor, and neither where profiles are kept (`files.profile.library`) nor how they are written
(`files.profile.toml`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

from dvtcli.domain.pdo import Direction, Pdo

if TYPE_CHECKING:
    from dvtcli.domain.meanings import Meaning, ObjectRange

#: An inclusive range: lowest and highest.
Range = tuple[int, int]
#: Index and sub-index of an object.
ObjectAddress = tuple[int, int]


class BitPolicy(StrEnum):
    """What becomes of bit 30 of a COB-ID when it is written."""

    KEEP = "keep"
    SET = "set"
    CLEAR = "clear"


class Severity(StrEnum):
    """How strongly a finding is meant: an error stops, a warning is shown, a note explains."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


class PreOperational(StrEnum):
    """Whether PDO parameters want the node in PRE-OPERATIONAL: the device insists, its maker advises it, or neither.

    Every member is true as a condition: compare with `is`.
    """

    REQUIRED = "required"
    ADVISED = "advised"
    NO = "no"


@dataclass(frozen=True, slots=True)
class StorePolicy:
    """How a device is told to keep its settings.

    *sub_indices* of 0x1010 in order of preference, none where the device has no such object (*instead* then says
    what its way is, *saved_by* which object's write it is, if any); *timeout_s* seconds to wait for the answer;
    *covers* the indices that are lost without a store, all others save themselves; *never_after* abort codes of a
    change after which nothing may be stored.
    """

    sub_indices: tuple[int, ...] = (1,)
    timeout_s: float = 20.0
    only_pre_operational: bool = False
    covers: Range = (0x0000, 0xFFFF)
    never_after: tuple[int, ...] = ()
    instead: str = ""
    saved_by: ObjectAddress | None = None

    def needed_for(self, index: int) -> bool:
        """Whether a change of the object at *index* is lost at power-off unless it is stored."""
        return self.covers[0] <= index <= self.covers[1]


@dataclass(frozen=True, slots=True)
class LoginPolicy:
    """How a device is logged in to: write *user_id* (u16), then *passcode* (u16), read *level* (u8) back.

    *needed* is the level that writes to the indices in *covers* ask for, *highest* the highest there is; 0 is logged
    out. *user* is the user ID (1..0xFFFF) where nobody names another.
    """

    level: ObjectAddress
    passcode: ObjectAddress
    user_id: ObjectAddress
    needed: int
    highest: int
    covers: tuple[Range, ...]
    user: int = 1

    def asked_for(self, index: int) -> bool:
        """Whether a write to the object at *index* takes the level *needed*."""
        return within(index, self.covers)


@dataclass(frozen=True, slots=True)
class VpdoGroup:
    """One list of virtual PDOs: sub-index k of the object at *index* holds (u16) what pin k stands for.

    *values* are the ranges of allowed object indices, *none* the value of an unused pin. *drives* are the ranges of
    objects that a device itself writes while a pin is tied.
    """

    index: int
    values: tuple[Range, ...]
    none: int
    drives: tuple[Range, ...] = ()

    def allows(self, value: int) -> bool:
        """Whether a pin may hold *value* (0x0000..0xFFFF), "none" included."""
        return value == self.none or within(value, self.values)


class StepKind(StrEnum):
    """What a step of a PDO's change writes, as far as a device's refusal means something else there."""

    ENTRY = "entry"
    COUNT = "count"
    COB_ID = "cob_id"
    PARAMETER = "parameter"
    OTHER = "other"


def step_kind(index: int, sub_index: int) -> StepKind:
    """What a write to *index*:*sub_index* is, as a step of a PDO's change."""
    pdo = Pdo.at(index)
    if pdo is None:
        return StepKind.OTHER
    if index == pdo.mapping_index:
        return StepKind.ENTRY if sub_index else StepKind.COUNT
    return StepKind.COB_ID if sub_index == 1 else StepKind.PARAMETER


@dataclass(frozen=True, slots=True)
class FaultList:
    """A family's own list of errors: how many there are at *count* (u16), and the *code* (u16) at a *position* (u16).

    The position, from 0, is chosen by writing it.
    """

    count: ObjectAddress
    position: ObjectAddress
    code: ObjectAddress


@dataclass(frozen=True, slots=True)
class KnownFault:
    """What an error code of a family means, and what helps; *remedy* is empty where nobody says."""

    text: str
    remedy: str = ""


@dataclass(frozen=True, slots=True)
class MappingAdvice:
    """Why the objects from index *first* to *last* should not feed a TPDO."""

    first: int
    last: int
    text: str


@dataclass(frozen=True, slots=True)
class DeviceProfile:
    """A device family's behaviours; None means: as the EDS says, or the standard where it is silent.

    *vendor_ids*, *product_codes* and *product_masks* (mask, value) tell which identities (0x1018) belong to it.
    *pdo_count* PDOs each way; *max_entries* a mapping; *max_entry_bits* an entry; *granularity* bits; *rtr_bit* the
    policy for bit 30 by direction; *extended_ids* whether 29-bit CAN-IDs are allowed; *transmission_types* the
    allowed ranges; *event_timer_types* those of a TPDO on which the event timer works; *max_time_count* the highest
    inhibit time (100 µs) and event timer (ms), if the EDS is silent; *partial_entries* whether an entry may be
    shorter than its object; *rw_in_tpdo*/*rww_in_tpdo*/*rw_in_rpdo* how an object of that access is judged in that
    direction (None: fine); *pre_operational_gate* whether PDO writes need PRE-OPERATIONAL; *state_object* where the
    device tells its NMT state; *state_request* where a master takes one (u8: 1 pre-operational, 0 operational),
    *master_object* where it says that it is one (1); *extended_error* where the reason after 0x08000000 stands and
    *reasons* its texts; *dummies* the supported dummy indices; *login* how access is unlocked, if it is locked;
    *hints* what an abort code usually means at a step of that kind, where the maker says more than the standard;
    *reversed_entries* whether a mapping entry has its fields the other way round on the wire; *filler* what unused
    entries hold (u32) where the count of a mapping cannot be written (None: it is);
    *silent_rpdo* what the device does where an RPDO's producer is silent, if anything;
    *fault_list* the family's own list of errors, *faults* what its error codes mean; *software_identification* what
    0x1F56 says of the right program, by its number (1..254): a number of 32 bits, or "crc32" for that of what was sent;
    *physical* what the values of its objects mean;
    *aliases* names a human types → objects; *type_texts* the maker's words for a transmission type and *type_notes*
    what to know about one; *warn_mapped* what should not feed a TPDO; *vpdo* its virtual PDOs; *configuration* ranges
    of the maker's own indices that a file or a clone may write, *no_configuration* those that none ever writes;
    *learnt* whether `learn` wrote it.
    """

    name: str = "generic"
    title: str = "CiA 301 device"
    vendor_ids: tuple[int, ...] = ()
    product_codes: tuple[int, ...] = ()
    product_masks: tuple[tuple[int, int], ...] = ()
    pdo_count: int | None = None
    max_entries: int | None = None
    max_entry_bits: int = 64
    granularity: int | None = None
    rtr_bit: dict[Direction, BitPolicy] = field(
        default_factory=lambda: {Direction.TPDO: BitPolicy.KEEP, Direction.RPDO: BitPolicy.KEEP}
    )
    extended_ids: bool = True
    transmission_types: tuple[Range, ...] = ((0, 240), (252, 255))
    event_timer_types: tuple[Range, ...] = ((0, 255),)
    max_time_count: int = 0xFFFF
    partial_entries: bool = False
    rw_in_tpdo: Severity | None = None
    rww_in_tpdo: Severity | None = Severity.ERROR
    rw_in_rpdo: Severity | None = None
    pre_operational_gate: PreOperational = PreOperational.NO
    state_object: ObjectAddress | None = None
    state_request: ObjectAddress | None = None
    master_object: ObjectAddress | None = None
    extended_error: ObjectAddress | None = None
    reasons: dict[int, str] = field(default_factory=dict)
    dummies: frozenset[int] | None = None
    store: StorePolicy = StorePolicy()
    login: LoginPolicy | None = None
    hints: dict[StepKind, dict[int, str]] = field(default_factory=dict)
    reversed_entries: bool = False
    filler: int | None = None
    silent_rpdo: str = ""
    fault_list: FaultList | None = None
    faults: dict[int, KnownFault] = field(default_factory=dict)
    software_identification: dict[int, int | str] = field(default_factory=dict)
    physical: dict[ObjectRange, Meaning] = field(default_factory=dict)
    aliases: dict[str, str] = field(default_factory=dict)
    type_texts: dict[int, str] = field(default_factory=dict)
    type_notes: dict[int, str] = field(default_factory=dict)
    warn_mapped: tuple[MappingAdvice, ...] = ()
    vpdo: dict[str, VpdoGroup] = field(default_factory=dict)
    configuration: tuple[Range, ...] = ()
    no_configuration: tuple[Range, ...] = ()
    learnt: bool = False

    def matches(self, vendor_id: int, product_code: int) -> bool:
        """Whether a device of this identity (0x1018:1 and :2) belongs to the family.

        A profile without product codes and masks takes all of its vendors' products; one without vendors none.
        """
        if vendor_id not in self.vendor_ids:
            return False
        if not self.product_codes and not self.product_masks:
            return True
        masked = any(product_code & mask == value for mask, value in self.product_masks)
        return masked or product_code in self.product_codes

    def hint(self, index: int, sub_index: int, abort: int) -> str | None:
        """What the abort code *abort* of a write to *index*:*sub_index* usually means in this family, or None."""
        return self.hints.get(step_kind(index, sub_index), {}).get(abort)

    def allows_type(self, transmission_type: int) -> bool:
        """Whether the family knows *transmission_type* (0..255)."""
        return within(transmission_type, self.transmission_types)

    def why_not_in_tpdo(self, index: int) -> str | None:
        """Why the object at *index* should not feed a TPDO, or None."""
        return next((advice.text for advice in self.warn_mapped if advice.first <= index <= advice.last), None)


def within(value: int, ranges: Iterable[Range]) -> bool:
    """Whether *value* lies in one of the inclusive *ranges*."""
    return any(low <= value <= high for low, high in ranges)


GENERIC = DeviceProfile()
