"""An RPDO that nobody feeds is worth a warning on a family that then reports a fault."""

from __future__ import annotations

import pytest

from tests.cli.commands.bench import Bench


def rules(bench: Bench, line: str) -> list[str]:
    ran = bench.run(f"{line} --json")
    assert ran.code == 0, ran.stdout
    return [finding["rule"] for finding in ran.document["findings"]]


def test_enabling_an_rpdo_that_no_known_node_sends_warns() -> None:
    with Bench(("gen4@1", "tmcm@2")) as bench:
        assert "rpdo-producer" in rules(bench, "map rpdo1 6040 --cob-id 0x182")
        assert "rpdo-producer" not in rules(bench, "set rpdo1 --type 1")
        assert bench.run("disable rpdo1").code == 0
        assert bench.run("node 2").code == 0
        assert bench.run("pdo").code == 0
        assert bench.run("node 1").code == 0
        assert "rpdo-producer" not in rules(bench, "enable rpdo1")


def test_a_producer_that_this_session_set_counts() -> None:
    with Bench(("gen4@1", "tmcm@2")) as bench:
        assert bench.run("node 2").code == 0
        assert bench.run("set tpdo1 --cob-id 0x2A0").code == 0
        assert bench.run("node 1").code == 0
        assert "rpdo-producer" not in rules(bench, "map rpdo1 6040 --cob-id 0x2A0")


@pytest.mark.parametrize("family", ["generic", "tmcm", "roboteq"])
def test_other_families_do_not_mind(family: str) -> None:
    with Bench((family,)) as bench:
        assert "rpdo-producer" not in rules(bench, "set rpdo1 --cob-id 0x2A0")
