"""What changes a device's objects by itself, as seen by the node it belongs to; signals and the plant are such.

Does not know what moves, nor when.
"""

from __future__ import annotations

from typing import Protocol

from dvtcli.domain.datatypes import DataType
from dvtcli.simulator.device.strict_device import StrictDevice

#: an object by index and sub-index
Place = tuple[int, int]
NEVER = float("inf")


class Source(Protocol):
    """Something that moves objects of a device."""

    @property
    def due_s(self) -> float:
        """When it wants to be polled, in seconds of a monotonic clock; infinite for never, as things stand."""
        ...

    def poll(self, now_s: float) -> None:
        """Change what has changed by *now_s* (s)."""
        ...


def put_number(device: StrictDevice, place: Place, data_type: DataType, value: float) -> None:
    """Let *device* have *value* in the object at *place*, rounded and clipped to its type, if it is another one."""
    data = encoded(data_type, value)
    if device.value(*place) != data:
        device.set_value(*place, data)


def encoded(data_type: DataType, value: float) -> bytes:
    """The bytes of *value*, rounded and clipped to what *data_type* can hold."""
    if data_type.limits is not None:
        low, high = data_type.limits
        value = min(high, max(low, round(value)))
    return data_type.encode(value)
