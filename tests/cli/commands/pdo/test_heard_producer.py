"""A CAN-ID that is on the bus already, sent by a node that nobody named, is not given to a second TPDO."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.nmt import NmtCommand
from dvtcli.operations.session.simulated_nodes import simulated_device, simulated_nodes
from tests.cli.commands.bench import Bench, beside
from tests.harness.sample import heavy
from tests.small_eds import U16, U32, communication, plain, var
from tests.virtual_time import VirtualTimeBus


def stranger_sends(can_id: int, folder: Path, every_ms: int = 1) -> VirtualTimeBus:
    """Nodes 5 and 9; node 9 sends *can_id* every *every_ms* ms, and runs."""
    path, other = folder / "io.eds", folder / "other.eds"
    io = plain()
    io.info = {"ProductNumber": 0x72}
    io.record(0x1018, "Identity", {n: var(f"Part {n}", U32, 0x72 if n == 2 else 0, "ro") for n in range(1, 5)})
    path.write_text(io.text(), "latin-1")
    eds = plain()
    eds.record(0x1800, "Communication 1", communication(can_id, sub5=var("Event timer", U16, every_ms)))
    other.write_text(eds.text(), "latin-1")
    bus = beside([simulated_device(one) for one in simulated_nodes((f"{path}@5", f"{other}@9"))])
    bus.send_nmt(NmtCommand.START, 9)
    return bus


LINES = ["set tpdo1 --cob-id 0x1A5", "map tpdo2 6000:2 --cob-id 0x1A5", "enable tpdo2", "write 1801:1 0x1A5"]


@pytest.mark.parametrize("line", LINES)
@pytest.mark.parametrize("sent", [0x1A5, 0x1A6])
def test_a_second_producer_is_refused_unless_forced(tmp_path: Path, line: str, sent: int) -> None:
    bus = stranger_sends(sent, tmp_path)
    with Bench((), {"node": 5, "yes": True}, bus) as bench:
        if line.startswith(("enable", "write")):
            assert bench.run("map tpdo2 6000:2 --off --cob-id 0x1A5").code == 0
        held = bench.session.node(5).pdos()
        ran = bench.run(f"{line} --json")
        refused = sent == 0x1A5
        assert ran.code == int(refused), ran.stdout
        assert ("sent by an unknown node" in ran.stdout) is refused
        if refused:
            assert bench.session.node(5).pdos() == held
            assert bench.run(f"{line} --force").code == 0


HOW = (
    "apply wanted.dcf",
    "apply wanted.xdc",
    "apply wanted.jsonl",
    "clone wanted.dcf",
    "clone wanted.xdc",
    "apply plan.json",
)


@pytest.mark.parametrize("sent", [0x1A5, 0x1A6])
@pytest.mark.parametrize("how", HOW)
def test_so_it_is_of_a_file_about_a_device_and_of_a_saved_plan(tmp_path: Path, how: str, sent: int) -> None:
    bus = stranger_sends(sent, tmp_path)
    options = {"node": 5, "yes": True, "eds": str(tmp_path / "io.eds")}
    verb, name = how.split()
    wanted = tmp_path / name
    with Bench((f"{tmp_path / 'io.eds'}@{7 if verb == 'clone' else 5}",), {"yes": True}) as other:
        made = tmp_path / "wanted.dcf" if name == "plan.json" else wanted
        assert other.run("map tpdo2 6000:2 --cob-id 0x1A5").code == 0
        assert other.run(f"{'backup' if made.suffix == '.jsonl' else 'export'} {made}").code == 0
    with Bench((), options, bus) as bench:
        if name == "plan.json":
            assert bench.run(f"plan {made} -o {wanted} --force").code == 0
        held = bench.session.node(5).pdos()
        ran = bench.run(f"{verb} {wanted} --json")
        refused = sent == 0x1A5
        assert ran.code == int(refused), ran
        assert ("sent by an unknown node" in ran.stdout) is refused
        if refused:
            assert "take another CAN-ID at 0x1801:01 in the file" in ran.stdout
            assert "cob-id" not in ran.stdout
            assert bench.session.node(5).pdos() == held
            assert bench.run(f"{verb} {wanted} --force").code == 0


@pytest.mark.parametrize("verb", ["plan", "apply"])
@pytest.mark.parametrize("sent", [0x1A5, 0x1A6])
def test_so_it_is_of_a_file_that_names_one_of_two_nodes(tmp_path: Path, verb: str, sent: int) -> None:
    bus = stranger_sends(sent, tmp_path)
    file = tmp_path / "net.yml"
    file.write_text("a: {node_id: 5, dcf: io.eds, tpdo: {1: {enabled: true, cob_id: 0x1A5}}}\n", "utf-8")
    with Bench((), {"yes": True}, bus) as bench:
        ran = bench.run(f"{verb} {file} --json")
        assert ran.code == int(sent == 0x1A5), ran.stdout
        assert bench.run(f"{verb} {file} --force").code == 0


@pytest.mark.parametrize("verb", ["plan", "diff", "apply"])
def test_it_is_told_with_the_other_errors_of_the_file(tmp_path: Path, verb: str) -> None:
    bus = stranger_sends(0x1A5, tmp_path)
    file = tmp_path / "net.yml"
    pdos = "1: {enabled: true, cob_id: 0x1A5}, 2: {enabled: true, cob_id: 0x601}"
    file.write_text(f"a: {{node_id: 5, dcf: io.eds, tpdo: {{{pdos}}}}}\n", "utf-8")
    with Bench((), {"yes": True}, bus) as bench:
        ran = bench.run(f"{verb} {file} --json")
        assert ran.code == 1, ran.stdout
        assert {one["rule"] for one in ran.document["findings"]} >= {"one-producer", "can-id-restricted"}


@heavy
def test_what_the_node_itself_sends_is_no_second_producer(tmp_path: Path) -> None:
    bus = stranger_sends(0x1A5, tmp_path)
    with Bench((), {"node": 9, "yes": True}, bus) as bench:
        assert bench.run("set tpdo1 --timer 2").code == 0
        assert bench.run("map tpdo1 6000:2").code == 0
        assert bench.run("disable tpdo1").code == 0
        assert bench.run("map tpdo2 6000:2 --cob-id 0x1A5").code == 0


@pytest.mark.parametrize("every_ms", [20, 90])
def test_one_that_sends_less_often_than_the_node_takes_to_be_read_is_found_too(tmp_path: Path, every_ms: int) -> None:
    bus = stranger_sends(0x1A5, tmp_path, every_ms)
    with Bench((), {"node": 5, "yes": True}, bus) as bench:
        for _ in range(5):
            assert bench.run("set tpdo1 --cob-id 0x1A5").code == 1


@pytest.mark.parametrize("command", [NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.START])
@pytest.mark.parametrize("line", ["set tpdo1 --cob-id 0x1A5", "plan {}", "apply {}"])
def test_what_the_node_holds_and_cannot_have_sent_counts(tmp_path: Path, line: str, command: NmtCommand) -> None:
    bus = stranger_sends(0x1A5, tmp_path)
    file = tmp_path / "net.yml"
    file.write_text("a: {node_id: 5, dcf: io.eds, tpdo: {1: {enabled: true, cob_id: 0x1A5}}}\n", "utf-8")
    with Bench((), {"node": 5, "yes": True}, bus) as bench:
        assert bench.run("set tpdo1 --cob-id 0x1A5 --force").code == 0
        assert bench.run("write 1017 20").code == 0
        bus.send_nmt(command, 5)
        bus.idle(0.1)
        ran = bench.run(line.format(file))
        assert ran.code == (0 if command is NmtCommand.START else 1), ran


@pytest.mark.parametrize("service", [0x585, 0x605, 0x709, 0x000])
def test_frames_of_a_service_are_not_of_an_unknown_node(tmp_path: Path, service: int) -> None:
    """They are answers to this dvtcli's own requests, or heartbeats; the standard's restriction is the reason."""
    bus = stranger_sends(0x1A6, tmp_path)
    with Bench((), {"node": 5, "yes": True}, bus) as bench:
        ran = bench.run(f"map tpdo2 6000:2 --cob-id 0x{service:X} --json")
    assert ran.code == 1, ran.stdout
    assert "can-id-restricted" in ran.stdout
    assert "unknown node" not in ran.stdout


def test_the_default_of_a_node_that_was_received_and_not_read_is_a_warning(tmp_path: Path) -> None:
    bus = stranger_sends(0x1A6, tmp_path)
    bus.send_nmt(NmtCommand.RESET_COMMUNICATION, 9)
    with Bench((), {"node": 5, "yes": True}, bus) as bench:
        warned = bench.run("map tpdo2 6000:2 --cob-id 0x189")
        same = bench.run("set tpdo2 --timer 500")
        absent = bench.run("map tpdo2 6000:2 --cob-id 0x188 --json")
    text = "0x189 is the default COB-ID of TPDO1 of node 9, which is on the bus and was not read"
    assert (warned.code, text in warned.stdout + warned.stderr) == (0, True), warned
    assert "check --live` reads every node" in warned.stdout + warned.stderr
    assert "was not read" not in same.stdout + same.stderr
    (finding,) = (one for one in absent.document["findings"] if one["rule"] == "can-id-default")
    assert (finding["severity"], finding["text"]) == ("note", "0x188 is the default COB-ID of TPDO1 of node 8")
