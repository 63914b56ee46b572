"""Which entries a device lets be mapped (CiA 301, 7.5.2.36 and 7.5.2.38), in the device's own words.

As `pdo_guard`, it shares no rule with `dvtcli.domain.rules`. Does not know whether a PDO is valid now.
"""

from __future__ import annotations

from functools import cached_property

from dvtcli.domain.abort import Abort
from dvtcli.domain.mapping import DUMMY_BITS, PdoMappingEntry
from dvtcli.domain.pdo import Pdo
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.memory import Memory
from dvtcli.simulator.device.refusal import Refusal

_ENFORCED_GRANULARITIES = (1, 8)
_MISSING: dict[int, str] = {Abort.NO_OBJECT: "missing-object", Abort.NO_SUB_INDEX: "missing-sub-index"}


def refuse(family: Family, pdo: Pdo, check: str, code: int) -> None:
    """Raise Refusal with the family's answer to *check*, *code* where it has none of its own; 0 is no refusal."""
    code = family.answers.get(pdo.direction, {}).get(check, code)
    if code:
        raise Refusal(code)


class EntryGuard:
    """Judges entries for the mappings of one device."""

    def __init__(self, memory: Memory, family: Family) -> None:
        self._memory = memory
        self._family = family

    def check(self, pdo: Pdo, entry: PdoMappingEntry) -> None:
        """Raise Refusal where *entry* cannot be mapped into *pdo*."""
        if entry.index in DUMMY_BITS:
            longest: int | None = self._dummy_bits(pdo, entry)
        else:
            longest = self._object_bits(pdo, entry)
        if longest is not None and entry.bits > longest:
            refuse(self._family, pdo, "entry-too-long", Abort.NOT_MAPPABLE if self._family.entry_length_checked else 0)
        elif longest is not None and entry.bits < longest:
            refuse(self._family, pdo, "entry-too-short", 0)
        if entry.bits > self._family.max_entry_bits:
            refuse(self._family, pdo, "entry-bits", Abort.NOT_MAPPABLE)
        if entry.bits % self._granularity:
            refuse(self._family, pdo, "granularity", Abort.NOT_MAPPABLE)

    @property
    def _granularity(self) -> int:
        stated = self._family.granularity
        if stated is None:
            stated = self._memory.dictionary.info.granularity
        return stated if stated in _ENFORCED_GRANULARITIES else 1

    def _dummy_bits(self, pdo: Pdo, entry: PdoMappingEntry) -> int:
        if entry.sub_index:
            refuse(self._family, pdo, "dummy-sub-index", Abort.NO_SUB_INDEX)
        if pdo.is_tpdo and self._family.tpdo_dummies:
            refuse(self._family, pdo, "dummy", self._family.tpdo_dummies)
        supported = self._family.dummies
        if supported is None:
            supported = self._memory.dictionary.info.dummies
        if supported is not None and entry.index not in supported:
            refuse(self._family, pdo, "dummy", Abort.NOT_MAPPABLE)
        return DUMMY_BITS[entry.index]

    def _object_bits(self, pdo: Pdo, entry: PdoMappingEntry) -> int | None:
        """The length of a mapped object, None where nobody knows it."""
        try:
            self._memory.require(entry.index, entry.sub_index)
        except Refusal as missing:
            refuse(self._family, pdo, _MISSING.get(missing.code, "missing-object"), missing.code)
            return None
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
            refuse(self._family, pdo, "wrong-direction", wrong_way if telling else Abort.NOT_MAPPABLE)
        mappable = not self._states_mappability if described.pdo_mapping is None else described.pdo_mapping
        if not mappable:
            refuse(self._family, pdo, "not-mappable", Abort.NOT_MAPPABLE)

    @cached_property
    def _states_mappability(self) -> bool:
        """Whether the file has a PDOMapping key anywhere; where it has none, nothing is refused for it."""
        return any(entry.pdo_mapping is not None for entry in self._memory.dictionary.entries())
