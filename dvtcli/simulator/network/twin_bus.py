"""The dry run: every node is replaced by a simulated twin that reads from the node and keeps all writes to itself.

Nothing but SDO uploads reaches the wrapped bus.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence

from dvtcli.bus.turns import one_by_one
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import BootUp, CanopenBus, Emergency, Frame, HeardEmergency, NodeEvent
from dvtcli.errors import UsageError
from dvtcli.simulator.network.twin import DeviceFor, Twin

_NMT_CAN_ID, _HEARTBEAT = 0x000, 0x700
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

    def upsets(self, node_id: int) -> int:
        """The disturbances of the node, and the boot-ups of its twin."""
        return self._wrapped.upsets(node_id) + self._twin_boot_ups(node_id)

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
        upsets, downloads = self._wrapped.happened(node_id)
        return upsets + self._twin_boot_ups(node_id), downloads

    def wait_boot_up(self, node_id: int, seen: int, timeout_s: float) -> bool:
        """Wait for more than *seen* boot-ups; a twin's come at once."""
        if self.boot_ups(node_id) > seen:
            return True
        return self._wrapped.wait_boot_up(node_id, seen - self._twin_boot_ups(node_id), timeout_s)

    def heard_nodes(self) -> dict[int, NmtState]:
        """The states received from nodes, and the states of commanded twins."""
        commanded = {node_id: twin.state for node_id in list(self._twins) if (twin := self._commanded(node_id))}
        return self._wrapped.heard_nodes() | commanded

    def emergency(self, node_id: int) -> Emergency | None:
        """The last emergency message of the node; a twin's are only frames."""
        return self._wrapped.emergency(node_id)

    def heard_emergencies(self, node_id: int) -> tuple[HeardEmergency, ...]:
        """Every error code sent by the node; a twin's are only frames."""
        return self._wrapped.heard_emergencies(node_id)

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
        if frame.can_id == _NMT_CAN_ID and not frame.extended:
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
        """The node's twin after a command to it or to all; None without a command or without a node."""
        twin = self.sdo(node_id) if self._to_all else self._twins.get(node_id)
        return twin if twin is not None and twin.commanded and twin.exists() else None
