"""The objects of a simulated device: values in RAM, stored values, defaults, and existence."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from dvtcli.domain.abort import Abort
from dvtcli.domain.datatypes import U8, U16, U32, DataType
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
from dvtcli.domain.objects import RESTORE_PARAMETERS, STORE_PARAMETERS
from dvtcli.domain.pdo import Pdo
from dvtcli.simulator.device.family import Family, Range

Backing = Callable[[int, int], bytes]
Key = tuple[int, int]
_MISSING = (Abort.NO_OBJECT, Abort.NO_SUB_INDEX)
#: What a PDO wakes with whose file tells no COB-ID, or 0x000, which is NMT: it does not exist (bit 31).
_OFF, _COB_ID_BYTES = bytes([0, 0, 0, 0x80]), 4
_COMMUNICATION_TYPES = {0: U8, 1: U32, 2: U8, 3: U16, 5: U16, 6: U8}


class Memory:
    """The values of one node; *capabilities* are the values of 0x1010:s and 0x1011:s; *backing* as in `StrictDevice`.

    *absent* has the abort codes of objects removed from *dictionary*, sub-index 0 for whole objects.
    """

    def __init__(
        self,
        dictionary: ObjectDictionary,
        node_id: int,
        capabilities: Mapping[int, int],
        backing: Backing | None = None,
        absent: Mapping[Key, int] = MappingProxyType({}),
    ) -> None:
        self.dictionary = dictionary
        self._absent = absent
        self.backing = backing
        #: the node's own node-ID, 255 for none; what defaults with $NODEID follow
        self.node_id = node_id
        self._capabilities = capabilities
        self._ram: dict[Key, bytes] = {}
        self._stored: dict[Key, bytes] = {}
        #: grows whenever a stored value changes
        self.stored_changes = 0
        self._existence: dict[Key, Refusal | None] = {}
        #: the cache of the dictionary, which does not change
        self._existing: set[Key] = set()
        self._initials: dict[Key, bytes] = {}
        #: the number of changes, for observers
        self.changes = 0
        #: called at each growth
        self.on_change: list[Callable[[], None]] = []

    def take_node_id(self, node_id: int) -> None:
        """Set the node-ID to *node_id* (1..127, 255 for none): defaults with $NODEID follow."""
        if node_id != self.node_id:
            self.node_id = node_id
            self._initials.clear()

    def entry(self, index: int, sub_index: int) -> OdEntry | None:
        """The dictionary's entry for an object, None if missing."""
        return self.dictionary.entry(index, sub_index)

    def require(self, index: int, sub_index: int) -> None:
        """Raise Refusal(06020000) for a missing object, Refusal(06090011) for a missing sub-index."""
        if (index, sub_index) in self._existing:
            return
        if self.backing is not None:
            self._require_backed(index, sub_index)
            return
        code = self._absent.get((index, 0)) or self._absent.get((index, sub_index))
        if code:
            raise Refusal(code)
        if index not in self.dictionary:
            raise Refusal(Abort.NO_OBJECT)
        if self.entry(index, sub_index) is None:
            raise Refusal(Abort.NO_SUB_INDEX)
        self._existing.add((index, sub_index))

    def exists(self, index: int, sub_index: int) -> bool:
        """True if the node has the object."""
        try:
            self.require(index, sub_index)
        except Refusal:
            return False
        return True

    def _require_backed(self, index: int, sub_index: int) -> None:
        key = (index, sub_index)
        if key not in self._existence:
            self._existence[key] = self._missing(index, sub_index)
        refusal = self._existence[key]
        if refusal is not None:
            raise Refusal(refusal.code)

    def _missing(self, index: int, sub_index: int) -> Refusal | None:
        if (index, sub_index) in self._ram:
            return None
        try:
            self.read(index, sub_index)
        except Refusal as refusal:
            return refusal if refusal.code in _MISSING else None
        return None

    def read(self, index: int, sub_index: int) -> bytes:
        """The bytes of an upload, regardless of access; the object must exist."""
        held = self._ram.get((index, sub_index))
        if held is not None:
            return held
        if self.backing is not None:
            return bytes(self.backing(index, sub_index))
        initial = self._initials.get((index, sub_index))
        if initial is None:
            initial = self._initials[index, sub_index] = self._initial(index, sub_index)
        return initial

    def _initial(self, index: int, sub_index: int) -> bytes:
        size = self.size(index, sub_index)
        if index in self._capabilities and sub_index:
            return self._capabilities[index].to_bytes(4, "little")
        entry = self.entry(index, sub_index)
        data = (entry.at_power_on(self.node_id) if entry else None) or b""
        if not any(data) and size == _COB_ID_BYTES and _is_cob_id(index, sub_index):
            return _OFF
        return data if size is None else data[:size].ljust(size, b"\0")

    def number(self, index: int, sub_index: int, missing: int = 0) -> int:
        """The object's value as an unsigned number, *missing* if the node has no such object."""
        if not self.exists(index, sub_index):
            return missing
        return int.from_bytes(self.read(index, sub_index), "little")

    def write(self, index: int, sub_index: int, data: bytes) -> None:
        """Put *data* into RAM, unchecked."""
        self._ram[index, sub_index] = bytes(data)
        self.touch()

    def touch(self) -> None:
        """Record a change, also of a state outside the objects."""
        self.changes += 1
        for callback in self.on_change:
            callback()

    def data_type(self, index: int, sub_index: int) -> DataType | None:
        """The object's type by the dictionary, else by CiA 301 for PDO parameters and 0x1010/0x1011, else None."""
        entry = self.entry(index, sub_index)
        if entry is not None and entry.data_type is not None:
            return entry.data_type
        if index in (STORE_PARAMETERS, RESTORE_PARAMETERS):
            return U32 if sub_index else U8
        pdo = Pdo.at(index)
        if pdo is None:
            return None
        if index == pdo.mapping_index:
            return U32 if sub_index else U8
        return _COMMUNICATION_TYPES.get(sub_index)

    def size(self, index: int, sub_index: int) -> int | None:
        """The object's length in bytes, None if variable or unknown."""
        data_type = self.data_type(index, sub_index)
        return None if data_type is None else data_type.size

    def highest_sub_index(self, index: int) -> int | None:
        """The last sub-index in the dictionary, None if missing or a backing decides."""
        if self.backing is not None or index not in self.dictionary:
            return None
        return max(self.dictionary[index].entries, default=0)

    def indices(self) -> set[int]:
        """Every index in the dictionary or written so far."""
        return set(self.dictionary) | {index for index, _ in self._ram}

    def save(self, first: int, last: int) -> None:
        """Copy RAM to the stored values for indices *first*..*last*."""
        self.stored_changes += 1
        for (index, sub_index), data in self._ram.items():
            entry = self.entry(index, sub_index)
            if first <= index <= last and (entry is None or entry.access.writable):
                self._stored[index, sub_index] = data

    def forget_stored(self, first: int, last: int) -> None:
        """Drop the stored values of indices *first*..*last*: the defaults apply again."""
        self.stored_changes += 1
        self._stored = self.stored_outside(first, last)

    def stored_outside(self, first: int, last: int) -> dict[Key, bytes]:
        """The stored values outside indices *first*..*last*."""
        return {key: data for key, data in self._stored.items() if not first <= key[0] <= last}

    def put_stored(self, values: Mapping[Key, bytes]) -> None:
        """Load *values* as stored values, if they still fit an object of the node."""
        fitting = (key for key, data in values.items() if self.exists(*key) and self.size(*key) in (None, len(data)))
        self._stored = {key: bytes(values[key]) for key in fitting}

    def reload(self, first: int, last: int) -> None:
        """Reset indices *first*..*last* to their stored values, else their defaults."""
        self._ram = {key: data for key, data in self._ram.items() if not first <= key[0] <= last}
        self._ram.update({key: data for key, data in self._stored.items() if first <= key[0] <= last})
        self.touch()


def _is_cob_id(index: int, sub_index: int) -> bool:
    pdo = Pdo.at(index)
    return pdo is not None and (index, sub_index) == (pdo.communication_index, 1)


_SIGNATURES = {STORE_PARAMETERS: b"save", RESTORE_PARAMETERS: b"load"}
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
        if index == RESTORE_PARAMETERS:
            if not self.restores_nothing:
                self._to_restore.add(area)
                self._memory.stored_changes += 1
            return
        if index == STORE_PARAMETERS and self._family.save_answer:
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
        code = self._family.wrong_signature if index == STORE_PARAMETERS else Abort.CANNOT_STORE
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


class Refusal(Exception):
    """The device aborts an SDO request with *code*; *reason* is the value of its extended error object."""

    def __init__(self, code: int, reason: int | None = None) -> None:
        super().__init__(f"0x{code:08X}")
        self.code = int(code)
        self.reason = reason
