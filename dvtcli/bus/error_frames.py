"""Error frames in plain words: the CAN controller's report, and advice.

Decodes the error classes of Linux in an error frame's CAN-ID and data (linux/can/error.h); other drivers' error
frames are only counted.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import can

_CONTROLLER, _NO_ACKNOWLEDGE, _BUS_OFF, _RESTARTED = 0x004, 0x020, 0x040, 0x100
#: bits of data[1] if the class is _CONTROLLER
_WARNING, _PASSIVE = 0x0C, 0x30
#: from this many error frames on they are reported: a few happen when a device is plugged in
MANY = 5

_BIT_RATE = (
    "check that the bit rate is that of the nodes, and that there is a 120 ohm terminator at each end of the line"
)
_TEXTS = {
    "bus-off": f"the CAN controller went bus-off: nothing is sent or received until it is restarted (SocketCAN: sudo "
    f"ip link set CHANNEL type can restart). {_BIT_RATE}",
    "restarted": f"the CAN controller was bus-off and is restarted: no frames passed until then. {_BIT_RATE}",
    "no acknowledge": "no other node acknowledges our frames: check that a node is on, with this bit rate",
    "error-passive": f"the CAN controller is error-passive, so most frames fail: {_BIT_RATE}",
    "error warning": f"the CAN controller counts many errors: {_BIT_RATE}",
    "bus errors": f"the bus carries error frames: {_BIT_RATE}",
}


@dataclass(slots=True, eq=False, repr=False)
class ErrorFrames:
    """Error frames of a bus: their number, and kinds not yet reported."""

    count: int = 0
    _kinds: dict[str, bool] = field(default_factory=dict)

    def notice(self, message: can.Message) -> None:
        """Count an error frame; quick, since a broken bus has thousands a second."""
        if message.arbitration_id & _RESTARTED:
            self.count += 1
            self._kinds = {"restarted": False}  # another bus-off is news again
            return
        self.count_one(_kind(message.arbitration_id, bytes(message.data)))

    def count_one(self, kind: str | None = None) -> None:
        """Count an error frame of *kind*, None for no specific kind."""
        self.count += 1
        if kind is None and self.count >= MANY:
            kind = "bus errors"
        if kind is not None:
            self._kinds.setdefault(kind, False)

    def news(self) -> list[str]:
        """Each kind once, with advice; the worst first, without kinds that a worse kind explains."""
        worst = next((kind for kind in _TEXTS if kind in self._kinds), None)
        if worst is None or self._kinds[worst]:
            return []
        self._kinds[worst] = True
        return [_TEXTS[worst]]


def _kind(error_class: int, data: bytes) -> str | None:
    """The kind of an error frame, None for no specific kind."""
    if error_class & _BUS_OFF:
        return "bus-off"
    if error_class & _NO_ACKNOWLEDGE:
        return "no acknowledge"
    status = data[1] if error_class & _CONTROLLER and len(data) > 1 else 0
    if status & _PASSIVE:
        return "error-passive"
    return "error warning" if status & _WARNING else None
