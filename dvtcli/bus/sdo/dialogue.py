"""Requests to a node's SDO server and their answers: every answer is checked before it counts.

Multiplexer, command specifier and toggle bit must fit (CiA 301, 7.2.4.3). canopen 2.4.1 mistakes an earlier write's
late acknowledgement for the present acknowledgement, even if the device aborts the present write.
One transfer at a time: see `SdoChannel`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from dvtcli.bus.receiver import Wake
from dvtcli.bus.sdo.sdo_link import RESTARTED, DroppedAnswers, Inbox, SdoLink, SdoSettings
from dvtcli.domain.abort import Abort
from dvtcli.domain.can_ids import SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import (
    BusUnavailable,
    DvtcliError,
    NoAnswer,
    SafetyRefusal,
    SdoAborted,
    SdoProtocolError,
    stopped_node,
)

_NEVER = Hint(
    Action.FIND_NODES, why="check power, node-ID and bit rate; a STOPPED node answers no SDO; {} lists the nodes"
)
_BEFORE = Hint(
    Action.GIVE_TIMEOUT,
    why="it answered before; a single lost frame causes this: try again; if it fails again, use a longer {}, "
    "or check its supply, the wiring and the bus load",
)


def no_answer(
    node_id: int,
    place: str,
    timeout_s: float,
    why: str | None = None,
    *,
    answered: bool = False,
    is_stopped: bool = False,
) -> NoAnswer:
    """The error for node *node_id* without answer for the object at *place* (`1018:01`) within *timeout_s* (s).

    *answered* tells whether the node ever answered, *is_stopped* whether its last state was STOPPED.
    """
    if is_stopped:
        refused, silent = stopped_node(node_id), f"it did not answer for 0x{place} within {timeout_s:g} s"
        stopped = NoAnswer(refused.text, node=node_id, place=place, why=silent, hint=refused.hint)
        stopped.exit_code, stopped.slug = SafetyRefusal.exit_code, SafetyRefusal.slug  # CiA 301, 7.3.2.2: no SDO then
        return stopped
    return NoAnswer(
        f"node {node_id} did not answer for 0x{place} within {timeout_s:g} s",
        node=node_id,
        place=place,
        why=why,
        hint=_BEFORE if answered else _NEVER,
    )


# Command specifiers, bits 7..5 of the first byte (CiA 301, 7.2.4.3.3 to 7.2.4.3.17).
_DOWNLOAD_SEGMENT, _DOWNLOAD, _UPLOAD, _UPLOAD_SEGMENT, _ABORT, _BLOCK_UPLOAD, _BLOCK_DOWNLOAD = range(7)
#: request's specifier -> the answer's; a server may answer a block upload with segments
_ANSWERS_TO = {
    _DOWNLOAD_SEGMENT: (1,), _DOWNLOAD: (3,), _UPLOAD: (2,), _UPLOAD_SEGMENT: (0,), _BLOCK_UPLOAD: (6, 2),
    _BLOCK_DOWNLOAD: (5,),
}  # fmt: skip
_INITIATE = (_DOWNLOAD, _UPLOAD, _BLOCK_UPLOAD, _BLOCK_DOWNLOAD)
#: answers that begin a transfer, with their sub-command bits, which must be 0
_INITIATED = {3: 0, 2: 0, 6: 0x01, 5: 0x03}
_WITH_MULTIPLEXER = (2, 3, 4)
_TOGGLE, _EXPEDITED = 0x10, 0x02
_ABORT_BYTE = 0x80
#: reads the device type, present in every node (CiA 301, 7.5.2.1)
_FENCE = bytes.fromhex("40 00 10 00 00 00 00 00")

#: maximum extension of the time-out (s) if this machine did not read the bus meanwhile
_MOST_DELAY_S = 2.0


class _Wait:
    """A wait of *timeout_s* (s) for frames over *link*, beginning with the first `take`.

    While this machine keeps the bus from being read, the wait is extended: an answer could not be seen, and a node or
    an adapter driven by this machine could not send.
    """

    def __init__(self, link: SdoLink, timeout_s: float) -> None:
        self._link, self._timeout_s = link, timeout_s
        self._deadline_s: float | None = None
        self._delay_s, self._left_s = link.delay_s(anew=True), _MOST_DELAY_S

    def take(self, inbox: Inbox) -> bytes | None:
        """The next item of *inbox*; None if none came in time."""
        link = self._link
        if self._deadline_s is None:
            self._deadline_s = link.now_s() + self._timeout_s
        while (item := link.take(inbox, self._deadline_s)) is None:
            delay_s = link.delay_s(anew=False)
            more_s, self._delay_s = min(delay_s - self._delay_s, self._left_s), delay_s
            if more_s <= 0:
                return None
            self._left_s -= more_s
            self._deadline_s = link.now_s() + more_s
        return item

    def shorten(self, timeout_s: float) -> None:
        """Limit the rest of a wait that began to *timeout_s* (s)."""
        if self._deadline_s is not None:
            self._deadline_s = min(self._deadline_s, self._link.now_s() + timeout_s)


class Dialogue:
    """A node's default SDO channel, request by request; raises only errors of dvtcli.

    One transfer at a time: `begin` starts it, by its first request.
    """

    def __init__(self, node_id: int, link: SdoLink, settings: SdoSettings) -> None:
        self.node_id = node_id
        self.rx_cobid, self.tx_cobid = SDO_REQUEST_BASE + node_id, SDO_RESPONSE_BASE + node_id
        self.settings = settings
        self.timeout_s = settings.timeout_s
        self.retries = settings.retries
        self.dropped = DroppedAnswers()
        self.inbox = Inbox()
        self.link = link
        #: the present transfer's object, and whether its first request was sent
        self._multiplexer = bytes(3)
        self.requested = False
        self._asked: deque[bytes] = deque(maxlen=8)
        #: whether a late answer to an earlier request may still come
        self._unsettled = False
        #: whether segments of an interrupted block transfer may still come
        self._leftovers = False
        self._late_answers = 0
        self._toggle_errors = 0
        self._has_answered = False
        #: number of requests repeated after a missing answer, or faulty segments
        self.repeated = 0

    @property
    def place(self) -> str:
        """The object of the present transfer."""
        index, sub_index = _object_of(self._multiplexer)
        return f"{index:04X}:{sub_index:02X}"

    def request_response(self, request: bytes) -> bytes:
        """Send *request* and return its own answer. Raises SdoAborted, NoAnswer, SdoProtocolError."""
        kind = request[0] >> 5
        attempts, initiates = 1, kind in _INITIATE
        if initiates:
            self.requested = False
        self.link.await_share()
        if initiates:
            self.begin(request[1:4])
            if kind in (_UPLOAD, _BLOCK_UPLOAD):  # only these may be repeated: they have no side effects
                attempts += self.retries
        else:
            self.discard()
        malformed = self.dropped.malformed
        for attempt in range(attempts):
            self.repeated += attempt > 0
            if attempt == 1 and not self._has_answered:  # the server may wait for a block of a killed client
                self.abort(Abort.TIME_OUT)
            answer = self._exchange(request)
            if answer is not None:
                return answer
        if self._toggle_errors:
            raise self.broken("does not alternate the toggle bit", Abort.TOGGLE_BIT)
        if self.dropped.malformed > malformed:
            raise self.broken("answers with malformed frames", Abort.TIME_OUT)
        raise self.silent(is_read=attempts == 1 and kind in (_UPLOAD, _BLOCK_UPLOAD))

    @contextmanager
    def told(self, *, in_blocks: bool = False) -> Iterator[None]:
        """A transfer of many frames: the server gets an abort if it is interrupted, for example by Ctrl-C.

        Frames of a server *in_blocks* still on the way are then discarded.
        """
        try:
            yield
        except SdoAborted:
            raise
        except BaseException as torn:
            if in_blocks:
                self._unsettled = self._leftovers = True
            if self.requested and not isinstance(torn, DvtcliError):  # else the server knows, or cannot be told
                with suppress(BusUnavailable):
                    self.abort()
            raise

    def give_up(self, code: Abort) -> None:
        """Abort a block transfer; frames of the server still on the way are discarded."""
        self._unsettled = self._leftovers = True
        self.abort(code)

    def send(self, request: bytes) -> None:
        """Send a frame of a block transfer, as soon as the bus has room."""
        self.link.await_share()
        self.link.send_sdo(self.rx_cobid, request)

    def next_frame(self, timeout_s: float | None = None) -> bytes | None:
        """The server's next frame in a block transfer; None after *timeout_s* (None: the default).

        Raises SdoAborted if the server aborts the transfer, NoAnswer if it restarted.
        """
        wait = _Wait(self.link, self.timeout_s if timeout_s is None else timeout_s)
        while (frame := wait.take(self.inbox)) is not None:
            if self._is_of_block(frame):
                return frame
        return None

    def sweep(self) -> int:
        """Discard unrequested frames received so far and return their number. Raises as `next_frame`."""
        self.link.drain()
        count = 0
        while not self.inbox.empty():
            item = self.inbox.get_nowait()
            if not isinstance(item, Wake) and self._is_of_block(item):
                count += 1
                self.drop(item)
        return count

    def _is_of_block(self, frame: bytes) -> bool:
        if frame is RESTARTED:
            raise self.silent()
        if len(frame) != 8 or (frame[0] == _ABORT_BYTE and frame[1:4] != self._multiplexer):
            self.drop(frame)
            return False
        if frame[0] == _ABORT_BYTE:
            self._refuse_abort(frame)
        return True

    def abort(self, abort_code: int = Abort.GENERAL) -> None:
        """Abort the present transfer at the device, with the object's address."""
        self.link.send_sdo(self.rx_cobid, b"\x80" + self._multiplexer + abort_code.to_bytes(4, "little"))

    def receive(self, can_id: int, data: bytes, *, extended: bool) -> None:
        """Process another sender's frame of this node's SDO channel, from the thread that reads the bus."""
        if extended:
            self.dropped.foreign += 1
        elif can_id == self.tx_cobid:
            self.inbox.put(data)
        else:
            self.dropped.other_client += 1

    def begin(self, multiplexer: bytes) -> None:
        """Start a transfer without leftovers of earlier transfers."""
        self.requested = False
        self.discard()
        self._toggle_errors = 0
        if self._unsettled:
            self._settle(multiplexer)
        self._multiplexer = multiplexer
        self._asked.append(multiplexer)
        self.requested = True

    def discard(self) -> None:
        """Discard frames received so far: an answer must not precede its request."""
        self.link.drain()
        while not self.inbox.empty():
            item = self.inbox.get_nowait()
            if not isinstance(item, Wake) and item is not RESTARTED:
                self.drop(item)

    def _settle(self, multiplexer: bytes) -> None:
        """After a time-out, make sure that no late answer is mistaken for the next request's.

        A server answers in order: once a read of another object is answered, no earlier answer can follow. Otherwise, a
        write's late acknowledgement would pass for its repetition's.
        """
        self._multiplexer = _FENCE[1:4]
        self._asked.append(self._multiplexer)
        try:
            for _ in range(1 + self.retries):
                answer = self._exchange(_FENCE)
                if answer is not None:
                    break
            else:
                self._multiplexer = multiplexer
                raise self.silent(is_read=not self.retries)
            if not answer[0] & _EXPEDITED:  # a segmented device type: end the transfer here
                self.abort()
        except SdoAborted:
            pass  # a refusal is an answer, too
        self._unsettled = self._leftovers = False
        self._late_answers = 0

    def _exchange(self, request: bytes) -> bytes | None:
        """Send *request* once; its answer, or None at the time-out.

        After any other end, also by Ctrl-C, a late answer is expected.
        """
        unsettled_before, self._unsettled = self._unsettled, True
        wait, inbox = _Wait(self.link, self.timeout_s), self.inbox
        answered = False
        try:
            self._send(request)
            while (answer := wait.take(inbox)) is not None:
                if answer is RESTARTED:  # a rebooted node will not answer any more, so the wait for a store can end
                    wait.shorten(self.settings.timeout_s)
                elif self._fits(request, answer):
                    answered = True
                    break
        finally:
            if not answered:
                self._late_answers += 1
        if answer is None:
            return None
        self._unsettled, self._has_answered = unsettled_before, True
        self._refuse_abort(answer)
        return answer

    def _send(self, request: bytes) -> None:
        """Send *request*; if a transfer's first request is not sent, the transfer counts as not requested."""
        try:
            self.link.send_sdo(self.rx_cobid, request)
        except BusUnavailable as failed:
            if failed.never_sent and request[0] >> 5 in _INITIATE:
                self.requested = False
            raise

    def _refuse_abort(self, answer: bytes) -> None:
        """Raise SdoAborted if *answer* is an abort."""
        if answer[0] >> 5 == _ABORT:
            raise SdoAborted(*_object_of(answer[1:4]), int.from_bytes(answer[4:], "little"), node=self.node_id)

    def _fits(self, request: bytes, answer: bytes) -> bool:
        """Whether *answer* is the answer to *request*; any other is discarded and counted."""
        if len(answer) == 8:
            kind, specifier = request[0] >> 5, answer[0] >> 5
            fits = specifier in _ANSWERS_TO[kind]
            if specifier == _ABORT or (fits and kind in _INITIATE):
                if answer[1:4] == self._multiplexer and not answer[0] & _INITIATED.get(specifier, 0):
                    return True
            elif fits:
                if not (answer[0] ^ request[0]) & _TOGGLE:
                    return True
                self._toggle_errors += 1
        self.drop(answer)
        return False

    def drop(self, answer: bytes) -> None:
        """Count a frame that does not answer the request."""
        if self._leftovers:
            return
        if len(answer) != 8 or answer[0] >> 5 > _ABORT:
            self.dropped.malformed += 1
        elif answer[0] >> 5 in _WITH_MULTIPLEXER and answer[1:4] not in self._asked:
            self.dropped.foreign += 1  # another client is recognised by its requests
        else:
            self.dropped.stale += 1
            if self._late_answers:
                self._late_answers -= 1
            else:
                self.dropped.doubled += 1

    def broken(self, what: str, code: Abort) -> SdoProtocolError:
        """End a transfer that violates the protocol."""
        self.abort(code)
        return SdoProtocolError(f"node {self.node_id} {what} (0x{self.place})", node=self.node_id, place=self.place)

    def silent(self, *, is_read: bool = False) -> NoAnswer:
        """End a transfer without answer.

        The first read (*is_read*) from a node that never answered needs no abort: the node may not exist.
        """
        if not is_read or self._has_answered:
            self.abort(Abort.TIME_OUT)
        why = f"its ignored answers: {self.dropped}" if self.dropped.total else None
        return no_answer(
            self.node_id,
            self.place,
            self.timeout_s,
            why,
            answered=self._has_answered,
            is_stopped=self.link.is_stopped(self.node_id),
        )


def _object_of(multiplexer: bytes) -> tuple[int, int]:
    return int.from_bytes(multiplexer[:2], "little"), multiplexer[2]
