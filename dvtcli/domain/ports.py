"""Interfaces to the outside: a node's dictionary, and the network; implemented in `bus`.

Implementations raise the errors of `dvtcli.errors`: SdoAborted, NoAnswer, BusUnavailable, SdoProtocolError.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from dvtcli.domain.nmt import NmtCommand, NmtState


class BootUp(NamedTuple):
    """Boot-up message of a node (CiA 301, 7.2.8.3.3)."""

    node_id: int
    timestamp_s: float = 0.0


class StateChange(NamedTuple):
    """A heartbeat with another state than *before*; *before* is None if unknown."""

    node_id: int
    before: NmtState | None
    after: NmtState
    timestamp_s: float = 0.0


class Emergency(NamedTuple):
    """An emergency message: *code* (CiA 301, table 26), *register* (0x1001) and five manufacturer-specific bytes."""

    node_id: int
    code: int
    register: int
    manufacturer: bytes
    timestamp_s: float = 0.0


@dataclass(frozen=True, slots=True)
class ReceivedEmergency:
    """Occurrences of a node's error code: *count* times, first at *first_s*, and the *last* message."""

    count: int
    first_s: float
    last: Emergency


NodeEvent = BootUp | StateChange | Emergency


class Frame(NamedTuple):
    """A CAN data or remote frame; *timestamp_s* is the bus's clock in seconds.

    *dlc* is the data length code of a remote frame without data: the number of requested bytes (0..8).
    """

    can_id: int
    data: bytes
    extended: bool = False
    remote: bool = False
    timestamp_s: float = 0.0
    dlc: int = 0


class SdoReader(Protocol):
    """Read access to a node's object dictionary."""

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """Read an object. Raises SdoAborted if the device refuses, NoAnswer if it is silent.

        *timeout_s* and *retries* (0..) override the defaults.
        """
        ...


class SdoTransport(SdoReader, Protocol):
    """Access to a node's object dictionary."""

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        """Write an object; *timeout_s* overrides the usual time-out (a store takes seconds)."""
        ...


