"""The services of a device besides SDO and NMT commands: PDO, SYNC, EMCY, heartbeat and node guarding.

Applies the NMT state's restrictions (CiA 301, 7.3.2.2) and tells when the next frame is due.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.domain.abort import Abort
from dvtcli.domain.can_ids import HEARTBEAT_BASE, SYNC_ID
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.objects import (
    COB_ID_EMCY,
    COB_ID_SYNC,
    COB_ID_TIME,
    CONSUMER_HEARTBEAT,
    CYCLE_PERIOD,
    ERROR_BEHAVIOUR,
    ERROR_FIELD,
    FURTHER_SDO_CHANNELS,
    GUARD_TIME,
    LIFE_TIME_FACTOR,
    PRODUCER_HEARTBEAT,
    SAFETY_VALID,
    SYNC_OVERFLOW,
)
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import Frame
from dvtcli.domain.profile import ObjectAddress
from dvtcli.simulator.device.emergency import Emergencies
from dvtcli.simulator.device.family import Family, MotorCopy, PinCopy
from dvtcli.simulator.device.memory import Memory, Refusal
from dvtcli.simulator.device.pdos_at_work import PdoExchange

if TYPE_CHECKING:
    from dvtcli.simulator.device.safety import SafetyObjects

_PRODUCES, _EXTENDED = 1 << 30, 1 << 29
_INVALID, _TIME_USED, _FROZEN = 1 << 31, 3 << 30, 0x3FFF_FFFF


class SyncProducer:
    """The SYNC producer of one device; *due_s* is the time of the next SYNC, infinite for never."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self.reset()

    def reset(self) -> None:
        """Restart as after a reset: the counter begins with 1."""
        self._period_us = 0
        self._counter = 0
        self.due_s = float("inf")

    def check(self, index: int, _sub_index: int, data: bytes) -> None:
        """Refuse a download to 0x1005 or 0x1019 that the standard forbids while SYNCs are produced."""
        if index == SYNC_OVERFLOW:
            self._check_overflow(data)
        elif index == COB_ID_SYNC:
            self._check_cob_id(data)

    def _check_overflow(self, data: bytes) -> None:
        """CiA 301, 7.5.2.22: not to be changed while the SYNC period is not 0."""
        if data != self._memory.read(SYNC_OVERFLOW, 0) and self._memory.number(CYCLE_PERIOD, 0):
            raise Refusal(Abort.DEVICE_STATE)

    def _check_cob_id(self, data: bytes) -> None:
        """CiA 301, 7.5.2.5: bits 29 to 0 are not to be changed while the node produces SYNC (bit 30)."""
        held, wanted = self._memory.number(COB_ID_SYNC, 0), int.from_bytes(data, "little")
        if held & wanted & _PRODUCES and (held ^ wanted) & 0x3FFF_FFFF:
            raise Refusal(Abort.VALUE_RANGE)

    def poll(self, now_s: float) -> Frame | None:
        """The SYNC due at *now_s* (s); the first follows one period (0x1006, µs) after activation."""
        raw = self._memory.number(COB_ID_SYNC, 0, missing=SYNC_ID)
        period_us = self._memory.number(CYCLE_PERIOD, 0) if raw & _PRODUCES else 0
        if period_us != self._period_us:
            self.reset()
            self._period_us = period_us
            self.due_s = now_s + period_us / 1e6 if period_us else float("inf")
        if now_s < self.due_s:
            return None
        late = now_s >= self.due_s + period_us / 1e6
        self.due_s = (now_s if late else self.due_s) + period_us / 1e6
        return Frame(raw & 0x1FFF_FFFF, self._count(), extended=bool(raw & _EXTENDED))

    def _count(self) -> bytes:
        """The counter byte, 1..0x1019; empty if 0x1019 is 0 or absent."""
        overflow = self._memory.number(SYNC_OVERFLOW, 0)
        if not overflow:
            return b""
        self._counter = self._counter % overflow + 1
        return bytes([self._counter])


