"""A recording that is damaged is refused with its line, in words of its own; no frame is left out without a word."""

from __future__ import annotations

import time
from pathlib import Path

import can
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.recordings.pasted import PASTED, PastedFormat
from dvtcli.files.recordings.recording_file import read_recorded
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.process import dvtcli

TEXT = (".asc", ".log", ".trc")
#: what stands in the place of a frame, and is none
NO_FRAMES = (
    "oops",
    "9.9",
    "0.5 1",
    "0.5 1 18",
    "0.5 1 1 x 181 Rx d 1 00",
    "(1.5) can0",
    "(1.5 can0 181#00",
    "181#00",
    "37 370.0 DT 1",
)
#: events of other kinds, as tools write them among the frames
EVENTS = {
    ".asc": (
        "// a comment", "0.500 1 Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.0%", "0.500 Log Trigger Event",
        "0.500 CAN 1 Status:chip status error active", "0.500 1 J1939TP FEE3p 6 0 0 - Rx d 23 A0",
        "0.5 SV: 2 0 1 ::x = 1", "End TriggerBlock", "0.500 Li 3C Tx 8 00 01", "",
    ),
    ".trc": ("; a comment", "7 70.000 ST 1 - Rx - 4 00 00 00 00", "8 80.0 ER 1 - Rx - 5 04 00 02 00 00", ""),
    ".log": ("",),
}  # fmt: skip


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """A recording of 20 frames in each form."""
    found = {}
    for suffix in (*TEXT, ".blf"):
        path = tmp_path_factory.mktemp("good") / f"run{suffix}"
        with can.Logger(str(path)) as writer:
            for number in range(20):
                data = bytes([number]) * (number % 9)
                writer(
                    can.Message(timestamp=1.7e9 + number / 50, arbitration_id=0x181, is_extended_id=False, data=data)
                )
        found[suffix] = path.read_bytes()
    return found


def read(path: Path, data: bytes) -> tuple[int, InputFileError | None]:
    """How many frames *data* has, and what ended that."""
    path.write_bytes(data)
    count = 0
    try:
        for _ in read_recorded(path):
            count += 1
    except InputFileError as error:
        found = error
    else:
        return count, None
    assert not any(word in str(found.why) for word in ("invalid literal", "unpack (", "could not convert", "range("))
    return count, found


def lines_of(data: bytes) -> tuple[list[bytes], list[int]]:
    """The lines of a recording, and which of them are frames."""
    lines = data.splitlines(keepends=True)
    return lines, [number for number, text in enumerate(lines) if b"181" in text and not text.startswith(b";")]


@pytest.mark.parametrize("suffix", TEXT)
@pytest.mark.parametrize("text", NO_FRAMES)
def test_a_line_that_is_no_frame_is_named(suffix: str, text: str, good: dict[str, bytes], tmp_path: Path) -> None:
    lines, at = lines_of(good[suffix])
    for number in (at[0], at[7], at[-1]):
        bent = [*lines[:number], text.encode() + b"\n", *lines[number + 1 :]]
        count, error = read(tmp_path / f"bad{suffix}", b"".join(bent))
        assert error is not None, number
        assert (count, error.place) == (at.index(number), f"{tmp_path / f'bad{suffix}'}:{number + 1}")
        assert error.why == f"this line is not a frame: {text}"


def test_a_first_line_without_the_time_that_others_have_is_no_frame(tmp_path: Path) -> None:
    """Its time would be decades before theirs."""
    path = tmp_path / "run.txt"
    path.write_text("705#05\n(1700000000.0) can0 705#05\n", "ascii")
    with pytest.raises(UsageError, match="no format is known by its content"):
        list(read_recorded(path))


@pytest.mark.parametrize("suffix", TEXT)
def test_events_of_other_kinds_are_no_damage(suffix: str, good: dict[str, bytes], tmp_path: Path) -> None:
    lines, at = lines_of(good[suffix])
    for text in EVENTS[suffix]:
        bent = [*lines[: at[3]], text.encode() + b"\n", *lines[at[3] :]]
        assert read(tmp_path / f"good{suffix}", b"".join(bent)) == (20, None), text


