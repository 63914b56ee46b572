"""Logs as people paste them: each form of the same traffic gives the same decoded lines."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path

import can
import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.ports import Frame
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.recordings.recording_file import read_recorded, read_recording
from tests.cli.commands.bench import Bench
from tests.process import dvtcli

BEGIN_S = 1_700_000_000.0
#: data frames with 11 and 29 bits, an empty one, and a remote frame
TRAFFIC = [
    Frame(0x000, b"\x80\x05"), Frame(0x605, bytes.fromhex("2F60600008000000")),
    Frame(0x585, bytes.fromhex("8060600030000906")), Frame(0x085, bytes.fromhex("2030810000000000")),
    Frame(0x080, b""), Frame(0x705, b"\x05"), Frame(0x18FF0102, b"\x01\x02", extended=True),
]  # fmt: skip
REMOTE = Frame(0x705, b"", remote=True, dlc=1)


def _at(number: int) -> float:
    return 0.001 + 0.01 * number


def _date(number: int) -> str:
    return f"{datetime.fromtimestamp(BEGIN_S + _at(number), UTC):%Y-%m-%d %H:%M:%S.%f}"


def _id(frame: Frame) -> str:
    return f"{frame.can_id:0{8 if frame.extended else 3}X}"


def _bytes(frame: Frame) -> str:
    return frame.data.hex(" ").upper()


def candump(frame: Frame, before: str = "", behind: str = "") -> str:
    shown = f"  {_id(frame)}   [{frame.dlc or len(frame.data)}]  {'remote request' if frame.remote else _bytes(frame)}"
    return f" {before}can0{shown}{behind}".rstrip()


def _each(line: Callable[[int, Frame], str], head: Sequence[str] = ()) -> Callable[[Sequence[Frame]], str]:
    def written(frames: Sequence[Frame]) -> str:
        return "\n".join([*head, *(line(number, frame) for number, frame in enumerate(frames))]) + "\n"

    return written


def _busmaster(number: int, frame: Frame) -> str:
    kind = ("x" if frame.extended else "s") + ("r" if frame.remote else "")
    at = round(1e4 * _at(number))
    return (
        f"10:00:{at // 10_000:02d}:{at % 10_000:04d} Rx 1 0x{_id(frame)} {kind} {frame.dlc or len(frame.data)}"
        f" {_bytes(frame)}"
    )


def _savvy(number: int, frame: Frame) -> str:
    cells = [f"{byte:02X}" for byte in frame.data] + ["00"] * (8 - len(frame.data))
    extended = str(frame.extended).lower()
    return f"{round(1e6 * _at(number))},{frame.can_id:08X},{extended},Rx,0,{len(frame.data)},{','.join(cells)}"


def _pcan(number: int, frame: Frame) -> str:
    can_id = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:04X}"
    data = "RTR" if frame.remote else _bytes(frame)
    return (
        f"{number + 1:6d}) {1000 * _at(number):11.1f}  Rx     {can_id}  {frame.dlc or len(frame.data)}  {data}".rstrip()
    )


def _pcan_10(number: int, frame: Frame) -> str:
    """Whole milliseconds, and no direction."""
    can_id = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:04X}"
    return f"{number + 1:5d}) {1000 * (_at(number) - 0.001):9.0f}  {can_id}  {len(frame.data)}  {_bytes(frame)} "


def _pcan_2(number: int, frame: Frame) -> str:
    can_id = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:04X}"
    kind = "RR" if frame.remote else "DT"
    return (
        f"{number + 1:7d} {1000 * _at(number):13.3f} {kind} {can_id:>8} Rx {frame.dlc or len(frame.data)} "
        f" {_bytes(frame)}"
    ).rstrip()


def _asc(number: int, frame: Frame) -> str:
    can_id = f"{frame.can_id:X}{'x' if frame.extended else ''}"
    data = f"r {frame.dlc}" if frame.remote else f"d {len(frame.data)} {_bytes(frame)}"
    return f"   {0.001 if not number else 0.01:.6f} 1  {can_id:<15} Rx   {data}"


def _trace(number: int, frame: Frame) -> str:
    behind = f"R{frame.dlc}" if frame.remote else frame.data.hex().upper()
    return (
        f"{1000 * _at(number):9.1f} ms  {'->' if number % 2 else '<-'} {_id(frame)}#{behind}   SDO request, node 5  x"
    )


def _message(frame: Frame, number: int) -> can.Message:
    return can.Message(
        BEGIN_S + _at(number), frame.can_id, is_extended_id=frame.extended, is_remote_frame=frame.remote,
        data=frame.data, dlc=frame.dlc or len(frame.data), channel="can0",
    )  # fmt: skip


def _compact(frame: Frame) -> str:
    return f"{_id(frame)}#{f'R{frame.dlc}' if frame.remote else frame.data.hex().upper()}"


def _quoted(text: str) -> str:
    return "".join(f"> > {line}".rstrip() + "\n" for line in text.splitlines())


def _python_can_screen(frames: Sequence[Frame]) -> str:
    said = io.StringIO()
    printer = can.Printer(said)
    for number, frame in enumerate(frames):
        printer.on_message_received(_message(frame, number))
    return said.getvalue()


def _python_can_csv(frames: Sequence[Frame]) -> str:
    file = io.StringIO()
    writer = can.CSVWriter(file)
    for number, frame in enumerate(frames):
        writer.on_message_received(_message(frame, number))
    return file.getvalue()


_BUSMASTER = [
    "***BUSMASTER Ver 3.2.2***", "***PROTOCOL CAN***", "***NOTE: PLEASE DO NOT EDIT THIS DOCUMENT***",
    "***START DATE AND TIME 27:11:2026 10:00:00:000***", "***HEX***", "***ABSOLUTE MODE***",
    "***<Time><Tx/Rx><Channel><CAN ID><Type><DLC><DataBytes>***",
]  # fmt: skip
_PCAN_10 = [
    ";##########################################################################", ";   C:\\run.trc", ";",
    ";   PCAN-Net: Line", ";---+--   ----+----  --+--  +  -+ -- -- -- -- -- -- --",
]  # fmt: skip
_SAVVY = ["Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8"]
_ASC = ["date Tue Nov 14 10:00:00.000 am 2023", "base hex  timestamps relative", "internal events logged"]
FORMS: dict[str, Callable[[Sequence[Frame]], str]] = {
    "candump": _each(lambda _, frame: candump(frame)),
    "candump -ta": _each(lambda number, frame: candump(frame, f"({BEGIN_S + _at(number):.6f})  ")),
    "candump -tz": _each(lambda number, frame: candump(frame, f"({_at(number):010.6f})  ")),
    "candump -tA": _each(lambda number, frame: candump(frame, f"({_date(number)})  ")),
    "candump -x": _each(lambda _, frame: f"  can0  RX - -{candump(frame)[5:]}"),
    "candump -c": _each(lambda _, frame: f"\x1b[34m{candump(frame)}\x1b[0m"),
    "candump -a": _each(lambda _, frame: candump(frame, behind="" if frame.remote else "   '.a.'")),
    "frames such as 705#05": _each(lambda _, frame: _compact(frame)),
    "quoted candump -L": _each(lambda number, frame: f"> ({_at(number):.6f}) can0 {_compact(frame)}"),
    "candump in a block of code": lambda frames: f"```text\n{FORMS['candump'](frames)}```\n",
    "candump -tz in a quoted block": lambda frames: _quoted(f"~~~\n\n{FORMS['candump -tz'](frames)}~~~\n"),
    "BUSMASTER": _each(_busmaster, _BUSMASTER),
    "SavvyCAN": _each(_savvy, _SAVVY),
    "PCAN-View": _each(_pcan),
    "PCAN-View 2": _each(_pcan_2),
    "PCAN-View 1.0": _each(_pcan_10, _PCAN_10),
    "PCAN-View 1.0, lines": _each(_pcan_10),
    "Vector ASC, relative": _each(_asc, _ASC),
    "dvtcli trace": _each(_trace),
    "python-can's screen": _python_can_screen,
    "python-can's CSV": _python_can_csv,
}  # fmt: skip
_WITHOUT_TIMES = (
    "candump", "candump -x", "candump -c", "candump -a", "frames such as 705#05", "candump in a block of code",
)  # fmt: skip
#: forms without remote frames
_WITHOUT_REMOTE = ("SavvyCAN", "PCAN-View 1.0", "PCAN-View 1.0, lines")
#: what dvtcli wrote itself
_OWN = ("decode", "decode --json")


def frames_of(form: str) -> list[Frame]:
    return TRAFFIC if form in _WITHOUT_REMOTE else [*TRAFFIC, REMOTE]


def decoded(path: Path, words: str = "") -> list[str]:
    ran = Bench(()).run(f"decode {path} {words}")
    assert ran.code == 0, ran.stderr
    return ran.stdout.splitlines()


@pytest.mark.parametrize("name", ["run.log", "run.txt", "run"])
@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_the_same_lines(form: str, name: str, tmp_path: Path) -> None:
    frames = frames_of(form)
    path, plain = tmp_path / name, tmp_path / "plain" / "run.log"
    path.write_text(FORMS[form](frames), "utf-8")
    plain.parent.mkdir()
    with can.CanutilsLogWriter(str(plain)) as writer:
        for number, frame in enumerate(frames):
            writer.on_message_received(_message(frame, number))
    assert [line.partition("  ")[2] for line in decoded(path)] == [line.partition("  ")[2] for line in decoded(plain)]
    found = list(read_recording(path))
    if form not in _WITHOUT_TIMES:
        times = [frame.timestamp_s - found[0].timestamp_s for frame in found]
        assert times == pytest.approx([_at(number) - _at(0) for number in range(len(frames))], abs=1e-4)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
@pytest.mark.parametrize("form", [*FORMS, "candump -L"])
def test_a_byte_order_mark_changes_nothing(form: str, encoding: str, tmp_path: Path) -> None:
    """PowerShell's `>` writes UTF-16, and Windows' editor the mark of UTF-8; what follows the damage can be read."""
    lines = "".join(f"({BEGIN_S + _at(n):.6f}) can0 {_id(one)}#{one.data.hex()}\n" for n, one in enumerate(TRAFFIC))
    text = lines if form == "candump -L" else FORMS[form](TRAFFIC)
    plain, marked = tmp_path / "plain", tmp_path / "marked"
    plain.write_text(text, "utf-8")
    marked.write_text(text, encoding)
    assert decoded(marked) == decoded(plain)
    marked.write_text(f"{text}(oops) can0 \u010a\n{text if form == 'candump -L' else ''}", encoding)
    with pytest.raises(InputFileError, match=f"damaged after {len(TRAFFIC)} frames") as failed:
        list(read_recording(marked))
    assert "this line is not a frame: (oops) can0" in failed.value.why
    if form == "candump -L":
        assert "the rest of it can be read" in typed(failed.value.hint)


def test_frames_before_a_damage_are_decoded_without_a_description_too(tmp_path: Path) -> None:
    """The recording is read for its mappings first."""
    path = tmp_path / "cut.log"
    path.write_text("(1.0) can0 705#05\n(2.0) can0 705#7F\n(3.0) can0 70", "ascii")
    ran = Bench(()).run(f"decode {path}")
    assert (ran.code, [line.split()[-1] for line in ran.stdout.splitlines()]) == (4, ["OPERATIONAL", "PRE-OPERATIONAL"])
    assert f"{path}:3: damaged after 2 frames" in ran.stderr


@pytest.mark.parametrize("words", ["", "--json"])
def test_what_decode_prints_can_be_decoded_again(words: str, tmp_path: Path) -> None:
    """Its text has no date; its documents have all."""
    first, second = tmp_path / "run.log", tmp_path / "again.txt"
    first.write_text(FORMS["candump -ta"]([*TRAFFIC, REMOTE]), "utf-8")
    second.write_text("\n".join(decoded(first, words)) + "\n", "utf-8")
    again = decoded(second, words)
    if not words:
        assert again == decoded(first)
        return
    keys = ("time", "cob_id", "data", "what", "text", "remote", "extended")
    before, after = (
        [[json.loads(line)[key] for key in keys] for line in found] for found in (decoded(first, words), again)
    )
    assert after == before


def test_deltas_are_added_up(tmp_path: Path) -> None:
    """candump -td: the times go back, as no clock does."""
    path, deltas = tmp_path / "run.txt", (0.0, 0.5, 0.25, 1.0)
    path.write_text("".join(f" (00{delta:.6f})  can0  181   [1]  05\n" for delta in deltas), "ascii")
    assert [frame.timestamp_s for frame in read_recording(path)] == [0.0, 0.5, 0.75, 1.75]


@pytest.mark.parametrize(
    ("mode", "lines", "times"),
    [
        ("SYSTEM", ["23:59:59:9000", "00:00:00:1000"], [0.0, 0.2]),
        ("ABSOLUTE", ["00:00:01:0000", "00:00:02:5000"], [0.0, 1.5]),
        ("RELATIVE", ["00:00:01:0000", "00:00:00:5000", "00:00:00:2500"], [0.0, 0.5, 0.75]),
    ],
)
def test_busmasters_modes(mode: str, lines: list[str], times: list[float], tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    head = [f"***{mode} MODE***" if "MODE" in line else line for line in _BUSMASTER]
    path.write_text("\n".join([*head, *(f"{time} Rx 1 0x181 s 1 05" for time in lines)]), "ascii")
    found = [frame.timestamp_s for frame in read_recording(path)]
    assert [time_s - found[0] for time_s in found] == pytest.approx(times, abs=1e-6)


def test_error_frames_of_candump_are_none(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text("  can0  181   [1]  05\n  can0  20000080   [8]  00 00 00 00 00 00 00 00   ERRORFRAME\n", "ascii")
    assert [recorded.error for recorded in read_recorded(path)] == [False, True]


@pytest.mark.parametrize("words", ["", "--json", "--csv", "-o values.csv"])
def test_frames_that_are_left_out_are_counted(words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Error frames, and CAN FD, whose services are others than those of CANopen."""
    monkeypatch.chdir(tmp_path)
    log = "(1.0) can0 705#05\n(1.1) can0 20000004#0004000000000000\n(1.2) can0 185##101\n(1.3) can0 185##102\n"
    Path("run.log").write_text(log, "ascii")
    ran = Bench(()).run(f"decode run.log {words}")
    assert (ran.code, ran.stderr.count("left out: 1 error frame and 2 CAN FD frames; `")) == (0, 1), ran.stderr
    Path("run.log").write_text(f"{log}nonsense\n", "ascii")
    ran = Bench(()).run(f"decode run.log {words} {'--yes' if 'csv' in words else ''}")
    assert (ran.code, ran.stderr.count("left out: 1 error frame and 2 CAN FD frames; `")) == (4, 1), ran.stderr