class ServiceCobIds:
    """COB-IDs of TIME, EMCY and further SDO channels of one device, read-only while in use.

    Source: CiA 301, 7.5.2.15, 7.5.2.17, 7.5.2.33 and 7.5.2.34.
    """

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def check(self, index: int, sub_index: int, data: bytes) -> None:
        """Refuse a change of bits 29 to 0 for a service in use."""
        if index not in (COB_ID_TIME, COB_ID_EMCY) and not (index in FURTHER_SDO_CHANNELS and sub_index in (1, 2)):
            return
        held, wanted = self._memory.number(index, sub_index), int.from_bytes(data, "little")
        if _is_used(index, held) and _is_used(index, wanted) and (held ^ wanted) & _FROZEN:
            raise Refusal(Abort.VALUE_RANGE)


def _is_used(index: int, raw: int) -> bool:
    return bool(raw & _TIME_USED) if index == COB_ID_TIME else not raw & _INVALID


class VirtualPdos:
    """Copies values after every change; a pin tied to a missing object is left alone."""

    def __init__(self, memory: Memory, family: Family) -> None:
        self._memory = memory
        self._family = family

    def copy(self) -> None:
        """Update every tied object."""
        for group in self._family.pins:
            for pin, selected in self._selected(group.selector):
                self._copy_pin(group, pin, (selected, 0))
        if self._family.motors is not None:
            self._copy_motors(self._family.motors)

    def _selected(self, selector: int) -> Iterator[tuple[int, int]]:
        """Pins from 1 with the index tied to each; an index ending in FF means none."""
        for pin in range(1, self._memory.number(selector, 0) + 1):
            selected = self._memory.number(selector, pin)
            if selected & 0xFF != 0xFF:
                yield pin, selected

    def _copy_pin(self, group: PinCopy, pin: int, selected: ObjectAddress) -> None:
        place, bit = divmod(pin - 1, 8) if group.bitwise else (pin - 1, 0)
        if place >= len(group.pins):
            return
        physical = group.pins[place]
        if not group.bitwise:
            self._move(*((selected, physical) if group.to_pin else (physical, selected)))
        elif group.to_pin:
            self._set_bit(physical, bit, self._memory.number(*selected))
        else:
            self._put(selected, self._memory.number(*physical) >> bit & 1)

    def _set_bit(self, place: ObjectAddress, bit: int, value: int) -> None:
        others = self._memory.number(*place) & ~(1 << bit)
        self._put(place, others | (1 << bit if value else 0))

    def _copy_motors(self, motors: MotorCopy) -> None:
        for _, motor in self._selected(motors.selector):
            for sub_index, profile in motors.down.items():
                self._move((motor, sub_index), profile)
            for sub_index, profile in motors.up.items():
                self._move(profile, (motor, sub_index))

    def _move(self, source: ObjectAddress, target: ObjectAddress) -> None:
        if self._memory.exists(*source):
            self._put(target, self._memory.number(*source))

    def _put(self, place: ObjectAddress, value: int) -> None:
        size = self._memory.size(*place)
        if size is None or not self._memory.exists(*place):
            return
        data = (value & (1 << 8 * size) - 1).to_bytes(size, "little")
        if self._memory.read(*place) != data:
            self._memory.write(*place, data)


_NEVER = float("inf")
#: value of 0x1029:1 -> the state that a communication error leads to; others keep the state (CiA 301, 7.5.2.32)
_AFTER_AN_ERROR = {0: NmtState.PRE_OPERATIONAL, 2: NmtState.STOPPED}


