"""A node that restarts in the middle of a change without a boot-up message that is heard: another PDO is not mixed."""

from __future__ import annotations

import pytest

from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench, Ran
from tests.harness.sample import heavy
from tests.laws.bench import DirectSdo, booted
from tests.virtual_time import VirtualTimeBus

TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")
STORED = ("disable tpdo2", "store")
NOT_STORED = ("map tpdo2 6064 606C --timer 70", "set tpdo1 --timer 30")
CHANGE = "map tpdo1 606C 6041 --cob-id 0x1A1"


def changed(device: StrictDevice, lines: tuple[str, ...], faults: tuple[str, ...] = (), *, alone: bool = False) -> Ran:
    """Run *lines* on *device*, or the one line as a command of its own; how the last one ended."""
    bus = VirtualTimeBus([device], faults=[Fault.parse(one) for one in faults], timeout_s=0.3, simulated=False)
    options = {"yes": True, "node": device.node_id, "eds": str(family_eds("generic"))}
    with Bench((), options, bus) as bench:
        bench.session.started = not alone
        ran = [bench.run(line) for line in lines]
    return ran[-1]


def held(device: StrictDevice) -> dict[Pdo, PdoConfig]:
    """What the device has of both PDOs."""
    return {pdo: read_pdo(DirectSdo(device), pdo) for pdo in (TPDO1, TPDO2)}


@pytest.fixture
def device() -> StrictDevice:
    """TPDO2 is on in RAM, and stored as one that is off and maps something else."""
    device = booted()
    assert changed(device, STORED).code == 0
    assert changed(device, NOT_STORED).code == 0
    return device


@pytest.mark.parametrize("fault", ["reset@2=0", "reset@3=0", "reset@4=0.4"])
def test_what_is_stored_of_another_pdo_is_not_switched_on(device: StrictDevice, fault: str) -> None:
    before = held(device)
    ran = changed(device, (CHANGE,), (fault, "no-boot-up"), alone=True)
    now = held(device)
    assert ran.code in (1, 5)
    assert now[TPDO1] == before[TPDO1]
    device.restart()
    device.boot_up()
    assert now[TPDO2] == held(device)[TPDO2] != before[TPDO2]
    said = " ".join(ran.stderr.split())
    assert "unknown: TPDO1 is as it was, read back equal; TPDO2 is not, and was not changed" in said
    assert "0x1801:01 was" in said
    assert "everything is as before" not in said


def test_in_a_session_which_has_read_it_whole_it_is_put_back_whole(device: StrictDevice) -> None:
    before = held(device)
    ran = changed(device, (CHANGE,), ("reset@3=0", "no-boot-up"))
    assert ran.code == 5
    assert held(device) == before
    assert "everything is as before" in ran.stderr


def test_what_the_change_itself_altered_is_put_back(device: StrictDevice) -> None:
    """The device holds what it took: nothing but the change can have done that."""
    before = held(device)
    ran = changed(device, (CHANGE,), ("alters@2=1801:1:0xC00002B1", "refuse@4=0x08000022"), alone=True)
    assert ran.code == 1
    assert held(device) == before
    assert "TPDO2 has its COB-ID again" in ran.stderr


@heavy
@pytest.mark.parametrize("received", [True, False])
def test_a_restart_while_the_others_are_looked_at_after_the_way_back_is_no_rolled_back(
    device: StrictDevice, *, received: bool
) -> None:
    """Whatever upload of the way back the node restarts at: what is said to be as it was is so at the end."""
    before = held(device)
    device_held = set()
    for upload in range(8, 20):
        for line in NOT_STORED:
            changed(device, (line,))
        assert held(device) == before
        faults = ("lose-response@2", f"reset-at-read@{upload}=0.05", *(() if received else ("no-boot-up",)))
        ran = changed(device, (CHANGE,), faults)
        assert ran.code == 5
        assert held(device)[TPDO1] == before[TPDO1], upload
        device_held.add(held(device)[TPDO2] == before[TPDO2])
        device.restart()
        device.boot_up()
    assert (False in device_held) is received, "not heard, what was read whole of the other is rolled back"
