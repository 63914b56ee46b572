"""What an SDO client and a bus need to know of each other. Does not import a CAN library."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from queue import SimpleQueue
from threading import Lock
from typing import Protocol

from dvtcli.bus.receiver import Wake

#: CAN-IDs of the default SDO channel, to which the node-ID is added (CiA 301, 7.3.5)
REQUEST_ID = 0x600
ANSWER_ID = 0x580

#: how long an SDO answer is waited for (s), and how often a read's first request is repeated after it
DEFAULT_TIMEOUT_S = 0.5
DEFAULT_RETRIES = 1

#: what stands in an inbox for "the node sent a boot-up": longer than what a CAN frame carries
RESTARTED = b"restarted"


class Inbox(SimpleQueue[bytes | Wake]):
    """What a node answered; *on_arrival* is called with each of it, by the thread that reads the bus."""

    on_arrival: Callable[[], None] | None = None

    def put(self, item: bytes | Wake, block: bool = True, timeout: float | None = None) -> None:
        """Put *item* in, and tell who waits for it; there is always room."""
        super().put(item, block, timeout)
        if self.on_arrival is not None:
            self.on_arrival()


class SdoLink(Protocol):
    """What a client needs of a bus."""

    def send_sdo(self, can_id: int, data: bytes) -> None:
        """Send one SDO frame; raises BusUnavailable."""
        ...

    def take(self, inbox: Inbox, deadline_s: float) -> bytes | None:
        """Wait for an answer in *inbox* until *deadline_s* (as `now_s` tells)."""
        ...

    def await_share(self) -> None:
        """Wait until a request and its answer fit into what may be used of the bus."""
        ...

    def takes_bursts(self) -> bool:
        """Whether many frames may follow one another at once: not while that could stop a machine."""
        ...

    def is_stopped(self, node_id: int) -> bool:
        """Whether *node_id* was heard to be STOPPED since its last NMT command."""
        ...

    def consumes_heartbeat(self, node_id: int, sub_index: int, *, consumes: bool) -> None:
        """Take what was read or written: whether 0x1016 of *node_id* is not zero at *sub_index*."""
        ...

    def note_act(self, text: str | None) -> None:
        """Note that *text*, which a node acts on, is about to be sent."""
        ...

    def begin_transfer(self, turn: Lock) -> None:
        """Take *turn*, which somebody may hold who waits for an answer: a transfer begins."""
        ...

    def end_transfer(self, turn: Lock) -> None:
        """Give *turn* back: the transfer has ended."""
        ...

    def delay_s(self) -> float:
        """How long in all this machine, and no node, kept answers from being read, in seconds."""
        ...

    def now_s(self) -> float:
        """The time that deadlines are measured in, in seconds."""
        ...

    def drain(self) -> None:
        """Deliver what has already arrived."""
        ...


@dataclass(slots=True)
class DroppedAnswers:
    """How many answers of a node did not count.

    *stale*: late, or a second one to the same request; *foreign*: for an object that was not asked for, or with a
    29-bit CAN-ID; *malformed*: not 8 bytes, or no such command specifier; *doubled*: those of *stale* that are not
    late; *other_client*: requests on the node's SDO channel that are not ours.
    """

    stale: int = 0
    foreign: int = 0
    malformed: int = 0
    doubled: int = 0
    other_client: int = 0

    @property
    def total(self) -> int:
        """All answers that were dropped."""
        return self.stale + self.foreign + self.malformed

    def __str__(self) -> str:
        return f"{self.stale} stale, {self.foreign} foreign, {self.malformed} malformed"


@dataclass(slots=True)
class SdoSettings:
    """*timeout_s* for each answer, and how often (0..) a read's first request is repeated after it."""

    timeout_s: float
    retries: int
