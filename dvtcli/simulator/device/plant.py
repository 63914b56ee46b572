"""A motor without load: the state machine of controlword and statusword, and a velocity that follows (CiA 402-2).

A drive keeps the values of its dictionary until its controlword, target velocity or mode changes. From then on target
velocity 60FF moves actual velocity 606C, position 6064 integrates the velocity and mode display 6061 follows 6060. The
velocity follows in every mode.
"""

from __future__ import annotations

from collections.abc import Collection
from enum import IntEnum
from typing import Protocol

from dvtcli.domain.datatypes import DataType
from dvtcli.domain.profile import ObjectAddress
from dvtcli.simulator.device.strict_device import StrictDevice

NEVER = float("inf")


class Source(Protocol):
    """A source of changes to objects of a device."""

    @property
    def due_s(self) -> float:
        """The time of the next poll, in seconds of a monotonic clock; infinite for never."""
        ...

    def poll(self, now_s: float) -> None:
        """Apply the changes due by *now_s* (s)."""
        ...


def put_number(device: StrictDevice, place: ObjectAddress, data_type: DataType, value: float) -> None:
    """Set the object at *place* to *value*, rounded and clipped to its type, if different."""
    data = encoded(data_type, value)
    if device.value(*place) != data:
        device.set_value(*place, data)


def encoded(data_type: DataType, value: float) -> bytes:
    """The bytes of *value*, rounded and clipped to the range of *data_type*."""
    if data_type.limits is not None:
        low, high = data_type.limits
        value = min(high, max(low, round(value)))
    return data_type.encode(value)


#: how often the plant moves (s)
STEP_S = 0.01
CONTROLWORD, STATUSWORD, MODE, MODE_DISPLAY = (0x6040, 0), (0x6041, 0), (0x6060, 0), (0x6061, 0)
TARGET_VELOCITY, ACTUAL_VELOCITY, ACTUAL_POSITION = (0x60FF, 0), (0x606C, 0), (0x6064, 0)
ACCELERATION, QUICK_STOP_OPTION = (0x6083, 0), (0x605A, 0)
_NEEDED = (CONTROLWORD, STATUSWORD, TARGET_VELOCITY, ACTUAL_VELOCITY)
_ORDERS = (CONTROLWORD, TARGET_VELOCITY, MODE)
_DEFAULT_ACCELERATION = 1000.0
#: statusword
_VOLTAGE_ENABLED, _REMOTE, _TARGET_REACHED, _STANDS = 0x0010, 0x0200, 0x0400, 0x1000
#: controlword
_SWITCH_ON, _ENABLE_VOLTAGE, _NO_QUICK_STOP, _ENABLE_OPERATION, _FAULT_RESET, _HALT = (
    0x01,
    0x02,
    0x04,
    0x08,
    0x80,
    0x100,
)
#: quick stop option codes after which the drive stays where it is, and what it has by itself
_STAYS_STOPPED, _DEFAULT_OPTION = range(5, 9), 2


class DriveState(IntEnum):
    """The states by their statusword bits (CiA 402-2, 8.4.2)."""

    NOT_READY_TO_SWITCH_ON = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY_TO_SWITCH_ON = 0x21
    SWITCHED_ON = 0x23
    OPERATION_ENABLED = 0x27
    QUICK_STOP_ACTIVE = 0x07
    FAULT_REACTION_ACTIVE = 0x0F
    FAULT = 0x08


#: states that end by themselves
_PASSING = {
    DriveState.NOT_READY_TO_SWITCH_ON: DriveState.SWITCH_ON_DISABLED,
    DriveState.FAULT_REACTION_ACTIVE: DriveState.FAULT,
}
#: states that no command ends
_DEAF = (*_PASSING, DriveState.FAULT)
#: states without voltage at the motor
_WITHOUT_VOLTAGE = (DriveState.NOT_READY_TO_SWITCH_ON, DriveState.SWITCH_ON_DISABLED)
_STOPPING = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
#: states from which *switch on* and *enable operation* may come
_SHUT_DOWN = DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON, DriveState.OPERATION_ENABLED


