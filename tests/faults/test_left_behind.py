"""An error with exit code 7 names exactly the PDOs and objects that the device holds otherwise than before."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from dvtcli.domain.pdo import Pdo
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.bench import Bench, Ran, beside
from tests.faults.matrix import _held
from tests.harness.sample import heavy
from tests.operations.network.bench import device

FILE = """nodes:
  first: {node_id: 5, tpdo: {1: {transmission: 1, mapping: [6041, 6064]}}, rpdo: {1: {cob_id: 0x305}}}
  second: {node_id: 9, tpdo: {2: {event_timer: 120}}}
"""


def on(folder: Path, *faults: str, nodes: tuple[int, ...] = (5,)) -> tuple[Bench, dict[int, StrictDevice]]:
    devices = {node_id: device(node_id, "generic") for node_id in nodes}
    bus = beside(list(devices.values()), *faults)
    return Bench((), {"yes": True, "journal": str(folder), "node": 5, "eds": "generic", "timeout": 0.2}, bus), devices


def held(devices: dict[int, StrictDevice]) -> dict[tuple[int, str], bytes]:
    """The value of each object of PDOs, and of the heartbeat and one that is write-only, of each node."""
    return {
        (node_id, f"{index:04X}:{sub_index:02X}"): value
        for node_id, one in devices.items()
        for index, sub_index in [
            (index, sub_index)
            for index in one.dictionary
            if 0x1400 <= index <= 0x1BFF or index in {0x1017, 0x2004}
            for sub_index in one.dictionary[index].entries
        ]
        if (value := _held(one, index, sub_index)) is not None
    }


def label(place: str) -> str:
    pdo = Pdo.at(int(place[:4], 16))
    return place if pdo is None else pdo.label


def differing(before: dict[tuple[int, str], bytes], devices: dict[int, StrictDevice]) -> set[tuple[int, str]]:
    """Node and PDO, or object, of all that is not as it was; entries behind a mapping's count mean nothing."""
    now = held(devices)
    found = set()
    for (node_id, place), value in before.items():
        index, sub_index = int(place[:4], 16), int(place[5:], 16)
        is_entry = 0x1600 <= index <= 0x17FF or 0x1A00 <= index <= 0x1BFF
        if is_entry and sub_index > max(before[node_id, f"{index:04X}:00"][0], 1):
            continue
        if now[node_id, place] != value:
            found.add((node_id, label(place)))
    return found


def error_of(ran: Ran) -> dict[str, Any]:
    (error,) = (one for one in ran.documents if one["schema"] == "dvtcli.error/1")
    return error


def says_what_is_left(
    error: dict[str, Any], before: dict[tuple[int, str], bytes], devices: dict[int, StrictDevice]
) -> None:
    assert (error["exit_code"], error["state"]) == (7, "left_changed")
    named = {(row["node"], row["changed"]) for row in error["left"]}
    assert named == differing(before, devices)
    for row in error["left"]:
        assert row["holds"] == devices[row["node"]].value(*place(row["object"])).hex()
        assert row["before"] == before[row["node"], row["object"]].hex()
        assert row["changed"] in error["text"] or row["node"] != error["node"]
    for node in error["as_before"]:
        for changed in node["changed"]:
            assert (node["node"], changed) not in named
            assert changed not in error["text"]


def place(text: str) -> tuple[int, int]:
    return int(text[:4], 16), int(text[5:], 16)


@pytest.mark.parametrize(
    "line", ["map tpdo1 6041 6064", "set tpdo1 --cob-id 0x3A1", "disable tpdo1; enable tpdo1", "map rpdo1 6040 60FF"]
)
@pytest.mark.parametrize("altered", ["1801:1:0x80000281", "1801:5:0x0021", "1401:1:0x80000305"])
def test_a_change_whose_roll_back_alters_another_pdo_names_that_one(line: str, altered: str, tmp_path: Path) -> None:
    bench, devices = on(tmp_path, f"enable-alters={altered}")
    with bench:
        for one in line.split("; "):
            before = held(devices)
            ran = bench.run(f"{one} --json")
            if ran.code:
                break
        if ran.code == 7:
            says_what_is_left(error_of(ran), before, devices)
        else:
            assert differing(before, devices) <= {(5, label(altered[:4])), (5, "TPDO1"), (5, "RPDO1")}


@heavy
def test_of_an_atomic_script_what_nobody_can_read_is_left_and_the_rest_is_as_before(tmp_path: Path) -> None:
    bench, devices = on(tmp_path)
    with bench:
        before = held(devices)
        script = tmp_path / "x.dvt"
        script.write_text("set tpdo1 --timer 9\nwrite 2004 5\nset tpdo2 --timer 8\nread 5FFF\n")
        error = error_of(bench.run(f"run {script} --atomic --json"))
        assert differing(before, devices) == {(5, "2004:00")}
        assert error["text"] == "2004:00 of node 5 could not be rolled back"
        assert [(row["changed"], row["object"], row["holds"], row["before"]) for row in error["left"]] == [
            ("2004:00", "2004:00", None, None)
        ]
        assert error["as_before"] == [{"node": 5, "changed": ["TPDO1", "TPDO2"]}]


def test_of_an_atomic_script_behind_a_line_that_is_final_all_that_is_held_is_named(tmp_path: Path) -> None:
    bench, devices = on(tmp_path)
    with bench:
        before = held(devices)
        script = tmp_path / "x.dvt"
        script.write_text("set tpdo1 --timer 9\nstore\nread 5FFF\n")
        says_what_is_left(error_of(bench.run(f"run {script} --atomic --json")), before, devices)


@pytest.mark.parametrize("altered", ["1802:1:0x80000385", "1801:1:0x80000285", "1401:1:0x80000305"])
def test_a_network_names_what_is_left_on_each_node(altered: str, tmp_path: Path) -> None:
    bench, devices = on(tmp_path, f"5:enable-alters={altered}", nodes=(5, 9))
    file = tmp_path / "two.yaml"
    file.write_text(FILE)
    with bench:
        before = held(devices)
        ran = bench.run(f"apply {file} --json")
        if ran.code == 7:
            says_what_is_left(error_of(ran), before, devices)
        else:
            assert ran.code
            assert not differing(before, devices)


@pytest.mark.parametrize("fault", ["silent@2", "silent@4"])
def test_of_a_node_that_is_silent_nothing_is_known(fault: str, tmp_path: Path) -> None:
    bench, _ = on(tmp_path, fault)
    with bench:
        ran = bench.run("map tpdo1 6041 6064")
        assert ran.code == 7
        assert "error: TPDO1 of node 5 could not be rolled back" in ran.stderr
        assert "  left    TPDO1 of node 5: its value is unknown: node 5 did not answer" in ran.stderr
        assert "see above" not in ran.stderr
        assert "is as it was" not in ran.stderr
