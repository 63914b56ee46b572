"""socketcand's words: what clients may say, however it is cut, and what is refused."""

from __future__ import annotations

from contextlib import suppress

import pytest
from can.interfaces.socketcand.socketcand import (
    convert_ascii_message_to_can_message,
    convert_can_message_to_ascii_message,
)
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.hub_client import LONGEST, Requests, RubbishError, frame_line, parse_open, parse_send
from tests.drawn_frames import drawn

data_frames = st.one_of(
    drawn(st.integers(0, 0x7FF), st.binary(max_size=8)),
    drawn(st.integers(0, 0x1FFF_FFFF), st.binary(max_size=8), extended=st.just(True)),
)


@given(data_frames)
def test_python_cans_client_reads_what_is_told_and_is_read(frame: Frame) -> None:
    message = convert_ascii_message_to_can_message(frame_line(frame, 1_700_000_000.25).decode())
    assert (message.arbitration_id, bytes(message.data)) == (frame.can_id, frame.data)
    assert (message.is_extended_id, message.timestamp) == (frame.extended, 1_700_000_000.25)
    (request,) = Requests().feed(convert_can_message_to_ascii_message(message).encode())
    assert parse_send(request) == frame


@given(st.lists(data_frames, max_size=5), st.lists(st.integers(1, 40), min_size=1, max_size=20))
def test_requests_survive_being_split_and_merged(frames: list[Frame], cuts: list[int]) -> None:
    text = b"\n".join(
        b"< send %s %x %s >"
        % (f"{f.can_id:0{8 if f.extended else 3}x}".encode(), len(f.data), " ".join(f"{b:x}" for b in f.data).encode())
        for f in frames
    )
    requests, found, at = Requests(), [], 0
    while at < len(text):
        cut = cuts[at % len(cuts)]
        found += requests.feed(text[at : at + cut])
        at += cut
    assert [parse_send(request) for request in found] == frames


@pytest.mark.parametrize(
    ("request_", "frame"),
    [
        (b"send 123 0", Frame(0x123, b"")),
        (b"send 1AAAAAAA 2 1 F1", Frame(0x1AAAAAAA, b"\x01\xf1", extended=True)),
        (b"send 7ff 3 a B 0c", Frame(0x7FF, b"\x0a\x0b\x0c")),
        (b"send 00000123 1 11", Frame(0x123, b"\x11", extended=True)),
        (b"sendrtr 181 8", Frame(0x181, b"", remote=True, dlc=8)),
        (b"echo", None),
    ],
)
def test_frames_that_clients_send(request_: bytes, frame: Frame | None) -> None:
    assert parse_send(request_) == frame


@pytest.mark.parametrize(
    "request_",
    [
        b"send", b"send 123", b"send 800 0", b"send 123 2 11", b"send 123 9 1 2 3 4 5 6 7 8 9", b"send xyz 0",
        b"send 20000000 0", b"send 123 1 100", b"sendrtr 123", b"send 123 1 -1", b"send 123 1 0x11",
    ],
)  # fmt: skip
def test_frames_that_do_not_exist(request_: bytes) -> None:
    with pytest.raises(ValueError, match=r"no such|differ"):
        parse_send(request_)


@given(st.lists(st.binary(max_size=60) | st.sampled_from([b"<", b">", b"< send ", b"123 1 ff", b"< open can0 >"])))
def test_whatever_comes_is_requests_or_rubbish(chunks: list[bytes]) -> None:
    requests = Requests()
    with suppress(ValueError):  # RubbishError is one
        for chunk in chunks:
            for request in requests.feed(chunk):
                frame = parse_send(request)
                assert frame is None or len(frame.data) <= 8
                parse_open(request)


@pytest.mark.parametrize("rubbish", [b"GET / HTTP/1.1\r\n", b"\xff\xfe", b"< ok > and more", b"<" + b"a" * LONGEST])
def test_rubbish_is_noticed(rubbish: bytes) -> None:
    with pytest.raises(RubbishError):
        Requests().feed(rubbish)


@pytest.mark.parametrize(
    ("request_", "name"),
    [(b"open can0", b"can0"), (b"open", None), (b"open a b", None), (b"open " + b"x" * 17, None), (b"rawmode", None)],
)
def test_opening(request_: bytes, name: bytes | None) -> None:
    assert parse_open(request_) == name


def test_a_remote_frame_is_told_with_its_length() -> None:
    assert frame_line(Frame(0x181, b"", remote=True, dlc=6), 1.5) == b"< rtr 181 1.500000 6 >"
