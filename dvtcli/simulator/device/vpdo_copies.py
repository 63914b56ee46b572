"""Virtual PDOs: copies inside one node between physical pins, motors and application objects.

The rules are those of the application note *PDO Fundamentals* rev 2, section 2; which objects take part is the
family's data. Does not know what a pin is wired to.
"""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.simulator.device.family import Family, MotorCopy, Object, PinCopy
from dvtcli.simulator.device.memory import Memory


class VirtualPdos:
    """Copies values after every change; a pin tied to an object that does not exist is left alone."""

    def __init__(self, memory: Memory, family: Family) -> None:
        self._memory = memory
        self._family = family

    def copy(self) -> None:
        """Bring every tied object up to date."""
        for group in self._family.pins:
            for pin, selected in self._selected(group.selector):
                self._copy_pin(group, pin, (selected, 0))
        if self._family.motors is not None:
            self._copy_motors(self._family.motors)

    def _selected(self, selector: int) -> Iterator[tuple[int, int]]:
        """Pins from 1 with the index they are tied to; an index that ends in FF means none."""
        for pin in range(1, self._memory.number(selector, 0) + 1):
            selected = self._memory.number(selector, pin)
            if selected & 0xFF != 0xFF:
                yield pin, selected

    def _copy_pin(self, group: PinCopy, pin: int, selected: Object) -> None:
        place, bit = divmod(pin - 1, 8) if group.bitwise else (pin - 1, 0)
        if place >= len(group.pins):
            return
        physical = group.pins[place]
        if not group.bitwise:
            self._move(*((selected, physical) if group.to_pin else (physical, selected)))
        elif group.to_pin:
            self._set_bit(physical, bit, self._memory.number(*selected))
        else:
            self._put(selected, self._memory.number(*physical) >> bit & 1)

    def _set_bit(self, place: Object, bit: int, value: int) -> None:
        others = self._memory.number(*place) & ~(1 << bit)
        self._put(place, others | (1 << bit if value else 0))

    def _copy_motors(self, motors: MotorCopy) -> None:
        for _, motor in self._selected(motors.selector):
            for sub_index, profile in motors.down.items():
                self._move((motor, sub_index), profile)
            for sub_index, profile in motors.up.items():
                self._move(profile, (motor, sub_index))

    def _move(self, source: Object, target: Object) -> None:
        if self._memory.exists(*source):
            self._put(target, self._memory.number(*source))

    def _put(self, place: Object, value: int) -> None:
        size = self._memory.size(*place)
        if size is None or not self._memory.exists(*place):
            return
        data = (value & (1 << 8 * size) - 1).to_bytes(size, "little")
        if self._memory.read(*place) != data:
            self._memory.write(*place, data)
