"""Captures of Wireshark and tcpdump: read whatever their form, ended with an error where they are damaged."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dvtcli.domain.ports import Frame
from dvtcli.domain.text import plural
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.recordings.recording_file import Recorder, read_recorded, read_recording
from tests.files.captures import CAN, COOKED, COOKED_2, ETHERNET, Style, block, packet, pcap, pcapng, section, socketcan
from tests.files.recordings import BEGIN_S, frames

STYLES = st.builds(
    Style,
    order=st.sampled_from("<>"),
    link=st.sampled_from([CAN, COOKED, COOKED_2]),
    kind=st.sampled_from(["enhanced", "old", "simple"]),
    resolution=st.sampled_from([None, 6, 9, 3, 0x80 | 20]),
    offset_s=st.sampled_from([0, 1_600_000_000, -5]),
    sections=st.sampled_from([1, 3]),
)
SAMPLE = [Frame(0x181 + n, bytes(range(n)), timestamp_s=BEGIN_S + n / 8) for n in range(6)]


def told(frame: Frame) -> tuple[int, bool, bool, bytes]:
    return frame.can_id, frame.extended, frame.remote, frame.data


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("captures") / "run.pcapng"


@given(some=frames(), style=STYLES)
def test_every_form_of_pcapng_is_read(path: Path, some: list[Frame], style: Style) -> None:
    path.write_bytes(pcapng(some, style))
    found = list(read_recorded(path))
    assert [told(one.frame) for one in found] == [told(one) for one in some]
    assert {one.channel for one in found} == {"can7"}
    if style.kind != "simple":
        for one, was in zip(found, some, strict=True):
            assert one.frame.timestamp_s == pytest.approx(was.timestamp_s, abs=2e-6 if style.ticks > 10**4 else 1e-3)


@given(some=frames(), order=st.sampled_from("<>"), nanoseconds=st.booleans(), link=st.sampled_from([CAN, COOKED]))
def test_every_form_of_pcap_is_read(path: Path, some: list[Frame], order: str, nanoseconds: bool, link: int) -> None:
    path = path.with_suffix(".pcap")
    path.write_bytes(pcap(some, order, nanoseconds=nanoseconds, link=link))
    found = list(read_recording(path))
    assert [told(one) for one in found] == [told(one) for one in some]
    assert [one.timestamp_s for one in found] == pytest.approx([one.timestamp_s for one in some], abs=2e-6)


def test_errors_can_fd_and_other_protocols_are_told_apart(path: Path) -> None:
    style = Style(link=COOKED)
    other = struct.pack(">HHH8sH", 0, 1, 6, bytes(8), 0x0800) + bytes(40)
    sent = Frame(0x181, b"\1")
    data = [other, *(struct.pack(">HHH8sH", 0, 280, 0, bytes(8), protocol) + one for protocol, one in (
        (0x0C, socketcan(sent)), (0x0D, socketcan(sent, flags=4)), (0x0C, socketcan(Frame(4, bytes(8)), error=True)),
        (0x0D, socketcan(Frame(0x181, bytes(12)))), (0x0E, bytes(20)),
    ))]  # fmt: skip
    path.write_bytes(section(style) + b"".join(packet(style, one, BEGIN_S) for one in data))
    assert [(one.fd, one.error) for one in read_recorded(path)] == [
        (False, False), (True, False), (False, True), (True, False),
    ]  # fmt: skip


@pytest.mark.parametrize(("word", "length"), [(0x40000181, 200), (0x181, 255), (0x181, 0x80), (0x181, 65)])
def test_what_is_no_frame_of_can_or_can_fd_is_left_out(path: Path, word: int, length: int) -> None:
    """CAN XL among it, which has the head of another frame: none is told that never was."""
    odd = struct.pack(">IBBH", word, length, 0, 0) + bytes(length)
    path.write_bytes(section(Style()) + packet(Style(), odd, BEGIN_S) + packet(Style(), socketcan(SAMPLE[1]), BEGIN_S))
    assert [told(one.frame) for one in read_recorded(path)] == [told(SAMPLE[1])]
    path.write_bytes(section(Style()) + packet(Style(), odd, BEGIN_S))
    assert as_far_as_it_goes(path)[0] == []
    assert "none of them a frame of CAN or CAN FD" in read_error(path)


def read_error(path: Path) -> str:
    with pytest.raises(InputFileError) as wrong:
        list(read_recording(path))
    return f"{wrong.value.text} {wrong.value.why}"


def as_far_as_it_goes(path: Path) -> tuple[list[Frame], str]:
    """What is read of *path*, and the error that ends it, if any."""
    found = []
    try:
        for frame in read_recording(path):
            found.append(frame)  # noqa: PERF402 - what came before the error counts
    except (InputFileError, UsageError) as wrong:  # it may have become another kind of file
        return found, wrong.text
    return found, ""


@pytest.mark.parametrize("suffix", [".pcapng", ".pcap"])
@given(length=st.integers(0))
def test_a_cut_off_capture_is_said_to_be_one(path: Path, suffix: str, length: int) -> None:
    """Wherever it ends: what is whole before that is read."""
    path = path.with_suffix(suffix)
    whole = pcapng(SAMPLE, Style()) if suffix == ".pcapng" else pcap(SAMPLE, "<", nanoseconds=True)
    path.write_bytes(whole[: length % len(whole)])
    found, error = as_far_as_it_goes(path)
    assert [told(one) for one in found] == [told(one) for one in SAMPLE[: len(found)]]
    assert (
        error.endswith(f"damaged after {plural(len(found), 'frame')}, or no {suffix} file")
        or "has no frames" in error
        or (found and not error)
    )


@example(style=Style(), at=0, new=b"%PDF", suffix=".pcapng")
@given(
    style=STYLES, at=st.integers(0), new=st.binary(min_size=1, max_size=8), suffix=st.sampled_from([".pcapng", ".pcap"])
)
def test_a_hostile_capture_ends_with_an_error(path: Path, style: Style, at: int, new: bytes, suffix: str) -> None:
    whole = bytearray(pcapng(SAMPLE, style) if suffix == ".pcapng" else pcap(SAMPLE, style.order, nanoseconds=True))
    at %= len(whole)
    whole[at : at + len(new)] = new
    path = path.with_suffix(suffix)
    path.write_bytes(whole)
    found, error = as_far_as_it_goes(path)
    assert not error or path.name in error
    assert found or error


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (pcapng(SAMPLE, Style())[:-1], "ends in the middle"),
        (section(Style()) + struct.pack("<III", 6, 0xFFFF_FFFC, 0), "none is longer"),
        (section(Style()) + struct.pack("<III", 6, 7, 0), "7 bytes long"),
        (section(Style()) + block("<", 6, struct.pack("<IIIII", 9, 0, 0, 0, 0)), "interface 9"),
        (section(Style(resolution=100)), "10^100"),
        (pcapng(SAMPLE, Style(link=ETHERNET)), "none of them a frame of CAN or CAN FD (link type 1)"),
        (b"\x0a\x0d\x0d\x0a" + bytes(40), "byte order"),
    ],
)
def test_it_is_said_what_is_wrong(path: Path, data: bytes, why: str) -> None:
    path.write_bytes(data)
    assert why in read_error(path)


def test_what_is_written_has_the_blocks_of_the_format(path: Path) -> None:
    """A section, one interface of CAN in nanoseconds, and a packet for each frame."""
    with Recorder(path) as recorder:
        for frame in SAMPLE:
            recorder.write(frame)
    data, kinds, at = path.read_bytes(), [], 0
    while at < len(data):
        kind, length = struct.unpack_from("<II", data, at)
        assert length == struct.unpack_from("<I", data, at + length - 4)[0]
        kinds.append(kind)
        at += length
    assert kinds == [0x0A0D0D0A, 1, *[6] * len(SAMPLE)]
    assert [one.frame.timestamp_s for one in read_recorded(path)] == [one.timestamp_s for one in SAMPLE]
