"""A `learn` that is killed leaves a journal, and `recover` puts back what it had changed, behind the counts, too."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.domain.store import Stamp
from dvtcli.simulator.device.memory import Refusal
from tests.device.learn.cells import some
from tests.device.learn.test_learnt_families import OF_THE_DEVICE
from tests.process import PATIENCE_S
from tests.recovery.bench import Bench


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    yield made
    made.wire.close()


@pytest.fixture
def stamped(tmp_path: Path) -> Iterator[Bench]:
    """Of a family that has 0x1020."""
    made = Bench(tmp_path, "generic")
    yield made
    made.wire.close()


def dump(bench: Bench) -> dict[tuple[int, int], bytes]:
    """Every object that the device holds."""
    device = bench.wire.device
    held = {}
    with bench.wire.at_work:
        for entry in device.dictionary.entries():
            if (entry.index, entry.sub_index) not in OF_THE_DEVICE:
                try:
                    held[entry.index, entry.sub_index] = device.value(entry.index, entry.sub_index)
                except Refusal:
                    continue
    return held


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    some(metafunc, "step", (2, 9, 40, 120, 250), 0.25)


@pytest.mark.counted
def test_recover_puts_back_what_a_killed_learn_changed(bench: Bench, step: int) -> None:
    before = dump(bench)
    bench.killed(step, "learn", "--yes")
    assert len(bench.journals()) == 1
    told = " ".join(bench.run("read", "1000")[2].split())
    assert "which asked TPDO5, RPDO5, TPDO4, RPDO1 of node 5, was interrupted: `dvtcli " in told
    assert "recover` rolls back to the old configuration" in told
    question = " ".join(bench.run("recover")[2].split()).partition("error: no terminal to answer on: ")[2]
    written, _, compared = question.rpartition("already as before the interrupted learning, compared only: ")
    assert set(re.findall("[TR]PDO\\d", written)) <= {"TPDO5", "RPDO5"}, "only what was written"
    assert set(re.findall("[TR]PDO\\d", question)) == {"TPDO5", "RPDO5", "TPDO4", "RPDO1"}
    assert "of node 5; recover?" in compared
    code, stdout, stderr = bench.run("recover", "--yes")
    assert code == 0, stderr
    named, _, rest = stdout.splitlines()[-1].partition(" rolled back: ")
    if rest:
        assert set(named.split(", ")) <= {"TPDO5", "RPDO5"}, "only what was written"
        assert re.search(r"\d more PDOs? (is|are) as before", rest)
    else:
        assert named.endswith("are already as requested; nothing was written.")
    assert dump(bench) == before
    assert not bench.journals()


@pytest.mark.long
@pytest.mark.parametrize("stamp", [Stamp.of("a file"), Stamp(15_000, 1)], ids=["ours", "another's"])
def test_recover_puts_a_stamp_back_that_is_not_ours(stamped: Bench, stamp: Stamp) -> None:
    """Ours says what a file wanted, which nobody has looked at again: the next `apply` sets it."""
    with stamped.wire.at_work:
        for sub_index in (1, 2):
            stamped.wire.device.set_value(0x1020, sub_index, stamp.data(sub_index))
    before = dump(stamped)
    stamped.killed(40, "learn", "--yes")
    assert [dump(stamped)[0x1020, sub_index] for sub_index in (1, 2)] == [bytes(4)] * 2, "a write clears it"
    code, _, stderr = stamped.run("recover", "--yes")
    assert code == 0, stderr
    ours = Stamp.of("a file") == stamp
    after = {**before, **{(0x1020, sub_index): bytes(4) for sub_index in (1, 2)}} if ours else before
    assert dump(stamped) == after
    assert not stamped.journals()


def test_a_ctrl_c_puts_everything_back(bench: Bench) -> None:
    import signal

    before = dump(bench)
    with bench.wire.at_work:
        child = bench.start("learn", "--yes")
        bench.wire.at_download = lambda number: child.send_signal(signal.SIGINT) if number == 50 else None
    _, stderr = child.communicate(timeout=PATIENCE_S)
    assert child.returncode == 130, stderr
    assert "rolled back" in stderr
    assert dump(bench) == before
    assert not bench.journals()
