"""A hostile SDO server in virtual time, and what the client must do whatever it answers.

Input: byte 0 says which transfer, byte 1 its length, byte 2 what happens once the moves are used up; then one move a
request: a byte that says what is answered and one more that shapes it. What counts as an acknowledgement is decided
here a second time, on purpose, from the frames and their times alone.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from heapq import heappop, heappush
from threading import Lock

from dvtcli.bus.receiver import Wake
from dvtcli.bus.sdo.client import SdoChannel, StrictSdoClient
from dvtcli.bus.sdo.sdo_link import Inbox, SdoSettings
from dvtcli.domain.can_ids import SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.errors import DvtcliError, NoAnswer, SdoAborted, SdoProtocolError

NODE, INDEX, SUB_INDEX = 5, 0x1A00, 1
_TIMEOUT_S, _RETRIES = 0.5, 1
_ANSWER_S = 0.0005
_MULTIPLEXER = INDEX.to_bytes(2, "little") + bytes([SUB_INDEX])
_DEVICE_TYPE = b"\x00\x10\x00"


@dataclass
class HostileLink:
    """An SdoLink on which time passes only when somebody waits; frames come as the input says."""

    moves: deque[int]
    last: int
    now: float = 0.0
    client: StrictSdoClient | None = None
    #: (time, order, frame) on their way to the client
    coming: list[tuple[float, int, bytes]] = field(default_factory=list)
    order: int = 0
    #: (time, request) as sent, and (time, frame) as received
    asked: list[tuple[float, bytes]] = field(default_factory=list)
    received: list[tuple[float, bytes]] = field(default_factory=list)
    toggle: int = 0
    left: int = 0
    #: after so many requests the server falls silent, so that one input stays cheap
    most_requests: int = 400

    def send_sdo(self, can_id: int, data: bytes) -> None:
        assert can_id == SDO_REQUEST_BASE + NODE
        assert len(data) == 8
        self.asked.append((self.now, data))
        if data[0] >> 5 == 4 or len(self.asked) > self.most_requests:
            return
        move = self.moves.popleft() if self.moves else self.last
        shape = self.moves.popleft() if self.moves else 0
        for after_s, frame in self._answers(data, move, shape):
            self.order += 1
            heappush(self.coming, (self.now + _ANSWER_S + after_s, self.order, frame))

    def await_share(self) -> None: ...

    def is_stopped(self, _node_id: int) -> bool:
        return False

    def takes_bursts(self) -> bool:
        return True

    def consumes_heartbeat(self, node_id: int, sub_index: int, *, consumes: bool) -> None: ...

    def note_act(self, text: str | None) -> None: ...

    def begin_transfer(self, turn: Lock) -> None:
        turn.acquire()

    def end_transfer(self, turn: Lock) -> None:
        turn.release()

    def take(self, inbox: Inbox, deadline_s: float) -> bytes | None:
        while inbox.empty() and self.coming and self.coming[0][0] <= deadline_s:
            self._arrive()
        if inbox.empty():
            self.now = max(self.now, deadline_s)
            return None
        item = inbox.get_nowait()
        return None if isinstance(item, Wake) else item

    def delay_s(self, *, anew: bool) -> float:
        return 0.0

    def now_s(self) -> float:
        return self.now

    def drain(self) -> None:
        while self.coming and self.coming[0][0] <= self.now:
            self._arrive()

    def _arrive(self) -> None:
        due_s, _, frame = heappop(self.coming)
        self.now = max(self.now, due_s)
        self.received.append((due_s, frame))
        assert self.client is not None
        self.client.receive(SDO_RESPONSE_BASE + NODE, frame, extended=False)

    def _answers(  # noqa: C901, PLR0911 - a table of moves
        self, request: bytes, move: int, shape: int
    ) -> list[tuple[float, bytes]]:
        good = self._good(request, shape)
        other = bytes([good[0] ^ 0x10]) + good[1:] if request[0] >> 5 in (0, 3) else good
        match move % 16:
            case 0 | 1 | 2 | 3 | 4:
                return [(0.0, good)]
            case 5:
                return []
            case 6:  # late, often after the time-out
                return [(shape / 100, good)]
            case 7:
                return [(0.0, good)] * (1 + shape % 4)
            case 8:  # the next answer before it is asked for
                return [(0.0, good), (0.0, other)]
            case 9:
                return [(0.0, other)]
            case 10:
                place = request[1:4] if shape & 1 else bytes([shape, 0x1A, 1])
                return [(0.0, b"\x80" + place + bytes([shape, 0, 4, 6])), (0.0, good)][: 1 + (shape >> 1 & 1)]
            case 11:  # one byte wrong
                at = shape & 7
                return [(0.0, good[:at] + bytes([good[at] ^ (shape | 1)]) + good[at + 1 :])]
            case 12:
                return [(0.0, good[: shape % 8])]
            case 13:  # another object's acknowledgement first
                return [(0.0, bytes([0x60, shape, 0x18, 1]) + bytes(4)), (0.0, good)]
            case 14:  # bytes of the input's own
                count = min(shape & 15, len(self.moves))
                return [(0.0, bytes(self.moves.popleft() for _ in range(count)))]
            case _:  # any specifier with the right address
                return [(0.0, bytes([shape]) + request[1:4] + bytes([shape] * 4))]

    def _good(self, request: bytes, shape: int) -> bytes:
        """What an honest server could answer."""
        kind, place = request[0] >> 5, request[1:4]
        if kind == 1:
            return b"\x60" + place + bytes(4)
        if kind == 0:
            return bytes([0x20 | request[0] & 0x10]) + bytes(7)
        if kind == 2:
            if shape & 0x80:
                self.left = shape & 0x3F
                size = (0, self.left, 0xFFFF_FFFF, 3)[shape >> 6 & 1 | shape & 2]
                return bytes([0x40 | shape & 1]) + place + size.to_bytes(4, "little")
            return bytes([0x43 | (shape & 3) << 2]) + place + bytes([1, 2, 3, shape])
        part = min(7, self.left) if self.left else 7
        self.left = max(0, self.left - part)
        last = not self.left and not shape & 0x40
        return bytes([request[0] & 0x10 | (7 - part) << 1 | last]) + bytes([shape] * 7)


def sdo_client(data: bytes) -> None:
    """Whatever the server sends: bytes that it sent, an acknowledgement that it gave, or an error of ours, in time."""
    if len(data) < 3:
        return
    link = HostileLink(deque(data[3:]), data[2])
    client = StrictSdoClient(NODE, link, SdoSettings(_TIMEOUT_S, _RETRIES))
    link.client = client
    channel = SdoChannel(client)
    for turn in range(1 + data[0] % 3):
        _transfer(channel, link, write=bool(data[0] >> 4 + turn & 1), size=data[1] >> turn)


def _transfer(channel: SdoChannel, link: HostileLink, *, write: bool, size: int) -> None:
    first, began_s = len(link.asked), link.now
    payload = bytes(range(size))
    got: bytes | None = None
    try:
        if write:
            channel.download(INDEX, SUB_INDEX, payload)
        else:
            got = channel.upload(INDEX, SUB_INDEX)
    except (NoAnswer, SdoProtocolError, SdoAborted) as error:
        _check_error(error, link, first, write=write)
        _in_time(link, first, began_s)
        return
    _in_time(link, first, began_s)
    answers = _answers_to(link, first)
    if write:
        assert _sent_payload(link, first) == payload
    else:
        assert got == _received(answers)


def _check_error(error: DvtcliError, link: HostileLink, first: int, *, write: bool) -> None:
    """An error names the node, an abort our object; after a write was sent, nobody knows what it did."""
    assert error.node == NODE
    assert error.exit_code in (1, 5)
    if isinstance(error, SdoAborted):
        assert error.index.to_bytes(2, "little") + bytes([error.sub_index]) in (_MULTIPLEXER, _DEVICE_TYPE)
    elif write and any(request[0] >> 5 == 1 for _, request in link.asked[first:]):
        assert error.state == "unknown"


def _in_time(link: HostileLink, first: int, began_s: float) -> None:
    """No request waits longer than its time-out."""
    assert link.now - began_s <= (len(link.asked) - first) * (_TIMEOUT_S + 1e-9)


def _answers_to(link: HostileLink, first: int) -> list[bytes]:
    """The answer to each request of the transfer: the first frame that fits and came after it, before the next.

    A read that went wrong may have been begun anew; then its last beginning counts.
    """
    requests = link.asked[first:]
    beginnings = [at for at, (_, request) in enumerate(requests) if request[:4] == b"\x40" + _MULTIPLEXER]
    requests = requests[beginnings[-1] :] if beginnings else requests
    found = []
    for number, (sent_s, request) in enumerate(requests):
        if request[0] >> 5 == 4 or request[1:4] == _DEVICE_TYPE:
            continue
        until_s = requests[number + 1][0] if number + 1 < len(requests) else float("inf")
        fitting = [frame for at_s, frame in link.received if sent_s < at_s <= until_s and _fits(request, frame)]
        assert fitting, f"nothing acknowledged {request.hex(' ')}"
        found.append(fitting[0])
    return found


def _fits(request: bytes, answer: bytes) -> bool:
    if len(answer) != 8:
        return False
    kind, specifier = request[0] >> 5, answer[0] >> 5
    if kind in (1, 2):
        return specifier == {1: 3, 2: 2}[kind] and answer[1:4] == request[1:4]
    return specifier == {0: 1, 3: 0}[kind] and not (answer[0] ^ request[0]) & 0x10


def _sent_payload(link: HostileLink, first: int) -> bytes:
    """What the requests of a download carried."""
    data = b""
    for _, request in link.asked[first:]:
        if request[1:4] == _DEVICE_TYPE and request[0] == 0x40:
            continue
        if request[0] >> 5 == 1 and request[0] & 2:
            return request[4 : 8 - (request[0] >> 2 & 3)]
        if request[0] >> 5 == 0:
            data += request[1 : 8 - (request[0] >> 1 & 7)]
    return data


def _received(answers: list[bytes]) -> bytes:
    """What the answers of an upload carry."""
    begin, *segments = answers
    if begin[0] & 2:
        return begin[4 : 8 - (begin[0] >> 2 & 3 if begin[0] & 1 else 0)]
    data = b"".join(segment[1 : 8 - (segment[0] >> 1 & 7)] for segment in segments)
    assert segments[-1][0] & 1
    assert not begin[0] & 1 or len(data) == int.from_bytes(begin[4:], "little")
    return data
