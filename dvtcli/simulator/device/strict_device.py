"""The strict simulated device: one node's state machine, without I/O and without a clock of its own.

Knows the order in which a CANopen device judges a request. Does not know SDO frames (`sdo_server`), CAN
(`network`), files, nor the tool's rules: what it refuses is decided here a second time, on purpose.
"""

from __future__ import annotations

from collections.abc import Mapping

from dvtcli.domain.abort import Abort
from dvtcli.domain.nmt import UNCONFIGURED, NmtCommand, NmtState
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.emergency import ERROR_HISTORY, Emergencies
from dvtcli.simulator.device.exchange import PdoExchange
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.gates import Gates
from dvtcli.simulator.device.heartbeat import CONSUMER_TIMES, HEARTBEAT, Guarded, Heartbeat, HeartbeatConsumer
from dvtcli.simulator.device.judge import Judge
from dvtcli.simulator.device.lss import LssSlave
from dvtcli.simulator.device.memory import Backing, Memory
from dvtcli.simulator.device.parameter_areas import ParameterStore
from dvtcli.simulator.device.refusal import Refusal
from dvtcli.simulator.device.sync_producer import SYNC_COB_ID, SyncProducer
from dvtcli.simulator.device.vpdo_copies import VirtualPdos

ERROR_BEHAVIOUR = 0x1029
_NEVER = float("inf")
_STATES = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
}
#: value of 0x1029:1 -> the state that a communication error leads to; others keep the state (CiA 301, 7.5.2.32)
_AFTER_AN_ERROR = {0: NmtState.PRE_OPERATIONAL, 2: NmtState.STOPPED}


