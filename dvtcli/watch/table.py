"""Decoded frames as CSV: a row for each frame, a column for each signal. Knows no files and no bus."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from typing import Protocol

from dvtcli.domain.datatypes import Value
from dvtcli.domain.ports import Frame
from dvtcli.domain.wall_clock import utc
from dvtcli.watch.decoder import Address, Decoder, Layout


class _Writable(Protocol):
    def write(self, text: str, /) -> object: ...


class SignalTable:
    """Writes frames whose signals *decoder* knows to *file*; other frames are only counted in *other*."""

    def __init__(self, file: _Writable, decoder: Decoder) -> None:
        self._rows = csv.writer(file, lineterminator="\n")
        self._decoder = decoder
        names = column_names(decoder)
        self._columns = {key: number for number, key in enumerate(names)}
        self._rows.writerow(["time", "frame", *names.values()])
        self.frames = 0
        self.other = 0

    def decode_by(self, decoder: Decoder) -> bool:
        """Take what *decoder* knows from now on; whether it knows the same signals, which the columns are for."""
        if column_names(decoder).keys() != self._columns.keys():
            return False
        self._decoder = decoder
        return True

    def write(self, frame: Frame) -> None:
        """Write one frame."""
        address = frame.can_id, frame.extended
        layout = self._decoder.layouts.get(address)
        if layout is None or not layout.signals or frame.remote:
            self.other += 1
            return
        cells = [""] * len(self._columns)
        for signal, value in zip(layout.signals, layout.read(frame.data), strict=True):
            if value is not None:
                cells[self._columns[address, signal.key]] = csv_text(value)
        self._rows.writerow([utc(frame.timestamp_s), title(layout), *cells])
        self.frames += 1


def title(layout: Layout) -> str:
    """A frame's name: `TPDO1 node 5`, or the message's of a DBC file."""
    service = layout.service
    return f"{service.label} node {service.node}" if service.node else service.label


def column_names(decoder: Decoder) -> dict[tuple[Address, str], str]:
    """The column of each signal: its key, with its frame's name in front where several frames have the same key."""
    places = [(address, layout, one.key) for address, layout in decoder.layouts.items() for one in layout.signals]
    keys = [key for _, _, key in places]
    return {
        (address, key): key if keys.count(key) == 1 else f"{title(layout)} {key}" for address, layout, key in places
    }


def csv_text(value: Value) -> str:
    """A value as a cell: floats with all their digits, bytes as hex."""
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    return repr(value) if isinstance(value, float) else str(value)


def write_csv(file: _Writable, frames: Iterable[Frame], decoder: Decoder) -> SignalTable:
    """Write all *frames*; the table with its counts."""
    table = SignalTable(file, decoder)
    for frame in frames:
        table.write(frame)
    return table
