"""The device's checks of PDO configuration (CiA 301, 7.5.2.35 to 7.5.2.38).

Deliberately shares no rule with `dvtcli.domain.rules`: a checker and a device that share a function share its mistakes.
"""

from __future__ import annotations

from functools import cached_property

from dvtcli.domain.abort import Abort
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.objects import SAFETY
from dvtcli.domain.pdo import DUMMY_BITS, Pdo, PdoMappingEntry, is_mpdo
from dvtcli.domain.profile import BitPolicy, within
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.memory import Memory, Refusal

_ENFORCED_GRANULARITIES = (1, 8)
_MISSING: dict[int, str] = {Abort.NO_OBJECT: "missing-object", Abort.NO_SUB_INDEX: "missing-sub-index"}


def answer_check(family: Family, pdo: Pdo, check: str, code: int) -> None:
    """Raise Refusal with the family's abort code for *check*, else *code*; returns if that is 0: it accepts the value.

    *check* is a key of `CHECKS`.
    """
    code = family.answers.get(pdo.direction, {}).get(check, code)
    if code:
        raise Refusal(code)


class EntryChecks:
    """Checks mapping entries of one device."""

    def __init__(self, memory: Memory, family: Family) -> None:
        self._memory = memory
        self._family = family

    def check(self, pdo: Pdo, entry: PdoMappingEntry) -> None:
        """Raise Refusal if *entry* cannot be mapped into *pdo*."""
        if entry.index in DUMMY_BITS:
            longest: int | None = self._dummy_bits(pdo, entry)
        else:
            longest = self._object_bits(pdo, entry)
        if longest is not None and entry.bits > longest:
            answer_check(
                self._family, pdo, "entry-too-long", Abort.NOT_MAPPABLE if self._family.entry_length_checked else 0
            )
        elif longest is not None and entry.bits < longest:
            answer_check(self._family, pdo, "entry-too-short", 0)
        if entry.bits > self._family.max_entry_bits:
            answer_check(self._family, pdo, "entry-bits", Abort.NOT_MAPPABLE)
        if entry.bits % self._granularity:
            answer_check(self._family, pdo, "granularity", Abort.NOT_MAPPABLE)

    @property
    def _granularity(self) -> int:
        stated = self._family.granularity
        if stated is None:
            stated = self._memory.dictionary.info.granularity
        return stated if stated in _ENFORCED_GRANULARITIES else 1

    def _dummy_bits(self, pdo: Pdo, entry: PdoMappingEntry) -> int:
        if entry.sub_index:
            answer_check(self._family, pdo, "dummy-sub-index", Abort.NO_SUB_INDEX)
        if pdo.is_tpdo and self._family.tpdo_dummies:
            answer_check(self._family, pdo, "dummy", self._family.tpdo_dummies)
        supported = self._family.dummies
        if supported is None:
            supported = self._memory.dictionary.info.dummies
        if supported is not None and entry.index not in supported:
            answer_check(self._family, pdo, "dummy", Abort.NOT_MAPPABLE)
        return DUMMY_BITS[entry.index]

    def _object_bits(self, pdo: Pdo, entry: PdoMappingEntry) -> int | None:
        """The length of a mapped object in bits, None if unknown."""
        try:
            self._memory.require(entry.index, entry.sub_index)
        except Refusal as missing:
            answer_check(self._family, pdo, _MISSING.get(missing.code, "missing-object"), missing.code)
            return None
        if entry.index in SAFETY:
            answer_check(self._family, pdo, "not-mappable", Abort.NOT_MAPPABLE)
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
            telling = self._family.entry_access_codes and described.pdo_mapping
            answer_check(self._family, pdo, "wrong-direction", wrong_way if telling else Abort.NOT_MAPPABLE)
        mappable = not self._states_mappability if described.pdo_mapping is None else described.pdo_mapping
        if not mappable:
            answer_check(self._family, pdo, "not-mappable", Abort.NOT_MAPPABLE)

    @cached_property
    def _states_mappability(self) -> bool:
        """True if the file has any PDOMapping key; without one, every object counts as mappable."""
        return any(entry.pdo_mapping is not None for entry in self._memory.dictionary.entries())


