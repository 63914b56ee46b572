"""A dvtcli that is killed while it changes an odd PDO: `recover` puts back what the device takes, and says what not.

Real processes, as in `test_killed`: the child gets SIGKILL at each SDO download in turn.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.prompt.wire import Wire
from tests.recovery.bench import Bench
from tests.small_eds import INPUTS, Eds, communication, mapping, plain

FIRST = INPUTS << 16 | 0x0108
NOTHING = "nothing to recover: no change of this node was interrupted\n"


def count_above() -> Eds:
    """TPDO2 enabled, with a count above its entries."""
    eds = plain()
    eds.record(0x1801, "Communication 2", communication("$NODEID+0x280"))
    eds.record(0x1A01, "Mapping 2", mapping(9, [FIRST, FIRST + 0x100]))
    return eds


def without_mapping() -> Eds:
    """TPDO2 enabled, and nothing says what it carries."""
    eds = count_above()
    del eds.objects[0x1A01]
    return eds


def on(folder: Path, eds: Eds) -> Bench:
    path = folder / "odd.eds"
    path.write_text(eds.text())
    bench = Bench(folder)
    bench.wire.close()
    bench.wire = Wire(family="generic", eds=path)
    bench.words[bench.words.index("--eds") + 1] = str(path)
    bench.words[bench.words.index("--bus-kwargs") + 3] = f"port={bench.wire.port}"
    return bench


@pytest.mark.parametrize("step", [1, 2, 3, 4, 5])
def test_a_count_above_the_entries(tmp_path: Path, step: int) -> None:
    bench = on(tmp_path, count_above())
    try:
        before = bench.pdos()
        bench.killed(step, "map", "tpdo2", "6000:3")
        assert bench.pdos() != before
        code, stdout, stderr = bench.run("recover", "--yes")
        if bench.pdos() == before:
            assert code == 0, stderr
        else:
            assert code == 1, stderr
            assert "TPDO2 was inconsistent, and the device refuses that configuration" in stderr
            assert "NOT undone completely" in stdout
        assert (bench.pdos() == before) is (step == 1), "a count that was written is not rolled back"
        assert bench.journals() == []
        assert bench.run("recover")[:2] == (0, NOTHING)
    finally:
        bench.wire.close()


def test_half_a_pdo_that_could_not_be_enabled_again(tmp_path: Path) -> None:
    bench = on(tmp_path, without_mapping())
    try:
        bench.killed(1, "disable", "tpdo2")
        code, stdout, stderr = bench.run("--json", "recover", "--yes")
        document, error = map(json.loads, stdout.splitlines())
        assert (error["exit_code"], error["state"]) == (1, "left_changed")
        assert (code, document["verified"], document["state"]) == (1, False, "left_changed"), stderr
        (text,) = document["not_put_back"]
        assert "the device refuses that configuration" in text
        assert bench.journals() == []
        assert bench.run("recover")[:2] == (0, NOTHING)
    finally:
        bench.wire.close()
