"""Behaviour of a device family as data, named by behaviour and not by vendor."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.domain.pdo import Direction, Pdo

if TYPE_CHECKING:
    from dvtcli.domain.object_scalings import ObjectRange, ScalingRule

#: An inclusive range: lowest and highest.
Range = tuple[int, int]
#: Index and sub-index of an object.
ObjectAddress = tuple[int, int]

#: expected identification if a device's software identification is the CRC-32 of its program
CRC32 = "crc32"


class BitPolicy(StrEnum):
    """Handling of bit 30 of a COB-ID at a write."""

    KEEP = "keep"
    SET = "set"
    CLEAR = "clear"


class Severity(StrEnum):
    """How strongly a finding is meant: an error stops, a warning is shown, a note explains."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


class PreOperational(StrEnum):
    """Whether PDO parameters need PRE-OPERATIONAL: required by the device, advised by its maker, or neither.

    Every member is true as a condition: compare with `is`.
    """

    REQUIRED = "required"
    ADVISED = "advised"
    NO = "no"


@dataclass(frozen=True, slots=True)
class StorePolicy:
    """How to store a device's settings.

    *sub_indices* of 0x1010 in order of preference, none if the device lacks the object (*instead* then describes
    its way, *saved_by* the object whose write saves, if any); *timeout_s* seconds to wait for the answer;
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
        """Whether a change of the object at *index* is lost at power-off without a store."""
        return self.covers[0] <= index <= self.covers[1]


class LoginPolicy(NamedTuple):
    """Login to a device: write *user_id* (u16), then *passcode* (u16), read *level* (u8) back.

    *needed* is the level for writes to the indices in *covers*, *highest* the highest level; 0 is logged
    out. *user* is the default user ID (1..0xFFFF).
    """

    level: ObjectAddress
    passcode: ObjectAddress
    user_id: ObjectAddress
    needed: int
    highest: int
    covers: tuple[Range, ...]
    user: int = 1

    def asked_for(self, index: int) -> bool:
        """Whether a write to the object at *index* requires the level *needed*."""
        return within(index, self.covers)


@dataclass(frozen=True, slots=True)
class VpdoGroup:
    """A list of virtual PDOs: sub-index k of the object at *index* holds (u16) the object index for pin k.

    *values* are the ranges of allowed object indices, *none* the value of an unused pin. *drives* are the ranges of
    objects that the device itself writes while a pin is connected.
    """

    index: int
    values: tuple[Range, ...]
    none: int
    drives: tuple[Range, ...] = ()

    def allows(self, value: int) -> bool:
        """Whether a pin may hold *value* (0x0000..0xFFFF), "none" included."""
        return value == self.none or within(value, self.values)


class StepKind(StrEnum):
    """Kind of write in a PDO's change, if relevant for an abort code's meaning."""

    ENTRY = "entry"
    COUNT = "count"
    COB_ID = "cob_id"
    PARAMETER = "parameter"
    OTHER = "other"


def step_kind(index: int, sub_index: int) -> StepKind:
    """Kind of a write to *index*:*sub_index* in a PDO's change."""
    pdo = Pdo.at(index)
    if pdo is None:
        return StepKind.OTHER
    if index == pdo.mapping_index:
        return StepKind.ENTRY if sub_index else StepKind.COUNT
    return StepKind.COB_ID if sub_index == 1 else StepKind.PARAMETER


@dataclass(frozen=True, slots=True)
class FaultList:
    """A family's error list: the number of errors at *count* (u16), and the *code* (u16) at a *position* (u16).

    Write the position, from 0, to select an error.
    """

    count: ObjectAddress
    position: ObjectAddress
    code: ObjectAddress


class KnownFault(NamedTuple):
    """Meaning of a family's error code; *remedy* is empty if unknown."""

    text: str
    remedy: str = ""


class MappingAdvice(NamedTuple):
    """Why the objects from index *first* to *last* should not feed a TPDO."""

    first: int
    last: int
    text: str


@dataclass(frozen=True, slots=True)
class DeviceProfile:
    """Behaviours of a device family; None means: as in the EDS, or as in the standard if the EDS is silent.

    *vendor_ids*, *product_codes* and *product_masks* (mask, value) select the identities (0x1018) of the family.
    *pdo_count* PDOs each way; *max_entries* a mapping; *max_entry_bits* an entry; *granularity* bits; *rtr_bit* the
    policy for bit 30 by direction; *extended_ids* whether 29-bit CAN-IDs are allowed; *transmission_types* the allowed
    ranges; *event_timer_types* types of a TPDO with a working event timer; *max_time_count* the highest inhibit time
    (100 µs) and event timer (ms), if the EDS is silent; *partial_entries* whether an entry may be shorter than its
    object; *rw_in_tpdo*/*rww_in_tpdo*/*rw_in_rpdo* judgement of objects with this access in this direction (None:
    fine); *pre_operational_gate* whether PDO writes need PRE-OPERATIONAL; *state_object* the object with the device's
    NMT state; *state_request* the object to request a state (u8: 1 pre-operational, 0 operational), *master_object* the
    object that reads 1 in a master; *extended_error* the object with the reason after 0x08000000 and *reasons* its
    texts; *dummies* the supported dummy indices; *login* how to unlock access, if locked; *hints* the usual meaning of
    an abort code at a kind of step, if the maker says more than the standard; *reversed_entries* whether a mapping
    entry has its fields in reverse order on the wire; *filler* the content (u32) of unused entries if the count of a
    mapping is read-only (None: it is writable); *silent_rpdo* the device's reaction to a silent RPDO producer, if any;
    *fault_list* the family's own error list, *faults* the meaning of its error codes; *software_identification* the
    value of 0x1F56 for the right program, by program number (1..254): a number of 32 bits, or "crc32" for the CRC of
    the sent program; *physical* the scaling of its objects; *aliases* typed names → objects; *type_texts* the maker's
    words for a transmission type and *type_notes* remarks on it; *warn_mapped* objects that should not feed a TPDO;
    *vpdo* its virtual PDOs; *configuration* ranges of manufacturer-specific indices that a file or a clone may write,
    *no_configuration* ranges never written; *learnt* whether `learn` wrote the profile.
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
    physical: dict[ObjectRange, ScalingRule] = field(default_factory=dict)
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

        A profile without product codes and masks matches all products of its vendors; without vendors it matches none.
        """
        if vendor_id not in self.vendor_ids:
            return False
        if not self.product_codes and not self.product_masks:
            return True
        masked = any(product_code & mask == value for mask, value in self.product_masks)
        return masked or product_code in self.product_codes

    def hint(self, index: int, sub_index: int, abort: int) -> str | None:
        """Usual meaning of *abort* for a write to *index*:*sub_index* in this family, or None."""
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