class CanopenBus(Protocol):
    """The network with its nodes."""

    @property
    def name(self) -> str:
        """Name of the bus on screens, for example `socketcan:can0`."""
        ...

    @property
    def simulated(self) -> bool:
        """Whether nothing leaves this process."""
        ...

    @property
    def carries_frames(self) -> bool:
        """Whether CAN frames are sent and received: a gateway may only read and write objects."""
        ...

    @property
    def carries_remote_frames(self) -> bool:
        """Whether `send` can send a remote frame."""
        ...

    @property
    def bitrate(self) -> int | None:
        """The bit rate in bit/s, None if unknown."""
        ...

    @property
    def runs_at(self) -> int | None:
        """The bit rate (bit/s) to return to after `set_bit_rate`, also of simulated nodes; None if unknown."""
        ...

    def require_settable(self, bit_rate: int, *, listen_only: bool = False) -> None:
        """Raise SafetyRefusal if *bit_rate* (bit/s) cannot be set from here, with the manual way.

        With *listen_only*, also if the interface may not support listen-only mode: a node that acknowledges and signals
        errors at a wrong bit rate destroys other nodes' frames.
        """
        ...

    def set_bit_rate(self, bit_rate: int, *, listen_only: bool = False) -> None:
        """Leave the bus and rejoin at *bit_rate* (bit/s), with *listen_only* silently. Raises BusUnavailable.

        Data received before stays known.
        """
        ...

    def read_at_once(self) -> None:
        """Read objects of simulated nodes without frames from now on; real nodes are read as before."""
        ...

    def side_by_side(self, jobs: Sequence[Callable[[], None]]) -> list[BaseException]:
        """Run *jobs*, each waiting for answers of its own node: in parallel if safe.

        All jobs have ended on return. Returns their errors in order of time; after an error no job is started.
        """
        ...

    def sdo(self, node_id: int) -> SdoTransport:
        """The default SDO channel of *node_id* (1..127); always the same object for the same node."""
        ...

    def set_timeout(self, timeout_s: float) -> None:
        """Set the time-out *timeout_s* (s) of every SDO answer from now on."""
        ...

    def set_bus_share(self, percent: int | None) -> None:
        """Limit the bus load to *percent* (1..100, None: 50) while a machine may be running."""
        ...

    def send_nmt(self, command: NmtCommand, node_id: int) -> None:
        """Send an NMT command to *node_id*, or to all nodes with 0."""
        ...

    def nmt_state(self, node_id: int, timeout_s: float = 0.0) -> NmtState | None:
        """The last received state of *node_id* (heartbeat, boot-up); waits up to *timeout_s* for a *new* sign of life.

        0 does not wait. None: no state was ever received.
        """
        ...

    def boot_ups(self, node_id: int) -> int:
        """Number of boot-up messages of *node_id* so far."""
        ...

    def restarts(self, node_id: int) -> int:
        """Number of boot-up messages of *node_id* so far without a reset sent from here."""
        ...

    def order_restart(self, node_id: int, within_s: float) -> None:
        """Do not count a boot-up of *node_id* (0: each node) within *within_s* seconds as a restart."""
        ...

    def disturbance_count(self, node_id: int) -> int:
        """A number that grows with each boot-up of *node_id*, and with each repeated upload.

        While it stays the same, all values read from the node are from the same boot.
        """
        ...

    def downloads_of_others(self, node_id: int) -> int:
        """Number of downloads by other SDO clients to *node_id* since its last boot-up."""
        ...

    def happened(self, node_id: int) -> tuple[int, int]:
        """Numbers of events that may have changed *node_id*: disturbances, and downloads of others; reads no bus."""
        ...

    def wait_boot_up(self, node_id: int, seen: int, timeout_s: float) -> bool:
        """Wait until more than *seen* boot-ups of *node_id* were received; False after *timeout_s*."""
        ...

    def nodes_seen(self) -> dict[int, NmtState]:
        """Every node's state known from heartbeats and boot-ups, by node-ID."""
        ...

    def emergency(self, node_id: int) -> Emergency | None:
        """The last emergency message of *node_id*, None for none."""
        ...

    def received_emergencies(self, node_id: int) -> tuple[ReceivedEmergency, ...]:
        """Every error code of *node_id* since the bus was opened, latest first."""
        ...

    def on_event(self, callback: Callable[[NodeEvent], None]) -> Callable[[], None]:
        """Call *callback* for each boot-up, state change and emergency; returns a function that ends the calls.

        The thread that reads the bus makes the call: *callback* must be quick and must not use the bus.
        """
        ...

    def tap(self, callback: Callable[[Frame, bool], None]) -> Callable[[], None]:
        """Call *callback*(frame, sent) for each frame received or sent; returns a function that ends it.

        See `on_event`.
        """
        ...

    def exchanged(self) -> list[tuple[Frame, bool]]:
        """The last frames sent from here and their answers, each with whether it is ours.

        Oldest first; times are seconds since 1970; the number is limited.
        """
        ...

    def acts(self) -> list[str]:
        """Frames with an effect on nodes sent since the last call, in words: SDO downloads, NMT, LSS, SYNC, PDOs."""
        ...

    def disturbances(self) -> list[str]:
        """Disturbances since the last call, in words: error frames, other SDO clients, a node-ID used twice."""
        ...

    def error_frame_count(self) -> int:
        """Number of error frames received so far."""
        ...

    def lost_frame_count(self) -> int:
        """Number of frames lost before they could be read, as far as known."""
        ...

    def send(self, frame: Frame) -> None:
        """Send a frame (SYNC, a PDO)."""
        ...

    def receive(self, duration_s: float) -> Iterator[Frame]:
        """Yield every frame received within *duration_s*, at its arrival."""
        ...

    def drain(self) -> None:
        """Deliver received frames without waiting."""
        ...

    def idle(self, duration_s: float) -> None:
        """Read the bus for *duration_s* (s) for the callbacks, as a background thread does in a loop.

        Gives way to any waiting thread.
        """
        ...

    def now_s(self) -> float:
        """The bus's own time in seconds: only differences are meaningful, and a simulated bus may run ahead."""
        ...

    def sleep(self, duration_s: float) -> None:
        """Wait *duration_s* of the bus's time (0 and less: not at all); others may use the bus meanwhile."""
        ...

    def close(self) -> None:
        """Leave the bus; returns promptly and may be called twice."""
        ...
