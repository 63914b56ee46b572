"""The dry run: every node is replaced by a simulated twin that reads from the node and keeps all writes to itself.

Nothing but SDO uploads reaches the wrapped bus.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from dvtcli.bus.turns import one_by_one
from dvtcli.domain.can_ids import HEARTBEAT_BASE, NMT_ID
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import BootUp, CanopenBus, Emergency, Frame, NodeEvent, ReceivedEmergency
from dvtcli.errors import NoAnswer, SdoAborted, UsageError
from dvtcli.simulator.device.memory import Refusal

if TYPE_CHECKING:
    from dvtcli.simulator.device.strict_device import StrictDevice

_BOOT_UP = b"\0"


class TwinBus:
    """A CanopenBus of twins of the nodes on *wrapped*, which stays open after `close`.

    *device_for*(node_id, backing) creates a node's twin on first use; `backing(index, sub_index)` reads the node and
    raises Refusal if the node refuses.
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
        """True if the real nodes are simulated in this process."""
        return self._wrapped.simulated

    @property
    def carries_frames(self) -> bool:
        """True: twins receive every frame, whatever the wrapped bus carries."""
        return True

    @property
    def carries_remote_frames(self) -> bool:
        """True: twins receive every frame."""
        return True

    @property
    def bitrate(self) -> int | None:
        """The bit rate of the wrapped bus."""
        return self._wrapped.bitrate

    @property
    def runs_at(self) -> int | None:
        """The bit rate of the wrapped bus."""
        return self._wrapped.runs_at

    def require_settable(self, bit_rate: int, *, listen_only: bool = False) -> None:
        """As the wrapped bus."""
        self._wrapped.require_settable(bit_rate, listen_only=listen_only)

    def set_bit_rate(self, bit_rate: int, *, listen_only: bool = False) -> None:
        """Do nothing: twins have no bit rate."""

    def sdo(self, node_id: int) -> Twin:
        """The dictionary of *node_id*'s twin; the same object for the same node."""
        if not 1 <= node_id <= 127:
            raise UsageError(f"node-ID {node_id} is outside 1..127")
        with self._lock:
            if node_id not in self._twins:
                self._twins[node_id] = Twin(self._wrapped, node_id, self._device_for, tuple(self._to_all))
            return self._twins[node_id]

    def set_timeout(self, timeout_s: float) -> None:
        """Set the SDO time-out for reads of nodes to *timeout_s*; twins answer at once."""
        self._wrapped.set_timeout(timeout_s)

    def set_bus_share(self, percent: int | None) -> None:
        """Limit the load of the wrapped bus while reading nodes to *percent* (1..100, None: 50)."""
        self._wrapped.set_bus_share(percent)

    def send_nmt(self, command: NmtCommand, node_id: int) -> None:
        """Command the twin of *node_id*, or with 0 all twins, present and future."""
        if node_id:
            self._hear(self.sdo(node_id).command(command))
            return
        with self._lock:
            self._to_all.append(command)
            twins = list(self._twins.values())
        for twin in twins:
            self._hear(twin.command(command))

    def nmt_state(self, node_id: int, timeout_s: float = 0.0) -> NmtState | None:
        """The twin's state after a command to the twin, else the state received from the node."""
        twin = self._commanded(node_id)
        return twin.state if twin is not None else self._wrapped.nmt_state(node_id, timeout_s)

    def boot_ups(self, node_id: int) -> int:
        """The boot-ups of the node and of its twin."""
        return self._wrapped.boot_ups(node_id) + self._twin_boot_ups(node_id)

    def restarts(self, node_id: int) -> int:
        """The restarts of the node: its twin restarts on command only."""
        return self._wrapped.restarts(node_id)

    def order_restart(self, node_id: int, within_s: float) -> None:
        """Do nothing: a restart of a twin does not reach its node."""

    def disturbance_count(self, node_id: int) -> int:
        """The disturbances of the node, and the boot-ups of its twin."""
        return self._wrapped.disturbance_count(node_id) + self._twin_boot_ups(node_id)

    def read_at_once(self) -> None:
        """Nothing changes: a twin is read without frames anyway."""

    def side_by_side(self, jobs: Sequence[Callable[[], None]]) -> list[BaseException]:
        """Run *jobs* in sequence up to the first fault, which is returned."""
        return one_by_one(jobs)

    def downloads_of_others(self, node_id: int) -> int:
        """The downloads by others to the node: nobody else uses its twin."""
        return self._wrapped.downloads_of_others(node_id)

    def happened(self, node_id: int) -> tuple[int, int]:
        """The events of the node, and the boot-ups of its twin."""
        disturbance_count, downloads = self._wrapped.happened(node_id)
        return disturbance_count + self._twin_boot_ups(node_id), downloads

    def wait_boot_up(self, node_id: int, seen: int, timeout_s: float) -> bool:
        """Wait for more than *seen* boot-ups; a twin's come at once."""
        if self.boot_ups(node_id) > seen:
            return True
        return self._wrapped.wait_boot_up(node_id, seen - self._twin_boot_ups(node_id), timeout_s)

    def nodes_seen(self) -> dict[int, NmtState]:
        """The states received from nodes, and the states of commanded twins."""
        commanded = {node_id: twin.state for node_id in list(self._twins) if (twin := self._commanded(node_id))}
        return self._wrapped.nodes_seen() | commanded

    def emergency(self, node_id: int) -> Emergency | None:
        """The last emergency message of the node; a twin's are only frames."""
        return self._wrapped.emergency(node_id)

    def received_emergencies(self, node_id: int) -> tuple[ReceivedEmergency, ...]:
        """Every error code sent by the node; a twin's are only frames."""
        return self._wrapped.received_emergencies(node_id)

    def on_event(self, callback: Callable[[NodeEvent], None]) -> Callable[[], None]:
        """Call *callback* for events of the nodes and boot-ups of twins; returns a function to end this."""
        self._listeners.append(callback)
        stop = self._wrapped.on_event(callback)

        def end() -> None:
            self._listeners.remove(callback)
            stop()

        return end

    def tap(self, callback: Callable[[Frame, bool], None]) -> Callable[[], None]:
        """Call *callback*(frame, sent) for frames of the wrapped bus and the twins; returns a function to end this."""
        self._taps.append(callback)
        stop = self._wrapped.tap(callback)

        def end() -> None:
            self._taps.remove(callback)
            stop()

        return end

    def acts(self) -> list[str]:
        """Empty: everything sent here went to a twin."""
        return []

    def disturbances(self) -> list[str]:
        """The disturbances of the wrapped bus since the last call."""
        return self._wrapped.disturbances()

    def error_frame_count(self) -> int:
        """The number of error frames received on the wrapped bus so far."""
        return self._wrapped.error_frame_count()

    def exchanged(self) -> list[tuple[Frame, bool]]:
        """Empty: a twin is asked without a wire."""
        return []

    def lost_frame_count(self) -> int:
        """The number of frames lost on the wrapped bus."""
        return self._wrapped.lost_frame_count()

    def send(self, frame: Frame) -> None:
        """Send *frame* (SYNC, a PDO, an NMT command) to the twins only; their answers are received next."""
        if frame.can_id == NMT_ID and not frame.extended:
            if len(frame.data) == 2 and frame.data[0] in list(NmtCommand):
                self.send_nmt(NmtCommand(frame.data[0]), frame.data[1])
            return
        self._tell(frame, sent=True)
        for twin in list(self._twins.values()):
            self._hear(twin.hear(frame))

    def receive(self, duration_s: float) -> Iterator[Frame]:
        """Yield the frames of twins; without any, ends after *duration_s*."""
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

    def drain(self) -> None:
        """Deliver pending frames of the wrapped bus."""
        self._wrapped.drain()

    def idle(self, duration_s: float) -> None:
        """Read the wrapped bus for *duration_s*."""
        self._wrapped.idle(duration_s)

    def close(self) -> None:
        """Drop the twins; the wrapped bus stays open for its owner."""
        with self._lock:
            self._twins.clear()
            self._to_all.clear()
            self._frames.clear()

    def _hear(self, frames: list[Frame]) -> None:
        """Pass the frames of twins to reception and to observers."""
        self._frames.extend(frames)
        for frame in frames:
            self._tell(frame, sent=False)
            if frame.can_id & ~0x7F == HEARTBEAT_BASE and frame.data == _BOOT_UP:
                for listener in tuple(self._listeners):
                    listener(BootUp(frame.can_id & 0x7F, frame.timestamp_s))

    def _tell(self, frame: Frame, *, sent: bool) -> None:
        for tap in tuple(self._taps):
            tap(frame, sent)

    def _twin_boot_ups(self, node_id: int) -> int:
        twin = self._commanded(node_id)
        return 0 if twin is None else twin.boot_ups

    def _commanded(self, node_id: int) -> Twin | None:
        """The node's twin after a command to it or to all; None without a command or without a node."""
        twin = self.sdo(node_id) if self._to_all else self._twins.get(node_id)
        return twin if twin is not None and twin.commanded and twin.exists() else None


