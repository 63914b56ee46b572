"""What a device sends and hears besides SDO and NMT commands: PDOs, SYNC, EMCY, heartbeats and node guarding.

Knows which of these services an NMT state allows (CiA 301, 7.3.2.2), and when the next frame is due. Does not judge
downloads, and does not know what a reset brings back.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.nmt import NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.emergency import ERROR_HISTORY, Emergencies
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.heartbeat import CONSUMER_TIMES, GuardingResponse, Heartbeat, HeartbeatConsumer
from dvtcli.simulator.device.memory import Memory
from dvtcli.simulator.device.pdos_at_work import PdoExchange
from dvtcli.simulator.device.sync_producer import SYNC_COB_ID, ServiceCobIds, SyncProducer

if TYPE_CHECKING:
    from dvtcli.simulator.device.vpdo_copies import VirtualPdos

ERROR_BEHAVIOUR = 0x1029
_NEVER = float("inf")
#: value of 0x1029:1 -> the state that a communication error leads to; others keep the state (CiA 301, 7.5.2.32)
_AFTER_AN_ERROR = {0: NmtState.PRE_OPERATIONAL, 2: NmtState.STOPPED}


class FrameServices:
    """The services of one device, as far as its NMT *state* allows them; the state is INITIALISING at first."""

    def __init__(self, memory: Memory, family: Family) -> None:
        self._memory = memory
        self._state = NmtState.INITIALISING
        self._vpdos = _virtual_pdos(memory, family)
        self._errors = Emergencies(memory, family.error_list)
        self._error_list = family.error_list
        self._exchange = PdoExchange(memory, family, self._errors)
        self._sync_producer = SyncProducer(memory)
        self._heartbeat = Heartbeat(memory)
        self._producers = HeartbeatConsumer(memory, self._errors)
        self._guarded = GuardingResponse(memory)
        #: how often the device has started so far
        self.starts = 0
        #: those that judge the values of their own objects
        self.judges = (self._errors, ServiceCobIds(memory), self._sync_producer, self._producers)
        #: what the memory counted when it was last polled, and when it is due if nothing changes
        self._polled_changes = -1
        self._due_s = -_NEVER
        self._sync_changes = 0
        self._copy()

    @property
    def state(self) -> NmtState:
        """The NMT state; a change of it makes PDOs start over."""
        return self._state

    @state.setter
    def state(self, state: NmtState) -> None:
        if state is not self._state:
            self._state = state
            self._exchange.forget()
            self._memory.touch()

    def booted(self) -> None:
        """The boot-up was sent: heartbeats begin."""
        self.starts += 1
        self._heartbeat.reset()

    def reset(self) -> None:
        """The device is INITIALISING again, and its memory holds what that brings back."""
        self._state = NmtState.INITIALISING
        self._exchange.forget()
        self._errors.reset()
        self._producers.configure()
        self._guarded.reset()
        self._sync_producer.reset()
        self._copy()

    def written(self, index: int) -> None:
        """An object of *index* was written by an SDO download."""
        self._sync_changes += index == SYNC_COB_ID
        if index == ERROR_HISTORY:
            self._errors.forget_history()
        if self._error_list is not None and index == self._error_list.position[0]:
            self._errors.list_active()
        if index == CONSUMER_TIMES:
            self._producers.configure()
        self.changed(index)

    def changed(self, index: int) -> None:
        """An object of *index* holds something else now, whoever changed it."""
        pdo = Pdo.at(index)
        if pdo is not None:
            self._exchange.forget(pdo)
        self._copy()

    def sync(self, counter: int | None = None) -> list[Frame]:
        """Obey a SYNC, with its *counter* (1..240) where it carries one; returns the TPDO frames due."""
        if self._state is not NmtState.OPERATIONAL:
            return []
        frames = self._exchange.sync(counter)
        self._copy()
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
        self._copy()
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

    def _copy(self) -> None:
        """Bring what virtual PDOs tie up to date."""
        if self._vpdos is not None:
            self._vpdos.copy()


def _virtual_pdos(memory: Memory, family: Family) -> VirtualPdos | None:
    """The virtual PDOs of a family that has any, unless the node is a twin: the real one has copied already."""
    if memory.backing is not None or not (family.pins or family.motors):
        return None
    from dvtcli.simulator.device.vpdo_copies import VirtualPdos

    return VirtualPdos(memory, family)
