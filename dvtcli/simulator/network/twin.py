"""The dry run: every node is replaced by a simulated twin that reads from the node and keeps all writes to itself.

Nothing but SDO uploads reaches the wrapped bus. Does not know files, profiles or what a device is asked to do.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.node_events import BootUp, Emergency, NodeEvent
from dvtcli.domain.ports import CanopenBus, Frame
from dvtcli.errors import NoAnswer, SdoAborted, UsageError
from dvtcli.simulator.device.refusal import Refusal

if TYPE_CHECKING:
    from dvtcli.simulator.device.strict_device import StrictDevice

Backing = Callable[[int, int], bytes]
DeviceFor = Callable[[int, Backing], "StrictDevice"]

_NMT_CAN_ID, _HEARTBEAT = 0x000, 0x700
_BOOT_UP = b"\0"


class TwinBus:
    """A CanopenBus of twins of the nodes on *wrapped*, which stays open when this one is closed.

    *device_for*(node_id, backing) makes a node's twin when it is first needed; `backing(index, sub_index)` reads the
    node and raises Refusal where the node refuses.
    """

    def __init__(self, wrapped: CanopenBus, device_for: DeviceFor) -> None:
        self._wrapped = wrapped
        self._device_for = device_for
        self._twins: dict[int, Twin] = {}
        self._to_all: list[NmtCommand] = []
        self._frames: deque[Frame] = deque(maxlen=4096)
        self._taps: list[Callable[[Frame, bool], None]] = []
        self._listeners: list[Callable[[NodeEvent], None]] = []
        self._lock = threading.RLock()

    @property
    def name(self) -> str:
        """The wrapped bus's name, marked."""
        return f"{self._wrapped.name} (dry run)"

    @property
    def simulated(self) -> bool:
        """Whether the nodes that are read live in this process."""
        return self._wrapped.simulated

    @property
    def carries_frames(self) -> bool:
        """Twins hear every frame, whatever the wrapped bus carries."""
        return True

    @property
    def carries_remote_frames(self) -> bool:
        """Twins hear every frame."""
        return True

    @property
    def bitrate(self) -> int | None:
        """The wrapped bus's."""
        return self._wrapped.bitrate

    def sdo(self, node_id: int) -> Twin:
        """The dictionary of *node_id*'s twin; the same object for the same node."""
        if not 1 <= node_id <= 127:
            raise UsageError(f"node-ID {node_id} is outside 1..127")
        with self._lock:
            if node_id not in self._twins:
                self._twins[node_id] = Twin(self._wrapped, node_id, self._device_for, tuple(self._to_all))
            return self._twins[node_id]

    def set_timeout(self, timeout_s: float) -> None:
        """Let every SDO answer of a node that is read take *timeout_s* from now on; twins answer at once."""
        self._wrapped.set_timeout(timeout_s)

    def send_nmt(self, command: NmtCommand, node_id: int) -> None:
        """Command the twin of *node_id*, or with 0 all, also those that are yet to come."""
        if node_id:
            self._hear(self.sdo(node_id).command(command))
            return
        with self._lock:
            self._to_all.append(command)
            twins = list(self._twins.values())
        for twin in twins:
            self._hear(twin.command(command))

    def nmt_state(self, node_id: int, timeout_s: float = 0.0) -> NmtState | None:
        """The twin's state where the twin was commanded, else what is heard of the node itself."""
        twin = self._commanded(node_id)
        return twin.state if twin is not None else self._wrapped.nmt_state(node_id, timeout_s)

    def boot_ups(self, node_id: int) -> int:
        """The boot-ups of the node and of its twin."""
        return self._wrapped.boot_ups(node_id) + self._twin_boot_ups(node_id)

    def upsets(self, node_id: int) -> int:
        """What upset the node, and the boot-ups of its twin."""
        return self._wrapped.upsets(node_id) + self._twin_boot_ups(node_id)

    def downloads_of_others(self, node_id: int) -> int:
        """Those to the node: nobody else meets its twin."""
        return self._wrapped.downloads_of_others(node_id)

    def wait_boot_up(self, node_id: int, seen: int, timeout_s: float) -> bool:
        """Wait for more than *seen* boot-ups; a twin's come at once."""
        if self.boot_ups(node_id) > seen:
            return True
        return self._wrapped.wait_boot_up(node_id, seen - self._twin_boot_ups(node_id), timeout_s)

    def heard_nodes(self) -> dict[int, NmtState]:
        """What is heard of the nodes, and the states of the twins that were commanded."""
        commanded = {node_id: twin.state for node_id in list(self._twins) if (twin := self._commanded(node_id))}
        return self._wrapped.heard_nodes() | commanded

    def emergency(self, node_id: int) -> Emergency | None:
        """The last emergency message of the node; a twin's are only frames."""
        return self._wrapped.emergency(node_id)

    def on_event(self, callback: Callable[[NodeEvent], None]) -> Callable[[], None]:
        """Call *callback* for what the nodes say, and for boot-ups of their twins; returns what ends that."""
        self._listeners.append(callback)
        stop = self._wrapped.on_event(callback)

        def end() -> None:
            self._listeners.remove(callback)
            stop()

        return end

    def tap(self, callback: Callable[[Frame, bool], None]) -> Callable[[], None]:
        """Call *callback*(frame, sent) for each frame on the wrapped bus and of the twins; returns what ends that."""
        self._taps.append(callback)
        stop = self._wrapped.tap(callback)

        def end() -> None:
            self._taps.remove(callback)
            stop()

        return end

    def disturbances(self) -> list[str]:
        """What was noticed on the wrapped bus since the last call."""
        return self._wrapped.disturbances()

    def error_frame_count(self) -> int:
        """How many error frames were received on the wrapped bus so far."""
        return self._wrapped.error_frame_count()

    def send(self, frame: Frame) -> None:
        """Show *frame* (SYNC, a PDO, an NMT command) to the twins only; what they answer is received next."""
        if frame.can_id == _NMT_CAN_ID and not frame.extended:
            if len(frame.data) == 2 and frame.data[0] in list(NmtCommand):
                self.send_nmt(NmtCommand(frame.data[0]), frame.data[1])
            return
        self._tell(frame, sent=True)
        for twin in list(self._twins.values()):
            self._hear(twin.hear(frame))

    def receive(self, duration_s: float) -> Iterator[Frame]:
        """Yield the frames that twins have sent; without any, the end comes after *duration_s*."""
        if not self._frames:
            self.sleep(duration_s)
        while self._frames:
            yield self._frames.popleft()

    def now_s(self) -> float:
        """The wrapped bus's time."""
        return self._wrapped.now_s()

    def sleep(self, duration_s: float) -> None:
        """Wait *duration_s* of the wrapped bus's time."""
        self._wrapped.sleep(duration_s)

    def idle(self, duration_s: float) -> None:
        """Read the wrapped bus for *duration_s*."""
        self._wrapped.idle(duration_s)

    def close(self) -> None:
        """Forget the twins; the wrapped bus stays open for whoever opened it."""
        with self._lock:
            self._twins.clear()
            self._to_all.clear()
            self._frames.clear()

    def _hear(self, frames: list[Frame]) -> None:
        """Take what twins said: to be received, and for those who watch."""
        self._frames.extend(frames)
        for frame in frames:
            self._tell(frame, sent=False)
            if frame.can_id & ~0x7F == _HEARTBEAT and frame.data == _BOOT_UP:
                for listener in tuple(self._listeners):
                    listener(BootUp(frame.can_id & 0x7F, frame.timestamp_s))

    def _tell(self, frame: Frame, *, sent: bool) -> None:
        for tap in tuple(self._taps):
            tap(frame, sent)

    def _twin_boot_ups(self, node_id: int) -> int:
        twin = self._commanded(node_id)
        return 0 if twin is None else twin.boot_ups

    def _commanded(self, node_id: int) -> Twin | None:
        """The node's twin if it was given a command, to itself or to all; None too where there is no such node."""
        twin = self.sdo(node_id) if self._to_all else self._twins.get(node_id)
        return twin if twin is not None and twin.commanded and twin.exists() else None


