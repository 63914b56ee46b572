"""One simulated node as the network sees it: frames in, frames out.

Knows the pre-defined connection set and which service a frame belongs to. Does not know buses, threads or clocks.
"""

from __future__ import annotations

from dvtcli.domain.ports import Frame
from dvtcli.simulator.device import StrictDevice
from dvtcli.simulator.sdo_server import SdoServer

NMT_CAN_ID, SDO_REQUEST, SDO_RESPONSE = 0x000, 0x600, 0x580


class SimulatedNode:
    """A device with its SDO server, addressed by CAN-ID."""

    def __init__(self, device: StrictDevice) -> None:
        self.device = device
        self.server = SdoServer(device)

    def handle(self, frame: Frame) -> list[Frame]:
        """What the node sends on hearing *frame*, in order."""
        if not frame.extended and frame.can_id == NMT_CAN_ID:
            self._obey(frame)
        elif not frame.extended and frame.can_id == SDO_REQUEST + self.device.node_id:
            return self._answer(frame)
        elif self.device.hears_sync(frame):
            return self.device.sync(frame.data[0] if frame.data else None) + self.device.take_outbox()
        else:
            return self.device.receive(frame) + self.device.take_outbox()
        return self.device.take_outbox()

    def poll(self, now_s: float) -> list[Frame]:
        """What the node sends by itself at *now_s*, a monotonic time in seconds."""
        return self.device.take_outbox() + self.device.poll(now_s)

    def _obey(self, frame: Frame) -> None:
        if frame.remote or len(frame.data) != 2 or frame.data[1] not in (0, self.device.node_id):
            return
        before = len(self.device.outbox)
        self.device.nmt(frame.data[0])
        if len(self.device.outbox) > before:
            self.server.reset()

    def _answer(self, frame: Frame) -> list[Frame]:
        response = None if frame.remote else self.server.handle(frame.data)
        answers = [] if response is None else [Frame(SDO_RESPONSE + self.device.node_id, response)]
        return answers + self.device.take_outbox()
