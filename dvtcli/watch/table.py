"""Decoded frames as rows: a column for each signal, in its physical unit."""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.domain.datatypes import Value
from dvtcli.domain.ports import Frame
from dvtcli.watch.decoder import Address, Decoder, Layout, Signal
from dvtcli.watch.frame_reader import OTHER, FrameReader

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