class Twin:
    """One node's twin as an SdoTransport; made when it is first used, then reads the node as it goes.

    *commands* are NMT commands to all nodes that were given before there was a twin.
    """

    def __init__(
        self, wrapped: CanopenBus, node_id: int, device_for: DeviceFor, commands: tuple[NmtCommand, ...] = ()
    ) -> None:
        self._wrapped = wrapped
        self._node_id = node_id
        self._device_for = device_for
        self._commands = commands
        self._made: StrictDevice | None = None
        self._lock = threading.RLock()
        #: time-out and retries of the present upload, None for the bus's
        self._limits: tuple[float | None, int | None] = None, None
        #: whether the state is the twin's own, no longer the node's
        self.commanded = bool(commands)
        self.boot_ups = 0

    @property
    def state(self) -> NmtState:
        """The twin's NMT state."""
        with self._lock:
            return self._device().state

    def exists(self) -> bool:
        """Whether there is such a node to be the twin of."""
        with self._lock:
            try:
                self._device()
            except NoAnswer:
                return False
            return True

    def upload(
        self,
        index: int,
        sub_index: int,
        *,
        timeout_s: float | None = None,
        retries: int | None = None,
    ) -> bytes:
        """Read an object: what was written to the twin, else what the node holds. Raises as the node would.

        *timeout_s* and *retries* hold for what is read of the node, also for finding out whether there is one.
        """
        with self._lock:
            self._limits = timeout_s, retries
            try:
                if self._made is None:
                    self._reach(index, sub_index)
                device = self._answering(index, sub_index)
                if (index, sub_index) == device.family.state_object:
                    self._follow_node(device)
                return device.upload(index, sub_index)
            except Refusal as refusal:
                raise SdoAborted(index, sub_index, refusal.code, node=self._node_id) from refusal
            finally:
                self._limits = None, None

    def _reach(self, index: int, sub_index: int) -> None:
        """NoAnswer where there is no node: making its twin would ask for more, and wait longer."""
        with suppress(Refusal):
            self._backing(index, sub_index)

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:  # noqa: ARG002
        """Write an object of the twin; SdoAborted where the device would refuse it. The node is only read."""
        with self._lock:
            device = self._answering(index, sub_index)
            self._follow_node(device)
            before = device.state
            try:
                device.download(index, sub_index, data)
            except Refusal as refusal:
                raise SdoAborted(index, sub_index, refusal.code, node=self._node_id) from refusal
            if device.state is not before:
                self.commanded = True

    def command(self, command: NmtCommand) -> list[Frame]:
        """Obey an NMT command; returns what the twin sends then (a boot-up)."""
        with self._lock:
            device = self._device()
            self.commanded = True
            device.nmt(command)
            return self._sent(device.take_outbox())

    def hear(self, frame: Frame) -> list[Frame]:
        """Take a frame of the bus; returns the twin's frames in answer."""
        with self._lock:
            device = self._device()
            self._follow_node(device)
            if device.services.hears_sync(frame):
                answers = device.services.sync(frame.data[0] if frame.data else None)
            else:
                answers = device.services.receive(frame)
            return self._sent(answers + device.take_outbox())

    def _sent(self, frames: list[Frame]) -> list[Frame]:
        self.boot_ups += frames.count(Frame(_HEARTBEAT + self._node_id, _BOOT_UP))
        return frames

    def _answering(self, index: int, sub_index: int) -> StrictDevice:
        """The device, unless it is silent (CiA 301, 7.3.2.2.4: no SDO while STOPPED)."""
        device = self._device()
        if self.commanded and device.state is NmtState.STOPPED:
            place = f"{index:04X}:{sub_index:02X}"
            text = f"node {self._node_id} does not answer for 0x{place}: its twin is STOPPED"
            raise NoAnswer(text, node=self._node_id, place=place, hint=f"nmt preop {self._node_id}")
        return device

    def _device(self) -> StrictDevice:
        """The simulated device; made here, in the node's state."""
        made = self._made
        if made is None:
            made = self._device_for(self._node_id, self._backing)
            made.state = self._state_of_node(made) or NmtState.PRE_OPERATIONAL
            self._made = made
            for command in self._commands:
                made.nmt(command)
            self._sent(made.take_outbox())
        return made

    def _follow_node(self, device: StrictDevice) -> None:
        """Until it is commanded, the twin is in the node's state."""
        if not self.commanded:
            device.state = self._state_of_node(device) or device.state

    def _state_of_node(self, device: StrictDevice) -> NmtState | None:
        """By the node's own state object where it has one: what was heard may be old."""
        if device.family.state_object is None:
            return self._wrapped.nmt_state(self._node_id)
        try:
            return NmtState(int.from_bytes(self._backing(*device.family.state_object), "little"))
        except (Refusal, ValueError):
            return None

    def _backing(self, index: int, sub_index: int) -> bytes:
        try:
            timeout_s, retries = self._limits
            return self._wrapped.sdo(self._node_id).upload(index, sub_index, timeout_s=timeout_s, retries=retries)
        except SdoAborted as aborted:
            raise Refusal(aborted.code) from aborted