@pytest.mark.parametrize("words", ["--csv", "-o values.csv"])
def test_can_fd_frames_are_no_rows(words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if they were not in the recording, and counted."""
    monkeypatch.chdir(tmp_path)
    classic, fd = "(1.0) can0 1FF#01\n", "(1.1) can0 705##105\n(1.2) can0 705##17F\n"
    said: list[tuple[int, str, str]] = []
    for text in (classic, classic + fd):
        Path("run.log").write_text(text, "ascii")
        ran = Bench(()).run(f"decode run.log {words}")
        said.append((ran.code, ran.stdout, ran.stderr.replace("note: left out: 2 CAN FD frames\n", "")))
    assert said[0] == said[1]
    assert (ran.code, ran.stderr.count("left out: 2 CAN FD frames\n")) == (2, 1), ran.stderr


def test_a_node_of_can_fd_frames_is_not_taken_for_that_of_an_eds(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    path.write_text("(1.0) can0 705#05\n(1.1) can0 709##105\n", "ascii")
    ran = Bench((), {"eds": "gen4"}).run(f"decode {path}")
    assert (ran.code, "node 5" in ran.stderr, "9" in ran.stderr) == (0, True, False), ran.stderr


@pytest.mark.parametrize("form", ["candump", "candump -ta", "PCAN-View", "frames such as 705#05"])
@pytest.mark.parametrize("name", ["run.log", "run.txt"])
def test_words_in_front_of_a_log_are_named_as_what_is_no_frame(form: str, name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text(f"Hi all,\n\nthis is what I see: [1] and 2:\n{FORMS[form](TRAFFIC)}", "utf-8")
    with pytest.raises(InputFileError, match="damaged after 0 frames") as failed:
        list(read_recording(path))
    assert failed.value.why == "this line is not a frame: Hi all,"
    assert failed.value.hint == "without lines 1 to 3 the rest of it can be read"


@pytest.mark.parametrize("form", [form for form in FORMS if form not in ("Vector ASC, relative", "PCAN-View 1.0")])
def test_a_quotation_gives_the_same_frames(form: str, tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text(_quoted(FORMS[form](TRAFFIC)), "utf-8")
    assert [frame.data for frame in read_recording(path)] == [frame.data for frame in TRAFFIC]


@pytest.mark.parametrize(
    ("content", "name"),
    [
        (b"SQLite format 3\0", "an SQLite database"),
        (b"PK\x03\x04rest", "a ZIP archive"),
        (b"[FileInfo]\nFileName=a.eds\n", "an EDS or DCF file"),
        (b'VERSION ""\nBO_ 1 a: 8 b\n', "a DBC file"),
        (b'<?xml version="1.0"?>\n', "an XML file"),
        (b"time,frame,TPDO1 node 1 6041:00\n", "a CSV file of values; plot reads it"),
        (b"nodes:\n  drive: {node_id: 5}\n", "a network file"),
        (b"No.     Time           Source      Destination  Protocol Length Info\n", "a list of packets from Wireshark"),
        (b"Chn Identifier Flg   DLC  D0...1...2...3...4...5...6..D7   Time   Dir\n", "a log of Kvaser CanKing"),
        (b"TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength\n", "a CSV file of a CSS logger"),
        (b"ASCII Trace IXXAT MiniMon V3  Version: 3.0\n", "a trace of IXXAT's MiniMon"),
        (b"t705105\rt605840416000000000000\r", "lines of an SLCAN interface"),
        (b'{"frames": []}\n', "JSON of another kind"),
        (b'[{"frame": 1}]\n', "JSON of another kind"),
        (b"[1, 2]\n", "JSON of another kind"),
        (b"[1000]\nParameterName=Device type\n", "a file of sections, as EDS, DCF and INI files are"),
    ],
)
@pytest.mark.parametrize("suffix", [".log", ".asc", ".txt"])
def test_another_format_is_named(content: bytes, name: str, suffix: str, tmp_path: Path) -> None:
    """It is not called damaged."""
    path = tmp_path / f"run{suffix}"
    path.write_bytes(content)
    ran = Bench(()).run(f"decode {path}")
    assert (ran.code, f"is not a recording of frames: it is {name}" in ran.stderr, "damaged" in ran.stderr) == (
        2,
        True,
        False,
    )


def test_a_damaged_line_is_said(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text("  can0  181   [1]  05\nnonsense and more\n", "ascii")
    with pytest.raises(InputFileError, match="damaged after 1 frame"):
        list(read_recording(path))


def test_a_missing_or_empty_file_is_called_so(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    with pytest.raises(UsageError, match=r"run\.txt: No such file"):
        list(read_recording(path))
    path.write_text("", "ascii")
    with pytest.raises(UsageError, match=r"run\.txt is empty"):
        list(read_recording(path))


@pytest.mark.parametrize("text", ["nonsense\n", "[00:00:01.234] RX 0x185 [8] 01\n"])
def test_what_is_nothing_known_is_a_usage_error(text: str, tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text(text, "ascii")
    with pytest.raises(UsageError, match=r"no format is known by its content or by \.txt"):
        list(read_recording(path))


@pytest.mark.parametrize("words", ["", "--csv", "--filter nothing", "--eds gen4 --filter velocity"])
def test_no_message_names_the_copy_of_standard_input(words: str) -> None:
    """It is gone when a user reads the message."""
    done = dvtcli("decode", "-", *words.split(), stdin="(1.0) can0 705#05\n(1.1) can0 20000004#0004000000000000\n")
    assert "left out: 1 error frame\n" in done.stderr or done.returncode == 2, done.stderr
    assert "dvtcli-" not in done.stderr


def test_standard_input_is_decoded() -> None:
    done = dvtcli("decode", "-", stdin=FORMS["candump -ta"](TRAFFIC))
    assert done.returncode == 0, done.stderr
    assert "abort 0x06090030 of 6060:00: invalid value for the parameter" in done.stdout
    assert len(done.stdout.splitlines()) == len(TRAFFIC)


@pytest.mark.parametrize(
    "damaged",
    [
        "  can0  185   [2",
        "  can0  18",
        "  can0",
        "  ca",
        "  AA BB",
        "1122",
        "  can1  185   [2",
        "  can0  RX - -  185",
        "  vcan7  185 [4]  11",
    ],
)
@pytest.mark.parametrize("is_last", [True, False])
def test_a_damaged_line_of_candump_is_said(damaged: str, is_last: bool, tmp_path: Path) -> None:
    whole = "  can0  181   [1]  05\n"
    path = tmp_path / "run.txt"
    path.write_text(f"{whole}{damaged}\n{'' if is_last else whole}", "ascii")
    with pytest.raises(InputFileError, match="damaged after 1 frame") as failed:
        list(read_recording(path))
    assert failed.value.place == f"{path}:2"


def test_what_candump_says_between_frames_is_no_frame(tmp_path: Path) -> None:
    said = [
        "",
        "me@bench:~$ candump can0",
        "^C",
        "me@bench:~$ ",
        "root@bench:~# ",
        "  read: network is down",
        "  -- can0 is up",
    ]
    path = tmp_path / "run.txt"
    frame = "  can0  181   [1]  05\n"
    path.write_text(frame + "".join(f"{text}\n{frame}" for text in said), "ascii")
    assert len(list(read_recording(path))) == 1 + len(said)


def test_a_shell_line_may_stand_before_candumps_frames(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text("me@bench:~$ candump can0 -n 1\n  can0  181   [1]  05\nme@bench:~$ \n", "ascii")
    assert len(list(read_recording(path))) == 1


@pytest.mark.parametrize("start_s", [0.0, 5.0, 100.0, BEGIN_S])
def test_a_clock_that_goes_back_a_little_is_no_delta(start_s: float, tmp_path: Path) -> None:
    """candump reads two interfaces one after the other."""
    times = [start_s + 0.01 * number - (0.0101 if number % 5 == 4 else 0.0) for number in range(40)]
    path = tmp_path / "run.txt"
    lines = (f" ({time_s:017.6f})  can{number % 5 // 4}  181   [1]  05\n" for number, time_s in enumerate(times))
    path.write_text("".join(lines), "ascii")
    assert [frame.timestamp_s for frame in read_recording(path)] == pytest.approx(times, abs=2e-6)


@pytest.mark.parametrize(
    "deltas", [(0.0, *(0.01 + 1e-6 * (number * 7 % 5) for number in range(40))), (2.0, 0.5, 0.1, 3.0), (0.0, 0.2, 0.1)]
)
def test_times_that_do_not_rise_are_deltas(deltas: Sequence[float], tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text("".join(f" ({delta:010.6f})  can0  181   [1]  05\n" for delta in deltas), "ascii")
    sums = [sum(deltas[: number + 1]) for number in range(len(deltas))]
    assert [frame.timestamp_s for frame in read_recording(path)] == pytest.approx(sums, abs=1e-6)


def _with_length(form: str, said: int) -> str:
    """A file of *form* with a whole frame, and one of three bytes that says *said*."""
    line = {
        "candump": "  can0  181   [LENGTH]  11 22 33",
        "BUSMASTER": "10:00:00:0010 Rx 1 0x181 s LENGTH 11 22 33",
        "SavvyCAN": "1000,00000181,false,Rx,0,LENGTH,11,22,33,,,,,",
        "PCAN-View": "     1)       1.0  Rx     0181  LENGTH  11 22 33",
        "PCAN-View 2": "      1         1.000 DT     0181 Rx LENGTH  11 22 33",
        "python-can's screen": "Timestamp: 1700000000.001000  ID: 181  S Rx      DL:  LENGTH    11 22 33",
        "python-can's CSV": "1700000000.001,0x181,0,0,0,LENGTH,ESIz",
    }[form]
    head = {
        "BUSMASTER": "\n".join([*_BUSMASTER, ""]), "SavvyCAN": f"{_SAVVY[0]}\n",
        "python-can's CSV": "timestamp,arbitration_id,extended,remote,error,dlc,data\n",
    }.get(form, "")  # fmt: skip
    return head + line.replace("LENGTH", "3") + "\n" + line.replace("LENGTH", str(said)) + "\n"


@pytest.mark.parametrize(
    "form",
    ["candump", "BUSMASTER", "SavvyCAN", "PCAN-View", "PCAN-View 2", "python-can's screen", "python-can's CSV"],
)
@pytest.mark.parametrize("said", [3, 8, 4])
def test_a_length_that_is_not_that_of_the_bytes_is_damage(form: str, said: int, tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text(_with_length(form, said), "ascii")
    if said == 3:
        assert [frame.data.hex() for frame in read_recording(path)] == ["112233"] * 2
        return
    with pytest.raises(InputFileError, match="damaged after 1 frame") as failed:
        list(read_recording(path))
    assert f"the length {said} is not that of the 3 bytes after it" in failed.value.why


def test_a_length_of_pcan_view_may_be_a_code_of_can_fd(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    lines = (f"{n:7d} {n:13.3f} FD     0181 Rx {said:2d}  {'11 ' * 12}" for n, said in enumerate((9, 12), 1))
    path.write_text("\n".join(lines), "ascii")
    assert [len(recorded.frame.data) for recorded in read_recorded(path)] == [12, 12]


_NINE = bytes(range(9, 18)).hex(" ").upper()


@pytest.mark.parametrize(
    ("line", "is_fd"),
    [
        ("  can0  181  [8]  01 02 03 04 05 06 07 08", False),
        (f"  can0  181  [09]  {_NINE}", True),
        ("  can0  181  [08]  01 02 03 04 05 06 07 08", True),
        ("10:00:00:0010 Rx 1 0x181 s 1 11", False),
        (f"10:00:00:0010 Rx 1 0x181 s 9 {_NINE}", True),
        (f"1000,00000181,false,Rx,0,9,{_NINE.replace(' ', ',')}", True),
        ("      1         1.000 DT     0181 Rx 1  11", False),
        *((f"      1         1.000 {kind}     0181 Rx 1  11", True) for kind in ("FD", "FB", "FE", "BI", "fd")),
        ("     1)       1.0  FD 0181 Rx - 9  00 11 22 33 44 55 66 77 88 99 AA BB", True),
        (f"     1)       1.0  Rx     0181  9  {_NINE}", True),
        (f"Timestamp: 1700000000.001000  ID: 181  S Rx      DL:  9    {_NINE}", True),
        ("Timestamp: 1700000000.001000  ID: 181  S Rx F    DL:  1    11", True),
        ("1700000000.001,0x181,0,0,0,9,CQoLDA0ODxAR", True),
        ("      1.0 ms  <- 181#090A0B0C0D0E0F1011   TPDO1", True),
        (f"22:13:20.010000+00:00  0x181  TPDO1 node 1        {_NINE}", True),
        (
            '{"schema": "dvtcli.frame/1", "time": "2023-11-14T22:13:20Z", "cob_id": 385, "data": "090A0B0C0D0E0F1011",'
            ' "remote": false, "extended": false}',
            True,
        ),
        ("181#1122334455667788", False),
        ("181##1090A0B0C0D0E0F1011", True),
        ("181##1", True),
    ],
)
def test_more_than_eight_bytes_or_a_mark_are_can_fd(line: str, is_fd: bool, tmp_path: Path) -> None:
    """Whatever format the line is of."""
    heads = {
        "10:00": "\n".join(_BUSMASTER),
        "1000,": _SAVVY[0],
        "17000": "timestamp,arbitration_id,extended,remote,error,dlc,data",
    }
    head = heads.get(line[:5])
    path = tmp_path / "run.txt"
    path.write_text(f"{head}\n{line}\n" if head else f"{line}\n", "ascii")
    assert [recorded.fd for recorded in read_recorded(path)] == [is_fd]


@pytest.mark.parametrize("channel", ["can0 ", "vcan12 ", "slcan0 ", "CAN1 ", "(1.0) bus ", "(1.0) can0 ", ""])
def test_a_frame_may_have_a_channel(channel: str, tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text(f"{channel}705#05\n{channel}705#7F\n", "ascii")
    name = channel.rsplit(maxsplit=1)[-1] if channel else ""
    assert [recorded.channel for recorded in read_recorded(path)] == [name] * 2


@pytest.mark.parametrize("command", ["send", "explain", "send --node", "dvtcli send"])
def test_commands_with_frames_are_no_recording(command: str, tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text(f"{command} 705#05\n" * 8, "ascii")
    with pytest.raises(UsageError, match="no format is known by its content"):
        list(read_recording(path))