def state_of(statusword: int) -> DriveState:
    """The state in *statusword*; bit 5 counts only in states that define bit 5."""
    for state in DriveState:
        mask = 0x6F if state & 0x07 and not state & 0x08 else 0x4F
        if statusword & mask == state:
            return state
    return DriveState.NOT_READY_TO_SWITCH_ON


def next_state(
    state: DriveState, controlword: int, *, reset_fault: bool = False, stop_can_end: bool = False
) -> DriveState:
    """The state after *controlword* in *state* (CiA 402-2, 8.4.1.3).

    *reset_fault* is the rising edge of bit 7; *stop_can_end*: a quick stop may return to operation.
    """
    if state is DriveState.FAULT and reset_fault:
        return DriveState.SWITCH_ON_DISABLED
    if state in _DEAF or controlword & _FAULT_RESET:  # every other command has bit 7 clear
        return state
    if not controlword & _ENABLE_VOLTAGE:
        return DriveState.SWITCH_ON_DISABLED
    if not controlword & _NO_QUICK_STOP:
        return DriveState.QUICK_STOP_ACTIVE if state in _STOPPING else DriveState.SWITCH_ON_DISABLED
    if state is DriveState.QUICK_STOP_ACTIVE:
        enabled = controlword & _SWITCH_ON and controlword & _ENABLE_OPERATION
        return DriveState.OPERATION_ENABLED if enabled and stop_can_end else state
    if not controlword & _SWITCH_ON:  # shutdown
        return DriveState.READY_TO_SWITCH_ON
    if state not in _SHUT_DOWN:
        return state
    return DriveState.OPERATION_ENABLED if controlword & _ENABLE_OPERATION else DriveState.SWITCHED_ON


def is_drive(device: StrictDevice) -> bool:
    """True if *device* has a controlword, a statusword, and a target and an actual velocity."""
    return all(_number_type(device, place) is not None for place in _NEEDED)


