"""Getting a device where PDOs can be written: its state, on its own terms, and raw writes of what nobody may see."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.device.access_level import log_in
from dvtcli.device.nmt_gate import Access, Gate
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.errors import DeviceRefused, SdoAborted
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.laws.bench import NODE, DirectBus, DirectSdo, dictionary, profile


def driven(*, master: bool, family: str = "gen4") -> tuple[Access, DirectBus]:
    """A vehicle that is being driven: it stays OPERATIONAL whatever it is asked."""
    behaviour = replace(load_family(family), stays_operational=True)
    device = StrictDevice(dictionary("gen4"), behaviour, NODE)
    device.boot_up()
    device.take_outbox()
    device.nmt(NmtCommand.START)
    device.set_value(0x5800, 0, bytes([master]))
    bus = DirectBus.of(device)
    return Access(bus, NODE, profile("gen4")), bus


@pytest.mark.parametrize("master", [True, False])
def test_a_vehicle_that_is_driven_refuses_and_nothing_is_written(master: bool) -> None:
    access, bus = driven(master=master)
    with pytest.raises(DeviceRefused) as caught:
        Gate(access, lambda _question: None).enter()
    assert caught.value.text == "node 1 did not reach PRE-OPERATIONAL"
    assert "it says OPERATIONAL" in (caught.value.why or "")
    assert bus.device.state is NmtState.OPERATIONAL
    assert isinstance(bus.channel, DirectSdo)
    assert {index for index, _, _ in bus.channel.writes} <= {0x2800}


def test_a_master_s_request_is_taken_back_since_it_outlasts_the_power() -> None:
    access, bus = driven(master=True)
    with pytest.raises(DeviceRefused):
        access.request(NmtState.PRE_OPERATIONAL)
    assert isinstance(bus.channel, DirectSdo)
    assert bus.channel.writes == [(0x2800, 0, b"\1"), (0x2800, 0, b"\0")]
    assert bus.device.value(0x2800) == b"\0"


def test_a_master_that_nobody_is_logged_in_to_says_why_it_refuses() -> None:
    access, _ = driven(master=True, family="gen4-locked")
    with pytest.raises(SdoAborted) as caught:
        access.request(NmtState.PRE_OPERATIONAL)
    assert caught.value.why == "the device says 8 at 0x5310:00: the access level is too low"
    assert log_in(access, 4, lambda: 0x4444) == 4


def test_firmware_that_aborts_the_user_id_is_logged_in_all_the_same() -> None:
    device = StrictDevice(dictionary("gen4"), load_family("gen4-locked"), NODE)
    device.boot_up()

    class Choosy(DirectSdo):
        """A device that takes no user ID."""

        def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
            if (index, sub_index) == (0x5000, 3):
                raise SdoAborted(index, sub_index, 0x0601_0002, node=NODE)
            super().download(index, sub_index, data)

    bus = DirectBus(device, Choosy(device))
    access = Access(bus, NODE, profile("gen4"))
    assert log_in(access, 4, lambda: 0x4444) == 4
    assert log_in(access, 4, lambda: pytest.fail("asked for a passcode that is not needed")) == 4
    assert log_in(access, 0, lambda: pytest.fail("logging out needs no passcode")) == 0
