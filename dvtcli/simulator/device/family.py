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
from dvtcli.domain.objects import RESTORE_PARAMETERS, STORE_PARAMETERS
from dvtcli.domain.pdo import Direction
from dvtcli.domain.profile import BitPolicy, ObjectAddress

Range = tuple[int, int]

_NOTHING: Mapping[Any, Any] = MappingProxyType({})
_KEEP = MappingProxyType({Direction.TPDO: BitPolicy.KEEP, Direction.RPDO: BitPolicy.KEEP})


class PinCopy(NamedTuple):
    """One group of virtual PDOs: sub-index k of *selector* names the object tied to physical pin k.

    *pins* are the objects of the physical side in pin order, each for eight pins if *bitwise*, a bit each. With
    *to_pin* data flows from the selected object to the pin, else from the pin.
    """

    selector: int
    pins: tuple[ObjectAddress, ...]
    to_pin: bool
    bitwise: bool = False


class MotorCopy(NamedTuple):
    """The virtual PDOs of the motors: *down* copies selected:sub → profile object, *up* the other way."""

    selector: int
    down: Mapping[int, ObjectAddress]
    up: Mapping[int, ObjectAddress]


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

    count: ObjectAddress
    position: ObjectAddress
    code: ObjectAddress


class Family(NamedTuple):
    """The behaviour of a device family; the defaults are a plain CiA 301 device."""

    # --- the device and its objects
    name: str = "generic"
    title: str = "CiA 301 device"
    #: its special features, in a few words
    about: str = ""
    #: objects of the EDS missing in the device, with the abort code; sub-index 0 for a whole object
    absent: Mapping[ObjectAddress, int] = _NOTHING
    #: the connected modules of a modular device, by their numbers in its EDS
    modules: tuple[int, ...] = ()
    #: whether `learn` wrote it with a profile, so that it is no independent check of the profile
    learnt: bool = False

    # --- communication parameters of PDOs
    #: required bit 30 of a COB-ID, by direction
    rtr_bit: Mapping[Direction, BitPolicy] = _KEEP
    #: whether bit 29 may be set
    extended_ids: bool = True
    #: whether a PDO must not have a CAN-ID restricted by CiA 301
    restricted_ids_refused: bool = True
    #: ranges of accepted transmission types
    transmission_types: tuple[Range, ...] = ((0, 240), (252, 255))
    #: abort code of each range of transmission types by direction, 0: accepted; replaces *transmission_types*
    pdo_types: Mapping[Direction, tuple[tuple[int, int, int], ...]] = _NOTHING
    #: the highest accepted inhibit time (100 µs)
    max_inhibit_time: int = 0xFFFF
    #: the highest accepted event timer (ms)
    max_event_timer: int = 0xFFFF
    #: whether a PDO without a mapping may be enabled
    empty_pdos_enabled: bool = False
    #: abort code of a check of `pdo_checks.CHECKS` by direction, 0: accepted; overrides the other fields
    answers: Mapping[Direction, Mapping[str, int]] = _NOTHING

    # --- mappings of PDOs
    #: lengths of entries are a multiple of it (bits); None: as in the EDS
    granularity: int | None = None
    #: the highest number of entries in a PDO
    max_entries: int = 64
    #: the greatest length of an entry (bits)
    max_entry_bits: int = 64
    #: supported dummies by index; None: as in the EDS
    dummies: frozenset[int] | None = None
    #: abort code for a dummy in a TPDO, 0: accepted
    tpdo_dummies: int = Abort.NOT_MAPPABLE
    #: access types of objects that can be mapped into a TPDO
    tpdo_access: frozenset[Access] = frozenset({Access.RO, Access.RWR, Access.CONST, Access.RW})
    #: access types of objects that can be mapped into an RPDO
    rpdo_access: frozenset[Access] = frozenset({Access.WO, Access.RWW, Access.RW})
    #: whether an entry for the wrong direction answers 06010001 or 06010002, else 06040041
    entry_access_codes: bool = False
    #: whether an entry must not be longer than its object
    entry_length_checked: bool = True
    #: whether a count must not exceed the existing entries
    count_within_entries: bool = True
    #: whether a count may cover an entry of 0
    empty_entries_counted: bool = False
    #: whether a count may cover an entry of 0 bits
    zero_bits_counted: bool = False
    #: abort code of a write to a mapping in use: the PDO is valid, or the count is not 0 for a write of an entry
    mapping_in_use: int = Abort.UNSUPPORTED_ACCESS
    #: whether a write of the present count or entry to a mapping in use is accepted
    same_mapping_accepted: bool = False
    #: the value, besides 0, of an unused entry if the count of a mapping is read-only
    filler: int = 0

    # --- PDOs at work
    #: whether an RPDO of transmission type n acts at the n-th SYNC, not at the next
    rpdo_counts_syncs: bool = False
    #: whether an RPDO longer than its mapping causes an EMCY (0x8220)
    reports_long_rpdos: bool = True
    #: whether a remote frame requests a TPDO, if its bit 30 allows
    answers_remote_frames: bool = True
    #: virtual PDOs of the pins
    pins: tuple[PinCopy, ...] = ()
    #: virtual PDOs of the motors
    motors: MotorCopy | None = None
    #: the simulated machine, if the device has its objects: `cia402`, a motor; "" for none
    plant: str = ""

    # --- conditions of writes
    #: whether the rules of PDOs hold in every NMT state, else in OPERATIONAL only
    pdo_rules_always: bool = True
    #: ranges of indices that refuse downloads outside PRE-OPERATIONAL
    pre_operational_writes: tuple[Range, ...] = ()
    #: the abort code of such a download, unless an extended error object explains the refusal
    wrong_state: int = Abort.DEVICE_STATE
    #: access levels; None: none
    login: Login | None = None

    # --- store and restore
    #: range of indices lost at a reset unless stored, all others are stored at once; None: everything must be stored
    needs_store: Range | None = None
    #: an object that stores everything when written
    save_command: ObjectAddress | None = None
    #: the value of 0x1010:s, and of 0x1011:s without *restore_capability*
    store_capability: int = 1
    #: the value of 0x1011:s, if different
    restore_capability: int | None = None
    #: abort code of 0x1010:s for a value other than "save", 0: accepted without storing
    wrong_signature: int = Abort.CANNOT_STORE
    #: abort code of 0x1010:s for "save", 0: accepted
    save_answer: int = 0
    #: whether stored values survive a reset
    store_lasts: bool = True
    #: whether a communication reset reloads stored values, else it changes nothing
    communication_reset_reloads: bool = True
    #: whether a write to the configuration clears both values of 0x1020 (CiA 301, 7.5.2.23)
    clears_stamp: bool = True

    # --- errors
    #: the object that explains abort 0x08000000
    extended_error: ObjectAddress | None = None
    #: abort code -> reason, for codes hidden behind 0x08000000
    reasons: Mapping[int, int] = _NOTHING
    #: the list of active errors, the highest code first
    error_list: ErrorList | None = None

    # --- NMT
    #: the state after boot-up
    boot_state: NmtState = NmtState.PRE_OPERATIONAL
    #: whether the device sends a boot-up message
    boot_up_message: bool = True
    #: an object that reads the NMT state
    state_object: ObjectAddress | None = None
    #: an object that forces the state (1 PRE-OPERATIONAL, 0 OPERATIONAL) if *master_object* is 1
    state_request: ObjectAddress | None = None
    #: an object that is 1 if the device is the NMT master, which ignores NMT commands
    master_object: ObjectAddress | None = None
    #: whether the device ignores a request to leave OPERATIONAL, like a vehicle in motion
    stays_operational: bool = False

    # --- LSS
    #: whether the configuration state answers every request of a fast scan, and each selection
    lss_echo: bool = False
    #: whether the first node-ID is active on return to waiting, else only after a communication reset
    lss_wakes: bool = True
    #: whether a new node-ID is reported before its activation
    lss_tells_pending: bool = False

    # --- SDO and programs
    #: segments of an SDO block, 0: no block transfer
    block_size: int = 127
    #: whether a block has a CRC
    block_crc: bool = True
    #: whether a program can be downloaded (CiA 302-3)
    boot_loader: bool = False
    #: abort code of the program's objects while the flash memory is at work, 0: the flash status (0x1F57) says so
    flash_busy: int = 0

    @property
    def capabilities(self) -> dict[int, int]:
        """The values of the sub-indices of 0x1010 and 0x1011 (CiA 301, 7.5.2.13 and 7.5.2.14)."""
        restore = self.store_capability if self.restore_capability is None else self.restore_capability
        return {STORE_PARAMETERS: self.store_capability, RESTORE_PARAMETERS: restore}


GENERIC = Family()
