"""Families of simulated devices as data: limits, requirements and deviations.

`network.family_file` reads them from files.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

from dvtcli.domain.abort import Abort
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.object_dictionary import Access
from dvtcli.domain.pdo import Direction
from dvtcli.domain.profile import BitPolicy

Object = tuple[int, int]
Range = tuple[int, int]

_NOTHING: Mapping[Any, Any] = MappingProxyType({})
_KEEP = MappingProxyType({Direction.TPDO: BitPolicy.KEEP, Direction.RPDO: BitPolicy.KEEP})


class PinCopy(NamedTuple):
    """One group of virtual PDOs: sub-index k of *selector* names the object tied to physical pin k.

    *pins* are the objects of the physical side in pin order, each for eight pins if *bitwise*, a bit each. With
    *to_pin* data flows from the selected object to the pin, else from the pin.
    """

    selector: int
    pins: tuple[Object, ...]
    to_pin: bool
    bitwise: bool = False


class MotorCopy(NamedTuple):
    """The virtual PDOs of the motors: *down* copies selected:sub → profile object, *up* the other way."""

    selector: int
    down: Mapping[int, Object]
    up: Mapping[int, Object]


@dataclass(frozen=True, slots=True)
class Login:
    """Access levels: sub 1 of *index* is the level, 2 takes a passcode, 3 a user ID.

    *passcodes* maps a passcode (0..0xFFFF) to its level; writes to the ranges in *writes* need *level*. *start* is the
    level after boot-up, None for the dictionary's value.
    """

    index: int
    level: int
    writes: tuple[Range, ...]
    passcodes: Mapping[int, int]
    start: int | None = None


@dataclass(frozen=True, slots=True)
class ErrorList:
    """The error list of a device beside CiA 301: number of errors, selected position, and its code (u16)."""

    count: Object
    position: Object
    code: Object


class Family(NamedTuple):
    """The behaviour of a device family; the defaults are a plain CiA 301 device.

    - *absent*: objects of the EDS missing in the device, with the abort code; sub-index 0 for a whole object.
    - *granularity* (bits), *dummies*: None means as in the EDS; *max_entries* a PDO, *max_entry_bits* an entry.
    - *rtr_bit*: required bit 30 of a COB-ID, by direction; *extended_ids*: bit 29 may be set.
    - *transmission_types*: ranges of accepted values; *rpdo_counts_syncs*: an RPDO of type n acts at the n-th SYNC
      instead of the next; *reports_long_rpdos*: an RPDO longer than its mapping causes an EMCY (0x8220).
    - *answers_remote_frames*: a remote frame requests a TPDO, if its bit 30 allows.
    - *tpdo_access*, *rpdo_access*: access types of mappable objects, by direction.
    - *pdo_rules_always*: the PDO rules hold in every NMT state, else in OPERATIONAL only.
    - *mapping_in_use*: abort code of a write to a mapping in use (PDO valid, or an entry while the count is not 0);
      *same_mapping_accepted*: writing the present mapping is accepted.
    - *entry_length_checked*: an entry must not be longer than its object; *entry_access_codes*: the wrong direction
      answers 06010001 or 06010002, else 06040041; *tpdo_dummies*: abort code for a dummy in a TPDO, 0 for accepted.
    - *count_within_entries*: a count must not exceed the existing entries; *empty_entries_counted*,
      *zero_bits_counted*: a count may cover an entry of 0, or of 0 bits.
    - *empty_pdos_enabled*: a PDO without a mapping may be enabled; *restricted_ids_refused*: a PDO must not have a
      CAN-ID restricted by CiA 301.
    - *answers*: abort code of a check of `pdo_checks.CHECKS` by direction, 0 for accepted; overrides the other keys.
      *pdo_types*: abort code of each range of transmission types by direction, 0 for accepted; replaces
      *transmission_types*.
    - *max_inhibit_time* (100 µs), *max_event_timer* (ms): the highest accepted value.
    - *filler*: the value, besides 0, of an unused entry if the count of a mapping is read-only.
    - *pre_operational_writes*: ranges of indices that refuse downloads outside PRE-OPERATIONAL; *wrong_state*: their
      abort code, unless an extended error object explains the refusal.
    - *needs_store*: range of indices lost at a reset unless stored, all others are stored at once; None: everything
    must
      be stored. *save_command*: an object that stores everything when written. *store_capability*: value of 0x1010:s
      and 0x1011:s; *restore_capability*: value of 0x1011:s if different. *wrong_signature*: abort code of 0x1010:s
      for a
      value other than "save", 0 for accepted without storing; *save_answer*: abort code for "save", 0 for accepted.
      *store_lasts*: stored values survive a reset; *communication_reset_reloads*: a communication reset reloads stored
      values, else changes nothing.
    - *clears_stamp*: a write to the configuration clears both values of 0x1020 (7.5.2.23).
    - *login*: access levels, None for none. *extended_error*: the object that explains abort 0x08000000;
      *reasons*: abort code → reason, for codes hidden behind 0x08000000.
    - *error_list*: the list of active errors, the highest code first.
    - *state_object*: reads the NMT state; *state_request*: forces the state (1 PRE-OPERATIONAL, 0 OPERATIONAL) if
      *master_object* is 1; such a master ignores NMT commands. *stays_operational*: the device ignores a request to
      leave OPERATIONAL, like a vehicle in motion.
    - *plant*: the simulated machine, if the device has its objects: `cia402`, a motor; "" for none.
    - *block_size*: segments of an SDO block, 0 for no block transfer; *block_crc*: CRC support.
    - *boot_loader*: a program can be downloaded (CiA 302-3); *flash_busy*: abort code of its objects while the flash
      memory is at work, 0 for a flash status (0x1F57) that says so.
    - *pins*, *motors*: virtual PDOs. *boot_state*: the state after boot-up; *boot_up_message*: the device sends one.
    - *lss_echo*: answers every request of a fast scan, and each selection, in the configuration state; *lss_wakes*:
      activates its first node-ID on return to waiting, else only at a communication reset; *lss_tells_pending*:
      reports a new node-ID before its activation.
    - *modules*: the connected modules of a modular device, by their numbers in its EDS.
    - *learnt*: written by `learn` with a profile, so no independent check of the profile.
    """

    name: str = "generic"
    title: str = "CiA 301 device"
    #: its special features, in a few words
    about: str = ""
    absent: Mapping[Object, int] = _NOTHING
    granularity: int | None = None
    max_entries: int = 64
    max_entry_bits: int = 64
    dummies: frozenset[int] | None = None
    rtr_bit: Mapping[Direction, BitPolicy] = _KEEP
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
    answers: Mapping[Direction, Mapping[str, int]] = _NOTHING
    pdo_types: Mapping[Direction, tuple[tuple[int, int, int], ...]] = _NOTHING
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
    reasons: Mapping[int, int] = _NOTHING
    error_list: ErrorList | None = None
    state_object: Object | None = None
    state_request: Object | None = None
    master_object: Object | None = None
    stays_operational: bool = False
    block_size: int = 127
    block_crc: bool = True
    boot_loader: bool = False
    flash_busy: int = 0
    pins: tuple[PinCopy, ...] = ()
    motors: MotorCopy | None = None
    plant: str = ""
    boot_state: NmtState = NmtState.PRE_OPERATIONAL
    boot_up_message: bool = True
    lss_echo: bool = False
    lss_wakes: bool = True
    lss_tells_pending: bool = False
    learnt: bool = False
    modules: tuple[int, ...] = ()

    @property
    def capabilities(self) -> dict[int, int]:
        """The values of the sub-indices of 0x1010 and 0x1011 (CiA 301, 7.5.2.13 and 7.5.2.14)."""
        restore = self.store_capability if self.restore_capability is None else self.restore_capability
        return {0x1010: self.store_capability, 0x1011: restore}


GENERIC = Family()


def within(index: int, ranges: tuple[Range, ...]) -> bool:
    """True if *index* lies in one of *ranges*, ends included."""
    return any(first <= index <= last for first, last in ranges)
