"""Errors raised by a simulated node at given times: `--fault emcy=0x3210:2`."""

from __future__ import annotations

from collections.abc import Iterable

from dvtcli.simulator.device.plant import NEVER
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice


class RaisedErrors:
    """*faults* of kind `emcy` on *device*, as a `moving.Source`, repeated after each start of the device."""

    def __init__(self, device: StrictDevice, faults: Iterable[Fault]) -> None:
        self._device = device
        self._faults = sorted(faults, key=lambda fault: fault.seconds or 0.0)
        self._waiting: list[tuple[float, int]] = []
        #: the start of the device for the waiting errors
        self._start = -1

    @property
    def due_s(self) -> float:
        """The time of the next error (s); at once after a start, when their times begin."""
        if self._device.services.starts != self._start:
            return -NEVER
        return self._waiting[0][0] if self._waiting else NEVER

    def poll(self, now_s: float) -> None:
        """Raise the errors due at *now_s* (s)."""
        if self._device.services.starts != self._start:
            self._start = self._device.services.starts
            self._waiting = [(now_s + (fault.seconds or 0.0), fault.code or 0) for fault in self._faults]
        while self._waiting and self._waiting[0][0] <= now_s:
            self._device.outbox += self._device.services.emergency(self._waiting.pop(0)[1])