@given(
    number=st.integers(0, 19), at=st.integers(0, 99), new=st.binary(max_size=4), gone=st.integers(0, 4), data=st.data()
)
def test_no_frame_is_lost_without_a_word(
    number: int,
    at: int,
    new: bytes,
    gone: int,
    data: st.DataObject,
    good: dict[str, bytes],
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    suffix = data.draw(st.sampled_from(TEXT))
    lines, where = lines_of(good[suffix])
    line = lines[where[number]].rstrip()
    bent = (line[:at] + new + line[at + gone :]).replace(b"\r", b"").replace(b"\n", b"")
    assume(bent.split() and not bent.strip().startswith((b";", b"//")))
    lines[where[number]] = bent + b"\n"
    count, error = read(tmp_path_factory.getbasetemp() / f"bent{suffix}", b"".join(lines))
    assert (count, error) == (20, None) or error is not None


def test_a_recording_of_blocks_that_was_cut_short_is_said_to_be(good: dict[str, bytes], tmp_path: Path) -> None:
    whole = good[".blf"]
    for size in range(0, len(whole), 7):
        _, error = read(tmp_path / "cut.blf", whole[:size])
        assert error is not None, size
    assert read(tmp_path / "whole.blf", whole) == (20, None)


def test_the_first_frame_behind_a_header_without_a_trigger_is_read(tmp_path: Path) -> None:
    head, frame = (
        b"date Mon Nov 23 14:18:45.891 2026\nbase hex  timestamps absolute\n",
        b" 0.010000 1  182             Rx   d 1 01\n",
    )
    assert read(tmp_path / "short.asc", head + 2 * frame) == (2, None)


def test_a_damaged_recording_is_no_twins(good: dict[str, bytes], tmp_path: Path) -> None:
    file = tmp_path / "bad.log"
    file.write_bytes(good[".log"] + b"(1.5) can0 181#ZZ\n")
    with Bench(("generic@5",)) as bench:
        for line in ("replay {} --dry-run --yes", "decode {}"):
            ran = bench.run(line.format(file))
            assert (ran.code, "this line is not a frame: (1.5) can0 181#ZZ" in ran.stderr) == (4, True), ran
            assert "twin" not in ran.stderr
        ran = bench.run("send 181#0102030405060708ZZ --dry-run")
        assert (ran.code, "twin" in ran.stderr) == (2, False)


#: what PEAK's tools write; the middle line of each
TRACES = {
    "1.0 bus information": (
        ";   Start time: 01.01.2020",
        "     2)         2  FFFFFFFF  4  00 00 00 04 -- -- -- --  BUSLIGHT",
    ),
    "2.1 code of a length": (
        ";$FILEVERSION=2.1\n;$STARTTIME=43008.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D",
        "      2      2.000 FD  1     0182 Rx -  9    00 01 02 03 04 05 06 07 08 09 0A 0B",
    ),
    "1.1 cut": (";$FILEVERSION=1.1\n;$STARTTIME=43008.5", "     2)         2.0  Rx         0181  8  EC 00 11"),
}
SOUND = {
    "1.0": "  {n})  {n}  0181  2  11 22",
    "2.1": " {n}  {n}.000 DT 1 0181 Rx - 2 11 22",
    "1.1": " {n}) {n}.0 Rx 0181 2 11 22",
}


@pytest.mark.parametrize(
    ("name", "frames"), [("1.0 bus information", 2), ("2.1 code of a length", 3), ("1.1 cut", None)]
)
def test_what_is_no_frame_of_a_trc_is_told_by_its_kind(tmp_path: Path, name: str, frames: int | None) -> None:
    head, middle = TRACES[name]
    sound = SOUND[name.split(maxsplit=1)[0]]
    text = "\n".join((head, sound.format(n=1), middle, sound.format(n=3), ""))
    count, error = read(tmp_path / "run.trc", text.encode())
    assert (count, error) == (frames, None) if frames else error is not None


@pytest.mark.parametrize("suffix", TEXT)
def test_that_the_rest_can_be_read_is_tried(good: dict[str, bytes], tmp_path: Path, suffix: str) -> None:
    path, lines = tmp_path / f"run{suffix}", good[suffix].splitlines(keepends=True)
    damage = (
        b"(1.5) can0 181#0\n"
        if suffix == ".log"
        else b"9.9 1 181 Rx d 1\n"
        if suffix == ".asc"
        else b"9 9.0 DT 1 0181\n"
    )
    one, other = len(lines) - 8, len(lines) - 4
    damaged = [*lines[:one], damage, *lines[one:]]
    count, wrong = read(path, b"".join(damaged))
    assert wrong is not None
    assert (wrong.hint, wrong.place) == (f"without line {one + 1} the rest of it can be read", f"{path}:{one + 1}")
    rest, fine = read(path, b"".join(lines))
    assert (rest, fine) == (20, None)
    assert count < rest
    _, wrong = read(path, b"".join([*damaged[:other], damage, *damaged[other:]]))
    assert wrong is not None
    assert wrong.hint == f"line {other + 1} is damaged, too"


@pytest.mark.parametrize("start", ["1e999", "nan", "-1e9", "9" * 40, "9" * 400, "4524644.9", ""])
def test_a_start_that_no_calendar_has_is_told_with_its_line(start: str, tmp_path: Path) -> None:
    head = f";$FILEVERSION=2.1\n;$STARTTIME={start}\n;$COLUMNS=N,O,T,I,d,l,D\n"
    found, error = read(tmp_path / "a.trc", f"{head} 1 0.1 DT 0181 Rx 1 37\n".encode())
    assert (found, error is not None and error.place) == (0, f"{tmp_path / 'a.trc'}:2")


@heavy
def test_what_a_library_logs_of_a_file_does_not_reach_the_terminal(good: dict[str, bytes], tmp_path: Path) -> None:
    """python-can logs lines as they are; where nothing handles that, Python prints it on stderr."""
    comment, damage = b"; \x1b]0;x\x07\n", b"1 2 \x1b]0;x\x07 DT 0181 Rx 1 37\n"
    short = b";$FILEVERSION=2.1\n;$STARTTIME=43008.5\n;$COLUMNS=N,O,T,I,d,l,D\n"
    for suffix, recording in [*good.items(), (".trc", short)]:
        lines = recording.splitlines(keepends=True)
        for number in {0, 3, max(0, len(lines) - 20), len(lines)}:
            path = tmp_path / f"a{suffix}"
            path.write_bytes(b"".join([*lines[:number], comment, damage, *lines[number:]]))
            done = dvtcli("decode", path.name, cwd=tmp_path)
            assert "\x1b" not in done.stdout + done.stderr
            said = [line for line in done.stderr.splitlines() if not line.startswith(" ")]
            assert [line for line in said if line.split(":")[0] not in ("error", "note", "warning")] == []


def test_bytes_that_are_no_text_are_not_printed(tmp_path: Path) -> None:
    path = tmp_path / "junk.log"
    path.write_bytes(bytes(range(128, 256)) * 4 + b"\n")
    with pytest.raises(InputFileError) as raised:
        list(read_recorded(path))
    assert raised.value.why == "this line is not a frame, nor text"


@pytest.mark.parametrize("before", ["", "can0 ", "> (1.0) can0 "])
def test_more_than_eight_bytes_without_the_mark_of_can_fd_are_no_frame(before: str, tmp_path: Path) -> None:
    """cansend and `explain` refuse them, too."""
    path = tmp_path / "run.txt"
    path.write_text(f"{before}705#05\n{before}181#112233445566778899\n", "ascii")
    with pytest.raises(InputFileError, match="damaged after 1 frame") as failed:
        list(read_recorded(path))
    assert (failed.value.place, failed.value.why) == (
        f"{path}:2", f"this line is not a frame: {before.removeprefix('> ')}181#112233445566778899",
    )  # fmt: skip


@pytest.mark.parametrize("format_", PASTED, ids=lambda each: each.title)
def test_a_line_too_long_for_a_format_reaches_no_pattern(format_: PastedFormat) -> None:
    """Some patterns take a time that grows with the square of a line's length."""
    assert format_.match(" " * (format_.most_characters + 1)) is None
    line = "  (1.0)  can0  181   [1]  05   '{}'".format("." * 400)
    assert format_.line.fullmatch(line) is None or format_.match(line) is None
    assert not format_.is_in([line, line.replace("1.0", "0.5"), line.replace("1.0", "0.7")])


def test_a_long_line_in_front_is_soon_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text(f"can0 123 [8]{' ' * 20_000}x\n" * 3, "ascii")
    begin_s = time.process_time()
    with pytest.raises(UsageError, match="no format is known by its content"):
        list(read_recorded(path))
    assert time.process_time() - begin_s < 5
