"""A node in another process, probed with raw frames over a socketcand link: `bench` at the other end of a bus.

Nothing here waits for a time-out to learn that a node is silent: behind each frame goes a question to a second node,
the fence. Frames come in order, so once the fence has answered, all that the probed node had to say is here.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import combinations
from pathlib import Path
from statistics import median

import can

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame
from tests.process import PATIENCE_S
from tests.simulator.bench import Aborted, Client
from tests.simulator.serve.served import Served, served

FENCE = 100
_QUESTION = Frame(0x600 + FENCE, bytes.fromhex("4018100100000000"))


class Link:
    """Node *node_id* of *server*, which has a fence too, as it left the factory."""

    def __init__(self, server: Served, bus: can.BusABC, node_id: int) -> None:
        self.server = server
        self.node_id = node_id
        self.client = Client(self)
        self._bus = bus
        self.restore()

    def handle(self, request: bytes) -> bytes | None:
        """The SDO answer to *request*, None for silence."""
        answers = [frame for frame in self.exchange(Frame(0x600 + self.node_id, request)) if self._is_answer(frame)]
        assert len(answers) <= 1
        return answers[0].data if answers else None

    def nmt(self, command: NmtCommand) -> None:
        self.exchange(Frame(0, bytes([command, self.node_id])))

    def sync(self) -> list[Frame]:
        return self.receive(Frame(0x080, b""))

    def receive(self, frame: Frame) -> list[Frame]:
        return [answer for answer in self.exchange(frame) if 0x080 < answer.can_id < 0x580 or answer.extended]

    def events(self, can_id: int, duration_ms: int) -> int:
        """By their times on the server's clock, from when they come steadily: a busy machine sends some frames late."""
        times: list[float] = []
        until_s = time.monotonic() + PATIENCE_S
        quiet_s = time.monotonic() + duration_ms / 1000
        while time.monotonic() < until_s:
            received = self._received(0.01) if times or time.monotonic() < quiet_s else self.exchange()
            new = [frame.timestamp_s for frame in received if frame.can_id == can_id]
            times += new
            if not times and time.monotonic() >= quiet_s:
                return 0
            if new and len(times) >= 16 and (period_s := _steady_period_s(times[-16:])) is not None:
                return round(duration_ms / 1000 / period_s)
        raise AssertionError(f"frames {can_id:X} do not come steadily: {times}")

    def exchange(self, *frames: Frame) -> list[Frame]:
        """Send *frames*; what everybody but the fence says until it answers."""
        for frame in (*frames, _QUESTION):
            self._bus.send(
                can.Message(
                    arbitration_id=frame.can_id,
                    data=frame.data,
                    is_extended_id=frame.extended,
                    is_remote_frame=frame.remote,
                )
            )
        received: list[Frame] = []
        until_s = time.monotonic() + PATIENCE_S
        while not received or received[-1].can_id != 0x580 + FENCE:
            assert time.monotonic() < until_s, "the fence does not answer"
            received += self._received(1.0)
        return received[:-1]

    def _received(self, timeout_s: float) -> list[Frame]:
        """The next frame, if there is one within *timeout_s* (s)."""
        message = self._bus.recv(timeout_s)
        if message is None:
            return []
        return [
            Frame(
                message.arbitration_id,
                bytes(message.data),
                extended=message.is_extended_id,
                timestamp_s=message.timestamp,
            )
        ]

    def _is_answer(self, frame: Frame) -> bool:
        return frame.can_id == 0x580 + self.node_id and not frame.extended

    def restore(self) -> None:
        """Back to what the node was when it was made: nothing stored, nothing changed."""
        self.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        with suppress(Aborted):  # a family without 0x1011 has nothing stored
            self.client.write_bytes(0x1011, 1, b"load")
        self.nmt(NmtCommand.RESET_NODE)


def _steady_period_s(times: list[float]) -> float | None:
    """The median period between frames and the next three, None where over half of them differ from it by 5 %."""
    pairs = [pair for pair in combinations(enumerate(times), 2) if pair[1][0] - pair[0][0] <= 3]
    periods_s = [(later - earlier) / (last - first) for (first, earlier), (last, later) in pairs]
    period_s = median(periods_s)
    near = [each for each in periods_s if abs(each - period_s) <= period_s / 20]
    return period_s if 2 * len(near) >= len(periods_s) else None


@contextmanager
def linked(folder: Path, *nodes: str) -> Iterator[tuple[Served, can.BusABC]]:
    """`dvtcli sim` with *nodes* and a fence, and a client of it, until the block ends."""
    with served(folder, *nodes, f"generic@{FENCE}") as server:
        yield server, server.attach()
