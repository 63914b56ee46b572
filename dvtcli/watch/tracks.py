"""Signals of a recording over time, found by their names."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from math import inf, isfinite
from typing import TypeVar

from dvtcli.domain.datatypes import Value
from dvtcli.domain.object_dictionary import normalised
from dvtcli.domain.ports import Frame
from dvtcli.errors import UsageError
from dvtcli.watch.decoder import Address, Decoder, Signal
from dvtcli.watch.statistics import SHORTEST_S, Point, physical_points
from dvtcli.watch.table import Column, Place

_Place = TypeVar("_Place", bound=Hashable)


@dataclass(slots=True)
class Track:
    """A signal with its full *name*, and its samples as times (s since 1970) and raw numbers."""

    name: str
    signal: Signal
    times_s: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)

    def points(self) -> list[Point]:
        """The samples in their physical unit, each as a point."""
        pairs = zip(self.times_s, self.values, strict=True)
        return physical_points((Point(time_s, value, value, value) for time_s, value in pairs), self.signal.meaning)

    def ranges(self, span_s: tuple[float, float], slots: int) -> list[Point]:
        """The samples in their physical unit, consecutive ones of a slot as one point: *slots* equal parts of *span_s*.

        Each is the range of its samples, which begins at the first of them.
        """
        begin_s, end_s = span_s
        length_s = max(end_s - begin_s, SHORTEST_S)
        points, present = list[Point](), None
        start_s = low = high = last = 0.0
        for time_s, value in zip(self.times_s, self.values, strict=True):
            slot = int((time_s - begin_s) / length_s * slots)
            if slot != present:
                if present is not None:
                    points.append(Point(start_s, low, high, last))
                present, start_s, low, high = slot, time_s, value, value
            elif value < low:
                low = value
            elif value > high:
                high = value
            last = value
        if present is not None:
            points.append(Point(start_s, low, high, last))
        return physical_points(points, self.signal.meaning)


def find_tracks(words: Sequence[str], columns: Mapping[_Place, Column]) -> dict[_Place, Track]:
    """An empty track for each of *columns* named in *words*, in their order.

    A word is a signal's name or object, as displayed. Raises UsageError with the nearest names if none fits.
    """
    found: dict[_Place, Track] = {}
    for word in words:
        places = [place for place, column in columns.items() if _fits(word, column.signal, column)]
        if not places:
            objects = [column.signal.object for column in columns.values() if column.signal.object]
            keys = [column.signal.key for column in columns.values()]
            raise _unknown(word, list(dict.fromkeys([*keys, *(column.name for column in columns.values()), *objects])))
        keys = [columns[place].signal.key for place in places]
        for place, key in zip(places, keys, strict=True):  # name the frame only if two frames have such a signal
            found[place] = Track(key if keys.count(key) == 1 else columns[place].name, columns[place].signal)
    return found


def _fits(word: str, signal: Signal, column: Column) -> bool:
    wanted = normalised(word)
    names = (signal.key, signal.name, column.name, column.header, column.name.rpartition(".")[2])
    known = {normalised(text) for text in names if text}
    return wanted in known or word.upper().removeprefix("0X") in _objects(signal)


def _objects(signal: Signal) -> set[str]:
    """Accepted spellings of the signal's object: `606C:00`, `606C:0`, `606C`."""
    index, _, sub_index = signal.object.partition(":")
    if not sub_index:
        return set()
    return {signal.object, f"{index}:{int(sub_index, 16):X}", *([index] if sub_index == "00" else [])}


def _unknown(word: str, names: list[str]) -> UsageError:
    if not names:
        return UsageError(
            f"no signals, so {word!r} is unknown",
            hint="name a DBC file, an EDS, the nodes or simulated nodes to decode by",
        )
    lower = {name.lower(): name for name in names}
    near = [lower[name] for name in get_close_matches(word.lower(), lower, n=3, cutoff=0.4)]
    return UsageError(f"unknown signal {word!r}", hint=f"did you mean {', '.join(near or names[:3])}?")


def fill(tracks: Mapping[Place, Track], frames: Iterable[Frame], decoder: Decoder) -> tuple[float, float]:
    """Add the samples of *frames* to their tracks; the recording's first and last time (s since 1970)."""
    #: the places of a frame's signals that have tracks, by address, with what reads them all
    wanted = dict[Address, tuple[Callable[[bytes], list[Value | None]], list[tuple[int, Track]]]]()
    for address in {address for address, _ in tracks}:
        layout = decoder.layouts[address]
        places = [(number, tracks.get((address, key))) for number, key in enumerate(layout.keys)]
        wanted[address] = layout.read, [(number, track) for number, track in places if track is not None]
    first_s, last_s = inf, -inf
    for frame in frames:
        time_s = frame.timestamp_s
        first_s = min(first_s, time_s)
        last_s = max(last_s, time_s)
        of_frame = wanted.get((frame.can_id, frame.extended))
        if of_frame is None or frame.remote:
            continue
        read, own = of_frame
        values = read(frame.data)
        for number, track in own:
            value = values[number]
            if isinstance(value, int | float) and isfinite(value):
                track.times_s.append(time_s)
                track.values.append(float(value))
    return (first_s, last_s) if first_s <= last_s else (0.0, 0.0)


def fill_rows(tracks: Mapping[int, Track], rows: Iterable[tuple[float, list[float | None]]]) -> tuple[float, float]:
    """Add the cells in *rows* to the tracks of their columns; the first and last time (s)."""
    first_s = last_s = None
    for time_s, cells in rows:
        first_s = time_s if first_s is None else min(first_s, time_s)
        last_s = time_s if last_s is None else max(last_s, time_s)
        for number, track in tracks.items():
            cell = cells[number]
            if cell is not None:
                track.times_s.append(time_s)
                track.values.append(cell)
    return first_s or 0.0, last_s or 0.0
