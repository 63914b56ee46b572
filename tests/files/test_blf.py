"""Frames of Vector's binary log, as python-can's own reader has them, and damage that it does not notice."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import can
import pytest
from can.io.blf import FILE_HEADER_STRUCT
from hypothesis import example, given
from hypothesis import strategies as st

from dvtcli.bus.can_message import frame_of
from dvtcli.errors import InputFileError
from dvtcli.files.recordings.recording_file import read_recorded
from dvtcli.files.recordings.recording_format import RecordedFrame

_OBJECT, _CLOCK, _DATA = struct.Struct("<4sHHLL"), struct.Struct("<LHHQ"), struct.Struct("<HBBL8s")
_CLOCK_2 = struct.Struct("<LBxHQ8x")
#: data frames, in 10 µs and in ns; another kind of object, which is not a frame
_KINDS, _STATISTIC = (1, 86), 4


@st.composite
def messages(draw: st.DrawFn) -> can.Message:
    extended, fd = draw(st.booleans()), draw(st.sampled_from([False, False, True]))
    data = draw(st.binary(max_size=8))
    is_remote = not fd and draw(st.booleans())
    return can.Message(
        1_764_380_000 + draw(st.floats(0, 1e5)), draw(st.integers(0, 0x1FFF_FFFF if extended else 0x7FF)), extended,
        is_remote, not fd and not is_remote and draw(st.booleans()), draw(st.integers(0, 9)),
        dlc=len(data), data=None if is_remote else data, is_fd=fd,
    )  # fmt: skip


def an_object(
    kind: int, *, version: int = 1, clock: int = 1, count: int = 123_456_789, flags: int = 0, length: int = 8,
    can_id: int = 0x181, data: bytes = b"12345678", channel: int = 1, more: int = 0,
) -> bytes:  # fmt: skip
    """An object and its padding: a data frame, or what is none but looks like it, with *more* bytes."""
    body = (_CLOCK if version == 1 else _CLOCK_2).pack(clock, 0, 0, count)
    body += _DATA.pack(channel, flags, length, can_id, data) + bytes(more)
    size = _OBJECT.size + len(body)
    return _OBJECT.pack(b"LOBJ", size - len(body), version, size, kind) + body + bytes(size % 4)


objects = st.one_of(
    st.builds(
        an_object, st.sampled_from(_KINDS), version=st.integers(1, 2), clock=st.integers(1, 2),
        count=st.integers(0, 10**12), flags=st.sampled_from([0, 1, 0x80]), length=st.sampled_from([0, 1, 4, 8, 12]),
        can_id=st.integers(0, 0x7FF) | st.integers(0x8000_0000, 0x9FFF_FFFF) | st.just(0x2000_0181),
        data=st.binary(min_size=8, max_size=8), channel=st.integers(1, 9),
    ),
    st.builds(an_object, st.just(_STATISTIC), version=st.integers(1, 2), more=st.integers(0, 9)),
)  # fmt: skip
#: what a measurement has: data frames of both kinds, clocks and lengths of CAN-IDs, and statistics between them
USUAL = [
    an_object(1), an_object(86, clock=2), an_object(_STATISTIC, more=3), an_object(1, can_id=0x9ABC_DEF0, length=3),
    an_object(_STATISTIC, more=1), an_object(86, length=0, channel=2),
]  # fmt: skip


def by_python_can(path: Path) -> list[RecordedFrame]:
    """The frames of *path*, as python-can alone reads them."""
    return [
        RecordedFrame(frame_of(one), str(one.channel), one.is_error_frame, one.is_fd) for one in can.BLFReader(path)
    ]


def container(data: bytes, *, packed: bool) -> bytes:
    """A container of *data*."""
    body = struct.pack("<H6xL4x", 2 if packed else 0, len(data)) + (zlib.compress(data) if packed else data)
    size = _OBJECT.size + len(body)
    return _OBJECT.pack(b"LOBJ", _OBJECT.size, 1, size, 10) + body + bytes(size % 4)


@given(st.lists(messages(), min_size=1, max_size=30), st.sampled_from([0, -1]), st.integers(150, 2000))
def test_what_python_can_writes_is_read_as_it_reads_it(written: list[can.Message], level: int, size: int) -> None:
    """With containers that are larger than an object: of smaller ones python-can's writer loses the last bytes."""
    options: dict[str, Any] = {"compression_level": level, "max_container_size": size}
    with TemporaryDirectory() as folder:
        path = Path(folder, "x.blf")
        with can.BLFWriter(path, **options) as writer:
            for message in written:
                writer.on_message_received(message)
        expected = by_python_can(path)
        if any(not frame.error for frame in expected):
            assert list(read_recorded(path)) == expected


