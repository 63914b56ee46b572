"""The client of a socketcand server: what a server may send, however it is cut, and what fails."""

from __future__ import annotations

import ctypes
import socket
import struct
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from itertools import chain, cycle, repeat
from threading import Thread
from time import sleep
from typing import Any

import can
import pytest
from can.interfaces.socketcand.socketcand import convert_ascii_message_to_can_message
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.bus import socketcand
from dvtcli.bus.can_message import frame_of
from dvtcli.bus.socketcand import ServerCarrier, SocketcandBus
from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.hub_client import Requests, frame_line, parse_send
from tests.drawn_frames import drawn

data_frames = st.one_of(
    drawn(st.integers(0, 0x7FF), st.binary(max_size=8), timestamp_s=st.integers(0, 2_000_000_000)),
    drawn(st.integers(0, 0x1FFF_FFFF), st.binary(max_size=8), extended=st.just(True), timestamp_s=st.just(1.5)),
)
#: pieces of a message, and what servers of other protocols send
rubbish = st.lists(st.sampled_from(["<", ">", " frame ", "< frame 181 1.0 ", "< ok ", "< error ", "00", "\n", "é"]))


def greet(listener: socket.socket, greeting: tuple[bytes, ...], ends: list[socket.socket]) -> None:
    """Accept a client, add its connection to *ends*, and send the parts of *greeting*, one after each request."""
    connection, _ = listener.accept()
    ends.append(connection)
    connection.sendall(greeting[0])
    for part in greeting[1:]:
        connection.recv(256)
        connection.sendall(part)


@contextmanager
def opened(*greeting: bytes, **settings: Any) -> Iterator[tuple[SocketcandBus, socket.socket]]:
    """A bus with *settings*, and its server's end, which sends *greeting* first."""
    ends: list[socket.socket] = []
    with ExitStack() as stack:
        listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        server = Thread(target=greet, args=(listener, greeting or (b"< hi >", b"< ok >", b"< ok >"), ends))
        server.start()
        try:
            bus = SocketcandBus("can0", "127.0.0.1", listener.getsockname()[1], **settings)
        finally:
            server.join()
            stack.enter_context(ends[0])
        yield stack.enter_context(bus), ends[0]


def read(bus: SocketcandBus, count: int) -> list[Frame]:
    """The next *count* frames."""
    messages = [bus.recv(10) for _ in range(count)]
    assert None not in messages
    return [frame_of(message) for message in messages if message is not None]


@given(st.lists(data_frames, min_size=1, max_size=6), st.lists(st.integers(1, 60), min_size=1, max_size=20))
def test_each_frame_is_read_once_and_in_order_however_it_is_cut(frames: list[Frame], cuts: list[int]) -> None:
    text = b"".join(frame_line(frame, frame.timestamp_s) for frame in frames)
    with opened() as (bus, server):
        at, found = 0, list[Frame]()
        for size in [*cuts, len(text)]:
            server.sendall(text[at : at + size])
            at += size
            while (message := bus.recv(0)) is not None:
                found.append(frame_of(message))
        assert found + read(bus, len(frames) - len(found)) == frames
        assert bus.recv(0) is None


@given(data_frames)
def test_a_frame_is_read_as_python_can_reads_it(frame: Frame) -> None:
    text = frame_line(frame, frame.timestamp_s)
    with opened() as (bus, server):
        server.sendall(text)
        assert read(bus, 1) == [frame_of(convert_ascii_message_to_can_message(text.decode()))]


@given(data_frames)
def test_a_server_reads_what_is_sent(frame: Frame) -> None:
    with opened() as (bus, server):
        bus.send(can.Message(arbitration_id=frame.can_id, data=frame.data, is_extended_id=frame.extended))
        requests, found = Requests(), list[bytes]()
        while not found:
            found = requests.feed(server.recv(256))
    (request,) = found
    sent = parse_send(request)
    assert sent is not None
    assert (sent.can_id, sent.data, sent.extended) == (frame.can_id, frame.data, frame.extended)


