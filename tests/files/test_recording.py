"""What is recorded is what is read back, in every format that is offered; what would lose frames is refused."""

from __future__ import annotations

import re
import struct
import tempfile
import zlib
from importlib.util import find_spec
from pathlib import Path

import can
import pytest
from can.io import MF4Writer
from hypothesis import given, settings

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.ports import Frame
from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.files.recordings.formats import formats, written
from dvtcli.files.recordings.recording_file import Recorder, read_recorded, read_recording
from dvtcli.files.recordings.recording_format import RecordingFormat
from tests.files.recordings import APPENDABLE, BEGIN_S, FORMATS, ROTATING, frames
from tests.harness.sample import heavy
from tests.house.source import PACKAGE

#: formats that can be written here: .mf4 where asammdf is installed
WRITABLE = [suffix for suffix in FORMATS if suffix != ".mf4" or find_spec("asammdf")]
SAMPLE = [Frame(0x181 + n, bytes([n]), timestamp_s=BEGIN_S + n / 100) for n in range(10)]


def told(frame: Frame) -> tuple[int, bool, bool, bytes]:
    return frame.can_id, frame.extended, frame.remote, frame.data


def record(path: Path, sent: list[Frame], **options: object) -> Recorder:
    with Recorder(path, **options) as recorder:  # type: ignore[arg-type]
        for frame in sent:
            recorder.write(frame)
    return recorder


def test_a_suffix_is_of_one_format_alone() -> None:
    # what is pasted is known by its content, whatever its suffix
    files = (file for file in (PACKAGE / "files" / "recordings").glob("[!_]*.py") if file.name != "pasted.py")
    said = [suffix for file in files for suffix in re.findall(r'^    suffix = "(.*)"$', file.read_text("utf-8"), re.M)]
    assert sorted(said) == sorted(formats()), "each is written in lower case with its point, and no other file has it"


def test_a_format_lacks_nothing() -> None:
    with pytest.raises(TypeError, match=r"Nameless needs a line such as suffix = \"\.asc\""):

        class Nameless(RecordingFormat):
            """One that nobody finds."""


