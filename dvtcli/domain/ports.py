"""The two seams to the world: one node's dictionary, and the network.

Everything above is written against these protocols; `bus` implements them. Errors that implementations
raise are those of `dvtcli.errors`: SdoAborted, NoAnswer, BusUnavailable, SdoProtocolError.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from dvtcli.domain.nmt import NmtCommand, NmtState


@dataclass(frozen=True, slots=True)
class BootUp:
    """A node said that it has started (CiA 301, 7.2.8.3.3)."""

    node_id: int
    timestamp_s: float = 0.0


@dataclass(frozen=True, slots=True)
class StateChange:
    """A node's heartbeat carries another state than before; *before* is None where none was known."""

    node_id: int
    before: NmtState | None
    after: NmtState
    timestamp_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Emergency:
    """An emergency message: *code* (CiA 301, table 26), *register* (0x1001) and the maker's five bytes."""

    node_id: int
    code: int
    register: int
    manufacturer: bytes
    timestamp_s: float = 0.0


@dataclass(frozen=True, slots=True)
class HeardEmergency:
    """One error code of a node as often as it was heard: *count* times, first at *first_s*, and the *last* message."""

    count: int
    first_s: float
    last: Emergency


NodeEvent = BootUp | StateChange | Emergency


@dataclass(frozen=True, slots=True)
class Frame:
    """A CAN data or remote frame; *timestamp_s* is the bus's clock in seconds.

    *dlc* is the data length code of a remote frame, which has no data: how many bytes (0..8) it asks for.
    """

    can_id: int
    data: bytes
    extended: bool = False
    remote: bool = False
    timestamp_s: float = 0.0
    dlc: int = 0


class SdoReader(Protocol):
    """Reading one node's object dictionary."""

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """Read an object; raises SdoAborted where the device refuses, NoAnswer where it is silent.

        *timeout_s* and *retries* (0..) override the usual ones.
        """
        ...


class SdoTransport(SdoReader, Protocol):
    """Access to one node's object dictionary."""

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        """Write an object; *timeout_s* overrides the usual time-out (a store takes seconds)."""
        ...


