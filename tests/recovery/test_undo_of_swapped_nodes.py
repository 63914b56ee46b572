"""Two devices that swapped their node-IDs: what was changed of one is never put back on the other, and that is said."""

from __future__ import annotations

import pytest

from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.bench import Bench, Ran
from tests.harness.sample import heavy
from tests.lss_nodes import address_of, unconfigured
from tests.virtual_time import VirtualTimeBus

TIMER = (0x1800, 5)


def drives() -> list[StrictDevice]:
    """Two of a kind, as node 1 and node 3, each with a serial number of its own."""
    return [unconfigured(0x100 + node_id, node_id=node_id) for node_id in (1, 3)]


def words(one: StrictDevice) -> str:
    """The address of a device, as `lss` takes it."""
    at = address_of(one)
    return f"vendor={at.vendor} product={at.product} revision={at.revision} serial={at.serial}"


def bench(nodes: list[StrictDevice], **options: object) -> Bench:
    return Bench((), {"yes": True, **options}, VirtualTimeBus(nodes, timeout_s=0.3, simulated=False))


def changed_and_swapped() -> list[StrictDevice]:
    """The first drive, now node 3, and the second one, now node 1, each of which was changed before."""
    nodes = drives()
    with bench(nodes) as one:
        for line in ("set 1:tpdo1 --timer 9", "set 3:tpdo1 --timer 8"):
            assert one.run(line).code == 0
    for node, node_id, serial in zip(nodes, (3, 1), (0x101, 0x103), strict=True):
        node.power_on({(0x1018, 4): serial.to_bytes(4, "little")}, node_id)
    return nodes


def undo(nodes: list[StrictDevice], line: str, **options: object) -> Ran:
    """How an undo of another process ends; no timer is what the other device's was."""
    with bench(nodes, **options) as one:
        ran = one.run(line)
    for node in nodes:
        assert node.value(*TIMER) == bytes(2)
    return ran


@pytest.mark.parametrize("line", ["undo", "undo --all"])
def test_it_is_said_that_those_are_other_devices_now(line: str) -> None:
    ran = undo(changed_and_swapped(), line)
    said = " ".join(ran.stderr.split())
    assert ran.code == 2
    assert "the history has no change of the devices that are now nodes 1 and 3" in said
    assert "-n ID undo" in said


def test_a_device_with_another_node_id_is_named_by_both() -> None:
    ran = undo(changed_and_swapped(), "undo", node=1)
    assert "node 1 was node 3 when it was changed" in " ".join(ran.stderr.split())


def test_a_backup_of_another_device_is_said_to_be_one() -> None:
    ran = undo(changed_and_swapped(), "undo --backup", node=1)
    said = " ".join(ran.stderr.split())
    assert (ran.code, "no backup of the device that is now node 1" in said) == (6, True)
    assert "its serial number (0x1018:04) differs" in said
    assert "--force" in said


@heavy
def test_a_spare_device_takes_the_backup_of_the_one_before_by_force() -> None:
    nodes = drives()
    with bench(nodes, node=1) as one:
        assert one.run("set tpdo1 --type 1 --timer 9").code == 0
    spare = [unconfigured(0x777, node_id=1)]
    with bench(spare, node=1) as one:
        assert one.run("set tpdo1 --type 254").code == 0
        spare[0].power_on({(0x1018, 4): (0x778).to_bytes(4, "little")}, 1)
    with bench(spare, node=1) as one:
        refused = one.run("undo --backup")
        assert (refused.code, spare[0].value(0x1800, 2)) == (6, b"\xff")
        assert one.run("undo --backup --force").code == 0


def test_a_session_that_gave_a_node_another_id_forgets_what_it_did_to_the_one_before() -> None:
    nodes = drives()
    with bench(nodes, node=1) as one:
        assert one.run("set 1:tpdo1 --timer 9").code == one.run("set 3:tpdo1 --timer 8").code == 0
        for node_id, moved in ((10, nodes[0]), (1, nodes[1]), (3, nodes[0])):
            ran = one.run(f"lss node-id {node_id} {words(moved)}")
            assert ran.code == 0, ran
        ran = one.run("undo")
        assert ran.code != 0
        assert "already as requested" not in ran.stdout
        assert ran.stderr
