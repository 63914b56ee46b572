"""The strict simulated device: one node's state machine, without I/O and without a clock of its own.

Applies checks in the order of a CANopen device. Deliberately shares no rule with dvtcli: every check is written a
second time.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

from dvtcli.domain.abort import Abort
from dvtcli.domain.can_ids import HEARTBEAT_BASE
from dvtcli.domain.nmt import UNCONFIGURED, NmtCommand, NmtState
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
from dvtcli.domain.objects import VERIFY_CONFIGURATION
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.frame_services import FrameServices
from dvtcli.simulator.device.memory import Backing, Memory, ParameterAreas, Refusal
from dvtcli.simulator.device.pdo_checks import PdoChecks, answer_check, limit_check
from dvtcli.simulator.device.write_conditions import WriteConditions

if TYPE_CHECKING:
    from dvtcli.simulator.device.boot_loader import BootLoader
    from dvtcli.simulator.device.lss_slave import LssSlave


def check_limits(entry: OdEntry, node_id: int, data: bytes) -> None:
    """Raise Refusal(06090031) above, Refusal(06090032) below the file's limits for *entry*.

    Ignores meaningless limits: low > high, outside the type, or no choice for a PDO parameter (real files have 0..0
    there).
    """
    data_type = entry.data_type
    value = None if data_type is None else data_type.decode(data)
    if data_type is None or not isinstance(value, int | float):
        return
    low, high = entry.limits(node_id)
    floor, ceiling = data_type.limits or (float("-inf"), float("inf"))
    lowest = floor if low is None else low
    highest = ceiling if high is None else high
    if not floor <= lowest <= highest <= ceiling or (lowest == highest and Pdo.at(entry.index)):
        return
    if value > highest:
        raise Refusal(Abort.VALUE_HIGH)
    if value < lowest:
        raise Refusal(Abort.VALUE_LOW)


class DeviceService(Protocol):
    """A part of the device with objects of its own, such as SYNC or EMCY."""

    def check(self, index: int, _sub_index: int, data: bytes, /) -> None:
        """Raise Refusal if *data* may not be written to an object of the service."""
        ...


class Judge:
    """Checks downloads to one device; *services* check after the PDO rules and the file's limits."""

    def __init__(
        self,
        memory: Memory,
        family: Family,
        conditions: WriteConditions,
        store: ParameterAreas,
        services: Sequence[DeviceService],
    ) -> None:
        self._memory = memory
        self._family = family
        self._conditions = conditions
        self._store = store
        self._services = tuple(services)
        self._guard = PdoChecks(memory, family)

    def check_access(self, index: int, sub_index: int, size: int | None) -> None:
        """Raise Refusal for a write impossible with any value; *size* is in bytes, None if unknown."""
        self._memory.require(index, sub_index)
        entry = self._memory.entry(index, sub_index)
        if entry is not None and not entry.access.writable:
            raise Refusal(Abort.READ_ONLY)
        wanted = self._memory.size(index, sub_index)
        if wanted is None or size is None or size == wanted:
            return
        raise Refusal(Abort.TOO_LONG if size > wanted else Abort.TOO_SHORT)

    def check_value(self, index: int, sub_index: int, data: bytes, state: NmtState) -> None:
        """Raise Refusal for *data*; state and PDO rules precede the file's limits, as their abort codes are more
        specific.
        """
        self._conditions.check(index, state)
        if self._family.pdo_rules_always or state is NmtState.OPERATIONAL:
            self._guard.check(index, sub_index, data)
        entry = self._memory.entry(index, sub_index)
        if entry is not None and not self._store.handles(index, sub_index):
            self._check_limits(entry, data)
        for service in self._services:
            service.check(index, sub_index, data)
        self._conditions.check_selection(index, sub_index, data)

    def _check_limits(self, entry: OdEntry, data: bytes) -> None:
        """Check the file's limits; for a PDO parameter the family may have another answer, or none."""
        try:
            check_limits(entry, self._memory.node_id, data)
        except Refusal as outside:
            pdo = Pdo.at(entry.index)
            check = limit_check(entry.index, entry.sub_index, outside.code)
            if pdo is None or not check:
                raise
            answer_check(self._family, pdo, check, outside.code)


