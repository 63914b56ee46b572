"""Store and restore: 0x1010 "save", 0x1011 "load" and the values after a reset (CiA 301, 7.5.2.13 and 7.5.2.14)."""

from __future__ import annotations

from dvtcli.domain.abort import Abort
from dvtcli.simulator.device.family import Family, Range
from dvtcli.simulator.device.memory import RESTORE, STORE, Memory
from dvtcli.simulator.device.refusal import Refusal

_SIGNATURES = {STORE: b"save", RESTORE: b"load"}
ALL: Range = (0x0000, 0xFFFF)
COMMUNICATION: Range = (0x1000, 0x1FFF)
_APPLICATION: Range = (0x6000, 0x9FFF)
_MANUFACTURER: Range = (0x2000, 0x5FFF)
_AREAS = {1: ALL, 2: COMMUNICATION, 3: _APPLICATION}


class ParameterAreas:
    """The non-volatile memory of one device.

    Faults: *fails*, a store answers 06060000; *stores_nothing* and *restores_nothing*, a signature is acknowledged
    without effect; *saves_itself*, every write is stored at once; *keeps_ram*, stored values return at a power cycle
    only, not at an NMT reset.
    """

    def __init__(self, memory: Memory, family: Family) -> None:
        self._memory = memory
        self._family = family
        self._to_restore: set[Range] = set()
        self.fails = self.stores_nothing = self.restores_nothing = self.saves_itself = self.keeps_ram = False

    def handles(self, index: int, sub_index: int) -> bool:
        """True if a download to the object is a store or restore command."""
        return (index in _SIGNATURES and sub_index > 0) or (index, sub_index) == self._family.save_command

    def command(self, index: int, sub_index: int, data: bytes) -> None:
        """Store, or record a restore. Raises Refusal for a wrong signature, and Refusal (06060000) for a failure."""
        area = _AREAS.get(sub_index, _MANUFACTURER) if index in _SIGNATURES else ALL
        if index in _SIGNATURES and data != _SIGNATURES[index]:
            self._wrong_signature(index)
            return
        if index == RESTORE:
            if not self.restores_nothing:
                self._to_restore.add(area)
                self._memory.stored_changes += 1
            return
        if index == STORE and self._family.save_answer:
            raise Refusal(self._family.save_answer)
        if self.fails:
            raise Refusal(Abort.HARDWARE)
        if self.stores_nothing:
            return
        if self._family.store_lasts:
            self._memory.save(*area)
        self._to_restore.discard(area)

    def _wrong_signature(self, index: int) -> None:
        """Raise Refusal, unless the family accepts any value at 0x1010; only the signature has an effect."""
        code = self._family.wrong_signature if index == STORE else Abort.CANNOT_STORE
        if code:
            raise Refusal(code)

    def keep_written(self, index: int) -> None:
        """Store an object that saves itself, after a write."""
        span = self._family.needs_store
        if self.saves_itself or (span is not None and not span[0] <= index <= span[1]):
            self._memory.save(index, index)

    @property
    def changes(self) -> int:
        """A number that grows whenever `kept` changes."""
        return self._memory.stored_changes

    def kept(self) -> dict[tuple[int, int], bytes]:
        """The values restored at power-on, by index and sub-index; the rest are defaults."""
        kept = self._memory.stored_outside(1, 0)
        for first, last in self._to_restore:
            kept = {key: data for key, data in kept.items() if not first <= key[0] <= last}
        return kept

    def reset(self, *, communication_only: bool, powered: bool) -> None:
        """Load stored values, or the defaults after a requested restore; *powered*: RAM kept its power.

        A device with *keeps_ram* loads only values with a requested restore.
        """
        if communication_only and not self._family.communication_reset_reloads:
            return
        due = {area for area in self._to_restore if area == COMMUNICATION or not communication_only}
        for area in due:
            self._memory.forget_stored(*area)
        self._to_restore -= due
        whole = COMMUNICATION if communication_only else ALL
        for area in due if powered and self.keeps_ram else (whole,):
            self._memory.reload(*area)
