"""A strict SDO client for one node: canopen's, with every answer checked before it counts.

canopen 2.4.1 takes a late acknowledgement of an earlier write for the present one's, even if the device aborts
that; here multiplexer, command specifier and toggle bit of every answer must fit (CiA 301, 7.2.4.3).
Does not know buses or threads (one transfer at a time: see sdo_channel), nor what an object means.
"""

from __future__ import annotations

from collections import deque
from queue import SimpleQueue

from canopen.objectdictionary import ObjectDictionary
from canopen.sdo.client import SdoClient
from canopen.sdo.constants import SDO_STRUCT

from dvtcli.bus.receiver import Wake
from dvtcli.bus.sdo.sdo_link import ANSWER_ID, REQUEST_ID, RESTARTED, DroppedAnswers, Inbox, SdoLink, SdoSettings
from dvtcli.bus.sdo.silence import no_answer
from dvtcli.domain.abort import Abort
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError

# Command specifiers, bits 7..5 of the first byte (CiA 301, 7.2.4.3.3 to 7.2.4.3.17).
_DOWNLOAD_SEGMENT, _DOWNLOAD, _UPLOAD, _UPLOAD_SEGMENT, _ABORT = range(5)
#: request's specifier -> answer's
_ANSWER_TO = {_DOWNLOAD_SEGMENT: 1, _DOWNLOAD: 3, _UPLOAD: 2, _UPLOAD_SEGMENT: 0}
_INITIATE = (_DOWNLOAD, _UPLOAD)
_WITH_MULTIPLEXER = (2, 3, 4)
_TOGGLE, _EXPEDITED, _SIZE_GIVEN, _LAST = 0x10, 0x02, 0x01, 0x01
#: No object of a CANopen device is larger; what goes on beyond it never ends.
_MOST_BYTES = 1 << 20
#: reads the device type, which every node has (CiA 301, 7.5.2.1)
_FENCE = bytes.fromhex("40 00 10 00 00 00 00 00")


