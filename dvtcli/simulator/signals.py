"""Signals: objects of a simulated device that move by themselves, as written in one line of text.

`606C=sine(1500,2s)` makes object 606C:00 swing. Time is passed in, in seconds of a monotonic clock; a signal begins
when it is polled for the first time. Does not know PDOs: the device sends what changed as it is configured.
"""

from __future__ import annotations

import csv
import math
import random
import re
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from dvtcli.domain.datatypes import DataType, Kind
from dvtcli.simulator.device import StrictDevice

#: how often a signal is written (s)
SAMPLE_S = 0.01
Shape = Callable[[float], float]

_FORM = re.compile(r"(?P<index>[0-9A-Fa-f]{4})(?::(?P<sub>[0-9A-Fa-f]{1,2}))?=(?P<shape>[a-z]+)\((?P<rest>.*)\)")
_NUMBER = re.compile(r"[+-]?\d{1,20}(\.\d{1,9})?|[+-]?0[xX][0-9a-fA-F]{1,16}")
_PERIOD = re.compile(r"(\d{1,9}(?:\.\d{1,9})?)(ms|s|min)?")
_UNITS = {None: 1.0, "s": 1.0, "ms": 1e-3, "min": 60.0}
_FORMS = {
    "sine": "sine(AMPLITUDE,PERIOD)",
    "ramp": "ramp(FROM,TO,PERIOD)",
    "square": "square(A,B,PERIOD)",
    "walk": "walk(STEP,MIN,MAX,PERIOD)",
    "const": "const(VALUE)",
    "csv": "csv(FILE,COLUMN)",
}


@dataclass(frozen=True, slots=True)
class Signal:
    """What object *index*:*sub_index* does: *shape* gives its value at a time in seconds since it began, 0…"""

    index: int
    sub_index: int
    shape: Shape = field(repr=False)

    @classmethod
    def parse(cls, text: str) -> Signal:
        """Read `INDEX[:SUB]=SHAPE(…)`, index and sub-index in hex; ValueError says what would be right.

        `sine(AMPLITUDE,PERIOD)` around 0; `ramp(FROM,TO,PERIOD)`, then from FROM again; `square(A,B,PERIOD)`, half of
        the period each; `walk(STEP,MIN,MAX,PERIOD)`, by up to STEP each period; `const(VALUE)`; `csv(FILE,COLUMN)`:
        rows of a time in seconds and values, COLUMN counted from 1 after the time or named in the first row, each
        value holds until the next row, the last one for ever. A period is `2s`, `500ms`, `1min` or a number of seconds.
        """
        found = _FORM.fullmatch(text.strip())
        if found is None or found["shape"] not in _FORMS:
            raise ValueError(
                f"{text!r} is no signal; write 606C=sine(1500,2s), with one of {', '.join(_FORMS.values())}"
            )
        shape = _shape(found["shape"], [word.strip() for word in found["rest"].split(",")])
        return cls(int(found["index"], 16), int(found["sub"] or "0", 16), shape)


def sine(amplitude: float, period_s: float) -> Shape:
    """Swings between -*amplitude* and *amplitude*, beginning with 0."""
    return lambda t_s: amplitude * math.sin(2 * math.pi * t_s / period_s)


def ramp(first: float, last: float, period_s: float) -> Shape:
    """Rises (or falls) from *first* to *last* in each period."""
    return lambda t_s: first + (last - first) * (t_s % period_s) / period_s


def square(one: float, other: float, period_s: float) -> Shape:
    """*one* for half of each period, then *other*."""
    return lambda t_s: one if t_s % period_s < period_s / 2 else other


def walk(step: float, lowest: float, highest: float, period_s: float) -> Shape:
    """Moves by up to *step* each period, within its limits, from their middle; the same way every time."""
    chance = random.Random(0)  # noqa: S311 (a simulation that can be repeated, no secret)
    values = [(lowest + highest) / 2]

    def value(t_s: float) -> float:
        steps = int(t_s / period_s)
        while len(values) <= min(steps, _MOST_STEPS):
            moved = values[-1] + chance.uniform(-step, step)
            values.append(min(highest, max(lowest, moved)))
        return values[steps % len(values)]

    return value


