"""Signals: objects of a simulated device that change by themselves, and their text form.

`606C=sine(1500,2s)` moves object 606C:00, `5:606C=…` the object of node 5. Times are seconds on a monotonic clock; a
signal begins with its first poll. The device sends the changes as configured.
"""

from __future__ import annotations

import csv
import math
import random
import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dvtcli.domain.datatypes import DataType, Kind
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.files.input_file import read_input
from dvtcli.simulator.device.plant import put_number
from dvtcli.simulator.device.strict_device import StrictDevice

Shape = Callable[[float], float]

_COLUMN = re.compile(r"[0-9]{1,4}")
#: A larger CSV file is no signal (bytes).
_MOST_BYTES = 16 << 20
#: a walk begins anew after so many steps
_MOST_STEPS = 100_000


def sine(amplitude: float, period_s: float) -> Shape:
    """Swings between -*amplitude* and *amplitude*, beginning with 0."""
    return lambda t_s: amplitude * math.sin(2 * math.pi * t_s / period_s)


def ramp(first: float, last: float, period_s: float) -> Shape:
    """Rises (or falls) from *first* to *last* in each period."""
    return lambda t_s: first + (last - first) * (t_s % period_s) / period_s


def square(one: float, other: float, period_s: float) -> Shape:
    """*one* for half of each period, *other* for the rest."""
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


def rows(points: list[tuple[float, float]]) -> Shape:
    """The values of *points* (time in s, value) in order of time, each until the next."""
    times = [time_s for time_s, _ in points]
    return lambda t_s: points[max(0, bisect_right(times, t_s) - 1)][1]


class RowsError(ValueError):
    """A CSV file has no usable rows; *place* is its path, with `:LINE` if known."""

    def __init__(self, text: str, place: str) -> None:
        super().__init__(text)
        self.place = place


def read_rows(path: Path, column: str) -> list[tuple[float, float]]:
    """The times (s) and values of *column* in CSV file *path*. Raises RowsError if there are none."""
    try:
        reader = csv.reader(_lines(path))
        numbered = [(reader.line_num, line) for line in reader if line]
    except (UnicodeError, csv.Error) as wrong:
        raise RowsError(f"no CSV file: {wrong}", str(path)) from wrong
    names = [name.strip() for name in numbered[0][1]] if numbered and not _is_number(numbered[0][1][0]) else []
    place = names.index(column) if column in names else int(column) if _COLUMN.fullmatch(column) else 0
    if numbered and place >= max(len(line) for _, line in numbered):
        place = 0  # a number beyond every row is no column either
    points = [(_cell(path, line, cells, 0), _cell(path, line, cells, place)) for line, cells in numbered[bool(names) :]]
    if not points or place == 0:
        known = f"; it has {', '.join(names[1:])}" if len(names) > 1 else ""
        raise RowsError(f"no column {column!r} with values; columns count from 1 after the time{known}", str(path))
    return sorted(points)


def _lines(path: Path) -> list[str]:
    """The lines of *path*. Raises OSError if unreadable, InputFileError for no regular file or too much data."""
    return read_input(path, _MOST_BYTES, "file of a signal").decode("utf-8-sig").splitlines(keepends=True)


def _cell(path: Path, line: int, cells: list[str], place: int) -> float:
    try:
        value = float(cells[place])
    except (ValueError, IndexError):
        value = math.nan
    if not math.isfinite(value):
        raise RowsError("rows are a time in seconds and numbers", f"{path}:{line}")
    return value


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


#: how often a signal is written (s)
SAMPLE_S = 0.01

