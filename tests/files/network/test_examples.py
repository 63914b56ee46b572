"""Every network file of `examples/` is checked, planned and applied; then its plan is empty."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.process import ROOT

#: which simulated nodes an example is about
NODES = {
    "bus.yml": ("generic@2", "generic@3"),
    "first.yaml": ("gen4@1", "generic@5"),
    "line.yaml": ("gen4@1", "generic@5"),
    "press.yaml": ("gen4@1", "tmcm@5"),
    "stamped.yaml": ("generic@5", "generic@9"),
    "traction.yaml": ("gen4@1", "generic@5", "generic@9"),
}
#: one that `check` is shown with, and one that only says which node-IDs nodes get
OTHERS = ("faulty.yaml", "lift.yaml")
EXAMPLES = sorted(path.name for path in (ROOT / "examples").glob("*.y*ml") if path.name not in OTHERS)


@heavy
@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_checked_applied_and_plans_empty(name: str, tmp_path: Path) -> None:
    file = ROOT / "examples" / name
    with Bench(NODES[name], {"yes": True}) as bench:
        assert bench.run(f"check {file}").code == 0
        ran = bench.run(f"plan {file} -o {tmp_path / 'plan.json'}")
        assert ran.code == 0, ran.stderr
        assert bench.run(f"diff {file}").code == 3
        applied = bench.run(f"apply {tmp_path / 'plan.json'}")
        assert applied.code == 0, applied.stderr
        for word in ("diff", "verify"):
            assert bench.run(f"{word} {file}").code == 0
        again = bench.run(f"apply {file} --json").document
        assert (again["writes"], again["stored"]) == (0, [])
