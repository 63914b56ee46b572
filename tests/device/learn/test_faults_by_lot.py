"""Faults and kills in the middle of `learn`, drawn by lot over families and steps; `--learn N` says how many.

After each the device is as it was, or exit code 7 and a journal say that it is not, and `recover` puts it back.
"""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.device.learn.test_faults import FINE
from tests.device.learn.test_killed import dump as held_by
from tests.device.learn.test_learnt_families import FAMILIES, dump
from tests.device.learn.virtual import own
from tests.process import PATIENCE_S
from tests.recovery.bench import Bench as Outside

WORDS = {
    "refuse": "refuse@{k}=0x08000022",
    "lose-request": "lose-request@{k}",
    "lose-response": "lose-response@{k}",
    "reset": "reset@{k}=0.05",
}
ENDS = ("kill", "cut")
#: What most families are written at least; a later one finds `learn` done.
STEPS = 240


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Families in turn, the rest by lot: the same in every process of a run, another for another number."""
    count = metafunc.config.getoption("--learn")
    kinds = [*WORDS] if "word" in metafunc.fixturenames else [*ENDS]
    lot = random.Random(f"{count} {kinds}")
    count = count if "word" in metafunc.fixturenames else max(1, count // 2)
    cells = [(FAMILIES[n % len(FAMILIES)], lot.choice(kinds), lot.randint(1, STEPS)) for n in range(count)]
    ids = [f"{family} {kind} {step}, {n}" for n, (family, kind, step) in enumerate(cells)]
    metafunc.parametrize(("family", "word" if "word" in metafunc.fixturenames else "end", "step"), cells, ids=ids)


@pytest.mark.counted
def test_a_fault_leaves_nothing_behind(family: str, word: str, step: int) -> None:
    with own(family) as clean:
        before = dump(clean)
    with own(family, {"fault": (WORDS[word].format(k=step),)}) as bench:
        ran = bench.run("learn --yes --json")
        assert ran.code in FINE, ran
        assert not ran.code or ran.document["state"] == "rolled_back", ran
        assert dump(bench) == before


@pytest.mark.counted
def test_recover_puts_back_what_was_cut_short(family: str, end: str, step: int, tmp_path: Path) -> None:
    """A `learn` that gets SIGKILL, or whose bus is gone, in a process of its own."""
    bench = Outside(tmp_path, family)
    try:
        before = held_by(bench)

        def cut_short(number: int) -> None:
            if number == step and end == "kill":
                child.kill()
                child.wait()
            elif number == step:
                bench.wire.hang_up()

        with bench.wire.at_work:
            child = bench.start("learn", "--yes")
            bench.wire.at_download = cut_short
        _, stderr = child.communicate(timeout=PATIENCE_S)
        bench.wire.at_download = lambda _number: None
        if child.returncode:
            assert child.returncode == {"kill": -9, "cut": 7}[end], stderr
            assert len(bench.journals()) == 1
            code, _, stderr = bench.run("recover", "--yes")
            assert code == 0, stderr
        assert held_by(bench) == before
        assert not bench.journals()
    finally:
        bench.wire.close()
