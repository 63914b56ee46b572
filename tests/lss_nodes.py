"""Simulated nodes for an LSS master, each with a serial number of its own; and a bus that answers wrongly."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from dvtcli.domain.can_ids import LSS_RESPONSE_ID
from dvtcli.domain.lss_services import LssAddress
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.bus import device
from tests.virtual_time import ANSWER_S, VirtualTimeBus

#: what becomes of the Nth answer of a slave: the frames that arrive in its place, each with its delay (s)
Fate = Callable[[int, Frame], list[tuple[float, Frame]]]


def unconfigured(serial: int, family: str = "generic", node_id: int = UNCONFIGURED) -> StrictDevice:
    one = device(family, node_id)
    one.power_on({(0x1018, 4): serial.to_bytes(4, "little")}, node_id)
    return one


def address_of(one: StrictDevice) -> LssAddress:
    return LssAddress(*(int.from_bytes(one.value(0x1018, sub_index), "little") for sub_index in (1, 2, 3, 4)))


class LossyBus(VirtualTimeBus):
    """In virtual time, where *fate* decides what becomes of each answer of an LSS slave."""

    def __init__(self, devices: Sequence[StrictDevice], fate: Fate) -> None:
        self._fate, self._answers = fate, 0
        super().__init__(devices, simulated=False)

    def _to_us(self, frame: Frame, delay_s: float = ANSWER_S) -> None:
        if frame.can_id != LSS_RESPONSE_ID:
            super()._to_us(frame, delay_s)
            return
        self._answers += 1
        for later_s, fated in self._fate(self._answers, frame):
            super()._to_us(fated, delay_s + later_s)
