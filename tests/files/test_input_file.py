"""Files of strangers: no command waits for ever for a pipe, and none reads a device or a file without an end."""

from __future__ import annotations

import os
import shlex
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from dvtcli import check_eds
from dvtcli.errors import DvtcliError, InputFileError
from dvtcli.files.dbc import read_dbc
from dvtcli.files.input_file import forget_pipes, open_input, read_input, read_input_head
from dvtcli.files.recordings.recording_file import read_recorded
from dvtcli.files.recordings.recording_format import MOST_CHARACTERS
from tests.cli.commands.bench import Bench
from tests.process import dvtcli

#: what reads a file that somebody may have made -> the suffix by which it is taken for one
READERS = {
    "plan {}": ".yaml", "apply {} --yes": ".yaml", "check {}": ".yaml", "diff {}": ".yaml", "load {}": ".yaml",
    "verify {}": ".yaml", "report r.html {}": ".yaml", "diff {} ": ".dcf", "compare {}": ".dcf",
    "clone {} --yes": ".jsonl", "recover {}": ".json", "import {}": ".cpj", "explain 181#00 -d {}": ".dbc",
    "eds check {}": ".eds", "eds check {} ": ".xdd", "eds add {}": ".eds", "eds convert {} x.xdd": ".eds",
    "eds show {}": ".eds", "run {}": ".dvt", "decode {}": ".log", "decode {} ": ".asc", "replay {} --yes": ".log",
    "write 2050 @{}": ".bin", "download {} --yes": ".bin", "eds show {} ": ".cdcf",
}  # fmt: skip
needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")


def reader(line: str) -> str:
    return f"{READERS[line]} {line}"


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="needs a file without an end")
@pytest.mark.parametrize("line", READERS, ids=reader)
def test_a_file_without_an_end_is_refused(tmp_path: Path, line: str) -> None:
    endless = tmp_path / f"endless{READERS[line]}"
    endless.symlink_to("/dev/zero")
    with Bench() as bench:
        ran = bench.run(line.format(endless))
    assert ran.code in (2, 4), ran
    assert "endless" in ran.stderr


@needs_pipes
@pytest.mark.long
def test_a_pipe_into_which_nobody_writes_is_given_up(tmp_path: Path) -> None:
    """All at once: each waits for its first byte as long as it may."""

    def ran(line: str) -> tuple[str, int]:
        pipe = tmp_path / f"pipe-{abs(hash(line))}{READERS[line]}"
        os.mkfifo(pipe)
        return line, dvtcli("--sim", "gen4", *line.format(pipe).split()).returncode

    with ThreadPoolExecutor(len(READERS)) as pool:
        codes = dict(pool.map(ran, READERS))
    assert {line: code for line, code in codes.items() if code not in (2, 4)} == {}


@needs_pipes
@pytest.mark.long
@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("check net.yaml", "pipe.eds is a pipe or a device, and dcf names a file"),
        ("plan net.yaml", "pipe.eds is a pipe or a device, and dcf names a file"),
        ("check endless.yaml", "endless.eds is a pipe or a device, and dcf names a file"),
        ("import new.yaml pipes", "pipes/list.cpj: no data from this pipe"),
        ("import new.yaml list.cpj", "pipe.eds: no data from this pipe"),
        ("import new.yaml endless.cpj", "endless.eds is a device, not a file"),
    ],
)
def test_what_another_file_names_is_a_file_or_refused(tmp_path: Path, line: str, said: str) -> None:
    """A network file, a nodelist and a folder lead to files that their reader did not name."""
    forget_pipes()
    (tmp_path / "pipes").mkdir()
    for pipe in ("pipe.eds", "pipes/list.cpj"):
        os.mkfifo(tmp_path / pipe)
    (tmp_path / "endless.eds").symlink_to("/dev/zero")
    nodelist = "[TOPOLOGY]\nNetName=x\nNodes=1\nNode1Present=1\nNode1Name=a\nNode1DCFName={}\n"
    for name, eds in (("net", "pipe.eds"), ("endless", "endless.eds")):
        (tmp_path / f"{name}.yaml").write_text(f"drive:\n  node_id: 1\n  dcf: {eds}\n", "utf-8")
        (tmp_path / f"{'list' if name == 'net' else name}.cpj").write_text(nodelist.format(eds), "utf-8")
    ran = dvtcli("--sim", "gen4", *line.split(), cwd=tmp_path)
    assert ran.returncode == 4, ran
    assert said in ran.stderr


