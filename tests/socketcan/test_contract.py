"""What every bus keeps, on the kernel's: nodes beside us on vcan, and across a vxcan pair, with and without echoes.

On vcan every frame comes from our own host and is marked so; across a pair none is.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from dvtcli.bus.opening import open_bus
from dvtcli.domain.ports import CanopenBus
from tests.bus.devices import device
from tests.bus.test_contract import CarriesFrames
from tests.socketcan.conftest import ANSWER_S, on


@pytest.mark.drawn(1)  # of each test, on each pair of links: with echoes or without
class OnLinks(CarriesFrames):
    ours, theirs = "vcan0", "vcan0"

    @pytest.fixture(params=["no echoes", "echoes"])
    def bus(self, request: pytest.FixtureRequest) -> Iterator[CanopenBus]:
        own = {"receive_own_messages": request.param == "echoes"}
        bus = open_bus("socketcan", self.ours, None, own, timeout_s=ANSWER_S, retries=0)
        with on(self.theirs, device(1), device(2)):
            yield bus
        bus.close()

    def test_remote_frames_are_carried(self, bus: CanopenBus) -> None:
        assert bus.carries_remote_frames


class TestVcan(OnLinks):
    pass


class TestVxcan(OnLinks):
    ours, theirs = "vxcan0", "vxcan1"
