"""`check` on a bus: what is heard beside what nodes hold, and files held against the nodes that are there."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from dvtcli.domain.network.check.check_bus import CHECKS_OF_BIT_RATE
from dvtcli.domain.network.check.network_rules import NETWORK_RULES
from dvtcli.domain.ports import Frame
from dvtcli.operations.network.check_live import check_live
from dvtcli.operations.network.check_networks import CheckOptions
from dvtcli.operations.session.simulated_nodes import simulated_device, simulated_nodes
from dvtcli.watch.recording_checks.recording_rules import RECORDING_RULES
from tests.cli.commands.bench import Bench
from tests.domain.network_check.planted import concise
from tests.harness.sample import heavy
from tests.process import ROOT
from tests.small_eds import U8, U16, U32, plain, var
from tests.virtual_time import VirtualTimeBus

LINE = ROOT / "examples" / "line.yaml"
DOMAIN = 0x000F


def _bus(*words: str, foreign: Iterable[tuple[float, int, bytes]] = ()) -> VirtualTimeBus:
    """A bus of simulated nodes that others use, too: *foreign* frames come after so many seconds."""
    bus = VirtualTimeBus([simulated_device(one) for one in simulated_nodes(words)], simulated=False)
    for after_s, can_id, data in foreign:
        bus.nodes_said(Frame(can_id, data), after_s)
    return bus


def _check(bus: VirtualTimeBus, line: str = "check --json", *before: str) -> tuple[int, list[dict[str, Any]]]:
    with Bench((), {"sim": (), "yes": True, "bitrate": 125_000}, bus) as bench:
        for one in before:
            ran = bench.run(one)
            assert ran.code == 0, (one, ran.stderr)
        ran = bench.run(line)
        return ran.code, ran.document["files"]


def _rules(file: dict[str, Any]) -> set[str]:
    return {one["rule"] for one in file["findings"]}


RUNS = ("node 1", "write 1017 500", "set tpdo1 --inhibit 10 --timer 100", "set tpdo2 --inhibit 10 --timer 100",
        "nmt start 1")  # fmt: skip
HEARD = {"sync-not-heard", "sync-heard-twice", "sync-uneven", "comes-too-often", "other-length", "not-heard",
         "from-nobody", "other-master", "node-id-twice", "heartbeat-not-heard", "heard-not-read", "restarts",
         "emergency", "error-frames"}  # fmt: skip


@heavy
def test_a_bus_is_listened_to_for_two_seconds() -> None:
    code, (bus,) = _check(_bus("gen4@1"), "check --json", *RUNS)
    assert code == 0
    assert bus["heard"]["seconds"] == 2.0
    assert 40 <= bus["heard"]["frames"] <= 44, "20 of each TPDO, 4 heartbeats"
    assert not _rules(bus) & HEARD


@heavy
def test_how_long_is_listened_can_be_said() -> None:
    assert _check(_bus("gen4@1"), "check --for 5 --json", *RUNS)[1][0]["heard"]["seconds"] == 5.0
    assert _check(_bus("gen4@1"), "check --for 0 --json", *RUNS)[1][0]["heard"] is None


def test_another_master_and_what_nobody_sends_are_heard() -> None:
    foreign = [(0.3, 0x000, b"\1\1"), (0.4, 0x601, b"\x40\0\x10\0\0\0\0\0"), (0.5, 0x2A0, bytes(4)),
               *((0.1 + n / 10, 0x700 + 9, b"\5") for n in range(30))]  # fmt: skip
    _, (bus,) = _check(_bus("gen4@1", foreign=[(20 + at, *rest) for at, *rest in foreign]), "check --for 40 --json")
    assert {"other-master", "from-nobody", "heard-not-read"} <= _rules(bus)
    texts = [one["text"] for one in bus["findings"] if one["rule"] == "other-master"]
    assert texts == [
        "node 1: another SDO client asks it: 1 request that is not ours",
        "NMT commands from an unknown sender: nmt start 1",
    ]


def test_what_is_heard_in_a_given_time_is_judged_as_a_recording() -> None:
    """A refused write, an EMCY, and heartbeats that end; each once, though a rule about networks has the EMCY, too."""
    foreign = [
        *((20 + n / 10, 0x709, b"\5") for n in range(60)), *((20 + n / 10, 0x70A, b"\5") for n in range(300)),
        (22.0, 0x089, b"\x10\x81\1\0\0\0\0\0"), (23.0, 0x609, b"\x2b\x17\x10\0\x64\0\0\0"),
        (23.1, 0x589, b"\x80\x17\x10\0\x22\0\0\x08"),
    ]  # fmt: skip
    recordings = {rule.name for rule in RECORDING_RULES} - {"error-frames"}
    code, (bus,) = _check(_bus("gen4@1", foreign=foreign), "check --for 40 --json")
    found = [(one["rule"], one["node"]) for one in bus["findings"] if one["rule"] in recordings]
    assert (code, found) == (3, [("emergency-not-reset", 9), ("refused-write", 9), ("heartbeat-stops", 9)])
    assert "emergency" not in _rules(bus)
    (text,) = (one["text"] for one in bus["findings"] if one["rule"] == "refused-write")
    assert text.startswith("write to 1017:00 producer heartbeat time refused: abort 0x08000022")
    assert " s); check first: " in text
    _, (short,) = _check(_bus("gen4@1", foreign=[(at - 20, *rest) for at, *rest in foreign]), "check --json")
    assert not _rules(short) & recordings, "no time is given"
    only = _check(_bus("gen4@1", foreign=foreign), "check --for 40 --rule heartbeat-stops --json")[1][0]
    assert (only["rules"], _rules(only)) == (1, {"heartbeat-stops"})


@pytest.mark.parametrize("rate", [125_000, None])
def test_rules_that_cannot_be_judged_are_not_called_checked(rate: int | None) -> None:
    of_files = {"pdo-other-length", "pdo-other-than-default", "rpdo-not-sent"}
    of_bit_rate: set[str] = {"bus-load", *CHECKS_OF_BIT_RATE} if rate is None else set()
    with Bench((), {"sim": (), "yes": True, "bitrate": rate}, _bus("gen4@1")) as bench:
        (asked,) = check_live(bench.session, CheckOptions(for_s=3)).reports
        names = {rule.name for rule in asked.rules}
        assert {rule.name for rule in (*RECORDING_RULES, *NETWORK_RULES)} - names == of_files | of_bit_rate
        for name in of_files | of_bit_rate:
            ran = bench.run(f"check --live --for 3 --rule {name} --rule restarts")
            said = "cannot be judged: the bit rate" if name in of_bit_rate else "is not judged on a running bus"
            assert (ran.code, f"rule {name} {said}" in " ".join(ran.stderr.split())) == (2, True), ran


@heavy
def test_sync_that_is_needed_and_not_heard_is_an_error() -> None:
    synchronous = (*RUNS[:2], "set tpdo1 --sync 1")
    code, (bus,) = _check(_bus("gen4@1"), "check --json", *synchronous)
    assert code == 3
    assert {"sync-not-heard", "sync-from-elsewhere"} <= _rules(bus)
    sync = [(at / 50, 0x080, b"") for at in range(3000)]
    code, (bus,) = _check(_bus("gen4@1", foreign=sync), "check --json", *synchronous)
    assert code == 0
    assert not {"sync-not-heard", "sync-from-elsewhere", "sync-uneven"} & _rules(bus)
    twice = [*sync, *((at / 50 + 0.005, 0x080, b"") for at in range(3000))]
    assert "sync-uneven" in _rules(_check(_bus("gen4@1", foreign=twice), "check --json", *synchronous)[1][0])


def test_two_nodes_with_one_node_id_are_heard() -> None:
    other = [(0.2 + at / 2, 0x701, b"\x7f") for at in range(100)]
    code, (bus,) = _check(_bus("gen4@1", foreign=other), "check --json", *RUNS[:2])
    assert code == 3
    assert "node-id-twice" in _rules(bus)


@heavy
def test_a_file_is_held_against_the_nodes_that_are_there(tmp_path: Path) -> None:
    file = tmp_path / "press.yaml"
    file.write_text(
        "drive: {node_id: 1, profile: gen4, identity: {vendor: 0x1E, serial: 77}}\n"
        "io: {node_id: 5, profile: generic}\n"
        "spare: {node_id: 9, profile: generic}\n"
    )
    code, (own, bus, against) = _check(_bus("gen4@1", "tmcm@5", "generic@7"), f"check {file} --live --json", *RUNS[:2])
    assert code == 4, "the simulated Gen4 of the file has another serial number, too"
    assert (own["bus"], bus["file"], against["file"], against["bus"]) == (None, None, str(file), "virtual time")
    found = {(one["rule"], one["node"], one["line"]) for one in against["findings"]}
    assert ("identity", 1, 1) in found
    assert ("not-on-the-bus", 9, 3) in found
    assert {node for rule, node, _ in found if rule == "not-in-the-file"} <= {7}
    assert "eds-identity" in _rules(against), "node 5 is a TMCM, the file has it as another"


def test_the_line_s_own_nodes_are_what_its_file_says() -> None:
    code, (_, _, against) = _check(_bus("gen4@1", "generic@5"), f"check {LINE} --live --json")
    assert (code, against["findings"]) == (0, [])


def _manager(folder: Path) -> VirtualTimeBus:
    eds = plain()
    eds.variable(0x1F80, var("NMT startup", U32, 1))
    for index, kind in ((0x1F81, U32), (0x1F83, U8), (0x1F85, U32)):
        eds.record(index, f"Boot {index:X}", {sub: var(f"Node {sub}", kind, 0) for sub in range(1, 6)})
    eds.record(0x1F22, "Concise DCF", {sub: var(f"Node {sub}", DOMAIN) for sub in range(1, 6)})
    eds.variable(0x1F89, var("Boot time", U32, 0))
    eds.variable(0x1F20, var("Spare", U16, 0))
    (folder / "manager.eds").write_text(eds.text())
    bus = _bus(f"{folder / 'manager.eds'}@10", "generic@5")
    device = next(node.device for node in bus.nodes if node.device.node_id == 10)
    for index, sub_index, value in ((0x1F81, 5, 9), (0x1F83, 5, 1), (0x1F85, 5, 0x99), (0x1F89, 0, 400)):
        size = len(device.value(index, sub_index))
        device.set_value(index, sub_index, value.to_bytes(size, "little"))
    device.set_value(0x1F22, 5, concise((0x1017, 0, 2, 900), (0x1800, 1, 4, 0x185)))
    return bus


def test_what_a_manager_expects_and_downloads_is_held_against_nodes_and_file(tmp_path: Path) -> None:
    file = tmp_path / "press.yaml"
    file.write_text("io: {node_id: 5, profile: generic, heartbeat_producer: 500}\n")
    code, (_, bus, against) = _check(
        _manager(tmp_path), f"check {file} --live --json", "scan", "node 5", "write 1017 500"
    )
    assert code == 3
    for found in (bus, against):
        assert {"concise-dcf", "boot-time", "guarded-by-manager", "boot-identity"} <= _rules(found)
    (text,) = (one["text"] for one in against["findings"] if one["rule"] == "concise-dcf")
    assert text.startswith("node 10 0x1F22:05: node 5: 0x1017:00 becomes 0x0384, not 0x01F4")


@pytest.mark.parametrize("words", ["", f"{LINE} --live", "--for 0", "--rule no-error-control"])
def test_where_no_node_answers_nothing_is_called_checked(words: str) -> None:
    with Bench((), {"sim": ()}, _bus(foreign=[(1, 0x70A, b"\5")])) as bench:
        ran = bench.run(f"check {words} --json")
        assert (ran.code, ran.document["error"]) == (5, "no_answer")


def test_a_node_that_is_heard_and_does_not_tell_what_it_holds_is_an_error() -> None:
    heartbeats = [(20 + n / 2, 0x709, b"\5") for n in range(100)]
    code, (bus,) = _check(_bus("gen4@1", foreign=heartbeats), "check --for 40 --json", *RUNS)
    assert (code, [one["severity"] for one in bus["findings"] if one["rule"] == "heard-not-read"]) == (3, ["error"])


def test_a_node_of_the_file_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    file = tmp_path / "press.yaml"
    file.write_text("drive: {node_id: 1, profile: gen4}\nspare: {node_id: 9, profile: generic}\n")
    code, (_, _, against) = _check(_bus("gen4@1"), f"check {file} --live --json --rule not-on-the-bus", *RUNS[:2])
    assert (code, [(one["node"], one["severity"]) for one in against["findings"]]) == (3, [(9, "error")])


def test_what_file_and_bus_have_in_common_is_said_once_and_alike(tmp_path: Path) -> None:
    """The name is one that only the device tells; the bit rate is the bus's, 125 kbit/s."""
    file = tmp_path / "net.yaml"
    file.write_text("nodes: {drive: {node_id: 9, tpdo: {1: {enabled: true, mapping: [statusword]}}}}\n")
    code, (of_file, of_bus, against) = _check(_bus("generic@9"), f"check {file} --live --json")
    assert (code, of_file["notes"]) == (0, [])
    mine = [one["text"] for one in of_file["findings"] if one["rule"] == "unbounded-event-pdo"]
    assert any("TPDO1" in text for text in mine)
    alone = _check(_bus("generic@9"), "check --json")[1][0]
    texts = {one["text"] for one in of_file["findings"]}
    assert texts & {one["text"] for one in alone["findings"]}
    assert not texts & {one["text"] for one in of_bus["findings"]}
    assert of_bus["said"] + len(of_bus["findings"]) == len(alone["findings"])
    assert (of_file["said"], against["said"]) == (0, 0)


def test_a_name_on_another_device_than_the_file_says_stays_unknown(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    drive = "{node_id: 9, identity: {product: 0x77}, tpdo: {1: {enabled: true, mapping: [statusword]}}}"
    file.write_text(f"nodes: {{drive: {drive}}}\n")
    of_file = _check(_bus("generic@9"), f"check {file} --live --json")[1][0]
    assert "is unknown: add `dcf:`" in of_file["notes"][0]["text"]
