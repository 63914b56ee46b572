"""A recording of values whose process is killed: what was on the disk becomes a whole file; others are left alone."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic

import can
import pytest

from dvtcli.domain.ports import Frame
from dvtcli.errors import SafetyRefusal
from dvtcli.files.values.parquet_file import finish
from dvtcli.files.values.value_file import (
    Rotation,
    ValueParts,
    WholeFile,
    finish_parts,
    next_part,
    read_values,
    write_file,
)
from dvtcli.files.values.value_rows import ParquetForm, open_locked, part_of, remove_locked, stream_of
from dvtcli.watch.table import SignalRows
from tests.files.recordings import BEGIN_S
from tests.files.test_value_files import layouts_of
from tests.process import PATIENCE_S, documents, dvtcli
from tests.simulator.serve.served import Served, bus_words, own_environment, served, wait_for
from tests.small_recording import ramp

pytestmark = [pytest.mark.needs("pyarrow"), pytest.mark.drawn(6, "killed recordings")]


def on_disk(path: Path) -> list[float]:
    """The velocities that are in the Arrow stream at *path* by now."""
    import pyarrow

    found: list[float] = []
    with suppress(pyarrow.ArrowException, OSError, StopIteration), path.open("rb") as file:
        reader = pyarrow.ipc.open_stream(file)
        while True:
            found += velocities(reader.read_next_batch().to_pylist())
    return found


def velocities(rows: list[dict[str, object]]) -> list[float]:
    return [float(str(row["value"])) for row in rows if row["object"] == "606C:00"]


def in_file(path: Path) -> list[float]:
    import pyarrow.parquet

    return velocities(pyarrow.parquet.read_table(path).to_pylist())


@contextmanager
def logging(server: Served, folder: Path, *words: str) -> Iterator[subprocess.Popen[str]]:
    """`log` of the values of node 5, which has begun; it is killed at the end."""
    process = subprocess.Popen(
        [sys.executable, "-m", "dvtcli", *bus_words(server.port), "log", *words, "--decode", "--nodes", "5"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", env=own_environment(folder), cwd=folder,
    )  # fmt: skip
    try:
        assert process.stderr is not None
        lines = iter(process.stderr.readline, "")
        assert any("Ctrl-C ends it" in line for line in lines)
        yield process
    finally:
        process.kill()
        process.communicate(timeout=PATIENCE_S)


def send(bus: can.BusABC, numbers: range) -> None:
    """TPDO2 of node 5, with *numbers* for its velocity."""
    for number in numbers:
        data = number.to_bytes(4, "little", signed=True) + bytes(4)
        bus.send(can.Message(arbitration_id=0x285, data=data, is_extended_id=False))


@pytest.mark.long
def test_what_a_killed_log_left_becomes_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    with served(tmp_path, "gen4@5") as server:
        bus = server.attach()
        with logging(server, tmp_path, "run.parquet", "-a") as process:
            send(bus, range(300))
            wait_for(lambda: on_disk(stream_of(path)) == [*range(300)], "values on the disk")
            assert not path.exists()
            send(bus, range(300, 400))
            process.send_signal(signal.SIGKILL)
            process.wait(timeout=PATIENCE_S)
        left = on_disk(stream_of(path))
        assert not path.exists()
        words = ["log", "run.parquet", "--decode", "--nodes", "5", "-a", "--duration", "0.2"]
        again = dvtcli(*bus_words(server.port), *words, cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert "run.parquet: " in again.stderr
    assert "rows of a recording that was killed" in again.stderr
    assert in_file(path) == left == [*range(len(left))]
    assert len(left) >= 300
    assert again.stdout.startswith("run-0002.parquet: ")
    assert sorted(each.name for each in tmp_path.glob("*run*")) == ["run-0002.parquet", "run.parquet"]


def test_a_file_that_is_being_written_is_left_alone(tmp_path: Path) -> None:
    with served(tmp_path, "gen4@5") as server:
        bus = server.attach()
        with logging(server, tmp_path, "run.parquet") as process:
            words = ["log", "run.parquet", "--decode", "--nodes", "5", "--duration", "0.2"]
            second = dvtcli(*bus_words(server.port), *words, cwd=tmp_path)
            assert second.returncode == 6, second.stderr
            assert "another dvtcli is writing" in second.stderr
            behind = dvtcli(*bus_words(server.port), *words, "-a", cwd=tmp_path)
            assert behind.returncode == 0, behind.stderr
            assert [each.name for each in tmp_path.glob("*.parquet")] == ["run-0002.parquet"]
            send(bus, range(20))
            wait_for(lambda: on_disk(tmp_path / "_run.arrows") == [*range(20)], "values on the disk")
            process.send_signal(signal.SIGINT)
            process.wait(timeout=PATIENCE_S)
    assert in_file(tmp_path / "run.parquet") == [*range(20)]
    assert sorted(each.name for each in tmp_path.glob("*run*")) == ["run-0002.parquet", "run.parquet"]


@pytest.mark.parametrize("layout", ["long", "wide"])
def test_a_stream_that_is_torn_anywhere_gives_its_whole_batches(tmp_path: Path, layout: str) -> None:
    """Cut at any byte, as a power-off does: no error, no value that was not sent, and none of a whole batch lost."""
    path, stream = tmp_path / "run.parquet", tmp_path / "_run.arrows"
    rows = SignalRows(layouts_of(5, [0x2000, 0x2001]))
    writer = write_file(path, rows, lambda _: {}, ParquetForm(layout))
    ends, per_batch = [0], {"long": 6, "wide": 3}[layout]
    for number in range(4):
        for step in range(3):
            writer.write(frame(3 * number + step))
        writer._writer._write_batch()  # type: ignore[attr-defined]
        ends.append(stream.stat().st_size)
    whole = stream.read_bytes()
    writer.close()
    sent = [cells for _, cells in read_values(path).rows]
    assert len(sent) == 12
    for size in sorted({*range(0, len(whole), 97), *ends, *(end - 1 for end in ends[1:]), len(whole)}):
        path.unlink(missing_ok=True)
        stream.write_bytes(whole[:size])
        part_of(path).write_bytes(b"PAR1")
        batches = max((number for number, end in enumerate(ends) if end <= size), default=0)
        finished = finish(stream, path, lambda: tmp_path / "other.parquet")
        assert finished is not None
        assert finished.aside is None
        found, least = finished.rows, per_batch * batches
        assert found in {least, least + per_batch}, size  # what a batch ends with may be padding
        assert path.exists() == bool(found)
        assert not found or [cells for _, cells in read_values(path).rows] == sent[: 3 * found // per_batch]
        assert not stream.exists()
        assert not part_of(path).exists()


def frame(number: int) -> Frame:
    return Frame(0x185, number.to_bytes(2, "little") + bytes(2), timestamp_s=BEGIN_S + number / 100)


def test_a_whole_file_is_not_made_again(tmp_path: Path) -> None:
    """Killed between the file's name and the removal of its stream."""
    path, stream = tmp_path / "run.parquet", tmp_path / "_run.arrows"
    left = killed(path, 3)
    assert [(each.path, each.rows) for each in finish_parts(path)] == [(path, 3)]
    whole = path.read_bytes()
    stream.write_bytes(left)
    assert finish_parts(path) == []
    assert path.read_bytes() == whole
    assert not stream.exists()