class Plant:
    """A motor on *device*, a drive (`is_drive`); objects in *taken* belong to other sources. *due_s* as in `Source`.

    Velocities are in the object's own unit per second; the acceleration is 6083 if not 0, else 1000 per second.
    """

    def __init__(self, device: StrictDevice, taken: Collection[ObjectAddress] = ()) -> None:
        self.device = device
        places = (*_NEEDED, MODE, MODE_DISPLAY, ACTUAL_POSITION, ACCELERATION, QUICK_STOP_OPTION)
        self._types = {place: _number_type(device, place) for place in places}
        self._taken = frozenset(taken)
        self._wake()

    @property
    def due_s(self) -> float:
        """The time of the next movement (s): at once after any change of the device, every 10 ms while turning."""
        return 0.0 if self.device.changes != self._seen else self._next_s

    def poll(self, now_s: float) -> None:
        """Move on to *now_s*, a monotonic time in seconds."""
        if self._told is not None and self.device.value(*STATUSWORD) != self._told:
            self._wake()  # the device was reset, or somebody else turned it
        if not self._resting or self._orders() != self._obeyed:
            self._move(now_s)
        self._seen = self.device.changes

    def _wake(self) -> None:
        """Start from the device's objects, at rest unless its state ends by itself."""
        self.state = state_of(int(self._number(STATUSWORD)))
        self._velocity, self._position = self._number(ACTUAL_VELOCITY), self._number(ACTUAL_POSITION)
        self._controlword = int(self._number(CONTROLWORD))
        self._obeyed, self._resting = self._orders(), self.state not in _PASSING
        #: the last statusword written
        self._told: bytes | None = None
        self._last_s: float | None = None
        self._next_s = NEVER if self._resting else 0.0
        self._seen = self.device.changes

    def _orders(self) -> tuple[bytes, ...]:
        return tuple(self.device.value(*place) for place in _ORDERS if self._types[place] is not None)

    def _move(self, now_s: float) -> None:
        elapsed_s = 0.0 if self._last_s is None else max(0.0, now_s - self._last_s)
        self._obeyed, before = self._orders(), self.state
        self._obey()
        target = self._wanted()
        self._turn(target, elapsed_s)
        reached = self._velocity == target
        self._show(reached=reached)
        turns = bool(self._velocity and self._types[ACTUAL_POSITION])
        self._resting = reached and self.state is before and not turns and not self._stop_passes
        self._last_s, self._next_s = (None, NEVER) if self._resting else (now_s, now_s + STEP_S)

    def _obey(self) -> None:
        """Apply the present controlword and mode."""
        controlword = int(self._number(CONTROLWORD))
        edge = bool(controlword & ~self._controlword & _FAULT_RESET)
        self._controlword = controlword
        if self._stop_passes and not self._velocity:
            self.state = DriveState.SWITCH_ON_DISABLED
        passing, stays = _PASSING.get(self.state), not self._stop_passes
        self.state = passing or next_state(self.state, controlword, reset_fault=edge, stop_can_end=stays)
        if self._types[MODE] is not None:
            self._put(MODE_DISPLAY, self._number(MODE))

    @property
    def _stop_passes(self) -> bool:
        """True if a quick stop is active that ends without voltage at standstill."""
        option = _DEFAULT_OPTION if self._types[QUICK_STOP_OPTION] is None else int(self._number(QUICK_STOP_OPTION))
        return self.state is DriveState.QUICK_STOP_ACTIVE and option not in _STAYS_STOPPED

    def _wanted(self) -> float:
        """The velocity to reach: 0 unless operation is enabled and not halted."""
        if self.state is not DriveState.OPERATION_ENABLED or self._controlword & _HALT:
            return 0.0
        return self._number(TARGET_VELOCITY)

    def _turn(self, target: float, elapsed_s: float) -> None:
        """Move for *elapsed_s*, from a velocity or position set by others, if any."""
        self._velocity = self._as_held(ACTUAL_VELOCITY, self._velocity)
        self._position = self._as_held(ACTUAL_POSITION, self._position)
        most = (self._number(ACCELERATION) or _DEFAULT_ACCELERATION) * elapsed_s
        before = self._velocity
        if ACTUAL_VELOCITY not in self._taken:
            self._velocity += min(most, max(-most, target - before))
        self._position += (before + self._velocity) / 2 * elapsed_s
        self._position = (self._position + (1 << 31)) % (1 << 32) - (1 << 31)  # as a 32-bit counter

    def _show(self, *, reached: bool) -> None:
        self._put(ACTUAL_VELOCITY, self._velocity)
        self._put(ACTUAL_POSITION, self._position)
        more = _REMOTE | (0 if self.state in _WITHOUT_VOLTAGE else _VOLTAGE_ENABLED)
        more |= (_TARGET_REACHED if reached else 0) | (0 if self._velocity else _STANDS)
        self._put(STATUSWORD, self.state | more)
        self._told = self.device.value(*STATUSWORD)

    def _as_held(self, place: ObjectAddress, value: float) -> float:
        """*value* if the object contains its rounded form, else the object's value."""
        data_type = self._types[place]
        if data_type is None or encoded(data_type, value) == self.device.value(*place):
            return value
        return self._number(place)

    def _number(self, place: ObjectAddress) -> float:
        data_type = self._types[place]
        value = None if data_type is None else data_type.decode(self.device.value(*place))
        return float(value) if isinstance(value, int) else 0.0

    def _put(self, place: ObjectAddress, value: float) -> None:
        data_type = self._types[place]
        if data_type is not None and place not in self._taken:
            put_number(self.device, place, data_type, value)


def _number_type(device: StrictDevice, place: ObjectAddress) -> DataType | None:
    entry = device.dictionary.entry(*place)
    return None if entry is None or entry.data_type is None or entry.data_type.limits is None else entry.data_type