#: What may have limits in a file: the sub-indices of a communication parameter, and of a mapping its count and entries.
_PARAMETERS = {1: "cob-id", 2: "type", 3: "inhibit", 5: "event", 6: "sync-start"}
_COUNT, _ENTRY = "count", "entry"


def limit_check(index: int, sub_index: int, code: int) -> str:
    """The name of the check for a file's limit that answers *code*; "" for no PDO parameter."""
    pdo = Pdo.at(index)
    if pdo is None:
        return ""
    communication = index == pdo.communication_index
    name = _PARAMETERS.get(sub_index, "") if communication else _ENTRY if sub_index else _COUNT
    side = "above" if code == Abort.VALUE_HIGH else "below"
    return f"{name}-{side}-limit" if name else ""


#: Check → what is written when it is made.
CHECKS = {
    "cob-id-again": "a COB-ID that is held already, while the PDO is valid",
    "cob-id-while-valid": "another CAN-ID, while the PDO is valid",
    "rtr-bit": "a COB-ID whose bit 30 is not as the family has it",
    "extended": "a COB-ID with bit 29",
    "beyond-frame": "a CAN-ID above 0x7FF without bit 29, to be valid",
    "restricted": "a CAN-ID that CiA 301 keeps for others, to be valid",
    "empty-enabled": "a COB-ID that makes a PDO valid whose count is 0",
    "type": "a transmission type that the family does not know",
    "type-without-rtr": "transmission type 252 or 253 while bit 30 forbids RTR",
    "type-while-valid": "a transmission type, while the PDO is valid",
    "inhibit-while-valid": "an inhibit time, while the PDO is valid",
    "event-while-valid": "an event timer, while the PDO is valid",
    "sync-start-while-valid": "a SYNC start value, while the PDO is valid",
    "inhibit-high": "an inhibit time above the family's highest",
    "event-high": "an event timer above the family's highest",
    "count-again": "the count that is held already, while the PDO is valid",
    "count-while-valid": "another count, while the PDO is valid",
    "count-beyond": "a count above the entries that there are",
    "count-over-zero": "a count over an entry of 0",
    "count-over-no-bits": "a count over an entry of 0 bits",
    "too-many-bits": "a count over more than 64 bits",
    "no-entry": "an entry after the last one",
    "entry-again": "the entry that is held already, while the PDO is valid",
    "entry-while-valid": "another entry, while the PDO is valid",
    "entry-again-counted": "the entry that is held already, while the count is not 0",
    "entry-while-counted": "another entry, while the count is not 0",
    "entry-zero": "an entry of 0",
    "missing-object": "an entry that names an object that is not there",
    "missing-sub-index": "an entry that names a sub-index that is not there",
    "not-mappable": "an entry that names an object that is not mappable",
    "wrong-direction": "an entry that names an object whose access is for the other direction",
    "entry-too-long": "an entry that is longer than its object",
    "entry-too-short": "an entry that is shorter than its object",
    "entry-bits": "an entry above the family's longest",
    "granularity": "an entry whose length is not a multiple of the granularity",
    "dummy": "an entry that names a dummy which the family does not have",
    "dummy-sub-index": "an entry that names sub-index 1 of a dummy",
    **{
        f"{name}-{side}-limit": f"{what} {side} the limit that the file states"
        for name, what in (
            ("cob-id", "a COB-ID"),
            ("type", "a transmission type"),
            ("inhibit", "an inhibit time"),
            ("event", "an event timer"),
            ("sync-start", "a SYNC start value"),
            (_COUNT, "a count"),
            (_ENTRY, "an entry"),
        )
        for side in ("below", "above")
    },
}