@given(rubbish)
def test_a_frame_after_rubbish_is_read_or_the_bus_fails(pieces: list[str]) -> None:
    with opened() as (bus, server):
        server.sendall("".join([*pieces, "> < frame 123 1.5 0A >"]).encode())
        try:
            found = read(bus, 1)
            while found[-1].can_id != 0x123:
                found += read(bus, 1)
        except can.CanOperationError as error:
            assert "what is not a frame" in str(error)  # noqa: PT017 - either way is right
        else:
            assert found[-1] == Frame(0x123, b"\n", timestamp_s=1.5)


def test_bytes_with_blanks_between_them_are_all_data() -> None:
    with opened() as (bus, server):
        server.sendall(b"< frame 123 23.424242 11 22 33 44 >")
        assert read(bus, 1) == [Frame(0x123, bytes.fromhex("11 22 33 44"), timestamp_s=23.424242)]


def test_a_long_greeting_and_frames_within_it() -> None:
    """Answers may come in pieces, and frames right behind the last answer: none of them is lost."""
    with opened(b"< hi >", b"< ok >", b"< ok >< frame 701 1.0 00 >< frame 1") as (bus, server):
        assert read(bus, 1) == [Frame(0x701, b"\0", timestamp_s=1.0)]
        server.sendall(b"81 2.0 01 >")
        assert read(bus, 1) == [Frame(0x181, b"\1", timestamp_s=2.0)]


@pytest.mark.parametrize("greeting", [(b"< bye >",), (b"< hi >", b"< error could not open bus >")], ids=["hi", "open"])
def test_a_server_that_refuses(greeting: tuple[bytes, ...]) -> None:
    with (
        pytest.raises(can.CanInitializationError, match=r"got '< (bye|error could not open bus) >'"),
        opened(*greeting),
    ):
        pass


def test_error_frames_are_recognised_and_errors_in_words_ignored() -> None:
    with opened() as (bus, server):
        server.sendall(b"< error could not send >< error 20000040 1.5 >< ok >")
        message = bus.recv(10)
        assert message is not None
        assert message.is_error_frame
        assert (message.arbitration_id, message.timestamp) == (0x40, 1.5)
        assert bus.recv(0) is None


def test_an_error_frame_without_a_time_has_the_time_of_its_arrival() -> None:
    with opened() as (bus, server):
        server.sendall(b"< error 20000008 >")
        message = bus.recv(10)
        assert message is not None
        assert (message.is_error_frame, message.arbitration_id) == (True, 8)
        assert message.timestamp > 1_700_000_000


@given(data_frames)
def test_bytes_without_leading_zeros_are_all_data(frame: Frame) -> None:
    """Small servers write bytes as the protocol's description does: `2 1 F1`."""
    with opened() as (bus, server):
        can_id = f"{frame.can_id:08x}" if frame.extended else f"{frame.can_id:03x}"
        server.sendall(f"< frame {can_id} 1.5 {' '.join(f'{byte:x}' for byte in frame.data)} >".encode())
        (found,) = read(bus, 1)
        assert (found.can_id, found.extended, found.data) == (frame.can_id, frame.extended, frame.data)


#: what looks like a frame, but is none that CAN knows, or that a recording can hold
NO_FRAMES = (
    *("123", "123 x 00", "xyz 1.0 00", "123 1.0 000", "123 1.0 000102030405060708", "123 1.0 0 1 2 3 4 5 6 7 8", ""),
    *("123 1.0 0011 22", "123 1.0 R", "123 1.0 +1", "FFF 1.0 00", "80000181 1.0 00", "20000000 1.0 00", "-12 1.0 00"),
    *(
        "FFFFFFFFF 1.0 00",
        "1_2 1.0 00",
        "0x181 1.0 00",
        "123 nan 00",
        "123 inf 00",
        f"123 {10**400} 00",
        "123 1_2 00",
        "123 -5 00",
    ),
)