@needs_pipes
@pytest.mark.long
def test_the_pipes_of_a_command_are_waited_for_together(tmp_path: Path) -> None:
    """However many there are: the time is over with the first; what is there already is still read."""
    forget_pipes()
    for name in ("first", "second", "third"):
        os.mkfifo(tmp_path / name)
        with pytest.raises(InputFileError, match="no data from this pipe") as refused:
            read_input(tmp_path / name, 100, "file")
        assert refused.value.why == "a command waits 8 s for the first bytes of its pipes"
    kept = os.open(tmp_path / "third", os.O_RDONLY | os.O_NONBLOCK)  # what is written stays while somebody may read it
    (tmp_path / "third").write_bytes(b"here")
    assert read_input(tmp_path / "third", 100, "file") == b"here"
    os.close(kept)
    forget_pipes()


@needs_pipes
@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("eds check {}.eds", "[FileInfo]\nFileName=a.eds\n[DeviceInfo]\nVendorName=A\n"),
        ("check {}.yaml", "drive:\n  node_id: 1\n  dcf: gen4\n"),
        ("plan {}.yaml", "drive:\n  node_id: 1\n  dcf: gen4\n  tpdo:\n    1:\n      event_timer: 100\n"),
        ("run {}.dvt", "read 1018:1\n"),
        ("decode {}.log", "(1.000000) can0 181#3706\n"),
        ("write 2020:1 @{}.bin", "a"),
    ],
    ids=lambda value: value.split()[0],
)
def test_a_pipe_says_what_its_file_says(tmp_path: Path, line: str, text: str) -> None:
    suffix = line.rpartition(".")[2]
    file, pipe = tmp_path / f"a.{suffix}", tmp_path / "pipe" / f"a.{suffix}"
    file.write_text(text, "utf-8")
    pipe.parent.mkdir()
    os.mkfifo(pipe)
    answers = []
    for path in (file, pipe):
        writer = threading.Thread(target=pipe.write_text, args=(text, "utf-8"), daemon=True)
        if path == pipe:
            writer.start()
        with Bench() as bench:
            ran = bench.run(line.format(path.with_suffix("")))
        answers.append((ran.code, ran.stdout.replace(str(pipe.parent), str(file.parent))))
    assert answers[0] == answers[1]