class StrictSdoClient(SdoClient):
    """canopen's client with its request, response and abort replaced; raises only errors of dvtcli."""

    def __init__(self, node_id: int, link: SdoLink, settings: SdoSettings) -> None:
        # An empty dictionary: canopen would cut data to the length that an EDS declares.
        rx, tx = REQUEST_ID + node_id, ANSWER_ID + node_id
        super().__init__(rx, tx, ObjectDictionary())  # type: ignore[no-untyped-call]
        self.node_id = node_id
        self.settings = settings
        self.timeout_s = settings.timeout_s
        self.retries = settings.retries
        self.dropped = DroppedAnswers()
        self.inbox: Inbox = SimpleQueue()
        self.link = link
        #: of the present transfer, which sets them when it begins: its object, and whether its first request was sent
        self._multiplexer: bytes
        self.requested: bool
        self._asked: deque[bytes] = deque(maxlen=8)
        #: an answer may still come that is not the next request's
        self._unsettled = False
        self._late_answers = 0
        self._toggle_errors = 0
        self._has_answered = False
        #: how many requests had to be sent again because no answer came, or segments went wrong
        self.repeated = 0

    @property
    def place(self) -> str:
        """The object that is being read or written."""
        index, sub_index = _object_of(self._multiplexer)
        return f"{index:04X}:{sub_index:02X}"

    def request_response(self, sdo_request: bytes | bytearray) -> bytes:
        """Send a request and return its answer, and no other; raises SdoAborted, NoAnswer, SdoProtocolError."""
        request = bytes(sdo_request)
        kind = request[0] >> 5
        attempts = 1
        if kind in _INITIATE:
            self.requested = False
        self.link.await_share()
        if kind in _INITIATE:
            self._begin(request[1:4])
            if kind == _UPLOAD:  # the only request that may be asked again: it changes nothing
                attempts += self.retries
        else:
            self._discard()
        malformed = self.dropped.malformed
        for attempt in range(attempts):
            self.repeated += attempt > 0
            answer = self._exchange(request)
            if answer is not None:
                return answer
        if self._toggle_errors:
            raise self._broken("does not alternate the toggle bit", Abort.TOGGLE_BIT)
        if self.dropped.malformed > malformed:
            raise self._broken("answers with malformed frames", Abort.TIME_OUT)
        raise self._silent()

    def upload(self, index: int, subindex: int) -> bytes:
        """Read an object; more or less data than the device announced is an SdoProtocolError.

        Reading changes nothing, so a transfer whose segments go wrong is begun anew as often as `retries` says.
        """
        left = self.retries
        while True:
            answer = self.request_response(SDO_STRUCT.pack(0x40, index, subindex) + bytes(4))
            if answer[0] & _EXPEDITED:
                unused = answer[0] >> 2 & 3 if answer[0] & _SIZE_GIVEN else 0
                return answer[4 : 8 - unused]
            announced = int.from_bytes(answer[4:], "little") if answer[0] & _SIZE_GIVEN else None
            try:
                return self._upload_segments(announced)
            except (NoAnswer, SdoProtocolError):
                if not left:
                    raise
                left -= 1
                self.repeated += 1

    def _upload_segments(self, announced: int | None) -> bytes:
        if announced is not None and announced > _MOST_BYTES:
            raise self._broken(f"announces {announced} bytes, more than any object has", Abort.OUT_OF_MEMORY)
        data = bytearray()
        toggle, last = 0, False
        while not last:
            answer = self.request_response(bytes([0x60 | toggle]) + bytes(7))
            part = answer[1 : 8 - (answer[0] >> 1 & 7)]
            last = bool(answer[0] & _LAST)
            toggle ^= _TOGGLE
            data += part
            if announced is not None and len(data) > announced:
                raise self._broken(f"sends more than the {announced} bytes it announced", Abort.TOO_LONG)
            if len(data) > _MOST_BYTES:
                raise self._broken(f"sends more than {_MOST_BYTES} bytes", Abort.OUT_OF_MEMORY)
            if not part and not last:  # it would never end
                raise self._broken("sends an empty segment in the middle", Abort.GENERAL)
        if announced is not None and len(data) < announced:
            raise self._broken(f"sends {len(data)} of the {announced} bytes it announced", Abort.TOO_SHORT)
        return bytes(data)

    def download(self, index: int, subindex: int, data: bytes, force_segment: bool = False) -> None:
        """Write an object; in segments where it is empty or longer than 4 bytes.

        Not by canopen's stream: that sends a further segment after an abort, even from its destructor.
        """
        size = len(data)
        if 1 <= size <= 4 and not force_segment:
            header = SDO_STRUCT.pack(0x23 | (4 - size) << 2, index, subindex)
            self.request_response(header + data.ljust(4, b"\0"))
            return
        self.request_response(SDO_STRUCT.pack(0x21, index, subindex) + size.to_bytes(4, "little"))
        toggle = 0
        for start in range(0, max(size, 1), 7):
            part = data[start : start + 7]
            last = start + 7 >= size
            self.request_response(bytes([toggle | (7 - len(part)) << 1 | last]) + part.ljust(7, b"\0"))
            toggle ^= _TOGGLE

    def abort(self, abort_code: int = Abort.GENERAL) -> None:
        """Tell the device that the present transfer is over, with the object's address."""
        self.link.send_sdo(self.rx_cobid, b"\x80" + self._multiplexer + abort_code.to_bytes(4, "little"))

    def receive(self, can_id: int, data: bytes, *, extended: bool) -> None:
        """Take a frame of this node's SDO channel that is not ours, from the thread that reads the bus."""
        if extended:
            self.dropped.foreign += 1
        elif can_id == self.tx_cobid:
            self.inbox.put(data)
        else:
            self.dropped.other_client += 1

    def _begin(self, multiplexer: bytes) -> None:
        """Start a transfer with nothing left over from those before."""
        self.requested = False
        self._discard()
        self._toggle_errors = 0
        if self._unsettled:
            self._settle(multiplexer)
        self._multiplexer = multiplexer
        self._asked.append(multiplexer)
        self.requested = True

    def _discard(self) -> None:
        """Drop what has come so far: an answer that comes before its request is none."""
        self.link.drain()
        while not self.inbox.empty():
            item = self.inbox.get_nowait()
            if not isinstance(item, Wake) and item is not RESTARTED:
                self._drop(item)

    def _settle(self, multiplexer: bytes) -> None:
        """After a time-out, make sure that no late answer can be taken for the next request's.

        A server answers in order: once a read of another object is answered, everything before it was, or never
        will be. Without it, a late acknowledgement of a write would pass for that of its repetition.
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
                raise self._silent()
            if not answer[0] & _EXPEDITED:  # a device type in segments: it ends here
                self.abort()
        except SdoAborted:
            pass  # a refusal is an answer as good as any
        self._unsettled = False
        self._late_answers = 0

    def _exchange(self, request: bytes) -> bytes | None:
        """Send *request* once; its answer, or None at the time-out.

        However it ends without one, by Ctrl-C too, the answer is expected late.
        """
        unsettled_before, self._unsettled = self._unsettled, True
        take, inbox = self.link.take, self.inbox
        answered = False
        try:
            self.link.send_sdo(self.rx_cobid, request)
            deadline_s = self.link.now_s() + self.timeout_s
            while (answer := take(inbox, deadline_s)) is not None:
                if answer is RESTARTED:  # unless it had answered, it will not: a store need not be waited for any more
                    deadline_s = min(deadline_s, self.link.now_s() + self.settings.timeout_s)
                elif self._fits(request, answer):
                    answered = True
                    break
        finally:
            if not answered:
                self._late_answers += 1
        if answer is None:
            return None
        self._unsettled, self._has_answered = unsettled_before, True
        if answer[0] >> 5 == _ABORT:
            raise SdoAborted(*_object_of(answer[1:4]), int.from_bytes(answer[4:], "little"), node=self.node_id)
        return answer

    def _fits(self, request: bytes, answer: bytes) -> bool:
        """Whether *answer* is the answer to *request*; any other is dropped and counted."""
        if len(answer) == 8:
            kind, specifier = request[0] >> 5, answer[0] >> 5
            if specifier == _ABORT or (specifier == _ANSWER_TO[kind] and kind in _INITIATE):
                if answer[1:4] == self._multiplexer:
                    return True
            elif specifier == _ANSWER_TO[kind]:
                if not (answer[0] ^ request[0]) & _TOGGLE:
                    return True
                self._toggle_errors += 1
        self._drop(answer)
        return False

    def _drop(self, answer: bytes) -> None:
        if len(answer) != 8 or answer[0] >> 5 > _ABORT:
            self.dropped.malformed += 1
        elif answer[0] >> 5 in _WITH_MULTIPLEXER and answer[1:4] not in self._asked:
            self.dropped.foreign += 1  # a client of somebody else's is known by its requests, which are heard, too
        else:
            self.dropped.stale += 1
            if self._late_answers:
                self._late_answers -= 1
            else:
                self.dropped.doubled += 1

    def _broken(self, what: str, code: Abort) -> SdoProtocolError:
        """End a transfer that breaks the protocol."""
        self.abort(code)
        return SdoProtocolError(f"node {self.node_id} {what} (0x{self.place})", node=self.node_id, place=self.place)

    def _silent(self) -> NoAnswer:
        """End a transfer whose answer did not come."""
        self.abort(Abort.TIME_OUT)
        why = f"its answers that did not count: {self.dropped}" if self.dropped.total else None
        return no_answer(self.node_id, self.place, self.timeout_s, why, answered=self._has_answered)


def _object_of(multiplexer: bytes) -> tuple[int, int]:
    return int.from_bytes(multiplexer[:2], "little"), multiplexer[2]
