"""What a device refuses when a PDO is configured (CiA 301, 7.5.2.35 to 7.5.2.38), in the device's own words.

Deliberately shares no rule with `dvtcli.domain.rules`: a checker and a device that share a function share its
mistakes. Does not know how PDOs travel.
"""

from __future__ import annotations

from functools import cached_property

from dvtcli.domain.abort import Abort
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.mapping import DUMMY_BITS, PdoMappingEntry
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.profile import BitPolicy
from dvtcli.simulator.device.family import Family, within
from dvtcli.simulator.device.memory import Memory
from dvtcli.simulator.device.refusal import Refusal

COB_ID, TRANSMISSION_TYPE, INHIBIT_TIME, SYNC_START = 1, 2, 3, 6
_RTR_TYPES = (252, 253)
_ENFORCED_GRANULARITIES = (1, 8)
#: CiA 301, table 40: CAN-IDs no PDO may use.
_RESTRICTED = (
    (0x000, 0x07F),
    (0x101, 0x180),
    (0x581, 0x5FF),
    (0x601, 0x67F),
    (0x6E0, 0x6FF),
    (0x701, 0x7FF),
)


class PdoGuard:
    """Judges downloads to the PDO parameters of one device."""

    def __init__(self, memory: Memory, family: Family) -> None:
        self._memory = memory
        self._family = family

    def check(self, index: int, sub_index: int, data: bytes) -> None:
        """Raise Refusal where the device does not take *data* for a PDO parameter now."""
        pdo = Pdo.at(index)
        if pdo is None:
            return
        value = int.from_bytes(data, "little")
        if index == pdo.communication_index:
            self._check_communication(pdo, sub_index, value)
        elif sub_index == 0:
            self._check_count(pdo, value)
        else:
            self._check_entry_write(pdo, sub_index, value)

    def cob_id(self, pdo: Pdo) -> CobId:
        """The COB-ID a PDO has now; disabled where the node has no such object."""
        return CobId.from_raw(self._memory.number(pdo.communication_index, COB_ID, missing=1 << 31) & 0xFFFF_FFFF)

    def _check_communication(self, pdo: Pdo, sub_index: int, value: int) -> None:
        if sub_index == COB_ID:
            self._check_cob_id(pdo, CobId.from_raw(value))
        elif sub_index == TRANSMISSION_TYPE:
            self._check_transmission_type(pdo, value)
        elif sub_index in (INHIBIT_TIME, SYNC_START) and self.cob_id(pdo).valid:
            raise Refusal(Abort.VALUE_RANGE)

    def _check_cob_id(self, pdo: Pdo, wanted: CobId) -> None:
        held = self.cob_id(pdo)
        if wanted == held:
            return
        self._check_frame_bits(pdo, wanted)
        if not wanted.valid:
            return
        if held.valid and (held.can_id, held.extended) != (wanted.can_id, wanted.extended):
            raise Refusal(Abort.VALUE_RANGE)
        if not wanted.fits_frame or self._is_restricted(wanted):
            raise Refusal(Abort.VALUE_RANGE)
        used = self._filled_mapping(pdo) if self._count_is_fixed(pdo) else self._memory.number(pdo.mapping_index, 0)
        empty = not held.valid and used == 0
        if empty and not self._family.empty_pdos_enabled:
            raise Refusal(Abort.VALUE_RANGE)

    def _count_is_fixed(self, pdo: Pdo) -> bool:
        """Whether entries can be written and their count cannot: unused ones hold a filler then."""
        count, first = (self._memory.entry(pdo.mapping_index, sub_index) for sub_index in (0, 1))
        return count is not None and first is not None and not count.access.writable and first.access.writable

    def _filled_mapping(self, pdo: Pdo) -> int:
        """How many entries of a fixed count are no filler; Refusal where they do not fit a frame together."""
        count = self._memory.number(pdo.mapping_index, 0)
        words = (self._memory.number(pdo.mapping_index, sub_index) for sub_index in range(1, count + 1))
        used = [word for word in words if word not in (0, self._family.filler)]
        if sum(self._covered_bits(pdo, word) for word in used) > 64:
            raise Refusal(Abort.PDO_LENGTH)
        return len(used)

    def _is_restricted(self, wanted: CobId) -> bool:
        return self._family.restricted_ids_refused and not wanted.extended and within(wanted.can_id, _RESTRICTED)

    def _check_frame_bits(self, pdo: Pdo, wanted: CobId) -> None:
        policy = self._family.rtr_bit[pdo.direction]
        against = (policy is BitPolicy.SET and wanted.rtr_allowed) or (
            policy is BitPolicy.CLEAR and not wanted.rtr_allowed
        )
        if against or (wanted.extended and not self._family.extended_ids):
            raise Refusal(Abort.VALUE_RANGE)

    def _check_transmission_type(self, pdo: Pdo, value: int) -> None:
        on_request = value in _RTR_TYPES
        if on_request and not (pdo.is_tpdo and self.cob_id(pdo).rtr_allowed):
            raise Refusal(Abort.VALUE_RANGE)
        if not within(value, self._family.transmission_types):
            raise Refusal(Abort.VALUE_RANGE)

    def _check_count(self, pdo: Pdo, count: int) -> None:
        if self.cob_id(pdo).valid:
            if self._is_same(pdo, 0, count):
                return
            raise Refusal(self._family.mapping_in_use)
        strict = self._family.count_within_entries
        if strict and count > self._max_entries(pdo):
            raise Refusal(Abort.PDO_LENGTH)
        bits = 0
        for sub_index in range(1, count + 1):
            if not self._memory.exists(pdo.mapping_index, sub_index):
                if strict:
                    raise Refusal(Abort.PDO_LENGTH)
                break
            bits += self._covered_bits(pdo, self._memory.number(pdo.mapping_index, sub_index))
        if bits > 64:
            raise Refusal(Abort.PDO_LENGTH)

    def _covered_bits(self, pdo: Pdo, raw: int) -> int:
        """The length of an entry that a count is about to make active, checked once more."""
        if raw == 0:
            if self._family.empty_entries_counted:
                return 0
            raise Refusal(Abort.NOT_MAPPABLE)
        entry = PdoMappingEntry.from_raw(raw)
        if entry.bits == 0 and not self._family.zero_bits_counted:
            raise Refusal(Abort.VALUE_RANGE)
        self._check_entry(pdo, entry)
        return entry.bits

    def _check_entry_write(self, pdo: Pdo, sub_index: int, raw: int) -> None:
        if sub_index > self._max_entries(pdo):
            raise Refusal(Abort.NO_SUB_INDEX)
        fixed = self._count_is_fixed(pdo)
        if self.cob_id(pdo).valid or (not fixed and self._memory.number(pdo.mapping_index, 0)):
            if self._is_same(pdo, sub_index, raw):
                return
            raise Refusal(self._family.mapping_in_use)
        if raw and not (fixed and raw == self._family.filler):
            self._check_entry(pdo, PdoMappingEntry.from_raw(raw))

    def _is_same(self, pdo: Pdo, sub_index: int, value: int) -> bool:
        """Whether the mapping holds *value* already, and the family takes that for no write."""
        return self._family.same_mapping_accepted and self._memory.number(pdo.mapping_index, sub_index) == value

    def _max_entries(self, pdo: Pdo) -> int:
        listed = self._memory.highest_sub_index(pdo.mapping_index)
        return min(self._family.max_entries, 64 if listed is None else listed)

    def _check_entry(self, pdo: Pdo, entry: PdoMappingEntry) -> None:
        if entry.index in DUMMY_BITS:
            longest: int | None = self._dummy_bits(pdo, entry)
        else:
            longest = self._object_bits(pdo, entry)
        step = self._granularity
        too_long = self._family.entry_length_checked and longest is not None and entry.bits > longest
        if too_long or entry.bits > self._family.max_entry_bits or entry.bits % step:
            raise Refusal(Abort.NOT_MAPPABLE)

    @property
    def _granularity(self) -> int:
        stated = self._family.granularity
        if stated is None:
            stated = self._memory.dictionary.info.granularity
        return stated if stated in _ENFORCED_GRANULARITIES else 1

    def _dummy_bits(self, pdo: Pdo, entry: PdoMappingEntry) -> int:
        if entry.sub_index:
            raise Refusal(Abort.NO_SUB_INDEX)
        supported = self._family.dummies
        if supported is None:
            supported = self._memory.dictionary.info.dummies
        if pdo.is_tpdo and self._family.tpdo_dummies:
            raise Refusal(self._family.tpdo_dummies)
        if supported is not None and entry.index not in supported:
            raise Refusal(Abort.NOT_MAPPABLE)
        return DUMMY_BITS[entry.index]

    def _object_bits(self, pdo: Pdo, entry: PdoMappingEntry) -> int | None:
        """The length of a mapped object, None where nobody knows it."""
        self._memory.require(entry.index, entry.sub_index)
        self._check_mappable(pdo, entry.index, entry.sub_index)
        data_type = self._memory.data_type(entry.index, entry.sub_index)
        if data_type is not None and data_type.bits is not None:
            return data_type.bits
        try:
            return 8 * len(self._memory.read(entry.index, entry.sub_index)) or None
        except Refusal:
            return None

    def _check_mappable(self, pdo: Pdo, index: int, sub_index: int) -> None:
        described = self._memory.entry(index, sub_index)
        if described is None:
            return
        if described.access not in (self._family.tpdo_access if pdo.is_tpdo else self._family.rpdo_access):
            wrong_way = Abort.WRITE_ONLY if pdo.is_tpdo else Abort.READ_ONLY
            raise Refusal(
                wrong_way if self._family.entry_access_codes and described.pdo_mapping else Abort.NOT_MAPPABLE
            )
        mappable = not self._states_mappability if described.pdo_mapping is None else described.pdo_mapping
        if not mappable:
            raise Refusal(Abort.NOT_MAPPABLE)

    @cached_property
    def _states_mappability(self) -> bool:
        """Whether the file has a PDOMapping key anywhere; where it has none, nothing is refused for it."""
        return any(entry.pdo_mapping is not None for entry in self._memory.dictionary.entries())