def test_a_killed_recording_is_kept_beside_another_file_of_its_name(tmp_path: Path) -> None:
    """As if a recording was decoded into that name since the kill."""
    path, stream = tmp_path / "run.parquet", tmp_path / "_run.arrows"
    killed(path, 3)
    rows = SignalRows(layouts_of(5, [0x2000]))
    other = WholeFile(path, rows, lambda _: {})
    for number in range(7, 10):  # as many rows, but others
        other.write(frame(number))
    other.complete()
    whole = path.read_bytes()
    (finished,) = finish_parts(path)
    assert (finished.path.name, finished.rows, finished.aside) == ("run-0002.parquet", 3, None)
    assert path.read_bytes() == whole
    assert [cells for _, cells in read_values(finished.path).rows] == [[0], [1 / 16], [2 / 16]]
    assert not stream.exists()


def killed(path: Path, count: int, *, layout: str = "long") -> bytes:
    """The stream that a `log` into *path* leaves that is killed after *count* batches of a frame."""
    writer = write_file(path, SignalRows(layouts_of(5, [0x2000])), lambda _: {}, ParquetForm(layout))
    for number in range(count):
        writer.write(frame(number))
        writer._writer._write_batch()  # type: ignore[attr-defined]
    left = stream_of(path).read_bytes()
    writer.close()
    path.unlink()
    stream_of(path).write_bytes(left)
    return left