class FrameServices:
    """The services of one device allowed by its NMT *state*, at first INITIALISING."""

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
        self._safety = _safety_objects(memory, self._errors)
        #: frames of a new NMT state, for the next poll
        self._waiting: list[Frame] = []
        #: the number of starts so far
        self.starts = 0
        #: the services that check values of their objects
        services = (self._errors, ServiceCobIds(memory), self._sync_producer, self._producers)
        self.judges = services if self._safety is None else (*services, self._safety)
        #: the memory's count at the last poll, and the due time if nothing changes
        self._polled_changes = -1
        self._due_s = -_NEVER
        self._sync_changes = 0
        self._copy()

    @property
    def state(self) -> NmtState:
        """The NMT state; a change restarts the PDOs."""
        return self._state

    @state.setter
    def state(self, state: NmtState) -> None:
        if state is not self._state:
            self._state = state
            self._exchange.forget()
            if self._safety is not None:
                self._waiting += self._safety.start(operational=state is NmtState.OPERATIONAL)
            self._memory.touch()

    def booted(self) -> None:
        """Start the heartbeats after the boot-up message."""
        self.starts += 1
        self._heartbeat.reset()

    def reset(self) -> None:
        """Restart in INITIALISING, after the memory was reset."""
        self._state = NmtState.INITIALISING
        self._exchange.forget()
        self._waiting.clear()
        if self._safety is not None:
            self._safety.start(operational=False)
        self._errors.reset()
        self._producers.configure()
        self._guarded.reset()
        self._sync_producer.reset()
        self._copy()

    def written(self, index: int) -> None:
        """Apply an SDO download to an object at *index*."""
        self._sync_changes += index == COB_ID_SYNC
        if index == ERROR_FIELD:
            self._errors.forget_history()
        if self._error_list is not None and index == self._error_list.position[0]:
            self._errors.list_active()
        if index == CONSUMER_HEARTBEAT:
            self._producers.configure()
        if self._safety is not None:
            self._safety.written(index)
        self.changed(index)

    def changed(self, index: int) -> None:
        """Apply any change of an object at *index*."""
        pdo = Pdo.at(index)
        if pdo is not None:
            self._exchange.forget(pdo)
        self._copy()

    def sync(self, counter: int | None = None) -> list[Frame]:
        """Receive a SYNC with its *counter* (1..240), if any; returns the TPDO frames due."""
        if self._state is not NmtState.OPERATIONAL:
            return []
        frames = self._exchange.sync(counter)
        self._copy()
        return frames

    def receive(self, frame: Frame) -> list[Frame]:
        """Receive an RPDO, a heartbeat, or a request for a TPDO or the state; returns the device's answers."""
        if self._state is not NmtState.INITIALISING and self._guarded.listens(frame):
            return [self._guarded.answer(self._state)]
        if self._state is not NmtState.INITIALISING and self._producers.listens(frame):
            over = self._producers.hear(frame)
            return [] if self._state is NmtState.STOPPED else over
        if self._state is not NmtState.OPERATIONAL:
            return []
        if frame.remote:
            return self._exchange.request(frame)
        if self._safety is not None:
            self._safety.receive(frame)
        answers = self._exchange.receive(frame)
        self._copy()
        return answers

    def hears(self, frame: Frame) -> bool:
        """True if *frame*, neither NMT command nor SDO, may concern the device: SYNC, PDO, error control."""
        if self._guarded.concerns(frame):
            return True
        if self._state is not NmtState.OPERATIONAL:
            return self._producers.listens(frame)
        if self._safety is not None and self._safety.listens(frame):
            return True
        return self._exchange.knows(frame) or self.hears_sync(frame) or self._producers.listens(frame)

    @property
    def hearing_changes(self) -> int:
        """A number that grows whenever the result of `hears` may change."""
        changes = self._exchange.forgotten + self._sync_changes + self._producers.changes
        return changes if self._safety is None else changes + self._safety.changes

    def hears_sync(self, frame: Frame) -> bool:
        """True if *frame* is the device's SYNC (0x1005, else 0x080)."""
        raw = self._memory.number(COB_ID_SYNC, 0, missing=0x80)
        return not frame.remote and (frame.can_id, frame.extended) == (raw & 0x1FFF_FFFF, bool(raw & 1 << 29))

    def poll(self, now_s: float) -> list[Frame]:
        """The frames due at *now_s*, a monotonic time in seconds.

        Heartbeats (0x1017), SYNC (0x1006), EMCYs held back (0x1015), event-driven TPDOs, and SRDOs.
        """
        changes = self._memory.changes
        if now_s < self._due_s and changes == self._polled_changes:
            return []
        self._polled_changes = changes
        frames: list[Frame] = []
        if self._state is not NmtState.INITIALISING:
            frames += self._watch_producers(now_s) + self._heartbeat.poll(now_s, self._state)
        if self._state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            frames += self._take_waiting() + self._produce_sync(now_s) + self._errors.poll(now_s)
        if self._state is NmtState.OPERATIONAL:
            frames += self._exchange.poll(now_s)
            if self._safety is not None:
                frames += self._safety.poll(now_s)
        self._due_s = self._next_due_s()
        return frames

    def next_poll_s(self) -> float | None:
        """The time of the next `poll` on the same clock, 0 for at once; None for never."""
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
            due_s = min(due_s, self._exchange.due_s, _NEVER if self._safety is None else self._safety.due_s)
        return due_s

    def _take_waiting(self) -> list[Frame]:
        frames, self._waiting = self._waiting, []
        return frames

    def _watch_producers(self, now_s: float) -> list[Frame]:
        """The EMCYs for lost heartbeat producers; a loss also ends OPERATIONAL."""
        frames = self._producers.poll(now_s)
        if frames is not None and self._state is NmtState.OPERATIONAL:
            self.state = _AFTER_AN_ERROR.get(self._memory.number(ERROR_BEHAVIOUR, 1), self._state)
        return [] if frames is None or self._state is NmtState.STOPPED else frames

    def _produce_sync(self, now_s: float) -> list[Frame]:
        """The SYNC due, and the TPDOs triggered by the node's own SYNC."""
        frame = self._sync_producer.poll(now_s)
        if frame is None:
            return []
        return [frame, *self.sync(frame.data[0] if frame.data else None)]

    def emergency(self, code: int) -> list[Frame]:
        """Raise error *code* (0x0000..0xFFFF; 0: no error) as the device's application would.

        Returns the EMCY frame; empty for a known error, if 0x1014 disables EMCY or 0x1015 delays it, and in NMT states
        without EMCY.
        """
        frames = self._errors.set(code, code) if code else self._errors.clear_all()
        return [] if self._state is NmtState.STOPPED else frames

    def _copy(self) -> None:
        """Update the objects tied by virtual PDOs."""
        if self._vpdos is not None:
            self._vpdos.copy()


