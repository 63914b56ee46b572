"""What dcfgen and ros2_canopen are known to get wrong in a bus.yml, one by one: here it means what it says.

Source: Lely core, python/dcf-tools; ros2_canopen, cogen.
"""

from __future__ import annotations

import shutil
from contextlib import chdir
from pathlib import Path
from typing import Any

import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench
from tests.small_eds import U32, plain, var


def planned(text: str, folder: Path, *before: str, sim: str = "generic@2") -> dict[str, Any]:
    """The plan of a bus.yml with one node, on a device to which the lines *before* were done; exit code 0."""
    path = folder / "bus.yml"
    path.write_text(text)
    with Bench((sim,), {"yes": True}) as bench:
        for line in before:
            assert bench.run(line).code == 0, line
        ran = bench.run(f"plan {path} --json")
        assert ran.code == 0, ran.stdout
        return dict(ran.documents[-1]["nodes"][0])


def writes(node: dict[str, Any]) -> dict[str, str]:
    return {one["object"]: one["after"] for one in node["objects"]}


def test_an_event_deadline_is_its_own_value(tmp_path: Path) -> None:
    node = planned("a: {node_id: 2, rpdo: {1: {event_deadline: 77}}}\n", tmp_path)
    assert node["pdos"][0]["event_timer"] == [0, 77]


@pytest.mark.parametrize("word", ['"false"', '"true"', "yes", "no", "off"])
def test_enabled_is_a_boolean_and_no_text(word: str, tmp_path: Path) -> None:
    path = tmp_path / "bus.yml"
    path.write_text(f"a: {{node_id: 2, tpdo: {{1: {{enabled: {word}}}}}}}\n")
    with Bench(("generic@2",)) as bench:
        ran = bench.run(f"plan {path} --json")
    assert ran.code == 4
    assert [one["column"] for one in ran.documents[-1]["complaints"]] == [37]


def test_a_configuration_file_is_noted_and_is_no_dcf(tmp_path: Path) -> None:
    shutil.copy(family_eds("generic"), tmp_path / "mine.eds")
    text = "a: {node_id: 2, dcf: mine.eds, configuration_file: other.bin, tpdo: {1: {mapping: [statusword, 606C]}}}\n"
    assert planned(text, tmp_path)["pdos"][0]["map"][1] == ["6041:00/16", "606C:00/32"]


def test_a_pdo_that_is_off_is_mapped_all_the_same(tmp_path: Path) -> None:
    text = "a: {node_id: 2, tpdo: {1: {mapping: [{index: 0x606C}]}}}\n"
    (pdo,) = planned(text, tmp_path, "disable tpdo1")["pdos"]
    assert pdo["map"] == [["6041:00/16"], ["606C:00/32"]]
    assert "enabled" not in pdo


def test_a_cob_id_without_bit_30_says_nothing_of_rtr(tmp_path: Path) -> None:
    (pdo,) = planned("a: {node_id: 2, tpdo: {1: {cob_id: 0x1A2}}}\n", tmp_path, "set tpdo1 --no-rtr")["pdos"]
    assert (pdo["cob_id"], "rtr_allowed" in pdo) == ([0x182, 0x1A2], False)


def test_two_nodes_that_get_one_can_id_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "bus.yml"
    path.write_text("".join(f"n{one}: {{node_id: {one}, tpdo: {{1: {{cob_id: 0x1A0}}}}}}\n" for one in (2, 3)))
    with Bench(("generic@2", "generic@3")) as bench:
        ran = bench.run(f"plan {path} --json")
    assert (ran.code, ran.documents[-1]["findings"][0]["rule"]) == (1, "can-id-clash")


