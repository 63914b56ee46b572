"""Interface between an SDO client and a bus, without a CAN library."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from queue import SimpleQueue
from threading import Lock
from typing import Protocol

from dvtcli.bus.receiver import Wake

#: SDO time-out (s), and repetitions of a read's first request after it
DEFAULT_TIMEOUT_S = 0.5
DEFAULT_RETRIES = 1

#: inbox item for a boot-up of the node: longer than a CAN frame's data
RESTARTED = b"restarted"


class Inbox(SimpleQueue[bytes | Wake]):
    """Answers of a node; *on_arrival* is called for each, by the thread that reads the bus."""

    on_arrival: Callable[[], None] | None = None

    def put(self, item: bytes | Wake, block: bool = True, timeout: float | None = None) -> None:
        """Put *item* in, and inform the waiting thread; never full."""
        super().put(item, block, timeout)
        if self.on_arrival is not None:
            self.on_arrival()


class SdoLink(Protocol):
    """Functions of a bus for a client."""

    def send_sdo(self, can_id: int, data: bytes) -> None:
        """Send an SDO frame. Raises BusUnavailable."""
        ...

    def take(self, inbox: Inbox, deadline_s: float) -> bytes | None:
        """Wait for an answer in *inbox* until *deadline_s* (of `now_s`)."""
        ...

    def await_share(self) -> None:
        """Wait until a request and its answer fit into the permitted bus share."""
        ...

    def takes_bursts(self) -> bool:
        """Whether bursts of frames are allowed: not while they could stop a machine."""
        ...

    def is_stopped(self, node_id: int) -> bool:
        """Whether the last known state since the last NMT command to *node_id* is STOPPED."""
        ...

    def consumes_heartbeat(self, node_id: int, sub_index: int, *, consumes: bool) -> None:
        """Note whether 0x1016 of *node_id* is not zero at *sub_index*, as read or written."""
        ...

    def note_act(self, text: str | None) -> None:
        """Note that *text*, an effect on nodes, is about to be sent."""
        ...

    def begin_transfer(self, turn: Lock) -> None:
        """Begin a transfer: take *turn*, which a waiting thread may hold."""
        ...

    def end_transfer(self, turn: Lock) -> None:
        """Give *turn* back: the transfer has ended."""
        ...

    def delay_s(self, *, anew: bool) -> float:
        """Total time in seconds during which this machine, not a node, kept answers from being read.

        *anew*: a wait begins, and the time since the last wait ended is not counted if no other thread waits.
        """
        ...

    def now_s(self) -> float:
        """Time base of deadlines, in seconds."""
        ...

    def drain(self) -> None:
        """Deliver received frames without waiting."""
        ...


@dataclass(slots=True)
class DroppedAnswers:
    """Number of discarded answers from a node.

    *stale*: late, or a second answer to the same request; *foreign*: for an object that was not requested, or with a
    29-bit CAN-ID; *malformed*: not 8 bytes, or an unknown command specifier; *doubled*: the *stale* answers that are
    not late; *other_client*: other clients' requests on the node's SDO channel.
    """

    stale: int = 0
    foreign: int = 0
    malformed: int = 0
    doubled: int = 0
    other_client: int = 0

    @property
    def total(self) -> int:
        """All discarded answers."""
        return self.stale + self.foreign + self.malformed

    def __str__(self) -> str:
        return f"{self.stale} stale, {self.foreign} foreign, {self.malformed} malformed"


@dataclass(slots=True, eq=False, repr=False)
class SdoSettings:
    """*timeout_s* for each answer, and the number (0..) of repetitions of a read's first request after it."""

    timeout_s: float
    retries: int
