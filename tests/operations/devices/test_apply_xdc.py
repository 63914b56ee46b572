"""`apply x.xdc`: what a DCF of the same node says, and on a device what that does."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from tests.bus.devices import dictionary
from tests.cli.commands.bench import Bench, beside
from tests.operations.devices.test_apply_file import EVERYTHING, _lines, run_or_force
from tests.operations.devices.test_export_dcf import FAMILIES
from tests.simulator.bench import booted


@settings(max_examples=max(1, settings().max_examples // 20), phases=(Phase.explicit, Phase.generate))
@given(st.data())
def test_a_dcf_and_an_xdc_of_one_node_are_one_plan_and_make_one_device(data: st.DataObject) -> None:
    """Whatever was changed on the node; on a bus that others use, where changes are journalled and the node stays."""
    family = data.draw(st.sampled_from(FAMILIES))
    with TemporaryDirectory() as folder:
        files = [Path(folder) / f"node.{form}" for form in ("dcf", "xdc")]
        with Bench((f"{family}@5",)) as bench:
            for line in data.draw(st.lists(_lines(bench), min_size=1, max_size=6)):
                bench.run(line)
            assert [bench.run(f"export {file}").code for file in files] == [0, 0]
        by_dcf, by_xdc = (applied(family, file) for file in files)
        assert by_xdc == by_dcf


def applied(family: str, file: Path) -> tuple[Any, ...]:
    """What is planned for a fresh node, what `apply` says it did, and every value that the node holds then."""
    device = booted(family, 5)
    if dictionary(family).entry(0x6041, 0):
        device.set_value(0x6041, 0, b"\x31\2")  # ready to switch on: it cannot move
    with Bench((), {"journal": file.with_suffix("")}, beside([device])) as bench:
        _, plan = run_or_force(bench, f"plan {file} {EVERYTHING}")
        planned = bench.run(f"{plan} --json").document
        ran = bench.run(f"{plan.replace('plan', 'apply', 1)} --yes --json")
        assert ran.code == 0, ran.stdout + ran.stderr
        assert ran.document["changed"] is bool(planned["changed"])
        assert bench.run(f"verify {file} --json").code == 0
        known = bench.session.node(5).dictionary
        assert known is not None
        held = {entry.object: device.value(entry.index, entry.sub_index) for entry in known.entries()}
    said = json.dumps(planned["nodes"]).replace(str(file), "FILE").replace(file.name, "FILE")
    return json.loads(said), ran.document["writes"], held
