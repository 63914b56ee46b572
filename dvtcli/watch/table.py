"""Decoded frames as rows with a column for each signal, and signals of a recording over time, found by their names."""

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
from dvtcli.watch.decoder import Address, Decoder, Layout, Signal
from dvtcli.watch.frame_reader import OTHER, FrameReader
from dvtcli.watch.statistics import SHORTEST_S, Point, physical_points

Place = tuple[Address, str]


@dataclass(frozen=True, slots=True)
class Column:
    """A *signal* with its full *name*, independent of other nodes' mappings, and without unit."""

    name: str
    signal: Signal

    @property
    def header(self) -> str:
        """The name with the unit: `TPDO1 node 5 606C:00 Velocity actual value [rpm]`."""
        return f"{self.name} [{self.signal.unit}]" if self.signal.unit else self.name

    def cell(self, value: Value) -> Value:
        """The cell for the raw *value*: the number in the column's unit, else *value* itself."""
        if isinstance(value, int | float) and self.signal.meaning.has_number:
            return self.signal.meaning.number(value)
        return value


class SignalRows:
    """Turns frames into values of the signals in *decoder* that match *wanted* (small letters).

    With a *reader*, frames of services that it has words for are rows without values. *only* are kinds of frames, as in
    `typed_frame.READ_KINDS`; none: all. *other* counts frames without a signal and without words.
    """

    def __init__(
        self,
        decoder: Decoder,
        wanted: str = "",
        reader: FrameReader | None = None,
        only: frozenset[str] = frozenset(),
    ) -> None:
        self.decoder = decoder
        self.reader = reader
        self._wanted, self._only = wanted, only
        #: what the last frame says
        self.reading = OTHER
        chosen = chosen_columns(decoder, wanted)
        self.columns = list(chosen.values())
        #: the frame of each column
        self.services = [decoder.layouts[address].service for address, _ in chosen]
        self._numbers = {place: number for number, place in enumerate(chosen)}
        self._of_frames = self._by_frame()
        self._titles: dict[Address, str] = {}
        self.frames = 0
        self.other = 0

    def _by_frame(self) -> dict[Address, tuple[Layout, tuple[int | None, ...]]]:
        """The layout by frame address, and the column of each of its signals."""
        layouts = {address: self.decoder.layouts[address] for address, _ in self._numbers}
        return {
            address: (layout, tuple(self._numbers.get((address, key)) for key in layout.keys))
            for address, layout in layouts.items()
        }

    def decode_by(self, decoder: Decoder) -> bool:
        """Use *decoder* from now on; False if its signals differ from the columns."""
        if chosen_columns(decoder, self._wanted).keys() != self._numbers.keys():
            return False
        self.decoder = decoder
        self._of_frames = self._by_frame()
        self._titles.clear()
        if self.reader is not None:
            self.reader.know(decoder)
        return True

    def layout(self, frame: Frame) -> Layout:
        """The layout of *frame*; may change after new decoding."""
        return self.decoder.layout(frame)

    def values(self, frame: Frame) -> list[tuple[int, Value]] | None:
        """The raw values of the next frame, each with its column number; None if the frame is no row.

        They are empty for a row in words.
        """
        if self.reader is not None:
            self.reading = self.reader.read(frame)
            if self._only and not self.reading.is_one_of(self._only):
                return None
        known = self._of_frames.get((frame.can_id, frame.extended))
        if known is None or frame.remote:
            if self.reading.text and self._wanted in f"{self.title(frame)} {self.reading.text}".lower():
                self.frames += 1
                return []
            self.other += 1
            return None
        self.frames += 1
        layout, numbers = known
        return [
            (number, value)
            for number, value in zip(numbers, layout.read(frame.data), strict=True)
            if number is not None and value is not None
        ]

    def row(self, frame: Frame) -> list[Value | None] | None:
        """The cells of a frame, None without any of the signals."""
        values = self.values(frame)
        if values is None:
            return None
        cells: list[Value | None] = [None] * len(self.columns)
        for number, value in values:
            cells[number] = self.columns[number].cell(value)
        return cells

    def title(self, frame: Frame) -> str:
        """The name of a frame with a row."""
        address = frame.can_id, frame.extended
        if address not in self._titles:
            self._titles[address] = title(self.decoder.layout(frame))
        return self._titles[address]

    def head(self, frame: Frame) -> str:
        """The name of the last frame, with its words if it has no values."""
        text = self.reading.text
        return f"{self.title(frame)}: {text}" if text else self.title(frame)


def title(layout: Layout) -> str:
    """A frame's name: `TPDO1 node 5`, or the message name of a DBC file."""
    service = layout.service
    return f"{service.label} node {service.node}" if service.node else service.label


def all_columns(decoder: Decoder) -> dict[Place, Column]:
    """A column for each signal, named by frame, object and signal."""
    return {
        (address, signal.key): Column(_name(layout, signal), signal)
        for address, layout in decoder.layouts.items()
        for signal in layout.signals
    }


def chosen_columns(decoder: Decoder, wanted: str) -> dict[Place, Column]:
    """Columns whose name contains *wanted* (small letters)."""
    return {place: column for place, column in all_columns(decoder).items() if wanted in column.name.lower()}


def _name(layout: Layout, signal: Signal) -> str:
    return signal_name(title(layout), signal.object, signal.key)


def signal_name(title: str, place: str, key: str) -> str:
    """The full name of signal *key* in frame *title*: with its object *place* unless *key* begins with it."""
    return " ".join(filter(None, [title, "" if key.startswith(place) else place, key]))


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
