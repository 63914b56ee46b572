"""Families of simulated devices, as data: what one allows, demands and does differently.

Does not know where a family is written down (`network.family_file`), how a behaviour is carried out, what a profile
says, and no maker.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from dvtcli.domain.abort import Abort
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.object_dictionary import Access
from dvtcli.domain.pdo import Direction
from dvtcli.domain.profile import BitPolicy

Object = tuple[int, int]
Range = tuple[int, int]

_NO_ANSWERS: Mapping[Direction, Mapping[str, int]] = MappingProxyType({})
_KEEP = MappingProxyType({Direction.TPDO: BitPolicy.KEEP, Direction.RPDO: BitPolicy.KEEP})


@dataclass(frozen=True, slots=True)
class PinCopy:
    """One group of virtual PDOs: sub-index k of *selector* names the object that physical pin k is tied to.

    *pins* are the objects of the physical side, in order of the pins; with *bitwise* each holds eight pins, a bit
    each. *to_pin* tells the direction: from the selected object to the pin, else from the pin to it.
    """

    selector: int
    pins: tuple[Object, ...]
    to_pin: bool
    bitwise: bool = False


@dataclass(frozen=True, slots=True)
class MotorCopy:
    """The virtual PDOs of the motors: *down* copies selected:sub → profile object, *up* the other way."""

    selector: int
    down: Mapping[int, Object]
    up: Mapping[int, Object]


@dataclass(frozen=True, slots=True)
class Login:
    """Access levels: sub 1 of *index* is the level, 2 takes a passcode, 3 a user ID.

    *passcodes* maps a passcode (0..0xFFFF) to the level it gives; writes to the ranges in *writes* need *level*. The
    device wakes at level *start*, None for what its dictionary says.
    """

    index: int
    level: int
    writes: tuple[Range, ...]
    passcodes: Mapping[int, int]
    start: int | None = None


@dataclass(frozen=True, slots=True)
class ErrorList:
    """Where a device lists its errors besides CiA 301: how many, the position that is chosen, the code there (u16)."""

    count: Object
    position: Object
    code: Object


@dataclass(frozen=True, slots=True)
class Family:
    """How a family of devices behaves; the defaults are a plain CiA 301 device.

    - *absent*: objects that its EDS lists and the device lacks, sub-index 0 for a whole object, each with the abort
      code that it answers.
    - *granularity* (bits), *dummies*: None means as the EDS says; *max_entries* a PDO, *max_entry_bits* an entry.
    - *rtr_bit*: what bit 30 of a COB-ID must be, by direction; *extended_ids*: whether bit 29 may be set.
    - *transmission_types*: ranges of accepted values; *rpdo_counts_syncs*: an RPDO of type n acts at the n-th SYNC
      instead of the next one; *reports_long_rpdos*: whether an RPDO longer than its mapping is worth an EMCY (0x8220).
    - *answers_remote_frames*: whether a remote frame brings a TPDO whose bit 30 allows it.
    - *tpdo_access*, *rpdo_access*: access types whose objects may be mapped in that direction.
    - *pdo_rules_always*: whether the PDO rules hold in every NMT state, or in OPERATIONAL only.
    - *mapping_in_use*: the abort code of a write to a mapping that is in use (valid, or an entry while the count is not
      0); *same_mapping_accepted*: whether writing what the mapping holds already is no such write.
    - *entry_length_checked*: whether an entry may not be longer than its object; *entry_access_codes*: whether the
      wrong direction answers 06010001 or 06010002, else 06040041; *tpdo_dummies*: what a dummy in a TPDO answers, 0
      for accepted.
    - *count_within_entries*: whether a count may not exceed the entries there are; *empty_entries_counted*,
      *zero_bits_counted*: whether a count may cover an entry of 0, or one of 0 bits.
    - *empty_pdos_enabled*: whether a PDO without a mapping may be enabled; *restricted_ids_refused*: whether a PDO may
      not have a CAN-ID that CiA 301 keeps for others.
    - *answers*: by direction the abort code that a check of `pdo_checks` answers, 0 for accepted; it goes before what
      the other keys say. *pdo_types*: by direction the abort code of each range of transmission types, 0 for
      accepted, in place of *transmission_types*.
    - *max_inhibit_time* (100 µs), *max_event_timer* (ms): the highest accepted.
    - *filler*: what an entry may hold, besides 0, that is not used where the count of a mapping is read-only.
    - *pre_operational_writes*: ranges of indices that refuse downloads outside PRE-OPERATIONAL; *wrong_state*: the
      abort code, where no extended error object explains it.
    - *needs_store*: range of indices that a reset reverts unless they were stored, everything outside keeps itself;
      None means that everything must be stored. *save_command*: an object that stores everything when written.
      *store_capability*: what 0x1010:s and 0x1011:s read; *restore_capability*: what 0x1011:s reads where it differs.
      *wrong_signature*: what 0x1010:s answers to another value than "save", 0 for accepted, which saves nothing;
      *save_answer*: what it answers to "save", 0 for accepted. *store_lasts*: whether a store outlasts a reset;
      *communication_reset_reloads*: whether a reset of communication brings stored values back, or leaves all as it
      is.
    - *clears_stamp*: whether a write that changes its configuration makes both values of 0x1020 0 (7.5.2.22).
    - *login*: access levels, None for none. *extended_error*: the object that explains abort 0x08000000;
      *reasons*: abort code → reason, for codes that this family hides behind 0x08000000.
    - *error_list* lists the errors that are active, the highest code first.
    - *state_object* reads the NMT state; *state_request* forces it (1 PRE-OPERATIONAL, 0 OPERATIONAL) where
      *master_object* is 1; such a master ignores NMT commands. *stays_operational*: whether it goes on in OPERATIONAL
      whatever it is asked, as a vehicle that is being driven does.
    - *plant*: what moves in the simulation where the device has its objects: `cia402`, a motor; "" for nothing.
    - *block_size*: how many segments of an SDO block transfer it takes at once, 0 for no block transfers;
      *block_crc*: whether it knows their CRC.
    - *boot_loader*: whether a program can be downloaded (CiA 302-3).
    - *pins*, *motors*: virtual PDOs. *boot_state*: the state after boot-up; *boot_up_message*: whether it says so.
    - *lss_echo*: whether it answers every question of a fast scan, and each selection, while it is being configured;
      *lss_wakes*: whether it takes its first node-ID once it waits again, or with an NMT reset of communication only;
      *lss_tells_pending*: whether it tells the node-ID that it was given before it has that.
    - *learnt*: it was written by `learn`, along with a profile: it is no second opinion on that.
    """

    name: str = "generic"
    title: str = "CiA 301 device"
    #: what is remarkable about it, in a few words
    about: str = ""
    absent: Mapping[Object, int] = field(default_factory=dict)
    granularity: int | None = None
    max_entries: int = 64
    max_entry_bits: int = 64
    dummies: frozenset[int] | None = None
    rtr_bit: Mapping[Direction, BitPolicy] = field(default_factory=lambda: _KEEP)
    extended_ids: bool = True
    transmission_types: tuple[Range, ...] = ((0, 240), (252, 255))
    rpdo_counts_syncs: bool = False
    reports_long_rpdos: bool = True
    answers_remote_frames: bool = True
    tpdo_access: frozenset[Access] = frozenset({Access.RO, Access.RWR, Access.CONST, Access.RW})
    rpdo_access: frozenset[Access] = frozenset({Access.WO, Access.RWW, Access.RW})
    pdo_rules_always: bool = True
    mapping_in_use: int = Abort.UNSUPPORTED_ACCESS
    same_mapping_accepted: bool = False
    entry_length_checked: bool = True
    entry_access_codes: bool = False
    tpdo_dummies: int = Abort.NOT_MAPPABLE
    count_within_entries: bool = True
    empty_entries_counted: bool = False
    zero_bits_counted: bool = False
    empty_pdos_enabled: bool = False
    restricted_ids_refused: bool = True
    answers: Mapping[Direction, Mapping[str, int]] = field(default_factory=lambda: _NO_ANSWERS)
    pdo_types: Mapping[Direction, tuple[tuple[int, int, int], ...]] = field(default_factory=dict)
    max_inhibit_time: int = 0xFFFF
    max_event_timer: int = 0xFFFF
    filler: int = 0
    pre_operational_writes: tuple[Range, ...] = ()
    wrong_state: int = Abort.DEVICE_STATE
    needs_store: Range | None = None
    save_command: Object | None = None
    store_capability: int = 1
    restore_capability: int | None = None
    wrong_signature: int = Abort.CANNOT_STORE
    save_answer: int = 0
    store_lasts: bool = True
    communication_reset_reloads: bool = True
    clears_stamp: bool = True
    login: Login | None = None
    extended_error: Object | None = None
    reasons: Mapping[int, int] = field(default_factory=dict)
    error_list: ErrorList | None = None
    state_object: Object | None = None
    state_request: Object | None = None
    master_object: Object | None = None
    stays_operational: bool = False
    block_size: int = 127
    block_crc: bool = True
    boot_loader: bool = False
    pins: tuple[PinCopy, ...] = ()
    motors: MotorCopy | None = None
    plant: str = ""
    boot_state: NmtState = NmtState.PRE_OPERATIONAL
    boot_up_message: bool = True
    lss_echo: bool = False
    lss_wakes: bool = True
    lss_tells_pending: bool = False
    learnt: bool = False

    @property
    def capabilities(self) -> dict[int, int]:
        """What the sub-indices of 0x1010 and of 0x1011 read (CiA 301, 7.5.2.13 and 7.5.2.14)."""
        restore = self.store_capability if self.restore_capability is None else self.restore_capability
        return {0x1010: self.store_capability, 0x1011: restore}


GENERIC = Family()


def within(index: int, ranges: tuple[Range, ...]) -> bool:
    """Whether *index* lies in one of *ranges*, ends included."""
    return any(first <= index <= last for first, last in ranges)
