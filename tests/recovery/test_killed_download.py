"""A `download` that is killed: the next dvtcli names the file and what the device holds, and loads it anew.

Real processes: the node lives in this one behind a socketcand server, dvtcli in a child that gets SIGKILL.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.simulator.device.boot_loader import FACTORY_PROGRAM
from tests.recovery.bench import Bench

PROGRAM = bytes(count * 7 % 251 for count in range(2000))
#: what the node is sent when it comes: stop, clear, a segment in the middle (it looks like a download), start
HOLDS = {
    1: "the old firmware, which may be stopped",
    2: "the old firmware or none",
    40: "no firmware that is known to be complete",
}


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path, "loader")
    yield made
    made.wire.close()


#: behind a kill in the middle of the segments the next one waits for as long as the product has patience
@pytest.mark.parametrize("number", [1, 2, pytest.param(40, marks=pytest.mark.long)])
def test_the_next_one_says_what_was_interrupted_and_begins_anew(bench: Bench, number: int, tmp_path: Path) -> None:
    file, loader = tmp_path / "fw.bin", bench.wire.device.loader
    file.write_bytes(PROGRAM)
    assert loader is not None
    bench.killed(number, "download", str(file), "--yes")
    with bench.wire.at_work:
        assert loader.program == (None if number == 40 else loader.program)
    code, _, stderr = bench.run("read", "1000")
    said = " ".join(stderr.split())
    assert code == 0, stderr
    assert f"the download of {file} into node 5 was not completed" in said
    assert f"it holds {HOLDS[number]}" in said
    code, stdout, stderr = bench.run("download", str(file), "--yes", "--expect", "crc32")
    assert code == 0, stderr
    assert "as expected" in stdout
    with bench.wire.at_work:
        assert loader.program == PROGRAM
    assert "was not completed" not in bench.run("read", "1000")[2]


def test_while_another_dvtcli_is_at_it_nothing_was_interrupted(bench: Bench, tmp_path: Path) -> None:
    file, loader = tmp_path / "fw.bin", bench.wire.device.loader
    file.write_bytes(PROGRAM)
    said: list[str] = []

    def look(count: int) -> None:
        if count == 2:
            said.extend(path.read_text() for path in (tmp_path / "programs").iterdir())

    bench.wire.at_download = look
    assert bench.run("download", str(file), "--yes")[0] == 0
    assert str(file) in said[0]
    assert not list((tmp_path / "programs").iterdir())
    assert loader is not None
    assert loader.program != FACTORY_PROGRAM
