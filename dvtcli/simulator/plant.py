"""A motor without load: the state machine of controlword and statusword, and a velocity that follows (CiA 402-2).

Knows 6040/6041 and the velocity that ramps to its target. Does not know operation modes, homing nor torque: whatever
mode is set, target velocity 60FF moves actual velocity 606C, and position 6064 integrates it.
"""

from __future__ import annotations

from enum import IntEnum

from dvtcli.domain.datatypes import DataType
from dvtcli.simulator.device import StrictDevice
from dvtcli.simulator.signals import put_number

#: how often the plant moves (s)
STEP_S = 0.01
CONTROLWORD, STATUSWORD, TARGET_VELOCITY = (0x6040, 0), (0x6041, 0), (0x60FF, 0)
ACTUAL_VELOCITY, ACTUAL_POSITION, ACCELERATION = (0x606C, 0), (0x6064, 0), (0x6083, 0)
_DEFAULT_ACCELERATION = 1000.0
_VOLTAGE_ENABLED, _REMOTE, _TARGET_REACHED = 0x0010, 0x0200, 0x0400
_FAULT_RESET = 0x80
_NUMBERS = (TARGET_VELOCITY, ACTUAL_VELOCITY)


class DriveState(IntEnum):
    """The states by their bits of the statusword (CiA 402-2, 8.4.2)."""

    SWITCH_ON_DISABLED = 0x40
    READY_TO_SWITCH_ON = 0x21
    SWITCHED_ON = 0x23
    OPERATION_ENABLED = 0x27
    QUICK_STOP_ACTIVE = 0x07
    FAULT = 0x08


_STOPPING = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
#: states from which *switch on* and *enable operation* may come
_SHUT_DOWN = DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON, DriveState.OPERATION_ENABLED


def next_state(state: DriveState, controlword: int, *, reset_fault: bool = False) -> DriveState:
    """Where *controlword* leads from *state*; *reset_fault* is the rising edge of its bit 7 (CiA 402-2, 8.4.1.3)."""
    if state is DriveState.FAULT:
        return DriveState.SWITCH_ON_DISABLED if reset_fault else state
    if not controlword & 0x02:  # disable voltage
        return DriveState.SWITCH_ON_DISABLED
    if not controlword & 0x04:  # quick stop
        return DriveState.QUICK_STOP_ACTIVE if state in _STOPPING else DriveState.SWITCH_ON_DISABLED
    if not controlword & 0x01:  # shutdown
        return state if state is DriveState.QUICK_STOP_ACTIVE else DriveState.READY_TO_SWITCH_ON
    if state not in _SHUT_DOWN:
        return state
    return DriveState.OPERATION_ENABLED if controlword & 0x08 else DriveState.SWITCHED_ON


class Plant:
    """A motor on *device*; ValueError where the device has no target and actual velocity. *due_s* as in `Source`.

    Velocities are in the object's own unit per second; the acceleration is 6083 where the device has one that is not
    0, else 1000 a second.
    """

    def __init__(self, device: StrictDevice) -> None:
        self.device = device
        self.due_s = 0.0
        self.state = DriveState.SWITCH_ON_DISABLED
        self._types = {place: self._type(place) for place in (*_NUMBERS, ACTUAL_POSITION, STATUSWORD, ACCELERATION)}
        if any(self._types[place] is None for place in _NUMBERS) or self._type(CONTROLWORD) is None:
            raise ValueError(f"node {device.node_id} is no drive: it lacks 6040, 60FF or 606C")
        self._velocity = 0.0
        self._position = self._number(ACTUAL_POSITION)
        self._controlword = 0
        self._last_s: float | None = None

    def fail(self) -> None:
        """Let the drive have a fault, which bit 7 of the controlword resets."""
        self.state = DriveState.FAULT

    def poll(self, now_s: float) -> None:
        """Move on to *now_s*, a monotonic time in seconds."""
        elapsed_s = 0.0 if self._last_s is None else max(0.0, now_s - self._last_s)
        self._last_s, self.due_s = now_s, now_s + STEP_S
        controlword = int(self._number(CONTROLWORD))
        edge = bool(controlword & ~self._controlword & _FAULT_RESET)
        self._controlword = controlword
        self.state = next_state(self.state, controlword, reset_fault=edge)
        reached = self._move(elapsed_s)
        more = _REMOTE | (0 if self.state is DriveState.SWITCH_ON_DISABLED else _VOLTAGE_ENABLED)
        self._put(STATUSWORD, self.state | more | (_TARGET_REACHED if reached else 0))

    def _move(self, elapsed_s: float) -> bool:
        """Turn for *elapsed_s*; whether the wanted velocity is reached."""
        target = self._number(TARGET_VELOCITY) if self.state is DriveState.OPERATION_ENABLED else 0.0
        most = (self._number(ACCELERATION) or _DEFAULT_ACCELERATION) * elapsed_s
        before = self._velocity
        self._velocity += min(most, max(-most, target - before))
        self._position += (before + self._velocity) / 2 * elapsed_s
        self._put(ACTUAL_VELOCITY, self._velocity)
        self._position = (self._position + (1 << 31)) % (1 << 32) - (1 << 31)  # as a 32-bit counter
        self._put(ACTUAL_POSITION, self._position)
        return self._velocity == target

    def _type(self, place: tuple[int, int]) -> DataType | None:
        entry = self.device.dictionary.entry(*place)
        return None if entry is None or entry.data_type is None or entry.data_type.limits is None else entry.data_type

    def _number(self, place: tuple[int, int]) -> float:
        data_type = self._type(place)
        value = None if data_type is None else data_type.decode(self.device.value(*place))
        return float(value) if isinstance(value, int) else 0.0

    def _put(self, place: tuple[int, int], value: float) -> None:
        data_type = self._types[place]
        if data_type is not None:
            put_number(self.device, place, data_type, value)
