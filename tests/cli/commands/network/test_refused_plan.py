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


@pytest.mark.parametrize("command", ["plan", "diff", "apply"])
def test_a_node_that_is_not_the_device_of_its_file_is_named_with_the_line(tmp_path: Path, command: str) -> None:
    path = tmp_path / "net.yaml"
    path.write_text("one:\n  node_id: 1\n  dcf: generic\n  identity: {vendor: 0x1E, product: 9}\n")
    with Bench(("gen4",), {"yes": True}) as bench:
        ran = bench.run(f"{command} {path} --json")
        assert (ran.code, ran.document["file"]) == (6, f"{path}:4:28")
        assert ran.document["text"].startswith(f"{path}:4:28: another device than the file describes: ")
        (also,) = ran.document["also"]
        assert also.startswith(f"{path}:3:8: the EDS is another device's: generic.eds is about product ")
        path.write_text("one:\n  node_id: 1\n  dcf: generic\n")
        ran = bench.run(f"{command} {path} --json")
        assert (ran.code, ran.document["file"]) == (6, f"{path}:3:8")
        assert "name the EDS of this device with dcf:" in ran.document["hint"]