@pytest.mark.parametrize("suffix", [suffix for suffix in WRITABLE if suffix != ".mf4"])
@settings(max_examples=max(8, settings().max_examples // 2), deadline=None)
@given(sent=frames())
def test_what_is_recorded_is_read_back(suffix: str, sent: list[Frame]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"run{suffix}"
        recorder = record(path, sent)
        kept = [frame for frame in sent if written()[suffix].keeps_remote or not frame.remote]
        assert recorder.left_out == len(sent) - len(kept)
        assert recorder.frames == len(kept)
        if not kept:
            return
        found = list(read_recording(path))
    assert [told(frame) for frame in found] == [told(frame) for frame in kept]
    for before, after in zip(kept, found, strict=True):
        assert abs(before.timestamp_s - after.timestamp_s) < 0.002


@pytest.mark.skipif(".mf4" in WRITABLE, reason="asammdf is installed")
def test_mf4_names_what_it_needs(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="asammdf") as caught:
        Recorder(tmp_path / "run.mf4")
    assert "canopen-dvtcli[mdf]" in typed(caught.value.hint)


@pytest.mark.parametrize("suffix", APPENDABLE)
def test_appending_keeps_what_was_there(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"run{suffix}"
    record(path, SAMPLE[:4])
    record(path, SAMPLE[4:], append=True)
    assert [told(frame) for frame in read_recording(path)] == [told(frame) for frame in SAMPLE]


@pytest.mark.parametrize("suffix", sorted(set(FORMATS) - set(APPENDABLE) - {".mf4"}))
def test_formats_that_cannot_be_appended_say_so(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(UsageError, match="appended") as caught:
        Recorder(tmp_path / f"run{suffix}", append=True)
    assert ".blf .log" in typed(caught.value.hint)


@heavy
@pytest.mark.parametrize("suffix", ROTATING)
def test_rotation_loses_no_frame(tmp_path: Path, suffix: str) -> None:
    sent = [Frame(0x181, n.to_bytes(8, "little"), timestamp_s=BEGIN_S + n / 100) for n in range(6000)]
    recorder = record(tmp_path / f"run{suffix}", sent, most_bytes=20_000)
    paths = list(tmp_path.iterdir())
    assert len(paths) == recorder.files > 1
    found = [frame for path in paths for frame in read_recording(path)]
    assert sorted(told(frame) for frame in found) == sorted(told(frame) for frame in sent)


@pytest.mark.parametrize(("name", "reason"), [("run.db", "loses frames"), ("run.csv", "base64"), ("run.xyz", "format")])
def test_formats_that_lose_something_are_refused(tmp_path: Path, name: str, reason: str) -> None:
    with pytest.raises(UsageError, match=reason):
        Recorder(tmp_path / name)


def test_a_damaged_line_is_named(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    record(path, SAMPLE)
    lines = path.read_text("utf-8").splitlines()
    lines[3] = "(oops) can0 181#ZZ"
    path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputFileError, match="damaged after 3 frames") as caught:
        list(read_recording(path))
    assert caught.value.place == f"{path}:4"


@pytest.mark.parametrize("suffix", [suffix for suffix in WRITABLE if suffix != ".mf4"])
@pytest.mark.parametrize("content", [b"", b"\x00\xff" * 200, b"nothing like it\n" * 10])
def test_other_files_are_said_to_be_no_recording(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"run{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputFileError):
        list(read_recording(path))


@pytest.mark.parametrize("time_s", ["1000000000000000000.0", "99999999999999.0", "-99999999999999.0", "nan", "inf"])
def test_a_time_that_no_calendar_has_is_damage(tmp_path: Path, time_s: str) -> None:
    path = tmp_path / "run.log"
    path.write_text(f"(1.5) can0 705#05\n({time_s}) can0 185#3712\n", encoding="utf-8")
    with pytest.raises(InputFileError, match="damaged after 1 frame,") as wrong:
        list(read_recording(path))
    assert wrong.value.place == f"{path}:2"


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".log", ".trc"])
def test_a_can_id_of_more_bits_than_a_frame_has_is_damage(tmp_path: Path, suffix: str) -> None:
    with can.Logger(str(tmp_path / f"nmt{suffix}")) as writer:
        writer(can.Message(timestamp=BEGIN_S, arbitration_id=0x800, is_extended_id=False, data=[1, 0]))
    with pytest.raises(InputFileError, match="damaged after 0 frames") as refused:
        list(read_recording(tmp_path / f"nmt{suffix}"))
    assert refused.value.why == "CAN-ID 0x800 has more than 11 bits"


def test_a_missing_file_is_a_usage_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="No such file"):
        list(read_recording(tmp_path / "none.log"))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("suffix", [".log", ".trc"])
def test_a_full_disk_is_said(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"run{suffix}"
    path.symlink_to("/dev/full")
    with pytest.raises(DvtcliError, match="No space left"):
        record(path, SAMPLE * 2000)


@pytest.mark.needs("asammdf")
@pytest.mark.parametrize("data", [b"", b"MDF     4.10", bytes(5000), b"MDF     4.10    x" * 999])
def test_an_mf4_that_is_none_is_an_error_of_the_file(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.mf4").write_bytes(data)
    with pytest.raises(InputFileError, match=r"a\.mf4: damaged after 0 frames"):
        list(read_recorded(tmp_path / "a.mf4"))


@pytest.mark.needs("asammdf")
def test_an_mf4_of_a_megabyte_that_unpacks_to_a_gigabyte_is_refused(tmp_path: Path) -> None:
    """Its only block of data (DZ) is replaced: a gigabyte of zeros, as the file itself says."""
    path = tmp_path / "a.mf4"
    with MF4Writer(path, compression_level=2) as writer:
        for number in range(2000):
            writer.on_message_received(can.Message(timestamp=number / 1000, arbitration_id=0x181, data=bytes(8)))
    file = path.read_bytes()
    file += bytes(-len(file) % 8)
    block, size = file.index(b"##DZ"), 1 << 30
    deflate = zlib.compressobj(9)
    packed = b"".join(deflate.compress(bytes(1 << 20)) for _ in range(size >> 20)) + deflate.flush()
    header = struct.pack("<4sIQQ2sBBIQQ", b"##DZ", 0, 48 + len(packed), 0, b"DT", 0, 0, 0, size, len(packed))
    linked = file.replace(struct.pack("<Q", block), struct.pack("<Q", len(file)))
    assert linked != file
    path.write_bytes(linked + header + packed)
    with pytest.raises(InputFileError, match=r"a\.mf4: damaged after 0 frames") as refused:
        list(read_recorded(path))
    assert "asammdf takes more than 720 MB for it" in str(refused.value.why)