class CanopenBus(Protocol):
    """The network that nodes live on."""

    @property
    def name(self) -> str:
        """How the bus is called on screens, for example `socketcan:can0`."""
        ...

    @property
    def simulated(self) -> bool:
        """Whether nothing leaves this process."""
        ...

    @property
    def carries_frames(self) -> bool:
        """Whether CAN frames are sent and heard: a gateway may do no more than read and write objects."""
        ...

    @property
    def carries_remote_frames(self) -> bool:
        """Whether `send` can send a remote frame."""
        ...

    @property
    def bitrate(self) -> int | None:
        """The bit rate in bit/s, None where nobody said."""
        ...

    @property
    def runs_at(self) -> int | None:
        """The bit rate (bit/s) that `set_bit_rate` could go back to, also of simulated nodes; None: not known."""
        ...

    def require_settable(self, bit_rate: int, *, listen_only: bool = False) -> None:
        """SafetyRefusal where *bit_rate* (bit/s) cannot be set from here, with the way to do it by hand.

        With *listen_only* also where the interface is not known to listen without a word: a frame that is read at a
        wrong bit rate is destroyed for others by who acknowledges and complains.
        """
        ...

    def set_bit_rate(self, bit_rate: int, *, listen_only: bool = False) -> None:
        """Leave the bus, and be on it again at *bit_rate* (bit/s), with *listen_only* without a word; BusUnavailable.

        What was heard so far stays known.
        """
        ...

    def side_by_side(self, jobs: Sequence[Callable[[], None]]) -> list[BaseException]:
        """Do *jobs*, each of which waits for answers of a node of its own: side by side where that harms nobody.

        On return none of them goes on. Answers what went wrong, in the order of time; after that none is begun.
        """
        ...

    def sdo(self, node_id: int) -> SdoTransport:
        """The default SDO channel of *node_id* (1..127); the same object for the same node."""
        ...

    def set_timeout(self, timeout_s: float) -> None:
        """Let every SDO answer take *timeout_s* (s) from now on."""
        ...

    def set_bus_share(self, percent: int | None) -> None:
        """Let the load stay at or below *percent* (1..100, None: 50) of the bus while a machine may be running."""
        ...

    def send_nmt(self, command: NmtCommand, node_id: int) -> None:
        """Send an NMT command to *node_id*, or to all nodes with 0."""
        ...

    def nmt_state(self, node_id: int, timeout_s: float = 0.0) -> NmtState | None:
        """The state last heard of *node_id* (heartbeat, boot-up); waits up to *timeout_s* for a *new* sign of life.

        With 0 nothing is waited for. None: nothing was ever heard.
        """
        ...

    def boot_ups(self, node_id: int) -> int:
        """How many boot-up messages of *node_id* were seen so far."""
        ...

    def restarts(self, node_id: int) -> int:
        """How many boot-up messages of *node_id* were seen so far that no reset sent from here explains."""
        ...

    def order_restart(self, node_id: int, within_s: float) -> None:
        """Let the next boot-up of *node_id* (0: of each node) be no restart if it comes within *within_s* seconds."""
        ...

    def upsets(self, node_id: int) -> int:
        """A number that grows with each boot-up of *node_id*, and with each upload that had to be asked again.

        As long as it stays the same, everything that was read of the node is of one and the same life of it.
        """
        ...

    def downloads_of_others(self, node_id: int) -> int:
        """How many downloads of other SDO clients to *node_id* were seen since its last boot-up."""
        ...

    def happened(self, node_id: int) -> tuple[int, int]:
        """What may have changed *node_id*: its `upsets`, and `downloads_of_others`; does not read the bus."""
        ...

    def wait_boot_up(self, node_id: int, seen: int, timeout_s: float) -> bool:
        """Wait until more than *seen* boot-ups of *node_id* were received; False after *timeout_s*."""
        ...

    def heard_nodes(self) -> dict[int, NmtState]:
        """Every node whose state is known from what it said by itself (heartbeats, boot-ups), by node-ID."""
        ...

    def emergency(self, node_id: int) -> Emergency | None:
        """The last emergency message of *node_id*, None where there was none."""
        ...

    def heard_emergencies(self, node_id: int) -> tuple[HeardEmergency, ...]:
        """Every error code that *node_id* sent since the bus is open, the one heard last first."""
        ...

    def on_event(self, callback: Callable[[NodeEvent], None]) -> Callable[[], None]:
        """Call *callback* for each boot-up, state change and emergency; returns what ends that.

        It is called by the thread that happens to read the bus: it must be quick and must not use the bus.
        """
        ...

    def tap(self, callback: Callable[[Frame, bool], None]) -> Callable[[], None]:
        """Call *callback*(frame, sent) for each frame received or sent here; returns what ends that. As `on_event`."""
        ...

    def exchanged(self) -> list[tuple[Frame, bool]]:
        """The frames that were sent here last, and those that answered them; each with whether it is ours.

        Oldest first; times are seconds since 1970; how many are remembered is bounded.
        """
        ...

    def acts(self) -> list[str]:
        """What was sent since the last call that nodes act on, in words: SDO downloads, NMT, LSS, SYNC, PDOs."""
        ...

    def disturbances(self) -> list[str]:
        """What was noticed since the last call, in words: error frames, other SDO clients, a node-ID used twice."""
        ...

    def error_frame_count(self) -> int:
        """How many error frames were received so far."""
        ...

    def lost_frame_count(self) -> int:
        """How many frames were dropped so far before anybody here could read them, as far as that is known."""
        ...

    def send(self, frame: Frame) -> None:
        """Send one frame (SYNC, a PDO)."""
        ...

    def receive(self, duration_s: float) -> Iterator[Frame]:
        """Yield every frame that arrives within *duration_s*, as it arrives."""
        ...

    def drain(self) -> None:
        """Deliver what has already arrived, without waiting."""
        ...

    def idle(self, duration_s: float) -> None:
        """Read the bus for *duration_s* (s) on behalf of the callbacks, as a background thread does in a loop.

        Gives way to any thread that waits for something.
        """
        ...

    def now_s(self) -> float:
        """The bus's own time in seconds: only differences mean something, and a simulated bus may run ahead."""
        ...

    def sleep(self, duration_s: float) -> None:
        """Wait *duration_s* of that time (0 and less: not at all); others may use the bus meanwhile."""
        ...

    def close(self) -> None:
        """Leave the bus; returns promptly and may be called twice."""
        ...