@pytest.mark.parametrize("text", NO_FRAMES)
def test_what_is_no_frame_is_an_error(text: str) -> None:
    with opened() as (bus, server):
        server.sendall(f"< frame {text} >".encode())
        for _ in range(2):
            with pytest.raises(can.CanOperationError, match="what is not a frame"):
                bus.recv(10)
        assert bus.may_have_messages()


@given(st.lists(data_frames, max_size=4), st.sampled_from(NO_FRAMES), st.lists(data_frames, max_size=4), st.booleans())
def test_frames_beside_what_is_no_frame_are_read_before_the_error(
    before: list[Frame], text: str, after: list[Frame], with_the_answer: bool
) -> None:
    """Also if they came right behind the server's last answer."""
    frames = [frame_line(frame, frame.timestamp_s) for frame in before + after]
    frames.insert(len(before), f"< frame {text} >".encode())
    greeting = (b"< hi >", b"< ok >", b"< ok >" + b"".join(frames if with_the_answer else []))
    with opened(*greeting) as (bus, server):
        if not with_the_answer:
            server.sendall(b"".join(frames))
        assert read(bus, len(before + after)) == before + after
        with pytest.raises(can.CanOperationError, match="what is not a frame"):
            bus.recv(10)


def test_an_endless_message_is_an_error() -> None:
    with opened() as (bus, server):
        server.sendall(b"x" * 2000)
        with pytest.raises(can.CanOperationError, match="what is not a message"):
            bus.recv(10)


def test_the_end_of_the_connection_is_an_error_after_all_frames() -> None:
    with opened() as (bus, server):
        server.sendall(b"< frame 123 1.0 >")
        server.shutdown(socket.SHUT_WR)
        assert read(bus, 1) == [Frame(0x123, b"", timestamp_s=1.0)]
        assert bus.may_have_messages()
        with pytest.raises(ConnectionResetError, match="closed the connection"):
            bus.recv(10)


def test_a_filter_and_a_remote_frame() -> None:
    filters = [{"can_id": 0x700, "can_mask": 0x780, "extended": False}]
    with opened(can_filters=filters, tcp_tune=True) as (bus, server):
        server.sendall(b"< frame 181 1.0 00 >< frame 00000701 1.0 00 >< frame 701 2.0 05 >")
        assert read(bus, 1) == [Frame(0x701, b"\5", timestamp_s=2.0)]
        with pytest.raises(can.CanOperationError, match="remote"):
            bus.send(can.Message(arbitration_id=0x181, is_remote_frame=True, is_extended_id=False))


def test_a_closed_bus_raises() -> None:
    with opened() as (bus, _):
        bus.shutdown()
        with pytest.raises(can.CanOperationError, match="closed"):
            bus.recv(0)


def send_until_it_fails(bus: SocketcandBus) -> None:
    """Send to a server that reads nothing."""
    while True:
        bus.send(can.Message(arbitration_id=0x181, data=bytes(8), is_extended_id=False))


def test_a_server_that_takes_no_more_data_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Part of a message may be sent, so that the server would not understand the next one."""
    monkeypatch.setattr(socketcand, "SEND_S", 0.3)
    with opened() as (bus, _):
        for attempt in (send_until_it_fails, send_until_it_fails, SocketcandBus.recv):
            with pytest.raises(ConnectionAbortedError, match=r"taken no data for 0\.3 s") as caught:
                attempt(bus)
        assert ServerCarrier(bus).is_gone(caught.value)


@pytest.mark.parametrize(
    "work", [send_until_it_fails, SocketcandBus.recv, lambda bus: bus.recv(60)], ids=["send", "recv", "recv in time"]
)
def test_closing_the_bus_ends_what_waits_in_another_thread(work: Callable[[SocketcandBus], object]) -> None:
    failures = list[BaseException]()

    def run(bus: SocketcandBus) -> None:
        try:
            work(bus)
        except (can.CanError, OSError, ValueError) as error:
            failures.append(error)

    with opened() as (bus, _):
        worker = Thread(target=run, args=(bus,))
        worker.start()
        worker.join(0.5)  # a sender has filled the buffers meanwhile, on a quick machine
        bus.shutdown()
        worker.join()
    (failure,) = failures
    assert isinstance(failure, can.CanOperationError)
    assert str(failure) == "the bus is closed"


@contextmanager
def talking(parts: Iterator[bytes], every_s: float) -> Iterator[int]:
    """The port of a server that sends the next of *parts* every *every_s* seconds and reads nothing."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def talk() -> None:
            connection, _ = listener.accept()
            with connection, suppress(OSError):
                for part in parts:
                    connection.sendall(part)
                    sleep(every_s)

        server = Thread(target=talk)
        server.start()
        try:
            yield listener.getsockname()[1]
        finally:
            server.join()


