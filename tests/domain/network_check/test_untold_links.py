"""Links of nodes that no EDS and no family describes: both ends have one CAN-ID, as `apply` will make it."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.operations.network.described_network import described_network
from tests.cli.commands.bench import Bench

FILE = """
nodes:
  drive:
    node_id: 1
    {first}
    heartbeat_producer: 200
    tpdo: {{1: {{mapping: [6041, 606C], event_timer: 20, inhibit_ms: 10}}}}
  io:
    node_id: 2
    {second}
    rpdo: {{1: {{mapping: [3000:01]}}}}
links:
  - {{from: drive:tpdo1, to: io:rpdo1}}
"""
WRONG = {"rpdo-without-producer", "tpdo-without-consumer", "unwatched-link", "link-length"}


@pytest.mark.parametrize("first", ["", "profile: gen4"])
@pytest.mark.parametrize("second", ["", "profile: generic"])
def test_a_link_is_none_that_nobody_sends_or_takes(first: str, second: str, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(FILE.format(first=first, second=second))
    with Bench(()) as bench:
        ran = bench.run(f"check {path} --json")
        of_link = [
            one for one in ran.document["files"][0]["findings"]
            if one["rule"] in WRONG and (one["node"], one["pdo"]) in ((1, "tpdo1"), (2, "rpdo1"))
        ]  # fmt: skip
        assert (ran.code, of_link) == (0, [])
        loaded = bench.run(f"load {path}")
        assert loaded.code == 0
        assert "2:rpdo1 receive" not in loaded.stdout


def test_the_can_id_is_what_the_file_says_of_the_tpdo(tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(FILE.format(first="", second="").replace("event_timer", "cob_id: 0x3A1, event_timer"))
    state = described_network(str(path))
    assert {config.communication.cob_id.can_id for node in state.nodes for config in node.pdos.values()} == {0x3A1}
    assert state.undescribed == (1, 2)
