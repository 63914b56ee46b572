"""Files of values that cannot be written or read to their end: what was there before stays, what is kept is named."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import IO

import pytest

from dvtcli.files.values.value_file import read_values
from tests.files.test_value_files import of_parquet
from tests.process import PATIENCE_S, dvtcli
from tests.simulator.serve.served import own_environment, wait_for
from tests.small_disk import fill, on_small_disk
from tests.small_recording import ramp

pytestmark = [pytest.mark.drawn(6, "unfinished values")]
FORMS = [pytest.param(suffix, marks=of_parquet(suffix)) for suffix in (".csv", ".jsonl", ".parquet")]


def logging(folder: Path, home: Path, file: str, *words: str) -> subprocess.Popen[str]:
    """`log` of the values of a simulated node, a process of its own in *folder*."""
    process = subprocess.Popen(
        [sys.executable, "-m", "dvtcli", "--sim", "gen4"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8",
        env=own_environment(home), cwd=folder,
    )  # fmt: skip
    given(process.stdin).write(f"nmt start\n{' '.join(('log', file, '--decode', *words))}\n")
    given(process.stdin).close()
    process.stdin = None
    return process


def given(stream: IO[str] | None) -> IO[str]:
    assert stream is not None
    return stream


@pytest.mark.parametrize("suffix", FORMS)
@pytest.mark.parametrize("is_rotated", [False, True])
def test_a_disk_that_becomes_full_ends_a_recording_and_what_is_kept_is_named(
    tmp_path: Path, suffix: str, is_rotated: bool
) -> None:
    disk = tmp_path / "disk"

    def record() -> None:
        words = ["--rotate", "1s"] if is_rotated else ["--rotate", "1h"]
        process = logging(disk, tmp_path, f"run{suffix}", *words, "--duration", "60")
        first = disk / f"run{suffix}" if suffix != ".parquet" or is_rotated else disk / "_run.arrows"
        wait_for(lambda: first.exists() and first.stat().st_size > 300, "values on the disk")
        fill(disk)
        stdout, stderr = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 1, stderr + stdout
        assert "No space left on device after" in stderr, stderr
        assert "Traceback" not in stderr
        if suffix == ".parquet" and not is_rotated:
            assert "the next log into run.parquet completes run.parquet" in stderr
            assert not (disk / "_run.parquet.part").exists()
        else:
            assert f"what was recorded is in run{suffix}" in stderr, stderr
        if suffix != ".parquet" or is_rotated:
            assert first.stat().st_size > 300
        if suffix == ".parquet":
            for whole in disk.glob("run*.parquet"):
                assert list(read_values(whole).rows)

    if wrong := on_small_disk(disk, record, size=300_000):
        pytest.fail(wrong)


@pytest.mark.parametrize("suffix", FORMS)
def test_a_full_disk_begins_no_recording(tmp_path: Path, suffix: str) -> None:
    disk = tmp_path / "disk"

    def record() -> None:
        fill(disk)
        process = logging(disk, tmp_path, f"run{suffix}", "--duration", "1")
        _, stderr = process.communicate(timeout=PATIENCE_S)
        assert (process.returncode, "No space left on device" in stderr) == (1, True), stderr
        assert not list(disk.glob("*run*"))

    if wrong := on_small_disk(disk, record, size=300_000):
        pytest.fail(wrong)


@pytest.mark.parametrize("suffix", FORMS)
def test_decode_of_a_damaged_recording_leaves_the_old_file(tmp_path: Path, suffix: str) -> None:
    ramp(tmp_path / "run.log")
    with (tmp_path / "run.log").open("a") as file:
        file.write("(1.0) can0 281#XY\n")
    target = tmp_path / f"values{suffix}"
    for number, kept in enumerate(("values-until-damage", "values-until-damage-0002")):
        if number:
            target.write_bytes(b"what was there")
        done = dvtcli("--yes", "decode", "run.log", "--eds", "gen4", "-o", target.name, cwd=tmp_path)
        assert done.returncode == 4, done.stderr
        assert "run.log:51" in done.stderr
        assert f"{target.name} is not written; the 50 frames before the damage are in {kept}{suffix}" in done.stderr
        assert len(list(read_values(tmp_path / f"{kept}{suffix}").rows)) == 50
        assert target.exists() == bool(number)
        assert not number or target.read_bytes() == b"what was there"
        assert not list(tmp_path.glob("_*"))


@pytest.mark.parametrize("suffix", FORMS)
def test_decode_on_a_full_disk_leaves_the_old_file(tmp_path: Path, suffix: str) -> None:
    disk = tmp_path / "disk"
    ramp(tmp_path / "run.log", 20_000)

    def decode() -> None:
        (disk / f"a{suffix}").write_bytes(b"what was there")
        words = ["--yes", "decode", str(tmp_path / "run.log"), "--eds", "gen4", "-o", str(disk / f"a{suffix}")]
        done = subprocess.run(
            [sys.executable, "-m", "dvtcli", *words],
            check=False, capture_output=True, encoding="utf-8", env=own_environment(tmp_path),
        )  # fmt: skip
        assert (done.returncode, "No space left on device after" in done.stderr) == (1, True), done.stderr
        assert [(each.name, each.read_bytes()) for each in disk.iterdir()] == [(f"a{suffix}", b"what was there")]

    if wrong := on_small_disk(disk, decode, size=100_000):
        pytest.fail(wrong)


def test_decode_says_what_it_counts(tmp_path: Path) -> None:
    ramp(tmp_path / "run.log")
    done = dvtcli("decode", "run.log", "--eds", "gen4", "-o", "a.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("a.csv: 50 frames, "), done.stdout