@pytest.mark.parametrize(("held", "said"), [(0x100, 0x200), (0x300, 0x100)])
def test_a_time_cob_id_is_written(held: int, said: int, tmp_path: Path) -> None:
    before = () if held == 0x100 else (f"write 1012 0x{held:X}",)
    eds = plain()
    eds.variable(0x1012, var("COB-ID time stamp", U32, 0x100))
    (tmp_path / "timed.eds").write_text(eds.text())
    text = f"a: {{node_id: 2, time_cob_id: 0x{said:X}}}\n"
    node = planned(text, tmp_path, *before, sim=f"{tmp_path / 'timed.eds'}@2")
    assert writes(node) == {"1012:00": said.to_bytes(4, "little").hex(" ").upper()}


def test_a_heartbeat_that_the_file_does_not_name_leaves_0x1016_alone(tmp_path: Path) -> None:
    text = "master: {node_id: 9, heartbeat_producer: 100}\na: {node_id: 2, heartbeat_producer: 700}\n"
    assert writes(planned(text, tmp_path, "write 1016:01 0x00090190")).keys() == {"1017:00"}


def test_defaults_never_overwrite_what_a_node_says(tmp_path: Path) -> None:
    text = "defaults: {heartbeat_producer: 100, tpdo: {1: {event_timer: 9}}}\n"
    text += "nodes: {a: {node_id: 2, heartbeat_producer: 700, tpdo: {1: {event_timer: 50}}}}\n"
    node = planned(text, tmp_path)
    assert writes(node) == {"1017:00": "BC 02"}
    assert node["pdos"][0]["event_timer"] == [0, 50]


def test_a_mapping_that_is_so_already_is_not_written(tmp_path: Path) -> None:
    assert planned("a: {node_id: 2, tpdo: {1: {mapping: [{index: 0x6041}]}}}\n", tmp_path)["pdos"] == []


def test_what_counts_is_what_the_device_holds_and_not_its_dcf(tmp_path: Path) -> None:
    text = "a: {node_id: 2, tpdo: {1: {event_timer: 0}}}\n"  # what the EDS says, too
    assert planned(text, tmp_path, "set tpdo1 --timer 33")["pdos"][0]["event_timer"] == [33, 0]


def test_a_file_of_a_node_is_beside_the_bus_yml_wherever_one_stands(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    shutil.copy(family_eds("generic"), tmp_path / "mine.eds")
    with chdir(tmp_path / "elsewhere"):
        for name in ("mine.eds", '"@BUS_CONFIG_PATH@/mine.eds"'):
            text = f"a: {{node_id: 2, dcf: {name}, tpdo: {{1: {{mapping: [velocity_actual_value]}}}}}}\n"
            assert planned(text, tmp_path)["pdos"][0]["map"][1] == ["606C:00/32"]


@pytest.mark.parametrize(
    "text",
    [
        "master: {node_id: 100, baud_rate: 500}\na: {node_id: 2}\n",
        'options: {dcf_path: "@BUS_CONFIG_PATH@"}\nmaster: {node_id: 100, driver: x}\na: {node_id: 0x2, period: 10}\n',
        "defaults: {scale_pos_from_dev: 1.0, polling: false}\nnodes: {a: {node_id: 2, register_map: {a: 0x10}}}\n",
        "a: {node_id: 2, reset_communication: true, restore_configuration: 2, software_file: a.bin, boot: true}\n",
    ],
)
def test_keys_of_others_are_notes_and_change_nothing(text: str, tmp_path: Path) -> None:
    path = tmp_path / "bus.yml"
    path.write_text(text)
    with Bench(("generic@2",), {"yes": True}) as bench:
        assert len(bench.run(f"check {path} --json").document["files"][0]["notes"]) >= 1
        ran = bench.run(f"plan {path} --exit-code --json")
        assert (ran.code, ran.documents[-1]["writes"]) == (0, 0)


def test_a_bare_auto_is_a_can_id_that_nobody_uses(tmp_path: Path) -> None:
    text = "a: {node_id: 2, tpdo: {1: {cob_id: auto}, 2: {cob_id: auto, enabled: true}}}\n"
    assert planned(text, tmp_path, "set tpdo1 --cob-id 0x1B0")["pdos"][0]["cob_id"] == [0x1B0, 0x182]
