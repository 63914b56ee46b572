"""`undo` takes back the last change of the session, whichever node it was on; `undo --all` those of every node."""

from __future__ import annotations

from pathlib import Path

from dvtcli.device.change.applied import Progress
from dvtcli.domain.nmt import NmtCommand
from tests.cli.commands.bench import Bench

TWO = ("generic@1", "generic@3")


def test_the_last_change_is_undone_whichever_node_it_was_on() -> None:
    with Bench(TWO) as bench:
        before = {node_id: bench.session.node(node_id).pdos() for node_id in (1, 3)}
        assert bench.run("map 3:tpdo1 6041 606C").code == 0
        assert bench.run("set 1:tpdo2 --timer 40").code == 0
        assert bench.run("map 3:tpdo3 6041 --cob-id 0x6A3").code == 0
        first = bench.run("undo --json").document
        assert (first["node"], first["pdos"]) == (3, ["tpdo3"])
        second = bench.run("undo")
        assert second.code == 0
        assert "TPDO2 of node 1 rolled back" in second.stdout
        third = bench.run("undo --json").document
        assert (third["node"], third["pdo"]) == (3, "tpdo1")
        assert {node_id: bench.session.node(node_id).pdos() for node_id in (1, 3)} == before
        assert bench.run("undo").code == 2


def test_all_of_every_node_in_one_document() -> None:
    with Bench(TWO) as bench:
        before = {node_id: bench.session.node(node_id).pdos() for node_id in (1, 3)}
        for line in ("map 3:tpdo1 6041 606C", "set 1:tpdo2 --timer 40", "map 3:tpdo3 6041 --cob-id 0x6A3"):
            assert bench.run(line).code == 0
        document = bench.run("undo --all --json").document
        assert document["schema"] == "dvtcli.change/1"
        assert (document["node"], document["pdo"], document["verified"]) == (None, None, True)
        assert set(document["pdos"]) == {"3:tpdo1", "3:tpdo3", "1:tpdo2"}
        assert {step["node"] for step in document["steps"]} == {1, 3}
        assert document["writes"] == len(document["steps"]) == sum(one["writes"] for one in document["nodes"])
        assert {node_id: bench.session.node(node_id).pdos() for node_id in (1, 3)} == before
        assert bench.run("undo --all").code == 2
        assert bench.session.record.lines == []


def test_what_somebody_else_changed_since_is_not_overwritten() -> None:
    with Bench(("generic",)) as bench:
        assert bench.run("map tpdo1 6041 606C").code == 0
        sdo = bench.session.node().sdo
        sdo.download(0x1800, 5, bytes([99, 0]))
        ran = bench.run("undo --json")
        assert ran.code == 6
        assert ran.document["state"] == "unchanged"
        assert "event timer is 99" in ran.document["text"]
        assert sdo.upload(0x1800, 5) == bytes([99, 0])
        assert bench.run("undo --force").code == 0
        assert bench.run("undo").code == 2


def test_a_reset_has_put_it_back_already() -> None:
    with Bench(("generic",)) as bench:
        assert bench.run("map tpdo1 6041 606C").code == 0
        assert bench.run("nmt reset-node").code == 0
        ran = bench.run("undo --json")
        assert (ran.code, ran.document["writes"]) == (0, 0)
        assert bench.run("undo").code == 2


def test_a_dry_run_shows_what_the_undo_of_this_session_would_write() -> None:
    with Bench(TWO) as bench:
        for line in ("map 3:tpdo1 6041 606C", "set 1:tpdo2 --timer 40", "map 3:tpdo3 6041 --cob-id 0x6A3"):
            assert bench.run(line).code == 0
        held = {node_id: bench.session.node(node_id).pdos() for node_id in (1, 3)}
        executed = list(bench.session.record.lines)
        for _ in range(2):
            last = bench.run("undo --dry-run --json").document
            assert (last["node"], last["pdo"], last["dry_run"]) == (3, "tpdo3", True)
            assert last["writes"] > 0
        whole = bench.run("undo --all --dry-run --json").document
        assert set(whole["pdos"]) == {"3:tpdo1", "3:tpdo3", "1:tpdo2"}
        assert {node_id: bench.session.node(node_id).pdos() for node_id in (1, 3)} == held
        assert bench.session.record.lines == executed
        assert (bench.run("undo --all").code, bench.run("undo --dry-run").code) == (0, 2)


def test_a_dry_run_undoes_what_it_did_itself_before_what_the_session_did(tmp_path: Path) -> None:
    script = tmp_path / "x.dvt"
    script.write_text("set 3:tpdo2 --timer 9\nundo\nundo\nundo\n")
    with Bench(TWO) as bench:
        assert bench.run("set 1:tpdo2 --timer 40").code == 0
        ran = bench.run(f"run {script} --dry-run --json")
        changed = [(one["node"], one["pdo"]) for one in ran.documents if one["schema"] == "dvtcli.change/1"]
        assert changed == [(3, "tpdo2"), (3, "tpdo2"), (1, "tpdo2")]
        assert ran.code == 2, "and then there is nothing more"
        assert bench.run("verify").code == 0


def test_a_write_that_alters_nothing_is_no_change() -> None:
    with Bench(("generic",)) as bench:
        assert bench.run("set tpdo1 --timer 40").code == 0
        for line in ("write 1017 500", "write 1800:5 40"):
            ran = bench.run(line)
            assert (ran.code, "It had this value before: nothing has changed." in ran.stdout) == (0, True), ran.stdout
        assert bench.run("store").code == 0
        assert bench.run("write 1017 500").code == 0
        assert not bench.session.node().unstored
        ran = bench.run("undo --json")
        assert (ran.code, ran.document["pdo"]) == (0, "tpdo1")
        assert bench.run("undo").code == 2


def test_a_node_that_restarts_while_another_is_undone_is_not_called_put_back() -> None:
    with Bench(("generic@1", "generic@2")) as bench:
        steps: list[int] = []

        def took(step: Progress) -> None:
            steps.append(step.node)
            if steps == [2, 1, 1, 2]:  # what was in RAM of node 1 before this session is back there, and lost again
                bench.session.wire.send_nmt(NmtCommand.RESET_NODE, 1)
                assert bench.session.wire.wait_boot_up(1, 1, 10)

        bench.session.open_network().on_step = took
        bench.session.wire.sdo(1).download(0x1800, 5, (33).to_bytes(2, "little"))
        assert bench.run("set 2:tpdo3 --timer 44").code == bench.run("set 1:tpdo1 --timer 55").code == 0
        ran = bench.run("undo --all")
        assert ran.code == 1
        assert "node 1 restarted while" in ran.stderr
        assert "rolled back: the changes are reverted on every node" in ran.stderr
        assert "node 1 restarted: other unstored values are lost" in ran.stderr
        assert bench.session.wire.sdo(1).upload(0x1800, 5) == (55).to_bytes(2, "little")
