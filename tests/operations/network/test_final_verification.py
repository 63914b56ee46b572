"""Everything that a file names is read after the last write: also what was equal when it was planned.

A device that alters an object with the change of another one is no device "as the file says". What it holds is read
from the device itself, never through the tool.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.bench import Bench, Ran, beside
from tests.faults.matrix import snapshot, stored_pdos
from tests.harness.sample import heavy
from tests.operations.network.bench import device

#: what the device alters when a PDO of it is enabled, as `--fault` writes it: another PDO, and a single object
ALTERED = ["1801:2:0x05", "1801:5:0x0063", "1017:0:0x0123"]
#: files that say all of a device, by what writes them, and what takes them
WRITERS = ["backup {}.dcf", "backup {}.jsonl", "export {}.dcf", "export {}.xdc", "export {}.yaml"]
NETWORK = """nodes:
  a:
    node_id: 5
    dcf: generic
    heartbeat_producer: 100
    tpdo:
      1: {transmission: 254, enabled: true, mapping: ["6041", "6061"]}
      2: {transmission: 255, event_timer: 0, enabled: true}
"""


def on(devices: list[StrictDevice], *faults: str, journal: Path) -> Bench:
    options = {"yes": True, "node": 5, "journal": str(journal), "eds": "generic", "timeout": 0.2}
    return Bench((), options, beside(devices, *faults))


def whole_device_file(tmp_path: Path, line: str) -> Path:
    """A file of a device with another TPDO1."""
    with on([device(5, "generic")], journal=tmp_path) as bench:
        assert bench.run("-q nmt preop 5").code in (0, 2)
        assert bench.run("map 5:tpdo1 6041 6061 --type 254").code == 0
        assert bench.run("write 5:1800:5 33").code == 0
        made = bench.run(line.format(tmp_path / "x"))
        assert made.code == 0, made
    return Path(line.format(tmp_path / "x").split()[1])


def refused(ran: Ran, was: object, of: StrictDevice) -> None:
    """It is no success; and the device is as it was, or the error says that it is not."""
    assert ran.code in (1, 7), ran
    assert "read back equal" not in ran.stdout
    if ran.code == 1:
        assert snapshot(of) == was
        assert "rolled back" in ran.stderr


@pytest.mark.parametrize("altered", ALTERED)
@pytest.mark.parametrize("store", ["", "    store: true\n"])
def test_a_network_file(tmp_path: Path, altered: str, store: str) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(NETWORK + store)
    of = device(5, "generic")
    was, stored = snapshot(of), stored_pdos(of)
    with on([of], f"enable-alters={altered}", journal=tmp_path) as bench:
        ran = bench.run(f"apply {file}")
    refused(ran, was, of)
    assert ran.code == 1
    assert altered[:4] in ran.stderr
    assert stored_pdos(of) == stored


@heavy
@pytest.mark.parametrize("altered", ALTERED)
@pytest.mark.parametrize("line", WRITERS)
def test_a_file_of_a_device(tmp_path: Path, altered: str, line: str) -> None:
    file = whole_device_file(tmp_path, line)
    for command in ["apply"] if file.suffix == ".yaml" else ["apply", "clone"]:
        of = device(5, "generic")
        was = snapshot(of)
        with on([of], f"enable-alters={altered}", journal=tmp_path) as bench:
            refused(bench.run(f"{command} {file}"), was, of)


@heavy
@pytest.mark.parametrize("altered", ALTERED[:2])
def test_no_node_stores_if_a_pdo_of_another_one_was_altered(tmp_path: Path, altered: str) -> None:
    """The file says nothing of TPDO2: one node stored, the other was refused, a power cycle left a mixture."""
    file = tmp_path / "a.yaml"
    file.write_text(
        "defaults: {store: true, dcf: generic}\nnodes:\n"
        + "".join(
            f'  n{node_id}:\n    node_id: {node_id}\n    tpdo:\n      1: {{enabled: true, mapping: ["6041", "6061"]}}\n'
            for node_id in (5, 9)
        )
    )
    devices = [device(node_id, "generic") for node_id in (5, 9)]
    was, stored = [snapshot(of) for of in devices], [stored_pdos(of) for of in devices]
    with on(devices, f"9:enable-alters={altered}", journal=tmp_path) as bench:
        ran = bench.run(f"apply {file}")
    assert ran.code == 1, ran
    assert [stored_pdos(of) for of in devices] == stored
    assert [snapshot(of) for of in devices] == was


@pytest.mark.parametrize("read", [20, 50, 75])
def test_a_node_that_only_stores_is_read_before_another_one_stores(tmp_path: Path, read: int) -> None:
    """It restarted without a word, and held no more what the file says: node 5 stored, node 9 was refused then."""
    file = tmp_path / "a.yaml"
    file.write_text(
        "defaults: {store: true, dcf: generic}\nnodes:\n"
        "  a: {node_id: 5, tpdo: {1: {event_timer: 50}}}\n  b: {node_id: 9, tpdo: {1: {event_timer: 70}}}\n"
    )
    devices = [device(node_id, "generic") for node_id in (5, 9)]
    was, stored = snapshot(devices[0]), [stored_pdos(of) for of in devices]
    faults = ("9:no-boot-up", f"9:reset-after-read@{read}=0.001")
    with on(devices, *faults, journal=tmp_path) as bench:
        assert bench.run("set 9:tpdo1 --timer 70").code == 0
        ran = bench.run(f"apply {file}")
    assert ran.code == 1, ran
    assert snapshot(devices[0]) == was
    assert [stored_pdos(of) for of in devices] == stored


@heavy
def test_a_setting_that_the_file_says_and_nobody_writes(tmp_path: Path) -> None:
    """The device alters it with a PDO: nothing would put it back, so it is said that it is left."""
    with Bench(("gen4",), {"yes": True}) as bench:
        assert bench.run("map tpdo1 6041 606C").code == 0
        assert bench.run(f"backup {tmp_path / 'x.jsonl'}").code == 0
    with Bench(("gen4",), {"yes": True, "fault": ("enable-alters=6080:0:0x00000FA1",)}) as bench:
        ran = bench.run(f"apply {tmp_path / 'x.jsonl'}")
        held = bench.run("read 6080").stdout
    assert (ran.code, "4001" in held) == (7, True)
    assert "6080:00 is 0x00000FA1, expected 0x00000FA0" in ran.stderr
    assert "node 1 has changed 6080:00" in ran.stderr
