"""Two enabled producers of one CAN-ID are refused on whichever nodes they are, as far as the session knows them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench, beside
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy

TWO = ("generic@1", "generic@3")


def test_a_second_producer_on_another_node_is_refused_before_any_write() -> None:
    with Bench(TWO) as bench:
        assert bench.run("map 1:tpdo1 6041 --cob-id 0x181").code == 0
        held = bench.session.node(3).pdos()
        ran = bench.run("map 3:tpdo2 6041 --cob-id 0x181 --json")
        assert ran.code == 1
        assert ran.document["error"] == "rules"
        assert ran.document["state"] == "unchanged"
        assert "already sent by TPDO1 of node 1" in ran.document["text"]
        assert bench.session.node(3).pdos() == held


@pytest.mark.parametrize("line", ["set 3:tpdo2 --cob-id 0x181", "write 1801:1 0x181", "enable 3:tpdo2"])
def test_so_it_is_by_every_way_to_a_cob_id(line: str) -> None:
    with Bench(TWO) as bench:
        assert bench.run("node 3").code == 0
        if not line.startswith("set"):
            assert bench.run("disable tpdo2").code == 0
        if line.startswith("enable"):
            assert bench.run("set tpdo2 --cob-id 0x181").code == 0
        bench.run("pdo 1:tpdo1")
        ran = bench.run(line)
        assert ran.code == 1, ran.stdout
        assert "TPDO1 of node 1" in ran.stderr


def test_a_simulated_node_counts_before_anybody_has_looked_at_it() -> None:
    with Bench(TWO) as bench:
        ran = bench.run("map 3:tpdo2 6041 --cob-id 0x181")
        ran.failed(1, "already sent by TPDO1 of node 1")


@pytest.mark.parametrize("judge", ["plan", "diff", "verify", "apply"])
@pytest.mark.parametrize("cob_id", ["0x181", "0x80", "0x691"])
def test_a_node_that_a_network_file_does_not_name_counts(judge: str, cob_id: str, tmp_path: Path) -> None:
    file = tmp_path / "net.yml"
    file.write_text("a: {node_id: 3, dcf: generic, tpdo: {2: {event_timer: 50}}}\n", "utf-8")
    with Bench((), {"yes": True}, beside([device("generic", 1), device("generic", 3)])) as bench:
        for line in ("read 1:1000", f"map 3:tpdo2 6041 --cob-id {cob_id} --timer 50 --force"):
            assert bench.run(line).code == 0, line
        assert bench.run(f"{judge} {file}").code == int(cob_id != "0x691")
        if judge in {"plan", "apply"}:
            assert bench.run(f"{judge} {file} --force").code == 0


def test_force_sends_it() -> None:
    with Bench(TWO) as bench:
        assert bench.run("map 1:tpdo1 6041 --cob-id 0x181").code == 0
        assert bench.run("map 3:tpdo2 6041 --cob-id 0x181 --force").code == 0


def test_what_the_other_node_holds_now_counts_not_what_was_set_once() -> None:
    with Bench(TWO) as bench:
        assert bench.run("map 1:tpdo1 6041 --cob-id 0x6A0").code == 0
        assert bench.run("nmt reset-node 1").code == 0
        assert bench.run("map 3:tpdo2 6041 --cob-id 0x6A0").code == 0, "the reset took it back to 0x181"
        assert bench.run("set 3:tpdo2 --cob-id 0x181").code == 1


def test_a_consumer_a_disabled_producer_and_29_bits_are_no_clash() -> None:
    with Bench(TWO) as bench:
        assert bench.run("map 1:tpdo1 6041 --cob-id 0x181").code == 0
        assert bench.run("set 3:rpdo1 --cob-id 0x181").code == 0
        assert bench.run("map 3:tpdo2 6041 --cob-id 0x181 --off").code == 0
        assert bench.run("map 3:tpdo3 6041 --cob-id 0x181 --extended").code == 0


def test_auto_takes_a_can_id_that_no_known_node_sends() -> None:
    with Bench(TWO) as bench:
        assert bench.run("map 1:tpdo1 6041 --cob-id 0x183 --force").code == 0
        assert bench.run("map 3:tpdo1 6041 --cob-id auto").code == 0
        (row,) = bench.run("pdo 3:tpdo1 --json").document["pdos"]
        assert row["cob_id"] == 0x680


@heavy
def test_the_twins_know_the_nodes_that_were_met_before() -> None:
    with Bench(TWO) as bench:
        assert bench.run("map 1:tpdo1 6041 --cob-id 0x181").code == 0
        assert bench.run("map 3:tpdo2 6041 --cob-id 0x181 --dry-run").code == 1


def test_a_silent_neighbour_is_no_hindrance() -> None:
    with Bench(TWO, {"timeout": 0.05}) as bench:
        assert bench.run("map 1:tpdo1 6041 --cob-id 0x181").code == 0
        assert bench.run("nmt stop 1").code == 0
        assert bench.run("map 3:tpdo2 6041 --cob-id 0x6A1").code == 0
        ran = bench.run("set 3:tpdo2 --cob-id 0x181")
        assert ran.code == 1, "what it was last known to send counts as long as it says nothing else"


def test_what_another_dvtcli_set_on_the_other_node_since_counts_too() -> None:
    two = Wire(device("generic", 1), device("generic", 2))
    with two as wire, Bench((), {**wire.options, "yes": True}) as bench:
        for line in ("node 2", "pdo", "node 1"):
            assert bench.run(line).code == 0
        with Bench((), {**wire.options, "node": 2, "yes": True}) as other:
            assert other.run("set tpdo1 --cob-id 0x1F0").code == 0
        ran = bench.run("set tpdo1 --cob-id 0x1F0 --json")
        assert (ran.code, ran.document["state"]) == (1, "unchanged")
        assert "already sent by TPDO1 of node 2" in ran.document["text"]
        assert bench.run("set tpdo1 --cob-id 0x182").code == 0, "node 2 has left it"
