"""Files as dcfgen and ros2_canopen take them: each trait of public ones gives the concise DCF that dcfgen makes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from dvtcli.files.device_file import device_file_bytes, parse_device_file
from dvtcli.operations.network.concise_network import concise_dcf
from tests.cli.commands.bench import Bench
from tests.small_eds import U8, U16, U32, plain, var

pytestmark = pytest.mark.needs("dcfgen")

MASTER = "master:\n  node_id: 127\n  baudrate: 500\n  heartbeat_producer: 100\n"
NODE = "a:\n  dcf: device.eds\n  node_id: 5\n"
#: What public files have, one trait each: the whole file, or the keys of its node.
TRAITS = {
    "binary numbers": NODE + "  sdo:\n    - {index: 0x1017, sub_index: 0, value: 0b1100100}\n",
    "no sub_index, no value": NODE + "  sdo:\n    - {index: 0x1017}\n    - {index: 0x100C, value: 7}\n",
    "eds beside dcf": NODE + "  eds: device.eds\n  heartbeat_producer: 300\n",
    "baudrate of a node": NODE + "  baudrate: 500\n  heartbeat_producer: 300\n",
    "its heartbeat only": NODE + "  heartbeat_producer: 300\n",
    "every object before the PDOs": NODE + "  error_behavior: {1: 2}\n  time_cob_id: 0x101\n  heartbeat_producer: 60\n"
    "  heartbeat_consumer: true\n  tpdo:\n    1: {enabled: true, transmission: 255}\n",
    "guarding": NODE + "  guard_time: 20\n  life_time_factor: 3\n",
    "a consumer of its own in sdo": NODE + "  heartbeat_consumer: true\n  sdo:\n"
    "    - {index: 0x1016, sub_index: 2, value: 0x100200}\n",
    "a factor for the heartbeat": "options:\n  heartbeat_multiplier: 2\n" + NODE + "  heartbeat_consumer: true\n",
    "flow mappings, hexadecimal": NODE + "  tpdo:\n    1: {enabled: true, cob_id: 0x1A5, transmission: 0xFE, "
    "mapping: [{index: 0x6000, sub_index: 2}, {index: 0x6000, sub_index: 3}]}\n",
    "cob_id auto": NODE + "  rpdo:\n    1: {enabled: true, cob_id: auto}\n    2: {enabled: true, cob_id: auto, "
    "mapping: [{index: 0x6200, sub_index: 1}]}\n",
    "a PDO that is off": NODE + "  heartbeat_producer: 300\n  rpdo:\n    2: {enabled: false}\n"
    "  tpdo:\n    2: {enabled: false, cob_id: 0x80000285}\n",
    "an anchor": ".common: &common\n  dcf: device.eds\n  heartbeat_producer: 250\na:\n  <<: *common\n  node_id: 5\n",
    "keys of others": "options:\n  dcf_path: '@BUS_CONFIG_PATH@'\n" + NODE + "  driver: ros2_canopen::Cia402Driver\n"
    "  package: canopen_402_driver\n  period: 10\n  scale_pos_to_dev: 1000.0\n  heartbeat_producer: 300\n",
    "boot and restore": NODE
    + "  boot: false\n  mandatory: true\n  reset_communication: false\n  heartbeat_producer: 1\n",
    "an identity": NODE + "  revision_number: 0\n  serial_number: 0\n  heartbeat_producer: 20\n",
}


@pytest.fixture(autouse=True)
def device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A device file that dcfgen takes, in the working folder."""
    monkeypatch.chdir(tmp_path)
    eds = plain()
    for index, name, kind, default in (
        (0x100C, "Guard time", U16, 0), (0x100D, "Life time factor", U8, 0), (0x1012, "COB-ID TIME", U32, 0x100),
    ):  # fmt: skip
        eds.variable(index, var(name, kind, default))
    eds.record(0x1016, "Consumer heartbeat time", {sub: var(f"Consumer {sub}", U32, 0) for sub in range(1, 4)})
    eds.record(0x1029, "Error behaviour", {1: var("Communication error", U8, 0)})
    read = parse_device_file(eds.text().encode(), "device.eds").dictionary
    Path("device.eds").write_bytes(device_file_bytes(read, "device.eds", "made for a test", None))


def of_dcfgen(file: str) -> bytes:
    """The concise DCF of node a that dcfgen makes of *file*."""
    ran = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "dcfgen.cli", file], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    return Path("a.bin").read_bytes()


@pytest.mark.parametrize("trait", TRAITS)
def test_a_trait_is_taken_and_gives_the_bytes_of_dcfgen(trait: str) -> None:
    Path("bus.yml").write_text(MASTER + TRAITS[trait])
    with Bench() as bench:
        checked = bench.run("check bus.yml")
    assert (checked.code, "error" in checked.stderr) == (0, False), checked
    made = concise_dcf("bus.yml", "a")
    assert made.data == of_dcfgen("bus.yml"), made.entries


def test_a_value_that_is_said_twice_is_written_once_with_a_note() -> None:
    twice = "    - {index: 0x1005, value: 129}\n    - {index: 0x1005, value: 0x81}\n"
    text = MASTER + NODE + "  heartbeat_producer: 300\n  sdo:\n    - {index: 0x1017, value: 300}\n"
    Path("bus.yml").write_text(text + twice.replace("1005", "100C"))
    with Bench() as bench:
        checked = bench.run("check bus.yml")
    assert checked.code == 0, checked
    assert "1017:00 is already set by heartbeat_producer of this node, to the same value" in checked.stdout
    assert "100C:00 has this value already (line 11)" in checked.stdout
    made = [(one.object, one.data) for one in concise_dcf("bus.yml", "a").entries]
    assert made == [("1017:00", b"\x2c\x01"), ("100C:00", b"\x81\x00")]


@pytest.mark.parametrize("value", ["0x82", "130"])
def test_another_value_for_the_same_object_is_an_error(value: str) -> None:
    twice = f"  sdo:\n    - {{index: 0x100C, value: 129}}\n    - {{index: 0x100C, value: {value}}}\n"
    Path("bus.yml").write_text(MASTER + NODE + twice)
    with Bench() as bench:
        checked = bench.run("check bus.yml")
    checked.failed(4, "has a value already (line 9)")


def test_without_dcf_the_eds_describes_the_node() -> None:
    Path("bus.yml").write_text(MASTER + "a:\n  eds: device.eds\n  node_id: 5\n  heartbeat_producer: 300\n")
    assert [one.object for one in concise_dcf("bus.yml").entries] == ["1017:00"]


def test_bit_30_of_the_device_is_kept_and_dcfgen_clears_it() -> None:
    text = Path("device.eds").read_text()
    assert text.count("$NODEID+0x00000180") == 1
    Path("device.eds").write_text(text.replace("$NODEID+0x00000180", "$NODEID+0x40000180"))
    Path("bus.yml").write_text(MASTER + NODE + "  tpdo:\n    1: {enabled: true, cob_id: 0x190}\n")
    last = {of: data[-4:].hex() for of, data in (("us", concise_dcf("bus.yml").data), ("them", of_dcfgen("bus.yml")))}
    assert last == {"us": "90010040", "them": "90010000"}
