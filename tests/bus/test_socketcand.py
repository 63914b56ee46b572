"""The client of a socketcand server: what a server may send, however it is cut, and what fails."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from threading import Thread
from typing import Any

import can
import pytest
from can.interfaces.socketcand.socketcand import convert_ascii_message_to_can_message
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.bus.can_message import frame_of
from dvtcli.bus.socketcand import SocketcandBus
from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.hub_client import Requests, sent_frame, told_frame

data_frames = st.one_of(
    st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8), timestamp_s=st.integers(0, 2_000_000_000)),
    st.builds(Frame, st.integers(0, 0x1FFF_FFFF), st.binary(max_size=8), st.just(True), timestamp_s=st.just(1.5)),
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
    text = b"".join(told_frame(frame, frame.timestamp_s) for frame in frames)
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
    text = told_frame(frame, frame.timestamp_s)
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
    sent = sent_frame(request)
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
            assert "what is no frame" in str(error)  # noqa: PT017 - either way is right
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


@pytest.mark.parametrize(
    "text", ["< frame 123 >", "< frame xyz 1.0 00 >", "< frame 123 1.0 0 >", "< frame 123 1.0 000102030405060708 >"]
)
def test_what_is_no_frame_is_an_error(text: str) -> None:
    with opened() as (bus, server):
        server.sendall(text.encode())
        with pytest.raises(can.CanOperationError, match="what is no frame"):
            bus.recv(10)


def test_an_endless_message_is_an_error() -> None:
    with opened() as (bus, server):
        server.sendall(b"x" * 2000)
        with pytest.raises(can.CanOperationError, match="what is no message"):
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