_STATES = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
}


class StrictDevice:
    """A simulated node that applies every check of CiA 301 and its family.

    *dictionary* lists the objects, *family* the behaviour; *node_id* is 1..127, or 255 for a node without a node-ID
    (LSS). With *backing* the device is a twin of a real node: an object not yet written is read by `backing(index,
    sub_index)`, which raises Refusal if the node refuses. The node decides existence; the dictionary (possibly empty)
    adds types, access, limits and mappability; unknown properties cause no refusal. Nothing is ever written to the
    node.

    A new device is INITIALISING until `boot_up`. Its own frames collect in `outbox`.
    """

    def __init__(
        self, dictionary: ObjectDictionary, family: Family, node_id: int, *, backing: Backing | None = None
    ) -> None:
        if not 1 <= node_id <= 127 and node_id != UNCONFIGURED:
            raise ValueError(f"node-ID {node_id} is not within 1..127")
        self.dictionary = dictionary.without(family.absent)
        self.family = family
        self.outbox: list[Frame] = []
        #: the number of resets
        self.resets = 0
        #: whether NMT commands that ask for a state are not obeyed
        self.ignores_nmt = False
        self._memory = Memory(self.dictionary, node_id, family.capabilities, backing, family.absent)
        self._conditions = WriteConditions(self._memory, family)
        #: stored values and the reset
        self.areas = ParameterAreas(self._memory, family)
        #: the services besides SDO and NMT commands
        self.services = FrameServices(self._memory, family)
        #: the boot loader, None for a fixed program and for a twin
        self.loader = _loader(family.flash_busy) if family.boot_loader and backing is None else None
        #: the LSS slave; before its first use, the bit rate (bit/s) at power-on, and the accepted bit rates
        self._lss: LssSlave | None = None
        self._rates: tuple[int | None, Collection[int] | None] = (None, ())
        self._judge = Judge(self._memory, family, self._conditions, self.areas, self.services.judges)

    @property
    def node_id(self) -> int:
        """The node-ID, 1..127; 255 for none."""
        return self._memory.node_id

    @property
    def lss(self) -> LssSlave:
        """The node's LSS slave, created on first use."""
        if self._lss is None:
            from dvtcli.simulator.device.lss_slave import LssSlave

            self._lss = LssSlave(self._memory, self.areas, self.node_id, self.family)
            self._lss.run_at(*self._rates)
        return self._lss

    @property
    def bit_rate(self) -> int | None:
        """The node's bit rate (bit/s); None if frames take no time."""
        return self._rates[0] if self._lss is None else self._lss.bit_rate

    def run_at(self, bit_rate: int | None, known_rates: Collection[int] | None = ()) -> None:
        """Run at *bit_rate* (bit/s) from now on; *known_rates* are accepted over LSS, None: those of CiA 305."""
        self._rates = bit_rate, known_rates
        if self._lss is not None:
            self._lss.run_at(bit_rate, known_rates)

    @property
    def state(self) -> NmtState:
        """The NMT state; a twin's is copied from the real node."""
        return self.services.state

    @state.setter
    def state(self, state: NmtState) -> None:
        self.services.state = state

    @property
    def changes(self) -> int:
        """A number that grows whenever an object was written, or may have been."""
        return self._memory.changes

    def on_change(self, callback: Callable[[], None]) -> None:
        """Call *callback* directly at each growth of this number; the callback must be quick."""
        self._memory.on_change.append(callback)

    def power_on(self, stored: Mapping[tuple[int, int], bytes], node_id: int | None = None) -> None:
        """Start from *stored* values and *node_id* only; INITIALISING until `boot_up`."""
        self._memory.put_stored(stored)
        if node_id:
            self.lss.stored = node_id
        self.restart()

    def upload(self, index: int, sub_index: int) -> bytes:
        """The value of an SDO upload. Raises Refusal if the device refuses."""
        self._memory.require(index, sub_index)
        entry = self._memory.entry(index, sub_index)
        if entry is not None and not entry.access.readable:
            raise Refusal(Abort.WRITE_ONLY)
        if (index, sub_index) == self.family.state_object:
            return bytes([self.state])
        if self.loader is not None and self.loader.handles(index, sub_index):
            return self.loader.read(index)
        return self._memory.read(index, sub_index)

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        """Write *data* as an SDO download. Raises Refusal, without any change, if the device refuses."""
        try:
            self._judge.check_access(index, sub_index, len(data))
            self._judge.check_value(index, sub_index, data, self.state)
            self._accept(index, sub_index, bytes(data))
        except Refusal as refusal:
            raise self._conditions.explained(refusal) from None

    def begin_download(self, index: int, sub_index: int, size: int | None) -> None:
        """Raise Refusal for a download impossible with any value: existence, access, or *size* (bytes, if known)."""
        try:
            self._judge.check_access(index, sub_index, size)
            if self.loader is not None and self.loader.handles(index, sub_index):
                self.loader.begin(index)
        except Refusal as refusal:
            raise self._conditions.explained(refusal) from None

    def size_of(self, index: int, sub_index: int) -> int | None:
        """The object's length in bytes, None if variable or unknown."""
        return self._memory.size(index, sub_index)

    def value(self, index: int, sub_index: int = 0) -> bytes:
        """The object's value, regardless of access. Raises Refusal if the object does not exist."""
        self._memory.require(index, sub_index)
        return self._memory.read(index, sub_index)

    def set_value(self, index: int, sub_index: int, data: bytes) -> None:
        """Change an object as the device's own application would: a sensor moved, a status changed."""
        self._memory.require(index, sub_index)
        self._memory.write(index, sub_index, data)
        self.services.changed(index)

    def nmt(self, command: int) -> None:
        """Obey an NMT command specifier; ignores unknown specifiers, and all as a master or before `boot_up`."""
        if self.node_id == UNCONFIGURED and command == NmtCommand.RESET_COMMUNICATION:
            self._reset(communication_only=True)  # obeyed without a node-ID, to activate a configured node-ID
            return
        if self.state is NmtState.INITIALISING or command not in list(NmtCommand) or self._conditions.is_master:
            return
        if command in _STATES:
            if self.ignores_nmt:
                return
            self.state = self._conditions.granted(_STATES[NmtCommand(command)], self.state)
        else:
            self._reset(communication_only=command == NmtCommand.RESET_COMMUNICATION)

    def layer_setting(self, request: bytes) -> bytes | None:
        """Obey an LSS *request*; the answer, None for none. An INITIALISING node obeys only without a node-ID."""
        if self.state is NmtState.INITIALISING and self.node_id != UNCONFIGURED:
            return None
        answer = self.lss.handle(request)
        if self.lss.woken:
            self._reset(communication_only=True)
        return answer

    def boot_up(self) -> None:
        """Finish initialising: put the boot-up frame in the outbox and enter the family's state.

        A node without a node-ID continues to wait for one (CiA 305).
        """
        if self.node_id == UNCONFIGURED:
            return
        if self.family.boot_up_message:
            self.outbox.append(Frame(HEARTBEAT_BASE + self.node_id, b"\0"))
        self.state = self.family.boot_state
        self.services.booted()

    def restart(self) -> None:
        """Lose unstored values, as at power-on; INITIALISING without communication until `boot_up`."""
        self.outbox.clear()
        self._initialise(communication_only=False, powered=False)

    def take_outbox(self) -> list[Frame]:
        """The frames to send now; empties the outbox."""
        frames, self.outbox = self.outbox, []
        return frames

    def _accept(self, index: int, sub_index: int, data: bytes) -> None:
        if self.areas.handles(index, sub_index):
            self.areas.command(index, sub_index, data)
            return
        if self._conditions.is_passcode(index, sub_index):
            self._conditions.log_in(data)
            return
        if self.loader is not None and self.loader.handles(index, sub_index):
            if self.loader.take(index, data, self.state):
                self._reset(communication_only=False)
            return
        held = self._known(index, sub_index) if self._clears_stamp_for(index, sub_index) else data
        self._memory.write(index, sub_index, data)
        if held != data:
            for part in (1, 2):
                self._memory.write(VERIFY_CONFIGURATION, part, bytes(4))
        self.areas.keep_written(index)
        self.services.written(index)
        self.state = self._conditions.granted(self._conditions.forced_state(index, sub_index), self.state)

    def _known(self, index: int, sub_index: int) -> bytes | None:
        """The object's value; None if the node behind a twin does not allow reading, as for a write-only object."""
        try:
            return self._memory.read(index, sub_index)
        except Refusal as refusal:
            if refusal.code not in (Abort.WRITE_ONLY, Abort.UNSUPPORTED_ACCESS):
                raise
            return None

    def _clears_stamp_for(self, index: int, sub_index: int) -> bool:
        """True if a write to the object clears 0x1020: the object is configuration, not a process value."""
        if (
            not self.family.clears_stamp
            or index == VERIFY_CONFIGURATION
            or self._memory.entry(VERIFY_CONFIGURATION, 1) is None
        ):
            return False
        entry = self._memory.entry(index, sub_index)
        return entry is None or not entry.pdo_mapping

    def _reset(self, *, communication_only: bool) -> None:
        self.resets += 1
        self._initialise(communication_only=communication_only, powered=True)
        self.boot_up()

    def _initialise(self, *, communication_only: bool, powered: bool) -> None:
        if self._lss is not None:
            self._lss.reset(communication_only=communication_only)
        if self.loader is not None:
            self.loader.restart()
        self.areas.reset(communication_only=communication_only, powered=powered)
        self.services.reset()
        self._conditions.reset(communication_only=communication_only)


