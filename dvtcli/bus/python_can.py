"""A CANopen network on any python-can bus, which is reopened at another bit rate if its driver can."""

from __future__ import annotations

import threading
import tomllib
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from importlib.resources import files
from math import inf
from time import monotonic, sleep

import can

from dvtcli.bus.can_message import frame_of
from dvtcli.bus.carrier import Carrier
from dvtcli.bus.error_frames import ErrorFrames
from dvtcli.bus.kernel_links import kernel_link
from dvtcli.bus.message_bus import MessageBus
from dvtcli.bus.receiver import Tap, bus_closed
from dvtcli.bus.sdo.sdo_link import DEFAULT_RETRIES, DEFAULT_TIMEOUT_S
from dvtcli.domain.can_ids import NMT_ID, SDO_REQUEST_BASE
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame, SdoTransport
from dvtcli.errors import BusUnavailable, SafetyRefusal

#: a sent frame: CAN-ID, extended, remote, data
_Sent = tuple[int, bool, bool, bytes]
#: maximum number of frames waiting for their echo; no more are sent between two reads
MOST_REMEMBERED = 1024
#: number of answered requests without any echo after which the bus is known not to echo
NONE_IN = 64
#: a controller may send by priority; an echo this late (s) after its sending, or a later frame's echo, was lost
LOST_AFTER_S = 1.0


class Echoes:
    """Messages sent, for detection of their echoes.

    Whether a bus echoes is learnt: an echo comes before the answer to its message. After `NONE_IN` answers without a
    single echo there are none: a bus echoes every frame or no frame.
    """

    def __init__(self) -> None:
        #: whether the bus echoes, None if not yet known
        self._echoing: bool | None = None
        self._sent: deque[tuple[_Sent, float]] = deque(maxlen=MOST_REMEMBERED)
        self._answered_without = 0
        self._lock = threading.Lock()

    def rule_out(self) -> None:
        """Expect no echoes: the driver is known not to echo, so every frame is another sender's."""
        self._echoing = False

    def expect(self, message: can.Message, now_s: float) -> None:
        """Expect the echo of *message*, before it is sent at *now_s*: another thread may read the echo."""
        if self._echoing is not False:
            with self._lock:
                self._sent.append((_key(message), now_s))

    def unsent(self) -> None:
        """Cancel the last message, which could not be sent."""
        with self._lock:
            if self._sent:
                self._sent.pop()

    def is_echo(self, message: can.Message) -> bool:
        """Whether a received *message* is the echo of a sent message; each has one echo."""
        if self._echoing is False or not self._sent:
            return False
        can_id = message.arbitration_id
        with self._lock:
            for place, (sent, sent_s) in enumerate(self._sent):
                if sent[0] == can_id and sent == _key(message):
                    self._echoing = True
                    del self._sent[place]
                    while self._sent and sent_s - self._sent[0][1] > LOST_AFTER_S:
                        self._sent.popleft()
                    return True
        return False

    def caught_up(self, now_s: float) -> None:
        """Drop old messages at *now_s*, when all received frames are read: their echoes will not come.

        On a bus known to echo they stay: a controller repeats a frame until another node acknowledges.
        """
        if self._echoing is not None or not self._sent:
            return
        with self._lock:
            while self._sent and now_s - self._sent[0][1] > LOST_AFTER_S:
                self._sent.popleft()

    def answered(self, can_id: int) -> None:
        """Drop requests to *can_id* and earlier messages after an answer, if no echo was ever seen."""
        if self._echoing is not None or not self._sent:
            return
        with self._lock:
            for place, (sent, _) in enumerate(self._sent):
                if sent[0] == can_id:
                    for _ in range(place + 1):
                        self._sent.popleft()
                    self._answered_without += 1
                    if self._answered_without == NONE_IN:
                        self._echoing = False
                        self._sent.clear()
                    return


def _key(message: can.Message) -> _Sent:
    return message.arbitration_id, message.is_extended_id, message.is_remote_frame, bytes(message.data)