def _safety_objects(memory: Memory, errors: Emergencies) -> SafetyObjects | None:
    """The SRDOs of a device, if it has any; none for a twin."""
    if memory.backing is not None or not memory.exists(SAFETY_VALID, 0):
        return None
    from dvtcli.simulator.device.safety import SafetyObjects

    return SafetyObjects(memory, errors)


def _virtual_pdos(memory: Memory, family: Family) -> VirtualPdos | None:
    """The virtual PDOs of a family, if any; none for a twin, whose real node has copied already."""
    if memory.backing is not None or not (family.pins or family.motors):
        return None

    return VirtualPdos(memory, family)


#: the EMCY error code of a producer that is not heard any more (CiA 301, table 26)
PRODUCER_LOST = 0x8130


class Heartbeat:
    """The heartbeat producer of one device; *due_s* is the time of the next heartbeat, infinite for never."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self.reset()

    def reset(self) -> None:
        """Restart as after a boot-up: the first heartbeat comes at once."""
        self._period_ms = 0
        self.due_s = _NEVER

    def poll(self, now_s: float, state: NmtState) -> list[Frame]:
        """The heartbeat due at *now_s* (s), with *state*."""
        period_ms = self._memory.number(PRODUCER_HEARTBEAT, 0)
        if period_ms != self._period_ms:
            self._period_ms, self.due_s = period_ms, now_s if period_ms else _NEVER
        if now_s < self.due_s:
            return []
        period_s = period_ms / 1000
        late = now_s >= self.due_s + period_s
        self.due_s = (now_s if late else self.due_s) + period_s
        return [Frame(HEARTBEAT_BASE + self._memory.node_id, bytes([state]))]


class GuardingResponse:
    """The node guarding response: the state, on a remote frame (CiA 301, 7.2.8.3.2.1).

    For a device with a guard time (0x100C) and without heartbeats; there is no life guarding.
    """

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self.reset()

    def reset(self) -> None:
        """Restart as after a boot-up: the first answer's toggle bit is 0."""
        self._toggle = 0

    def concerns(self, frame: Frame) -> bool:
        """True if *frame* requests the device's state."""
        return frame.remote and not frame.extended and frame.can_id == HEARTBEAT_BASE + self._memory.node_id

    def listens(self, frame: Frame) -> bool:
        """True if *frame* requests the device's state, and the device answers."""
        if not self.concerns(frame):
            return False
        return self._memory.exists(GUARD_TIME, 0) and not self._memory.number(PRODUCER_HEARTBEAT, 0)

    def answer(self, state: NmtState) -> Frame:
        """The device's answer in *state*; the next answer has the other toggle bit."""
        toggle, self._toggle = self._toggle, self._toggle ^ 0x80
        return Frame(HEARTBEAT_BASE + self._memory.node_id, bytes([toggle | state]))