@example(USUAL, [], True)
@example(USUAL, [100, 50], False)
@given(st.lists(objects, min_size=1, max_size=20), st.lists(st.integers(1, 300), max_size=8), st.booleans())
def test_objects_of_any_kind_over_containers_are_read_as_python_can_reads_them(
    written: list[bytes], cuts: list[int], packed: bool
) -> None:
    data, parts = b"".join(written), list[bytes]()
    for size in [*cuts, len(data)]:
        parts.append(data[:size])
        data = data[size:]
    containers = b"".join(container(part, packed=packed) for part in parts if part)
    with TemporaryDirectory() as folder:
        path = recording(Path(folder, "x.blf"), containers, 144 + len(containers))
        if expected := by_python_can(path):
            assert list(read_recorded(path)) == expected


def recording(path: Path, containers: bytes, size: int = 0) -> Path:
    """Write a recording of *containers*, whose header states *size* (bytes); 0 if its writer was killed."""
    began = 2025, 11, 6, 29, 1, 33, 20, 0
    head = b"LOGG", 144, 5, 0, 0, 0, 2, 6, 8, 1, size, 0, 0, 0, *began, *began
    path.write_bytes(FILE_HEADER_STRUCT.pack(*head).ljust(144, b"\0") + containers)
    return path


def frames_before_damage(path: Path) -> list[RecordedFrame]:
    """The frames of *path*, which is damaged behind them."""
    found = list[RecordedFrame]()
    with pytest.raises(InputFileError):
        found.extend(read_recorded(path))
    return found


#: two frames, each before an object of another kind
TWO_FRAMES = [an_object(1), an_object(_STATISTIC), an_object(86), an_object(_STATISTIC)]
_ONE = len(TWO_FRAMES[0])


def whole_frames(missing: int) -> int:
    """How many of `TWO_FRAMES` are there if *missing* bytes at the end are not."""
    return 2 if missing <= _ONE else 1 if missing <= 3 * _ONE else 0


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("missing", [n for n in range(1, 4 * _ONE, 5) if n % _ONE])
def test_a_recording_whose_last_object_is_cut_is_damaged(missing: int, packed: bool, tmp_path: Path) -> None:
    """Also if its header states no size: that is written last."""
    data = b"".join(TWO_FRAMES)
    path = recording(tmp_path / "x.blf", container(data[:-missing], packed=packed))
    assert len(frames_before_damage(path)) == whole_frames(missing)


@pytest.mark.parametrize("missing", [_ONE, 2 * _ONE, 3 * _ONE])
def test_a_recording_whose_objects_are_whole_is_not_damaged(missing: int, tmp_path: Path) -> None:
    path = recording(tmp_path / "x.blf", container(b"".join(TWO_FRAMES)[:-missing], packed=True))
    assert len(list(read_recorded(path))) == whole_frames(missing)


@pytest.mark.parametrize("missing", [1, 5, 47, 48, 100])
def test_a_container_that_its_file_does_not_end_is_damaged_behind_its_whole_frames(
    missing: int, tmp_path: Path
) -> None:
    path = recording(tmp_path / "x.blf", container(b"".join(TWO_FRAMES), packed=False)[:-missing])
    assert len(frames_before_damage(path)) == whole_frames(missing)


@pytest.mark.parametrize("length", range(16))
@pytest.mark.parametrize("kind", [1, 86, _STATISTIC, 100])
@pytest.mark.parametrize("version", [1, 2, 9])
def test_an_object_that_is_shorter_than_its_header_is_damage(
    length: int, kind: int, version: int, tmp_path: Path
) -> None:
    """A length of 0 leads back to the same object, for ever."""
    short = bytearray(an_object(kind))
    _OBJECT.pack_into(short, 0, b"LOBJ", 32, version, length, kind)
    for before in (TWO_FRAMES, [*TWO_FRAMES, an_object(1, version=2)]):
        data = b"".join([*before, bytes(short), *TWO_FRAMES])
        path = recording(tmp_path / "x.blf", container(data, packed=True))
        assert len(frames_before_damage(path)) == sum(one[12:16] != bytes([_STATISTIC, 0, 0, 0]) for one in before)
    outside = recording(tmp_path / "y.blf", container(b"".join(TWO_FRAMES), packed=True) + bytes(short) + bytes(64))
    assert len(frames_before_damage(outside)) == 2