#: what python-can's drivers raise when a bus fails in use; a closed socket is a ValueError in select(), a serial line
#: that is cut short an IndexError
BUS_FAILURES = (can.CanError, OSError, ValueError, RuntimeError, IndexError)
#: how often a full transmit buffer is tried again, every 2 ms: half of a long one takes this long at 125 kbit/s
SEND_PATIENCE = 150
#: drivers that send a data frame instead of a remote frame
_NO_REMOTE_FRAMES = frozenset({"socketcand"})
#: drivers of adapters that send and receive immediately at any bit rate, without reporting it
_QUICK = frozenset({"socketcand"})
#: the lowest usual bit rate (bit/s): its pace leaves gaps at every bit rate
LEAST_BIT_RATE = 125_000
#: time (s) of unfiltered reception before silence proves that no PDOs are sent
HEARD_S = 0.25


class CanBus(MessageBus[can.Message]):
    """A CanopenBus on a python-can *bus*, called *name* on screens.

    *carrier* adds the driver's state. The waiting thread reads the bus. *timeout_s* (s) and *retries* are those of
    `SdoSettings`, *bitrate* is in bit/s.
    """

    def __init__(
        self,
        bus: can.BusABC,
        name: str,
        *,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        retries: int = DEFAULT_RETRIES,
        bitrate: int | None = None,
        carrier: Carrier | None = None,
        setter: BitRateSetter | None = None,
    ) -> None:
        super().__init__(name, frame_of, timeout_s=timeout_s, retries=retries, bitrate=bitrate)
        if self.name.partition(":")[0] in _QUICK:
            self.unknown_pace = LEAST_BIT_RATE
        self._bus = bus
        self._carrier = carrier or Carrier()
        self._setter = setter
        #: held while the driver is read, and while it is replaced (*_changing*)
        self._read_lock = threading.Lock()
        self._changing = False
        self._send_lock = threading.Lock()
        #: time since which all frames are received, not only a configurator's
        self._hears_all_s = inf
        #: node-ID of the last requested SDO channel
        self._last_asked: int | None = None
        self._carrier.hear(everything=False)
        #: echoes of sent frames
        self.echoes = Echoes()
        #: error frames of the CAN controller
        self.error_frames = ErrorFrames()

    @property
    def carries_remote_frames(self) -> bool:
        """Whether a remote frame can be sent: some interfaces would turn it into a data frame."""
        return self.name.partition(":")[0] not in _NO_REMOTE_FRAMES

    def require_settable(self, bit_rate: int, *, listen_only: bool = False) -> None:
        """See `CanopenBus.require_settable`."""
        if self._setter is None:
            super().require_settable(bit_rate, listen_only=listen_only)
        else:
            self._setter.require(bit_rate, listen_only=listen_only)

    def set_bit_rate(self, bit_rate: int, *, listen_only: bool = False) -> None:
        """Close the interface and open it at *bit_rate* (bit/s); readers wait. Raises BusUnavailable."""
        self.require_settable(bit_rate)
        assert self._setter is not None  # noqa: S101 - else nothing is settable
        self._changing = True
        try:
            with self._read_lock, self._send_lock:
                self._leave()
                self._bus = self._setter.reopened(bit_rate, listen_only=listen_only)
        except BUS_FAILURES as error:
            raise self._failed(f"open at {bit_rate} bit/s", error) from error
        finally:
            self._changing = False
        self.bitrate = bit_rate

    def tap(self, callback: Tap) -> Callable[[], None]:
        """See `CanopenBus.tap`."""
        self._hear_all()
        self._carrier.make_room()
        return super().tap(callback)

    def drain(self) -> None:
        """Deliver received frames without waiting."""
        if self._carrier.may_have_frames():
            super().drain()
        else:
            self.echoes.caught_up(monotonic())

    def receive(self, duration_s: float) -> Iterator[Frame]:
        """Yield every frame received within *duration_s* (s) of this call, and frames since the last `send`."""
        self._hear_all()
        return super().receive(duration_s)

    def send(self, frame: Frame) -> None:
        """Send a frame; answers are kept for a `receive` within the next second."""
        if frame.can_id != NMT_ID or frame.data[:1] == bytes([NmtCommand.START]):  # no other command triggers PDOs
            self._hear_all()
        super().send(frame)

    def _hear_all(self) -> None:
        """Receive every frame from now on, not only services."""
        if self._hears_all_s == inf:
            self._carrier.hear(everything=True)
            self._hears_all_s = monotonic()

    def _most_at_once(self) -> int:
        """1 until PDOs that were filtered before would have been received."""
        self._hear_all()
        return super()._most_at_once() if monotonic() - self._hears_all_s >= HEARD_S else 1

    def _channel(self, node_id: int) -> SdoTransport:
        if self._last_asked not in (None, node_id):  # parallel requests to several nodes may follow
            self._hear_all()
        self._last_asked = node_id
        return super()._channel(node_id)

    def disturbances(self) -> list[str]:
        """Disturbances since the last call: error frames, lost frames, another SDO client, a node-ID used twice."""
        odd = super().disturbances()
        return [*self._carrier.news(), *self.error_frames.news(), *odd]

    def error_frame_count(self) -> int:
        """See `CanopenBus.error_frame_count`."""
        return self.error_frames.count

    def lost_frame_count(self) -> int:
        """See `CanopenBus.lost_frame_count`."""
        return self._carrier.lost_frames()

    def _leave(self) -> None:
        with suppress(*BUS_FAILURES):  # closed either way, and unused now
            self._bus.shutdown()

    def _send(self, can_id: int, data: bytes, *, extended: bool = False, remote: bool = False, dlc: int = 0) -> None:
        message = can.Message(
            arbitration_id=can_id, data=data, is_extended_id=extended, is_remote_frame=remote,
            dlc=dlc if remote else len(data),
        )  # fmt: skip
        for patience in range(SEND_PATIENCE, -1, -1):
            if self._closed:
                raise bus_closed()
            try:
                with self._send_lock:
                    self.echoes.expect(message, monotonic())
                    try:
                        self._bus.send(message)
                    except BaseException:
                        self.echoes.unsent()
                        raise
                break
            except BUS_FAILURES as error:
                is_full = self._carrier.is_full(error)
                if not patience or not is_full:
                    failure = self._failed("send", error)
                    failure.never_sent = is_full  # other errors may come after the frame was sent
                    if self._carrier.is_gone(error):
                        self._failure = failure
                    raise failure from error
                sleep(0.002)
        self._traffic.sent(message)

    def _read(self, wait_s: float) -> can.Message | None:
        if self._changing:
            sleep(wait_s)
            return None
        try:
            with self._read_lock:
                message = self._bus.recv(wait_s)
            if message is None:
                self.echoes.caught_up(monotonic())
            return message
        except BUS_FAILURES as error:
            if self._carrier.is_damaged(error):
                return None
            raise self._failed("receive", error) from error

    def _failed(self, what: str, error: Exception) -> BusUnavailable:
        why = str(error).partition("\n")[0] or type(error).__name__  # python-can puts tracebacks into messages
        return BusUnavailable(f"{self.name} failed ({what})", why=why, hint=self._carrier.next_step(error))

    def _deliver(self, message: can.Message) -> None:
        if message.is_error_frame:
            self.error_frames.notice(message)
        elif not self.echoes.is_echo(message):
            self._traffic.received(message)
            if not message.is_remote_frame:
                extended = message.is_extended_id
                self._understand(message, message.arbitration_id, message.data, extended=extended)

    def _answered(self, node_id: int) -> None:
        self.echoes.answered(SDO_REQUEST_BASE + node_id)