def test_a_stream_that_is_damaged_in_its_middle_is_kept(tmp_path: Path) -> None:
    """Whichever byte is wrong: rows are read, or their stream is kept; only a last batch looks like a torn one."""
    path, stream = tmp_path / "run.parquet", tmp_path / "_run.arrows"
    left = killed(path, 4)
    kept = 0
    for at in range(0, len(left), 7):
        for other in {left[at] ^ 0xFF, left[at] ^ 0x04, 0}:
            path.unlink(missing_ok=True)
            stream.write_bytes(left[:at] + bytes([other]) + left[at + 1 :])
            wrong = stream.read_bytes()
            finished = finish(stream, path, lambda: tmp_path / "other.parquet")
            assert finished is not None
            assert not stream.exists()
            assert path.exists() == bool(finished.rows)
            assert finished.rows <= 4
            if finished.aside is None:
                assert finished.rows >= 3, at
            else:
                assert finished.aside.name.startswith("_run.arrows.damaged-")
                assert finished.aside.read_bytes() == wrong
                finished.aside.unlink()
                kept += 1
    assert kept > 100


def test_what_is_no_stream_is_kept(tmp_path: Path) -> None:
    path, stream = tmp_path / "run.parquet", tmp_path / "_run.arrows"
    stream.write_bytes(b"notes of somebody")
    (finished,) = finish_parts(path)
    assert finished.aside is not None
    assert (finished.rows, finished.aside.read_bytes(), path.exists()) == (0, b"notes of somebody", False)
    stream.write_bytes(bytes(5_000))  # the length of a file reached the disk, its content did not
    assert finish_parts(path) == []
    assert not stream.exists()


