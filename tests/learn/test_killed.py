"""A `learn` that is killed leaves a journal, and `recover` puts back what it had changed, behind the counts, too."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.simulator.device.refusal import Refusal
from tests.learn.test_learnt_families import OF_THE_DEVICE
from tests.recovery.test_killed import Bench


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
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


@pytest.mark.parametrize("step", [2, 9, 40, 120, 250])
def test_recover_puts_back_what_a_killed_learn_changed(bench: Bench, step: int) -> None:
    before = dump(bench)
    child = bench.start("learn", "--yes")

    def kill(number: int) -> None:
        if number == step:
            child.kill()
            child.wait()

    bench.wire.at_download = kill
    child.communicate(timeout=120)
    assert child.returncode == -9
    bench.wire.at_download = lambda _number: None
    assert len(bench.journals()) == 1
    code, _, stderr = bench.run("recover", "--yes")
    assert code == 0, stderr
    assert dump(bench) == before
    assert not bench.journals()


def test_a_ctrl_c_puts_everything_back(bench: Bench) -> None:
    import signal

    before = dump(bench)
    child = bench.start("learn", "--yes")
    bench.wire.at_download = lambda number: child.send_signal(signal.SIGINT) if number == 50 else None
    _, stderr = child.communicate(timeout=120)
    assert child.returncode == 130, stderr
    assert "rolled back" in stderr
    assert dump(bench) == before
    assert not bench.journals()