#: a walk begins anew after so many steps
_MOST_STEPS = 100_000


def rows(points: list[tuple[float, float]]) -> Shape:
    """Holds each value of *points* (time in s, value), in order of time, until the next one."""
    times = [time_s for time_s, _ in points]
    return lambda t_s: points[max(0, bisect_right(times, t_s) - 1)][1]


def read_rows(path: Path, column: str) -> list[tuple[float, float]]:
    """The times (s) and values of *column* in CSV file *path*; ValueError where there are none."""
    try:
        lines = [line for line in csv.reader(path.read_text("utf-8").splitlines()) if line]
    except (OSError, UnicodeError, csv.Error) as wrong:
        raise ValueError(f"{path}: {wrong}") from wrong
    names = [name.strip() for name in lines[0]] if lines and not _is_number(lines[0][0]) else []
    body = lines[1:] if names else lines
    place = names.index(column) if column in names else int(column) if column.isdecimal() else 0
    try:
        points = [(float(line[0]), float(line[place])) for line in body]
    except (ValueError, IndexError) as wrong:
        raise ValueError(f"{path}: rows are a time in seconds and numbers ({wrong})") from wrong
    if not points or place == 0 or not all(math.isfinite(each) for point in points for each in point):
        raise ValueError(f"{path} has no column {column!r} with values; columns are counted from 1 after the time")
    return sorted(points)


class SignalSource:
    """*signal* at work on *device*; ValueError where the device has no such number object. *due_s* as in `Source`."""

    def __init__(self, device: StrictDevice, signal: Signal) -> None:
        entry = device.dictionary.entry(signal.index, signal.sub_index)
        place = f"{signal.index:04X}:{signal.sub_index:02X}"
        if (
            entry is None
            or entry.data_type is None
            or not (entry.data_type.limits or entry.data_type.kind is Kind.REAL)
        ):
            raise ValueError(f"node {device.node_id} has no object {place} that holds a number")
        self.due_s = 0.0
        self._device = device
        self._signal = signal
        self._type = entry.data_type
        self._began_s: float | None = None

    def poll(self, now_s: float) -> None:
        """Let the object have its value of *now_s*."""
        if self._began_s is None:
            self._began_s = now_s
        value = self._signal.shape(now_s - self._began_s)
        put_number(self._device, (self._signal.index, self._signal.sub_index), self._type, value)
        self.due_s = now_s + SAMPLE_S


def put_number(device: StrictDevice, place: tuple[int, int], data_type: DataType, value: float) -> None:
    """Let *device* have *value* in the object at *place*, rounded and clipped to its type, if it is another one."""
    if data_type.limits is not None:
        low, high = data_type.limits
        value = min(high, max(low, round(value)))
    data = data_type.encode(value)
    if device.value(*place) != data:
        device.set_value(*place, data)


def _shape(name: str, words: list[str]) -> Shape:
    wanted = _FORMS[name].count(",") + 1
    if len(words) != wanted or not all(words):
        raise ValueError(f"write {_FORMS[name]}")
    match name:
        case "sine":
            return sine(_number(words[0]), _period(words[1]))
        case "ramp":
            return ramp(_number(words[0]), _number(words[1]), _period(words[2]))
        case "square":
            return square(_number(words[0]), _number(words[1]), _period(words[2]))
        case "walk":
            step, lowest, highest = map(_number, words[:3])
            if lowest > highest or step < 0:
                raise ValueError(f"write {_FORMS[name]}, MIN up to MAX and STEP from 0")
            return walk(step, lowest, highest, _period(words[3]))
        case "csv":
            return rows(read_rows(Path(words[0]), words[1]))
    constant = _number(words[0])
    return lambda _: constant


def _number(text: str) -> float:
    if not _NUMBER.fullmatch(text):
        raise ValueError(f"{text!r} is no number")
    return float(int(text, 16)) if "x" in text.lower() else float(text)


def _period(text: str) -> float:
    found = _PERIOD.fullmatch(text)
    period_s = float(found[1]) * _UNITS[found[2]] if found else 0.0
    if period_s < 1e-3:
        raise ValueError(f"{text!r} is no period of 1 ms or more; write 2s, 500ms or 1min")
    return period_s


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