class HeartbeatConsumer:
    """The heartbeat consumer of one device; a producer is monitored from its first heartbeat on.

    *due_s* is the time of the next loss, infinite for never; *changes* grows whenever the result of `listens` may
    change.
    """

    def __init__(self, memory: Memory, errors: Emergencies) -> None:
        self._memory = memory
        self._errors = errors
        self.changes = 0
        self.configure()

    def configure(self) -> None:
        """Reload 0x1016 and wait for every producer again."""
        self.changes += 1
        entries = [] if self._memory.backing is not None else list(self._entries().values())
        self._times_s = {raw >> 16: (raw & 0xFFFF) / 1000 for raw in entries if raw & 0xFFFF and 1 <= raw >> 16 <= 127}
        self._received: set[int] = set()
        self._until_s: dict[int, float] = {}
        self.due_s = _NEVER

    def check(self, index: int, sub_index: int, data: bytes) -> None:
        """Refuse a second time for one producer (CiA 301, 7.5.2.19), and node guarding beside heartbeats."""
        wanted = int.from_bytes(data, "little")
        if index in (GUARD_TIME, LIFE_TIME_FACTOR) and wanted and self._memory.backing is None:
            raise Refusal(Abort.VALUE_RANGE)
        if index != CONSUMER_HEARTBEAT or not sub_index or not wanted & 0xFFFF:
            return
        others = (raw for sub, raw in self._entries().items() if sub != sub_index)
        if any(raw & 0xFFFF and (raw ^ wanted) >> 16 & 0xFF == 0 for raw in others):
            raise Refusal(Abort.INCOMPATIBLE)

    def listens(self, frame: Frame) -> bool:
        """True if *frame* is a heartbeat of a monitored producer."""
        return frame.can_id - HEARTBEAT_BASE in self._times_s and not frame.extended and not frame.remote

    def hear(self, frame: Frame) -> list[Frame]:
        """Receive a heartbeat; the EMCY frames: none, or the end of an error."""
        producer = frame.can_id - HEARTBEAT_BASE
        self._received.add(producer)
        self._memory.touch()
        return self._errors.clear((CONSUMER_HEARTBEAT, producer))

    def poll(self, now_s: float) -> list[Frame] | None:
        """The EMCY frames for producers lost by *now_s* (s), None without a loss."""
        for producer in self._received:
            self._until_s[producer] = now_s + self._times_s[producer]
        self._received.clear()
        lost = [producer for producer, until_s in self._until_s.items() if until_s <= now_s]
        frames: list[Frame] = []
        for producer in lost:
            del self._until_s[producer]
            frames += self._errors.set((CONSUMER_HEARTBEAT, producer), PRODUCER_LOST)
        self.due_s = min(self._until_s.values(), default=_NEVER)
        return frames if lost else None

    def _entries(self) -> dict[int, int]:
        last = self._memory.highest_sub_index(CONSUMER_HEARTBEAT) or 0
        return {sub: self._memory.number(CONSUMER_HEARTBEAT, sub) for sub in range(1, last + 1)}