@pytest.mark.parametrize(
    ("parts", "every_s", "why"),
    [
        (repeat(b"$GPRMC,123519,A,4807.038,N\r\n"), 0.01, r"expected '< hi >', got '\$GPRMC"),
        (repeat(b"x" * 4096), 0, "expected '< hi >', got 'xxx"),
        (chain([b"\r\n<"], repeat(b"x" * 4096)), 0, "expected '< hi >', got '<xxx"),
        (repeat(b" " * 4096), 0, "expected '< hi >', got ''"),
        (iter([b"hi >"]), 0, "expected '< hi >', got 'hi"),
    ],
    ids=["lines of another protocol", "endless text", "endless message", "blanks", "no beginning"],
)
def test_what_is_no_answer_is_refused_at_once(parts: Iterator[bytes], every_s: float, why: str) -> None:
    with talking(parts, every_s) as port, pytest.raises(can.CanInitializationError, match=why) as caught:
        SocketcandBus("can0", "127.0.0.1", port)
    assert len(str(caught.value)) < 100


@pytest.mark.parametrize("parts", [chain([b"<"], repeat(b" h")), cycle([b" ", b"\n"])], ids=["message", "blanks"])
def test_an_answer_that_goes_on_for_too_long_is_none(parts: Iterator[bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socketcand, "ANSWER_S", 0.3)
    with talking(parts, 0.02) as port, pytest.raises(TimeoutError, match=r"no whole answer within 0\.3 s"):
        SocketcandBus("can0", "127.0.0.1", port)


def cut_off(connection: socket.socket) -> None:
    """Let *connection* receive nothing more, not even what its system acknowledges: a filter that drops all."""
    drop_all = ctypes.create_string_buffer(struct.pack("HBBI", 0x06, 0, 0, 0))
    program = struct.pack("HL", 1, ctypes.addressof(drop_all))
    attach_filter = 26
    connection.setsockopt(socket.SOL_SOCKET, attach_filter, program)


@pytest.mark.skipif(sys.platform != "linux", reason="cuts a connection with a filter of Linux")
@pytest.mark.parametrize("is_sending", [False, True], ids=["nothing sent", "a frame sent"])
def test_a_server_whose_network_is_gone_is_noticed(is_sending: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also with a frame on its way, for which the system repeats the data and asks no more questions."""
    quick = {"TCP_KEEPIDLE": 1, "TCP_KEEPINTVL": 1, "TCP_KEEPCNT": 1, "TCP_USER_TIMEOUT": 1000}
    assert socketcand.KEEP_ALIVE.keys() == quick.keys()
    monkeypatch.setattr(socketcand, "KEEP_ALIVE", quick)
    with opened() as (bus, server):
        cut_off(server)
        if is_sending:
            bus.send(can.Message(arbitration_id=0x601, data=bytes(8), is_extended_id=False))
        with pytest.raises(TimeoutError) as caught:
            bus.recv(60)
        carrier = ServerCarrier(bus)
        assert carrier.is_gone(caught.value)
        assert "check the network" in str(carrier.next_step(caught.value))