def _loader(busy: int) -> BootLoader:
    """A boot loader, loaded on demand since few devices have one."""
    from dvtcli.simulator.device.boot_loader import BootLoader

    return BootLoader(busy)


_MAPPINGS = (range(0x1600, 0x1800), range(0x1A00, 0x1C00))


class ReversedDevice(StrictDevice):
    """A device, or a twin, with mapping entries in its own order; see `StrictDevice`."""

    def __init__(
        self, dictionary: ObjectDictionary, family: Family, node_id: int, *, backing: Backing | None = None
    ) -> None:
        def turned(index: int, sub_index: int) -> bytes:
            assert backing is not None  # noqa: S101 - called only where there is one
            data = backing(index, sub_index)
            return _inward(data) if _is_entry(index, sub_index, data) else data

        super().__init__(dictionary, family, node_id, backing=None if backing is None else turned)

    def upload(self, index: int, sub_index: int) -> bytes:
        """The value of an SDO upload."""
        data = super().upload(index, sub_index)
        return _outward(data) if _is_entry(index, sub_index, data) else data

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        """Write *data* as an SDO download does."""
        super().download(index, sub_index, _inward(data) if _is_entry(index, sub_index, data) else data)


def _is_entry(index: int, sub_index: int, data: bytes) -> bool:
    return sub_index > 0 and len(data) == 4 and any(index in mappings for mappings in _MAPPINGS)


def _inward(data: bytes) -> bytes:
    """0x20006064, as on the wire, is 0x60640020."""
    raw = int.from_bytes(data, "little")
    return ((raw & 0xFFFF) << 16 | (raw >> 16 & 0xFF) << 8 | raw >> 24).to_bytes(4, "little")


def _outward(data: bytes) -> bytes:
    """0x60640020 is 0x20006064 on the wire."""
    raw = int.from_bytes(data, "little")
    return (raw >> 16 | (raw >> 8 & 0xFF) << 16 | (raw & 0xFF) << 24).to_bytes(4, "little")