@cache
def silent_settings() -> Mapping[str, Mapping[str, object]]:
    """Settings for listen-only mode by interface name, if supported."""
    told = tomllib.loads((files("dvtcli.bus") / "listen_only.toml").read_text("utf-8"))
    states = {state.name: state for state in can.BusState}
    return {
        name: {key: states[value] if key == "state" else value for key, value in settings.items()}
        for name, settings in told.items()
    }


def is_silent(bus: can.BusABC, settings: Mapping[str, object]) -> bool:
    """Whether *bus*, opened with *settings*, is in listen-only mode, as far as its driver can tell."""
    return settings.get("state") in (None, bus.state)


#: interfaces that take a bit rate at opening, besides those with listen-only mode
_SETTABLE = {
    "canalystii", "etas", "gs_usb", "iscan", "ixxat", "neousys", "neovi", "nican", "robotell", "usb2can",
}  # fmt: skip
#: settings with which a bit rate alone does not define the bit timing
_TIMINGS = ("timing", "btr", "fd", "f_clock", "data_bitrate", "fd_bitrate")
#: Opens the interface by these settings.
Open = Callable[[Mapping[str, object]], can.BusABC]


class BitRateSetter:
    """Bit rate changes of the interface in *config*, opened by *opens*."""

    def __init__(self, config: Mapping[str, object], opens: Open) -> None:
        self._config, self._open = config, opens
        self._interface, self._channel = str(config["interface"]), config.get("channel")

    def require(self, bit_rate: int, *, listen_only: bool) -> None:
        """Raise SafetyRefusal with instructions if *bit_rate* or *listen_only* is not possible."""
        where = f"{self._interface}:{self._channel}"
        if self._interface == "socketcan":
            raise SafetyRefusal(
                f"the bit rate of {where} is set by the system, not by dvtcli",
                why=None
                if listen_only
                else "it can neither be changed together with the nodes nor restored if a node is lost",
                hint=_link_lines(str(self._channel), bit_rate, listen_only=listen_only),
            )
        if self._interface not in _SETTABLE | silent_settings().keys():
            raise SafetyRefusal(
                f"the bit rate of {where} cannot be set from here", why="it is set by its server",
                hint="set it there; or open a CAN adapter of this machine",
            )  # fmt: skip
        timing = next((key for key in _TIMINGS if self._config.get(key)), None)
        if timing is not None:
            raise SafetyRefusal(
                f"{where} was opened with {timing}, which is more than a bit rate",
                hint=Hint(Action.GIVE_BIT_RATE, why="open it with {}"),
            )
        if listen_only and self._interface not in silent_settings():
            raise SafetyRefusal(
                f"{self._interface} is not known to listen without a word",
                why="at a wrong bit rate it would destroy the frames of others",
                hint=f"these are: {', '.join(silent_settings())}"
                + Hint(Action.FORCE, why="on a bus without traffic: {}"),
            )

    def reopened(self, bit_rate: int, *, listen_only: bool) -> can.BusABC:
        """The interface, open at *bit_rate* (bit/s); it must be closed before. Raises the driver's errors."""
        silence = silent_settings()[self._interface] if listen_only else {}
        bus = self._open({**self._config, "bitrate": bit_rate, **silence})
        if not is_silent(bus, silence):
            bus.shutdown()
            raise BusUnavailable(f"{self._interface}:{self._channel} does not confirm listen-only mode")
        return bus


def _link_lines(name: str, bit_rate: int, *, listen_only: bool) -> Hint | str:
    """Commands that set the Linux CAN link *name* to *bit_rate* (bit/s)."""
    link = kernel_link(name)
    if link is not None and not link.wired:
        return f"{name} is virtual and has no bit rate"
    how = f"type can bitrate {bit_rate} listen-only {'on' if listen_only else 'off'}"
    lines = f"sudo ip link set {name} down; sudo ip link set {name} up {how}"
    if not listen_only:
        return f"where the nodes run at it already: {lines}"
    return lines + Hint(Action.LISTEN_BIT_RATE, why="then {} again")
