"""A device that would not take its own PDOs: later processes put back what it does take, and say what not."""

from __future__ import annotations

import json
from pathlib import Path

from can import Message

import dvtcli
from tests.cli.commands.bench import Bench
from tests.process import PATIENCE_S
from tests.simulator.serve.served import served
from tests.small_eds import INPUTS, communication, mapping, plain

FIRST = INPUTS << 16 | 0x0108


def odd_eds(folder: Path) -> Path:
    """TPDO1 enabled at 0x180, TPDO2 with a count above its entries, RPDO1 enabled and empty."""
    eds = plain()
    eds.record(0x1800, "Communication 1", communication(0x180))
    eds.record(0x1801, "Communication 2", communication("$NODEID+0x280"))
    eds.record(0x1A01, "Mapping 2", mapping(9, [FIRST, FIRST + 0x100]))
    eds.record(0x1600, "Mapping 1", mapping(0, [0, 0]))
    path = folder / "odd.eds"
    path.write_text(eds.text())
    return path


def test_each_process_puts_back_what_the_device_takes(tmp_path: Path) -> None:
    path = odd_eds(tmp_path)
    with served(tmp_path, str(path)) as server:
        words = ("-n", "1", "--eds", str(path))
        for line in ("map tpdo1 6000:2", "map tpdo2 6000:3", "map rpdo1 6200:1"):
            done = server.dvtcli(*words, *line.split())
            assert (done.returncode, "an undo leaves it off" in done.stderr) == (0, True), done
        for said in ("RPDO1 was enabled and empty", "TPDO2 was inconsistent", "TPDO1 was enabled"):
            done = server.dvtcli(*words, "undo")
            assert (done.returncode, said in done.stderr, "refuses that configuration" in done.stderr) == (
                1,
                True,
                True,
            ), done
            assert "not as before; its present value was read back" in done.stderr
            assert "NOT undone completely" in done.stdout
        assert server.dvtcli(*words, "undo").returncode == 2


def test_a_backup_says_what_it_does_not_put_back(tmp_path: Path) -> None:
    path = odd_eds(tmp_path)
    with served(tmp_path, str(path)) as server:
        words = ("-n", "1", "--eds", str(path))
        for line in ("map tpdo1 6000:2", "map tpdo2 6000:3"):
            assert server.dvtcli(*words, *line.split()).returncode == 0
        stamp = sorted((tmp_path / "state-home").rglob("*.dvt"))[0].stem.rpartition("-")[2]
        done = server.dvtcli(*words, "undo", "--backup", stamp)
        assert done.returncode == 1, done.stderr
        assert "TPDO1 is not undone completely: tpdo1 was enabled" in done.stderr
        assert "TPDO2 is not undone completely: tpdo2 is inconsistent" in done.stderr
        assert "NOT undone completely" in done.stdout
        assert "not undone completely: tpdo1 was enabled with CAN-ID 0x180" in done.stderr
        assert "not undone completely: tpdo2 is inconsistent (its count is 9" in done.stderr


def test_a_backup_of_an_odd_pdo_that_is_as_it_was_is_put_back_whole(tmp_path: Path) -> None:
    eds = plain()
    eds.record(0x1A01, "Mapping 2", mapping(9, [FIRST, FIRST + 0x100]))
    path = tmp_path / "odd.eds"
    path.write_text(eds.text())
    with served(tmp_path, str(path)) as server:
        words = ("-n", "1", "--eds", str(path))
        assert server.dvtcli(*words, "map", "tpdo1", "6000:2").returncode == 0
        done = server.dvtcli(*words, "undo", "--backup")
        assert (done.returncode, "tpdo2 is inconsistent" in done.stderr) == (0, True), done
        assert "TPDO1 rolled back" in done.stdout