Backing = Callable[[int, int], bytes]
DeviceFor = Callable[[int, Backing], "StrictDevice"]


class Twin:
    """One node's twin as an SdoTransport, created on first use, reading the node on demand.

    *commands* are NMT commands to all nodes from before the creation.
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
        """True if the real node exists."""
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
        """Read an object as written to the twin, else from the node. Raises as the node would.

        *timeout_s* and *retries* apply to reads of the node, including the check for existence.
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
        """Raise NoAnswer for a missing node early: creating its twin would need more uploads and a longer wait."""
        with suppress(Refusal):
            self._backing(index, sub_index)

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:  # noqa: ARG002
        """Write an object of the twin only. Raises SdoAborted if the device would refuse."""
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
        """Obey an NMT command; returns the twin's frames (a boot-up)."""
        with self._lock:
            device = self._device()
            self.commanded = True
            device.nmt(command)
            return self._sent(device.take_outbox())

    def hear(self, frame: Frame) -> list[Frame]:
        """Receive a frame of the bus; returns the twin's answers."""
        with self._lock:
            device = self._device()
            self._follow_node(device)
            if device.services.hears_sync(frame):
                answers = device.services.sync(frame.data[0] if frame.data else None)
            else:
                answers = device.services.receive(frame)
            return self._sent(answers + device.take_outbox())

    def _sent(self, frames: list[Frame]) -> list[Frame]:
        self.boot_ups += frames.count(Frame(HEARTBEAT_BASE + self._node_id, _BOOT_UP))
        return frames

    def _answering(self, index: int, sub_index: int) -> StrictDevice:
        """The device, unless silent (CiA 301, 7.3.2.2.4: no SDO while STOPPED)."""
        device = self._device()
        if self.commanded and device.state is NmtState.STOPPED:
            place = f"{index:04X}:{sub_index:02X}"
            text = f"node {self._node_id} does not answer for 0x{place}: its twin is STOPPED"
            raise NoAnswer(
                text, node=self._node_id, place=place, hint=Hint(Action.ENTER_PRE_OPERATIONAL, {"node": self._node_id})
            )
        return device

    def _device(self) -> StrictDevice:
        """The simulated device, created here in the node's state."""
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
        """Copy the node's state until the twin is commanded."""
        if not self.commanded:
            device.state = self._state_of_node(device) or device.state

    def _state_of_node(self, device: StrictDevice) -> NmtState | None:
        """The node's state, preferably from its state object: a received state may be old."""
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