COB_ID, TRANSMISSION_TYPE, INHIBIT_TIME, EVENT_TIMER, SYNC_START = 1, 2, 3, 5, 6
_RTR_TYPES = (252, 253)
#: CiA 301, table 40: CAN-IDs no PDO may use.
_RESTRICTED = (
    (0x000, 0x07F),
    (0x101, 0x180),
    (0x581, 0x5FF),
    (0x601, 0x67F),
    (0x6E0, 0x6FF),
    (0x701, 0x7FF),
)
#: Names in `CHECKS` of the parameters written while the PDO is valid, and the standard's answers.
_WHILE_VALID = {
    TRANSMISSION_TYPE: ("type-while-valid", 0),
    INHIBIT_TIME: ("inhibit-while-valid", Abort.VALUE_RANGE),
    EVENT_TIMER: ("event-while-valid", 0),
    SYNC_START: ("sync-start-while-valid", Abort.VALUE_RANGE),
}
#: What an entry that is written while the mapping is in use is called: by whether the PDO is valid (else its count is
#: not 0), and whether the entry is held already.
_IN_USE = {
    (True, True): "entry-again",
    (True, False): "entry-while-valid",
    (False, True): "entry-again-counted",
    (False, False): "entry-while-counted",
}


class PdoChecks:
    """Checks downloads to the PDO parameters of one device."""

    def __init__(self, memory: Memory, family: Family) -> None:
        self._memory = memory
        self._family = family
        self._entries = EntryChecks(memory, family)

    def check(self, index: int, sub_index: int, data: bytes) -> None:
        """Raise Refusal if the device does not accept *data* for a PDO parameter now."""
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
        """The present COB-ID of a PDO; disabled if the node has no such object."""
        return CobId.from_raw(self._memory.number(pdo.communication_index, COB_ID, missing=1 << 31) & 0xFFFF_FFFF)

    def _check_communication(self, pdo: Pdo, sub_index: int, value: int) -> None:
        if sub_index == COB_ID:
            self._check_cob_id(pdo, CobId.from_raw(value))
            return
        if sub_index == TRANSMISSION_TYPE:
            self._check_transmission_type(pdo, value)
        elif sub_index == INHIBIT_TIME and value > self._family.max_inhibit_time:
            answer_check(self._family, pdo, "inhibit-high", Abort.VALUE_HIGH)
        elif sub_index == EVENT_TIMER and value > self._family.max_event_timer:
            answer_check(self._family, pdo, "event-high", Abort.VALUE_HIGH)
        if sub_index in _WHILE_VALID and self.cob_id(pdo).valid:
            answer_check(self._family, pdo, *_WHILE_VALID[sub_index])

    def _check_cob_id(self, pdo: Pdo, wanted: CobId) -> None:
        held = self.cob_id(pdo)
        if wanted == held:
            if held.valid:
                answer_check(self._family, pdo, "cob-id-again", 0)
            return
        self._check_frame_bits(pdo, wanted)
        if not wanted.valid:
            return
        if held.valid and (held.can_id, held.extended) != (wanted.can_id, wanted.extended):
            answer_check(self._family, pdo, "cob-id-while-valid", Abort.VALUE_RANGE)
        if not wanted.fits_frame:
            answer_check(self._family, pdo, "beyond-frame", Abort.VALUE_RANGE)
        elif not wanted.extended and within(wanted.can_id, _RESTRICTED):
            answer_check(
                self._family, pdo, "restricted", Abort.VALUE_RANGE if self._family.restricted_ids_refused else 0
            )
        used = self._filled_mapping(pdo) if self._count_is_fixed(pdo) else self._memory.number(pdo.mapping_index, 0)
        if not held.valid and used == 0:
            answer_check(
                self._family, pdo, "empty-enabled", 0 if self._family.empty_pdos_enabled else Abort.VALUE_RANGE
            )

    def _count_is_fixed(self, pdo: Pdo) -> bool:
        """True if entries are writable but their count is not: unused entries contain a filler."""
        count, first = (self._memory.entry(pdo.mapping_index, sub_index) for sub_index in (0, 1))
        return count is not None and first is not None and not count.access.writable and first.access.writable

    def _filled_mapping(self, pdo: Pdo) -> int:
        """The number of used entries under a fixed count. Raises Refusal if the device refuses more than 64 bits."""
        count = self._memory.number(pdo.mapping_index, 0)
        words = (self._memory.number(pdo.mapping_index, sub_index) for sub_index in range(1, count + 1))
        used = [word for word in words if word not in (0, self._family.filler)]
        if sum(self._covered_bits(pdo, word) for word in used) > 64:
            answer_check(self._family, pdo, "too-many-bits", Abort.PDO_LENGTH)
        return len(used)

    def _check_frame_bits(self, pdo: Pdo, wanted: CobId) -> None:
        policy = self._family.rtr_bit[pdo.direction]
        if (policy is BitPolicy.SET and wanted.rtr_allowed) or (policy is BitPolicy.CLEAR and not wanted.rtr_allowed):
            answer_check(self._family, pdo, "rtr-bit", Abort.VALUE_RANGE)
        if wanted.extended and not self._family.extended_ids:
            answer_check(self._family, pdo, "extended", Abort.VALUE_RANGE)

    def _check_transmission_type(self, pdo: Pdo, value: int) -> None:
        if value in _RTR_TYPES and pdo.is_tpdo and not self.cob_id(pdo).rtr_allowed:
            answer_check(self._family, pdo, "type-without-rtr", Abort.VALUE_RANGE)
        own = self._family.pdo_types.get(pdo.direction)
        if own is not None:
            code = next((code for first, last, code in own if first <= value <= last), Abort.VALUE_RANGE)
        else:
            known = within(value, self._family.transmission_types) and (pdo.is_tpdo or value not in _RTR_TYPES)
            code = 0 if known else Abort.VALUE_RANGE
        if code:
            answer_check(self._family, pdo, "type", code)

    def _check_count(self, pdo: Pdo, count: int) -> None:
        if self.cob_id(pdo).valid:
            again = self._memory.number(pdo.mapping_index, 0) == count
            code = 0 if again and self._family.same_mapping_accepted else self._family.mapping_in_use
            answer_check(self._family, pdo, "count-again" if again else "count-while-valid", code)
            if again:
                return
        if is_mpdo(count) and self._memory.dictionary.info.group_messaging:
            return
        strict = Abort.PDO_LENGTH if self._family.count_within_entries else 0
        if count > self._max_entries(pdo):
            answer_check(self._family, pdo, "count-beyond", strict)
        bits = 0
        for sub_index in range(1, count + 1):
            if not self._memory.exists(pdo.mapping_index, sub_index):
                answer_check(self._family, pdo, "count-beyond", strict)
                break
            bits += self._covered_bits(pdo, self._memory.number(pdo.mapping_index, sub_index))
        if bits > 64:
            answer_check(self._family, pdo, "too-many-bits", Abort.PDO_LENGTH)

    def _covered_bits(self, pdo: Pdo, raw: int) -> int:
        """The length of an entry activated by a count, checked again."""
        if raw == 0:
            code = 0 if self._family.empty_entries_counted else Abort.NOT_MAPPABLE
            answer_check(self._family, pdo, "count-over-zero", code)
            return 0
        entry = PdoMappingEntry.from_raw(raw)
        if entry.bits == 0:
            answer_check(
                self._family, pdo, "count-over-no-bits", 0 if self._family.zero_bits_counted else Abort.VALUE_RANGE
            )
        self._entries.check(pdo, entry)
        return entry.bits

    def _check_entry_write(self, pdo: Pdo, sub_index: int, raw: int) -> None:
        if sub_index > self._max_entries(pdo):
            answer_check(self._family, pdo, "no-entry", Abort.NO_SUB_INDEX)
        fixed = self._count_is_fixed(pdo)
        valid = self.cob_id(pdo).valid
        if valid or (not fixed and self._memory.number(pdo.mapping_index, 0)):
            again = self._memory.number(pdo.mapping_index, sub_index) == raw
            code = 0 if again and self._family.same_mapping_accepted else self._family.mapping_in_use
            answer_check(self._family, pdo, _IN_USE[valid, again], code)
            if again:
                return
        if not raw:
            answer_check(self._family, pdo, "entry-zero", 0)
        elif not (fixed and raw == self._family.filler):
            self._entries.check(pdo, PdoMappingEntry.from_raw(raw))

    def _max_entries(self, pdo: Pdo) -> int:
        listed = self._memory.highest_sub_index(pdo.mapping_index)
        return min(self._family.max_entries, 64 if listed is None else listed)
