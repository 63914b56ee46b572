"""SYNC goes out with the CAN-ID that the node listens for."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device

SETUP = ("map tpdo1 6041 --cob-id 0x181 --sync 1", "write 1005 0xA0")


def test_sync_is_sent_as_the_selected_node_wants_it() -> None:
    with Bench(("generic",)) as bench:
        for line in (*SETUP, "nmt start"):
            assert bench.run(f"{line} --yes").code == 0, line
        ran = bench.run("sync")
        assert "with CAN-ID 0x0A0" in ran.stdout
        assert "1 frame came" in ran.stdout
        assert bench.run("sync --json").document["cob_id"] == 0xA0
        ran = bench.run("verify tpdo1 --frame --yes")
        assert "no frame" not in ran.stdout
        assert "on the bus  TPDO1: 0x181" in ran.stdout


def test_sync_is_0x080_where_nobody_says_otherwise() -> None:
    with Wire(device("generic", 1)) as wire:
        for options in ({"node": None}, {"node": 9, "timeout": 0.05}):
            with Bench((), {**wire.options, **options}) as bench:
                wire.frames()
                ran = bench.run("sync")
                assert ran.code == 0, ran.stderr
                assert "CAN-ID" not in ran.stdout
                assert [one.arbitration_id for one in wire.frames() if one.arbitration_id < 0x100] == [0x080]


def test_that_nobody_produces_it_is_a_warning_until_somebody_does() -> None:
    with Bench(("gen4",)) as bench:
        checked = bench.run("sync --check --json")
        (said,) = checked.document["findings"]
        assert (checked.code, said["rule"], said["severity"]) == (0, "sync-producer", "warning")
        for line in ("write 1006 20000", "write 1005 0x40000080"):
            assert bench.run(f"{line} --yes").code == 0, line
        checked = bench.run("sync --check --json")
        assert checked.document["produced"] is True
        assert "sync-producer" not in checked.stdout


def test_its_hint_makes_a_node_the_producer() -> None:
    """The commands of the hint run as they are printed: the period first where there is none."""
    with Bench(("generic@5", "generic@7")) as bench:
        (said,) = bench.run("sync --check --json").document["findings"]
        lines = re.findall(r"`(.*?)`", said["hint"])
        assert [line.partition(" write ")[2] for line in lines[:2]] == ["1006 20000", "1005 0x40000080"]
        for line in lines[:2]:
            assert bench.run(f"{line} --yes").code == 0, line
        assert bench.run("sync --check --json").document["produced"] is True


@pytest.mark.parametrize("value", ["0x702", "0x000", "0x5A1", "0x03A", "0x7E5"])
@pytest.mark.parametrize("index", ["1005", "1014"])
def test_a_restricted_can_id_of_a_service_is_refused_by_write_as_by_apply(
    index: str, value: str, tmp_path: Path
) -> None:
    """A node's own backup with such a value was refused, which a plain write had let in."""
    file = tmp_path / "node.jsonl"
    with Bench(("generic@5",), {"yes": True}) as bench:
        ran = bench.run(f"write {index} {value}")
        assert ran.code == 1
        assert f"rule    can-id-restricted at 0x{index}:00" in ran.stderr
        assert bench.run(f"write {index} {value} --force").code == 0
        assert bench.run(f"backup {file}").code == 0
    with Bench(("generic@5",), {"yes": True}) as bench:
        assert bench.run(f"apply {file}").code == 1, "the same judge"