def test_a_damaged_recording_is_said(tmp_path: Path) -> None:
    left = killed(tmp_path / "run.parquet", 4)
    (tmp_path / "_run.arrows").write_bytes(left[: len(left) // 2] + b"\xff" * 40 + left[len(left) // 2 + 40 :])
    line = "log run.parquet --decode --duration 0.2"
    done = dvtcli("--sim", "gen4", stdin=f"nmt start\n{line}\n", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (aside,) = tmp_path.glob("_run.arrows.damaged-*")
    assert f"all of it is kept in {aside.name}" in done.stderr
    assert sorted(each.name for each in tmp_path.glob("*.parquet")) == ["run-0002.parquet", "run.parquet"]


@pytest.mark.parametrize("words", [[], ["--yes"]])
def test_a_killed_recording_is_not_overwritten_by_the_next_one(tmp_path: Path, words: list[str]) -> None:
    killed(tmp_path / "run.parquet", 3)
    done = dvtcli(*words, "--sim", "gen4", stdin="log run.parquet --decode --duration 0.2\n", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "run.parquet: 3 rows of a recording that was killed" in done.stderr
    assert done.stdout.startswith("run-0002.parquet: ")
    assert len(list(read_values(tmp_path / "run.parquet").rows)) == 3


def test_values_that_came_before_the_bus_was_gone_are_on_the_disk(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    with served(tmp_path, "gen4@5") as server:
        bus = server.attach()
        with logging(server, tmp_path, "run.parquet", "--reconnect") as process:
            send(bus, range(20))
            wait_for(lambda: on_disk(stream_of(path)) == [*range(20)], "values on the disk")
            beside = server.attach()
            send(bus, range(20, 40))
            for number in range(20, 40):
                received = beside.recv(PATIENCE_S)
                assert received is not None
                assert int.from_bytes(received.data[:4], "little", signed=True) == number
            server.end()
            assert process.stderr is not None
            assert any("gone" in line for line in iter(process.stderr.readline, ""))
            wait_for(lambda: len(on_disk(stream_of(path))) > 20, "values on the disk")


def test_decode_leaves_a_file_alone_that_is_being_written(tmp_path: Path) -> None:
    ramp(tmp_path / "run.log")
    with served(tmp_path, "gen4@5") as server:
        bus = server.attach()
        with logging(server, tmp_path, "run.parquet") as process:
            send(bus, range(20))
            wait_for(lambda: on_disk(tmp_path / "_run.arrows") == [*range(20)], "values on the disk")
            words = ["decode", "run.log", "--eds", "gen4", "-o", "run.parquet"]
            decoded = dvtcli(*words, cwd=tmp_path)
            assert decoded.returncode == 6, decoded.stderr
            assert "another dvtcli is writing" in decoded.stderr
            process.send_signal(signal.SIGINT)
            process.wait(timeout=PATIENCE_S)
        assert in_file(tmp_path / "run.parquet") == [*range(20)]


def test_a_lock_is_that_of_the_file_which_has_the_name(tmp_path: Path) -> None:
    """Who opened a file that its holder removes gets no lock of what has no name any more."""
    path, taken = tmp_path / "_run.arrows", []

    end_s = monotonic() + PATIENCE_S

    def take(number: int) -> None:
        tries = 0
        while tries < 400 or (len({*taken}) < 2 and monotonic() < end_s):  # one may hold it while the others try
            tries += 1
            with suppress(SafetyRefusal):
                file = open_locked(path)
                file.write(b"%d" % number)
                file.flush()
                taken.append(number)
                assert path.read_bytes() == b"%d" % number
                remove_locked(file, path)

    with ThreadPoolExecutor(6) as pool:
        for done in [pool.submit(take, number) for number in range(6)]:
            done.result()
    assert len({*taken}) > 1
    assert not path.exists()


def test_a_pipe_of_a_streams_name_is_left_alone(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "_run.arrows")
    assert finish_parts(tmp_path / "run.parquet") == []


@pytest.mark.parametrize("suffix", [".csv", ".jsonl", ".parquet"])
def test_parts_are_whole_and_hold_each_frame_once(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"run{suffix}"
    (tmp_path / f"run-0007{suffix}").write_bytes(b"older")
    rows = SignalRows(layouts_of(5, [0x2001]))
    form = ParquetForm()
    parts = ValueParts(path, lambda part: write_file(part, rows, _document, form), Rotation(size_bytes=2_000))
    for number in range(500):
        parts.write(frame(number))
        if number % 50 == 49:
            if suffix == ".parquet":
                parts._file._writer._write_batch()  # type: ignore[union-attr]
            parts.flush()
    parts.close()
    names = [path, *(tmp_path / f"run-{number:04}{suffix}" for number in range(8, 7 + len(parts.files)))]
    assert parts.files == names
    assert len(parts.files) > 2
    assert parts.size == sum(part.stat().st_size for part in parts.files)
    if suffix != ".jsonl":
        assert [cells for part in parts.files for _, cells in read_values(part).rows] == [[n] for n in range(500)]
    assert (tmp_path / f"run-0007{suffix}").read_bytes() == b"older"


def _document(_frame: Frame) -> dict[str, object]:
    return {"text": "x" * 40}


def test_rotation_by_time_and_a_file_behind_others(tmp_path: Path) -> None:
    words = ["log", "run.parquet", "--decode", "--duration", "2.5", "--rotate", "1s"]
    done = dvtcli("--sim", "gen4", "--json", stdin=f"nmt start\n{' '.join(words)}\n", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = documents(done.stdout)[-1]
    files = sorted(tmp_path.glob("run*.parquet"))
    assert len(files) >= 2
    assert told["bytes"] == sum(each.stat().st_size for each in files)
    assert sum(len(list(read_values(each).rows)) for each in files) == told["frames"]
    for suffix, words in ((".parquet", ["-a"]), (".csv", []), (".csv", ["-a"])):
        line = " ".join(["log", f"run{suffix}", "--decode", "--duration", "0.2", *words])
        done = dvtcli("--sim", "gen4", stdin=f"nmt start\n{line}\n", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert {each.name for each in tmp_path.iterdir()} >= {"run.csv", "run-0002.csv", f"run-{len(files) + 1:04}.parquet"}
    with (tmp_path / "run-0002.csv").open(encoding="utf-8") as file:
        assert next(csv.reader(file))[:2] == ["time", "frame"]
    assert next_part(tmp_path / "run.csv").name == "run-0003.csv"


def test_few_values_for_a_long_time_take_little_memory(tmp_path: Path) -> None:
    """A batch a second, of a value each: what waits for its row group is not kept as thousands of arrays."""
    import pyarrow

    writer = WholeFile(tmp_path / "a.parquet", SignalRows(layouts_of(5, [0x2001])), lambda _: {})
    before = pyarrow.total_allocated_bytes()
    for number in range(3_000):
        writer.write(frame(number))
        writer._writer._write_batch()  # type: ignore[attr-defined]
    assert pyarrow.total_allocated_bytes() - before < 2_000_000
    writer.complete()
    assert len(list(read_values(tmp_path / "a.parquet").rows)) == 3_000


@pytest.mark.parametrize("words", [["--rotate", "fast"], ["--rotate", "1kB"], ["--rotate", "10"], ["--rotate", "0.5s"]])
def test_a_rotation_that_is_none_is_said(tmp_path: Path, words: list[str]) -> None:
    done = dvtcli("--sim", "gen4", "log", "run.csv", "--decode", *words, cwd=tmp_path)
    assert (done.returncode, words[1] in done.stderr) == (2, True), done.stderr
    assert not list(tmp_path.iterdir())


def test_frames_are_rotated_by_their_own_option(tmp_path: Path) -> None:
    done = dvtcli("--sim", "gen4", "log", "run.log", "--rotate", "10min", cwd=tmp_path)
    assert (done.returncode, "-s BYTES" in done.stderr) == (2, True)
    done = dvtcli("--sim", "gen4", "log", "run.csv", "--decode", "-s", "5000", cwd=tmp_path)
    assert (done.returncode, "--rotate 100MB" in done.stderr) == (2, True)
