"""SDO by the byte: expedited and segmented transfers, and what clients get wrong."""

from __future__ import annotations

import pytest

from dvtcli.simulator.device.strict_device import StrictDevice
from tests.harness.sample import heavy
from tests.simulator.bench import Aborted, Client, booted


def exchange(device: StrictDevice, *requests: str) -> list[str]:
    """Responses in hex to *requests* in hex, all on one server; `-` is silence."""
    server = Client.on(device).server
    answers = [server.handle(bytes.fromhex(each)) for each in requests]
    return ["-" if each is None else each.hex() for each in answers]


def test_expedited_bytes() -> None:
    assert exchange(booted(), "4000180100000000", "2f00180201000000", "4000180200000000", "4041600000000000") == [
        "4300180181010040",
        "6000180200000000",
        "4f00180201000000",
        "4b41600050020000",
    ]


def test_expedited_download_without_a_size_takes_the_object_s() -> None:
    assert exchange(booted(), "2200180201ffffff", "4000180200000000") == ["6000180200000000", "4f00180201000000"]


def test_segmented_upload_of_a_text() -> None:
    assert exchange(booted(), "4008100000000000", "6000000000000000", "7000000000000000") == [
        "410810000d000000",
        "0047656e65726963",
        "1320647269766500",
    ]


def test_segmented_download_of_a_text_reads_back() -> None:
    client = Client.on(booted())
    for text in (b"a drive with a long name", b"12345678", b"abc", b""):
        client.write_bytes(0x2002, 0, text)
        assert client.read(0x2002) == text


@pytest.mark.parametrize("short", ["", "40", "40001801000000"])
def test_short_frames_are_ignored(short: str) -> None:
    assert exchange(booted(), short, "4000180100000000") == ["-", "4300180181010040"]


def test_a_short_frame_does_not_disturb_a_transfer() -> None:
    first, ignored, second = exchange(booted(), "4008100000000000", "60", "6000000000000000")
    assert (first[:2], ignored, second) == ("41", "-", "0047656e65726963")


def test_a_client_s_abort_ends_its_transfer_in_silence() -> None:
    answers = exchange(booted(), "4008100000000000", "8008100000000405", "6000000000000000")
    assert answers[1:] == ["-", "8000000001000405"]


def test_a_new_request_ends_the_old_transfer() -> None:
    answers = exchange(booted(), "4008100000000000", "4000180100000000", "6000000000000000")
    assert answers[1:] == ["4300180181010040", "8000000001000405"]


def test_an_abort_of_a_segment_names_the_transfer_s_object() -> None:
    assert exchange(booted(), "4008100000000000", "7000000000000000")[1] == "8008100000000305"


@pytest.mark.parametrize(
    ("size", "code"), [(5, 0x06070012), (1, 0x06070013), (0, 0x06070013)], ids=["long", "short", "empty"]
)
def test_segmented_download_of_a_wrong_size_is_refused_at_once(size: int, code: int) -> None:
    with pytest.raises(Aborted) as caught:
        Client.on(booted()).ask(bytes.fromhex("21021a01") + size.to_bytes(4, "little"))
    assert caught.value.code == code


@pytest.mark.parametrize(
    ("segment", "code"),
    [("0041424344454647", 0x06070012), ("0b41420000000000", 0x06070013)],
    ids=["more than announced", "less than announced"],
)
def test_segments_keep_to_the_announced_size(segment: str, code: int) -> None:
    client = Client.on(booted())
    client.ask(bytes.fromhex("2102200003000000"))
    with pytest.raises(Aborted) as caught:
        client.ask(bytes.fromhex(segment))
    assert caught.value.code == code
    assert client.read(0x2002) == b"unit 1"


@heavy
def test_a_download_that_never_ends_is_refused() -> None:
    client = Client.on(booted())
    client.ask(bytes.fromhex("2002200000000000"))
    for count in range((1 << 20) // 7):
        client.ask(bytes([0x10 * (count % 2)]) + b"AAAAAAA")
    with pytest.raises(Aborted, match="05040005"):
        client.ask(b"\0AAAAAAA")