@needs_pipes
def test_a_pipe_is_read_once_a_command(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for text in (b"first", b"second"):
        forget_pipes()
        writer = threading.Thread(target=pipe.write_bytes, args=(text,))
        writer.start()
        assert read_input_head(pipe, 3) == text[:3]
        writer.join()
        assert read_input(pipe, 100, "file") == text


def test_a_file_larger_than_its_kind_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_bytes(bytes(1025))
    assert read_input(file, 1025, "network file") == bytes(1025)
    with pytest.raises(InputFileError, match="larger than 1 KiB") as refused:
        read_input(file, 1024, "network file")
    assert refused.value.why == "no network file is"


def test_a_folder_is_none(tmp_path: Path) -> None:
    for read in (open_input, lambda path: read_input(path, 10, "file")):
        with pytest.raises(OSError, match="directory"):
            read(tmp_path)


@pytest.mark.skipif(os.name != "posix", reason="needs a device")
def test_nothing_is_read_from_a_device_but_the_empty_one() -> None:
    assert read_input(os.devnull, 10, "file") == b""
    with pytest.raises(InputFileError, match="device"):
        open_input("/dev/zero").close()


@pytest.mark.parametrize(
    ("line", "codes"),
    [("plot {} speed", (4,)), ("sim gen4 --signal '606C=csv({},speed)'", (4,))],
    ids=["plot", "signal"],
)
def test_a_cell_larger_than_the_library_takes_is_an_error_of_the_file(
    tmp_path: Path, line: str, codes: tuple[int, ...]
) -> None:
    """Python's csv refuses more than 128 KiB in a cell."""
    file = tmp_path / "a.csv"
    file.write_text(f"time_s,speed\n0,1\n1,{'9' * (1 << 17)}9\n", "utf-8")
    ran = dvtcli(*shlex.split(line.format(file)))
    assert ran.returncode in codes, ran
    assert "field larger than field limit" in ran.stderr
    assert str(file) in ran.stderr


@pytest.mark.parametrize("suffix", [".log", ".asc", ".trc"])
def test_a_recording_without_line_ends_is_damaged(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"a{suffix}"
    file.write_bytes(b"x" * (2 * MOST_CHARACTERS))
    with pytest.raises(DvtcliError) as damaged:
        list(read_recorded(file))
    assert damaged.value.exit_code == 4


def test_blank_lines_of_a_dbc_cost_no_more_than_others(tmp_path: Path) -> None:
    """The search for its first section was quadratic in blank lines; 40,000 took 16 s."""
    file = tmp_path / "a.dbc"
    file.write_text("\n" * 2_000_000, "ascii")
    with pytest.raises(InputFileError, match="not a DBC"):
        read_dbc(str(file))


_AS_MANY_AS_MAY_BE = "VERSION ?\n" + 50_000 * "BO_ 1 A: 8 B\nSG_ a: 0|8@1\n"


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (_AS_MANY_AS_MAY_BE, "is not a DBC file"),  # cantools looks at it: its first line is wrong
        (_AS_MANY_AS_MAY_BE + "SG_ a: 0|8@1\n", "more than 100,000 messages and signals"),
        (_AS_MANY_AS_MAY_BE + "BO_ 1 A: 8 B\n", "more than 100,000 messages and signals"),
        ("VERSION ?\n".ljust(8 << 20), "is not a DBC file"),
        ("VERSION ?\n".ljust((8 << 20) + 1), "larger than 8 MiB"),
        ("VERSION ?\nBO_ 1 A: 4095 B\nSG_ a: 32760|32760@1\n", "is not a DBC file"),
        ("VERSION ?\nBO_ 1 A: 4096 B\n", "dbc:2: no message has more than 4095 bytes"),
        ("VERSION ?\nBO_ 1 A: 8 B\nSG_ a: 32761|1@1\n", "dbc:3: no message has more than 4095 bytes"),
        ("VERSION ?\nBO_ 1 A: 8 B\nSG_ a: 0|32761@1\n", "dbc:3: no message has more than 4095 bytes"),
    ],
    ids=("entries", "a signal more", "a message more", "bytes", "a byte more", "longest", "message", "start", "length"),
)
def test_a_dbc_is_refused_from_its_limits_on(tmp_path: Path, text: str, error: str) -> None:
    file = tmp_path / "a.dbc"
    file.write_text(text, "ascii", newline="")
    with pytest.raises(InputFileError) as refused:
        read_dbc(str(file))
    assert error in str(refused.value)


@needs_pipes
def test_a_call_of_the_api_is_not_answered_with_what_an_earlier_pipe_said(tmp_path: Path) -> None:
    pipe = tmp_path / "a.eds"
    os.mkfifo(pipe)
    said = []
    for name in ("first", "second"):
        text = f"[FileInfo]\nFileName=a.eds\n[DeviceInfo]\nVendorName={name}\n{name}=1\n"
        writer = threading.Thread(target=pipe.write_text, args=(text, "utf-8"), daemon=True)
        writer.start()
        said.append(str(check_eds(str(pipe)).document()))
        writer.join()
    assert ["first" in said[0], "first" in said[1], "second" in said[1]] == [True, False, True]