class StrictDevice:
    """A simulated node that refuses what CiA 301 and its family refuse.

    *dictionary* says which objects exist, *family* how the device behaves, *node_id* is 1..127, or 255 for a
    node that waits for one (LSS). With *backing* the device is a twin of a real node: an object that was not written
    yet is fetched by `backing(index, sub_index)`, which raises Refusal where the node refuses; existence is what the
    node says, the dictionary (it may be empty) adds types, access, limits and mappability, and what nobody knows is
    not refused. Nothing is ever written through it.

    A new device is INITIALISING until `boot_up`. Frames that it sends of its own accord collect in `outbox`.
    """

    def __init__(
        self, dictionary: ObjectDictionary, family: Family, node_id: int, *, backing: Backing | None = None
    ) -> None:
        if not 1 <= node_id <= 127 and node_id != UNCONFIGURED:
            raise ValueError(f"node-ID {node_id} is not within 1..127")
        self.dictionary = dictionary
        self.family = family
        self.outbox: list[Frame] = []
        self._state = NmtState.INITIALISING
        #: whether NMT commands that ask for a state are not obeyed
        self.ignores_nmt = False
        self._memory = Memory(dictionary, node_id, family.capabilities, backing)
        self._gates = Gates(self._memory, family)
        self._store = ParameterStore(self._memory, family)
        self.lss = LssSlave(self._memory, self._store, node_id)
        self._vpdos = VirtualPdos(self._memory, family)
        self._errors = Emergencies(self._memory)
        self._exchange = PdoExchange(self._memory, family, self._errors)
        self._sync_producer = SyncProducer(self._memory)
        self._heartbeat = Heartbeat(self._memory)
        self._producers = HeartbeatConsumer(self._memory, self._errors)
        self._guarded = Guarded(self._memory)
        services = (self._errors, self._sync_producer, self._producers)
        self._judge = Judge(self._memory, family, self._gates, self._store, services)
        #: what the memory counted when it was last polled, and when it is due if nothing changes
        self._polled_changes = -1
        self._due_s = -_NEVER
        self._sync_changes = 0
        self._vpdos.copy()

    @property
    def node_id(self) -> int:
        """The node's own node-ID, 1..127; 255 while it has none."""
        return self._memory.node_id

    @property
    def state(self) -> NmtState:
        """The NMT state; a twin's is set to what the real node's was."""
        return self._state

    @state.setter
    def state(self, state: NmtState) -> None:
        if state is not self._state:
            self._state = state
            self._exchange.forget()
            self._memory.touch()

    @property
    def store_fails(self) -> bool:
        """Whether the non-volatile memory is broken: a store then answers 06060000."""
        return self._store.fails

    @store_fails.setter
    def store_fails(self, fails: bool) -> None:
        self._store.fails = fails

    @property
    def parameter_store(self) -> ParameterStore:
        """The non-volatile side, which may be broken in several ways."""
        return self._store

    @property
    def changes(self) -> int:
        """A number that grows whenever an object was written, or may have been."""
        return self._memory.changes

    @property
    def stored_changes(self) -> int:
        """A number that grows whenever `stored` changes."""
        return self._memory.stored_changes

    def stored(self) -> dict[tuple[int, int], bytes]:
        """What the next power-on brings back, by index and sub-index; the rest are defaults."""
        return self._store.kept()

    def power_on(self, stored: Mapping[tuple[int, int], bytes], node_id: int | None = None) -> None:
        """Wake with *stored* and *node_id* as what was kept, and nothing else; INITIALISING until `boot_up`."""
        self._memory.put_stored(stored)
        self.lss.stored = node_id or self.lss.stored
        self.restart()

    def upload(self, index: int, sub_index: int) -> bytes:
        """What an SDO upload answers; Refusal where the device refuses it."""
        self._memory.require(index, sub_index)
        entry = self._memory.entry(index, sub_index)
        if entry is not None and not entry.access.readable:
            raise Refusal(Abort.WRITE_ONLY)
        if (index, sub_index) == self.family.state_object:
            return bytes([self._state])
        return self._memory.read(index, sub_index)

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        """Write *data* as an SDO download does; Refusal where the device refuses it, then nothing has changed."""
        try:
            self._judge.check_access(index, sub_index, len(data))
            self._judge.check_value(index, sub_index, data, self._state)
            self._accept(index, sub_index, bytes(data))
        except Refusal as refusal:
            raise self._gates.explained(refusal) from None

    def begin_download(self, index: int, sub_index: int, size: int | None) -> None:
        """Refuse what is hopeless whatever the value: existence, access, and *size* in bytes where it is known."""
        try:
            self._judge.check_access(index, sub_index, size)
        except Refusal as refusal:
            raise self._gates.explained(refusal) from None

    def size_of(self, index: int, sub_index: int) -> int | None:
        """The object's length in bytes, None where it varies or is not known."""
        return self._memory.size(index, sub_index)

    def value(self, index: int, sub_index: int = 0) -> bytes:
        """What the object holds, whatever its access; Refusal where it does not exist."""
        self._memory.require(index, sub_index)
        return self._memory.read(index, sub_index)

    def set_value(self, index: int, sub_index: int, data: bytes) -> None:
        """Let the device's own application change an object: a sensor moved, a status changed."""
        self._memory.require(index, sub_index)
        self._memory.write(index, sub_index, data)
        pdo = Pdo.at(index)
        if pdo is not None:
            self._exchange.forget(pdo)
        self._vpdos.copy()

    def nmt(self, command: int) -> None:
        """Obey an NMT command specifier; unknown ones are ignored, and everything by a master or before `boot_up`."""
        if self._state is NmtState.INITIALISING or command not in list(NmtCommand) or self._gates.is_master:
            return
        if command in _STATES:
            if self.ignores_nmt:
                return
            self.state = self._gates.granted(_STATES[NmtCommand(command)], self._state)
        else:
            self._reset(communication_only=command == NmtCommand.RESET_COMMUNICATION)

    def layer_setting(self, request: bytes) -> bytes | None:
        """Obey an LSS *request*; the answer, None for none. An INITIALISING node obeys only while it has no node-ID."""
        if self._state is NmtState.INITIALISING and self.node_id != UNCONFIGURED:
            return None
        answer = self.lss.handle(request)
        if self.lss.woken:
            self._reset(communication_only=True)
        return answer

    def boot_up(self) -> None:
        """Finish initialising: the boot-up frame goes to the outbox, the state is the family's.

        A node without a node-ID goes on waiting for one (CiA 305).
        """
        if self.node_id == UNCONFIGURED:
            return
        self.outbox.append(Frame(HEARTBEAT + self.node_id, b"\0"))
        self.state = self.family.boot_state
        self._heartbeat.reset()

    def restart(self) -> None:
        """Lose what was not stored, as at power-on; INITIALISING, silent and deaf until `boot_up`."""
        self.outbox.clear()
        self._initialise(communication_only=False, powered=False)

    def take_outbox(self) -> list[Frame]:
        """The frames that the device has to send now; empties the outbox."""
        frames, self.outbox = self.outbox, []
        return frames

    def sync(self, counter: int | None = None) -> list[Frame]:
        """Obey a SYNC, with its *counter* (1..240) where it carries one; returns the TPDO frames due."""
        if self._state is not NmtState.OPERATIONAL:
            return []
        frames = self._exchange.sync(counter)
        self._vpdos.copy()
        return frames

    def receive(self, frame: Frame) -> list[Frame]:
        """Take a frame: an RPDO, a heartbeat, a request for a TPDO or the state; what the device sends in answer."""
        if self._state is not NmtState.INITIALISING and self._guarded.listens(frame):
            return [self._guarded.answer(self._state)]
        if self._state is not NmtState.INITIALISING and self._producers.listens(frame):
            over = self._producers.hear(frame)
            return [] if self._state is NmtState.STOPPED else over
        if self._state is not NmtState.OPERATIONAL:
            return []
        if frame.remote:
            return self._exchange.request(frame)
        answers = self._exchange.receive(frame)
        self._vpdos.copy()
        return answers

    def hears(self, frame: Frame) -> bool:
        """Whether *frame*, no NMT command and no SDO, may mean something to the device: SYNC, PDO, error control."""
        if self._guarded.concerns(frame):
            return True
        if self._state is not NmtState.OPERATIONAL:
            return self._producers.listens(frame)
        return self._exchange.knows(frame) or self.hears_sync(frame) or self._producers.listens(frame)

    @property
    def hearing_changes(self) -> int:
        """A number that grows whenever `hears` may answer differently from before."""
        return self._exchange.forgotten + self._sync_changes + self._producers.changes

    def hears_sync(self, frame: Frame) -> bool:
        """Whether *frame* is a SYNC to this device (0x1005, else 0x080)."""
        raw = self._memory.number(SYNC_COB_ID, 0, missing=0x80)
        return not frame.remote and (frame.can_id, frame.extended) == (raw & 0x1FFF_FFFF, bool(raw & 1 << 29))

    def poll(self, now_s: float) -> list[Frame]:
        """The frames due by themselves at *now_s*, a monotonic time in seconds.

        Heartbeats (0x1017), SYNC (0x1006), EMCYs held back (0x1015), and event-driven TPDOs.
        """
        changes = self._memory.changes
        if now_s < self._due_s and changes == self._polled_changes:
            return []
        self._polled_changes = changes
        frames: list[Frame] = []
        if self._state is not NmtState.INITIALISING:
            frames += self._watch_producers(now_s) + self._heartbeat.poll(now_s, self._state)
        if self._state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            frames += self._produce_sync(now_s) + self._errors.poll(now_s)
        if self._state is NmtState.OPERATIONAL:
            frames += self._exchange.poll(now_s)
        self._due_s = self._next_due_s()
        return frames

    def next_poll_s(self) -> float | None:
        """When `poll` has something to do next, on the same clock, 0 for at once; None for never."""
        if self._memory.changes != self._polled_changes:
            return 0.0
        return None if self._due_s == _NEVER else self._due_s

    def _next_due_s(self) -> float:
        if self._state is NmtState.INITIALISING:
            return _NEVER
        due_s = min(self._heartbeat.due_s, self._producers.due_s)
        if self._state is not NmtState.STOPPED:
            due_s = min(due_s, self._sync_producer.due_s, self._errors.due_s)
        if self._state is NmtState.OPERATIONAL:
            due_s = min(due_s, self._exchange.due_s)
        return due_s

    def _watch_producers(self, now_s: float) -> list[Frame]:
        """The EMCYs of heartbeat producers that are lost, which also ends OPERATIONAL."""
        frames = self._producers.poll(now_s)
        if frames is not None and self._state is NmtState.OPERATIONAL:
            self.state = _AFTER_AN_ERROR.get(self._memory.number(ERROR_BEHAVIOUR, 1), self._state)
        return [] if frames is None or self._state is NmtState.STOPPED else frames

    def _produce_sync(self, now_s: float) -> list[Frame]:
        """The SYNC due, and the TPDOs that the node's own SYNC brings."""
        frame = self._sync_producer.poll(now_s)
        if frame is None:
            return []
        return [frame, *self.sync(frame.data[0] if frame.data else None)]

    def emergency(self, code: int) -> list[Frame]:
        """Let the device's own application raise error *code* (0x0000..0xFFFF; 0: all errors are gone).

        Returns the EMCY frame; none for an error that is raised already, where 0x1014 switches EMCY off, where 0x1015
        holds it back, and in NMT states without EMCY.
        """
        frames = self._errors.set(code, code) if code else self._errors.clear_all()
        return [] if self._state is NmtState.STOPPED else frames

    def _accept(self, index: int, sub_index: int, data: bytes) -> None:
        if self._store.handles(index, sub_index):
            self._store.command(index, sub_index, data)
            return
        if self._gates.is_passcode(index, sub_index):
            self._gates.log_in(data)
            return
        self._memory.write(index, sub_index, data)
        self._store.keep_written(index)
        self._sync_changes += index == SYNC_COB_ID
        if index == ERROR_HISTORY:
            self._errors.forget_history()
        if index == CONSUMER_TIMES:
            self._producers.configure()
        pdo = Pdo.at(index)
        if pdo is not None:
            self._exchange.forget(pdo)
        self._vpdos.copy()
        self.state = self._gates.granted(self._gates.forced_state(index, sub_index), self._state)

    def _reset(self, *, communication_only: bool) -> None:
        self._initialise(communication_only=communication_only, powered=True)
        self.boot_up()

    def _initialise(self, *, communication_only: bool, powered: bool) -> None:
        self.lss.reset(communication_only=communication_only)
        self._store.reset(communication_only=communication_only, powered=powered)
        self._state = NmtState.INITIALISING
        self._exchange.forget()
        self._errors.reset()
        self._producers.configure()
        self._guarded.reset()
        self._sync_producer.reset()
        self._gates.reset(communication_only=communication_only)
        self._vpdos.copy()
