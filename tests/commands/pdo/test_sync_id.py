"""SYNC goes out with the CAN-ID that the node listens for."""

from __future__ import annotations

from tests.commands.bench import Bench
from tests.commands.bus import Wire, device

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