_FORM = re.compile(
    r"(?:(?P<node>\d{1,3}|0[xX][0-9A-Fa-f]{1,2}):)?"
    r"(?P<index>[0-9A-Fa-f]{4})(?::(?P<sub>[0-9A-Fa-f]{1,2}))?=(?P<shape>[a-z]+)\((?P<rest>.*)\)"
)
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
class SimulatedSignal:
    """The signal of object *index*:*sub_index*: *shape* maps the time since its start (s, 0…) to a value.

    *node_id* is 1..127, None for the first simulated node.
    """

    index: int
    sub_index: int
    shape: Shape = field(repr=False)
    node_id: int | None = None

    @classmethod
    def parse(cls, text: str) -> SimulatedSignal:
        """Read `[NODE:]INDEX[:SUB]=SHAPE(…)`, index and sub-index in hex. Raises ValueError with the correct form.

        `sine(AMPLITUDE,PERIOD)` around 0; `ramp(FROM,TO,PERIOD)`, repeated; `square(A,B,PERIOD)`, half of the period
        each; `walk(STEP,MIN,MAX,PERIOD)`, by up to STEP each period; `const(VALUE)`; `csv(FILE,COLUMN)`: rows of a time
        in seconds and values, COLUMN counted from 1 after the time or named in the first row; each value lasts until
        the next row, the last for ever (RowsError if the file has none). A period is `2s`, `500ms`, `1min` or a number
        of seconds.
        """
        found = _FORM.fullmatch(text.strip())
        if found is None or found["shape"] not in _FORMS:
            raise ValueError(f"no such signal; write 606C=sine(1500,2s), with one of {', '.join(_FORMS.values())}")
        name, node = found["shape"], found["node"]
        words = found["rest"].rsplit(",", 1) if name == "csv" else found["rest"].split(",")  # a file may have commas
        shape = _shape(name, [word.strip() for word in words])
        node_id = None if node is None else int(node, 16 if node[1:2] in ("x", "X") else 10)
        return cls(int(found["index"], 16), int(found["sub"] or "0", 16), shape, node_id)


def read_signals(
    words: Iterable[str], dictionaries: Sequence[tuple[int, ObjectDictionary]]
) -> tuple[SimulatedSignal, ...]:
    """The signals in *words*, for nodes by node-ID and dictionary. Raises ValueError naming the wrong word.

    Also wrong: a node that is not simulated, an object without a number, and two signals for one object. Files raise
    RowsError and OSError.
    """
    found: dict[tuple[int, int, int], SimulatedSignal] = {}
    known = dict(dictionaries)
    for word in words:
        try:
            signal = SimulatedSignal.parse(word)
            node_id = dictionaries[0][0] if signal.node_id is None else signal.node_id
            if node_id not in known:
                raise ValueError(f"no simulated node {node_id}")
            number_type(known[node_id], signal.index, signal.sub_index)
            if (key := (node_id, signal.index, signal.sub_index)) in found:
                raise ValueError("another signal moves that object already")
        except RowsError:
            raise
        except ValueError as wrong:
            raise ValueError(f"{word}: {wrong}") from wrong
        found[key] = signal
    return tuple(found.values())


def number_type(dictionary: ObjectDictionary, index: int, sub_index: int) -> DataType:
    """The type of an object suitable for a signal. Raises ValueError if there is none."""
    entry = dictionary.entry(index, sub_index)
    data_type = None if entry is None else entry.data_type
    place = f"{index:04X}:{sub_index:02X}"
    if data_type is None or not (data_type.limits or data_type.kind is Kind.REAL):
        raise ValueError(f"the node has no object {place} that holds a number")
    if 0x1000 <= index < 0x2000:
        raise ValueError(f"{place} says how the node communicates; signals move what it measures, from 2000 on")
    return data_type


class SignalSource:
    """*signal* applied to *device*; *due_s* as in `Source`. Raises ValueError if the device lacks the number object."""

    def __init__(self, device: StrictDevice, signal: SimulatedSignal) -> None:
        self.due_s = 0.0
        self._device = device
        self._signal = signal
        self._type = number_type(device.dictionary, signal.index, signal.sub_index)
        self._began_s: float | None = None

    def poll(self, now_s: float) -> None:
        """Set the object to its value at *now_s*."""
        if self._began_s is None:
            self._began_s = now_s
        value = self._signal.shape(now_s - self._began_s)
        put_number(self._device, (self._signal.index, self._signal.sub_index), self._type, value)
        self.due_s = now_s + SAMPLE_S


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
        raise ValueError(f"{text!r} is not a number")
    return float(int(text, 16)) if "x" in text.lower() else float(text)


def _period(text: str) -> float:
    found = _PERIOD.fullmatch(text)
    period_s = float(found[1]) * _UNITS[found[2]] if found else 0.0
    if period_s < 1e-3:
        raise ValueError(f"{text!r} is not a period of 1 ms or more; write 2s, 500ms or 1min")
    return period_s