def test_a_document_says_what_is_not_put_back(tmp_path: Path) -> None:
    path = odd_eds(tmp_path)
    with served(tmp_path, str(path)) as server:
        words = ("-n", "1", "--eds", str(path))
        assert server.dvtcli(*words, "map", "tpdo2", "6000:3").returncode == 0
        done = server.dvtcli(*words, "--json", "undo")
        document, error = map(json.loads, done.stdout.splitlines())
        assert error["exit_code"] == done.returncode
        assert (done.returncode, document["verified"], document["state"]) == (1, False, "left_changed"), done
        (text,) = document["not_put_back"]
        assert "TPDO2 was inconsistent, and the device refuses that configuration: it is off and empty now" in text
        assert text in [finding["text"] for finding in document["findings"]]


def test_an_undo_that_ends_at_a_node_says_which_nodes_were_put_back_before(tmp_path: Path) -> None:
    path = odd_eds(tmp_path)
    with served(tmp_path, f"{path}@1", f"{path}@2") as server:
        for node in ("1", "2"):
            done = server.dvtcli("-n", node, "--eds", str(path), "map", "rpdo1", "6200:1")
            assert done.returncode == 0, done
        write = bytes.fromhex("2F00140264000000")
        with server.attach() as other:
            other.send(Message(arbitration_id=0x601, data=write, is_extended_id=False))
            assert other.recv(PATIENCE_S)
        ran = server.dvtcli("--json", "undo", "--all")
        *_, error = map(json.loads, ran.stdout.splitlines())
        assert (ran.returncode, error["exit_code"], error["node"]) == (6, 6, 1), ran
        assert error["done"] == ["node 2: rolled back before this"]
        assert error["nodes"] == [{"node": 1, "state": "unchanged"}, {"node": 2, "state": "rolled_back"}]
        assert error["state"] == "rolled_back"
        assert "state   node 1 unchanged: nothing was written" in error["message"]


def test_undo_of_everything_says_it_and_a_program_sees_false(tmp_path: Path) -> None:
    with dvtcli.simulate(str(odd_eds(tmp_path))) as bus:
        node = bus.node(1)
        node.map("tpdo2", "6000:3")
        node.map("rpdo1", "6200:1")
        undone = node.undo(everything=True)
        assert not undone
        assert len(undone.not_put_back) == 2


def test_undo_over_several_nodes_says_it_of_each(tmp_path: Path) -> None:
    path = str(odd_eds(tmp_path))
    with Bench((path, path), {"yes": True}) as bench:
        for line in ("map 1:tpdo2 6000:3", "map 2:tpdo2 6000:3", "map 2:tpdo1 6000:2 --cob-id 0x1A2"):
            assert bench.run(line).code == 0
        ran = bench.run("undo --all --json")
        document = ran.document
        assert (ran.code, document["verified"], document["state"]) == (1, False, "left_changed"), ran
        said = " ".join(document["not_put_back"])
        for node in (1, 2):
            assert f"node {node}: TPDO2 was inconsistent, and the device refuses that configuration" in said
    with Bench((path, path), {"yes": True}) as bench:
        for line in ("map 1:tpdo2 6000:3", "map 2:tpdo2 6000:3"):
            assert bench.run(line).code == 0
        ran = bench.run("undo --all")
        assert (ran.code, "node 1: TPDO2" in ran.stderr, "node 2: TPDO2" in ran.stderr) == (1, True, True), ran


def test_an_atomic_script_that_is_taken_back_says_what_the_device_did_not_take(tmp_path: Path) -> None:
    path = odd_eds(tmp_path)
    script = tmp_path / "x.dvt"
    script.write_text("map tpdo2 6000:3\nset tpdo1 --timer 7\nmap tpdo2 1018:1\n")
    with served(tmp_path, str(path)) as server:
        words = ("-n", "1", "--eds", str(path))
        done = server.dvtcli(*words, "run", "--atomic", str(script))
        assert done.returncode == 7, done.stderr
        assert (
            "TPDO2 was inconsistent, and the device refuses that configuration: it is off and empty now" in done.stderr
        )
        assert "everything is as before" not in done.stderr
        assert "nothing to recover" in server.dvtcli(*words, "recover", "--yes").stdout
