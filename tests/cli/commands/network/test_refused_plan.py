"""A plan that is refused leaves what this session knows of the nodes as it was: their files, families and names."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.bus.devices import unknown
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device

ANOTHER_S = "one: {node_id: 1, dcf: gen4, profile: gen4, tpdo: {1: {mapping: [statusword]}}}\n"
#: its own EDS, and what the device refuses
REFUSED = "one: {node_id: 1, dcf: generic, tpdo: {1: {mapping: [6041, 1008]}}}\n"


@pytest.mark.parametrize("meant", [ANOTHER_S, REFUSED, REFUSED.replace("1008", "no_such_name")])
@pytest.mark.parametrize("met", [True, False])
def test_the_file_that_was_refused_describes_nobody(tmp_path: Path, meant: str, *, met: bool) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(meant)
    with Wire(unknown(1)) as wire, Bench((), {**wire.options, "yes": True, "node": 1}) as bench:
        if met:
            assert bench.run("read 6041").code == 0
        for command in ("plan", "diff", "verify", "apply"):
            assert bench.run(f"{command} {path}").code in (1, 4, 6)
            named = bench.run("objects statusword")
            assert named.code, named.stdout
        assert bench.run("read statusword").code == 2
        assert bench.run("map tpdo1 6041 --dry-run").code == 0, "no other device's EDS is in the way"
        profile = bench.session.node(1).profile.name
    assert profile == "generic"


def test_an_eds_that_was_chosen_before_stays_chosen(tmp_path: Path) -> None:
    path, own = tmp_path / "net.yaml", family_eds("generic")
    path.write_text(f"one: {{node_id: 1, dcf: {own}, tpdo: {{1: {{event_timer: 70}}}}}}\n")
    with Wire(device("generic")) as wire, Bench((), {**wire.options, "yes": True, "node": 1}) as bench:
        assert bench.run(f"plan {path}").code == 0
        path.write_text(ANOTHER_S)
        assert bench.run(f"plan {path}").code == 6
        assert bench.run("read statusword").code == 0
        assert bench.session.network.files.own_eds == {1: own}
        assert bench.session.network.files.own_profile == {}
