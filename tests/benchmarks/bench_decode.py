"""What a frame of a recording costs `decode`, and its readers, beside python-can's reader of the same file.

    python -m tests.benchmarks decode

A recording of 30,000 frames of two nodes: SYNC, heartbeats, TPDOs with and without a known mapping. Processor time of
whole processes without what they take for ten frames; the readers are measured within one process. What the words of
services cost is measured beside a `decode` that has none.
"""

from __future__ import annotations

import random
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from time import process_time
from typing import Any

import can

from dvtcli.files.recordings.recording_file import read_recording
from tests.benchmarks.figures import ROOT, Figure, cpu_s

FRAMES, FEW = 30_000, 10
SUFFIXES = (".log", ".asc", ".blf")
ENTRY = "import sys; from dvtcli.__main__ import entry; sys.argv[1:] = {words!r}; entry()"
NETWORK = str(ROOT / "examples" / "line.yaml")
#: what is decoded by: options before the command and behind the file, with the goal as a ratio to python-can's reader
WAYS: list[tuple[str, str, list[str], list[str], float]] = [
    ("decode .log, network file", ".log", [], ["-d", NETWORK], 4),
    ("decode .log, EDS", ".log", ["--eds", "gen4"], [], 4),
    ("decode .log as JSON", ".log", [], ["-d", NETWORK, "--json"], 5),
    ("decode .log as CSV", ".log", [], ["-d", NETWORK, "--csv"], 4),
    ("decode .asc, network file", ".asc", [], ["-d", NETWORK], 4),
    ("decode .blf, network file", ".blf", [], ["-d", NETWORK], 6),
]
#: the same without words: PDOs and their values stay, every other frame is bytes
WITHOUT_WORDS = """
import dvtcli.watch.frame_reader as frame_reader
def reader_of(self, layout):
    reading = frame_reader._PDO if layout.service.kind == "pdo" else frame_reader.OTHER
    return lambda frame: reading
frame_reader.FrameReader._reader_of = reader_of
"""
#: the same rows without words: in a CSV file a frame of a service has its row only if its reading has a text
WITHOUT_WORDS_IN_ROWS = """
import dvtcli.watch.frame_reader as frame_reader
def reader_of(self, layout):
    kind = layout.service.kind
    words = "-" if kind in self._by_kind else ""
    reading = frame_reader.Reading(kind, words)
    return lambda frame: reading
frame_reader.FrameReader._reader_of = reader_of
"""
#: `WAYS` whose words are measured, and what leaves them out
WORDS, MOST_FOR_WORDS = [(WAYS[0], WITHOUT_WORDS), (WAYS[2], WITHOUT_WORDS), (WAYS[3], WITHOUT_WORDS_IN_ROWS)], 1.1
#: CAN-IDs of ten frames, and how many bytes they have
IDS = [
    (0x080, 0),
    (0x701, 1),
    (0x181, 6),
    (0x185, 3),
    (0x281, 8),
    (0x381, 8),
    (0x181, 6),
    (0x185, 3),
    (0x285, 4),
    (0x705, 1),
]


def record(path: Path, count: int) -> Path:
    """Write *count* frames to *path*, the same on each call."""
    drawn = random.Random(1)
    time_s = 1764380000.0
    with can.Logger(str(path)) as writer:
        for number in range(count):
            time_s += drawn.uniform(0.0001, 0.0004)
            can_id, size = IDS[number % len(IDS)]
            data = drawn.randbytes(size) if size > 1 else b"\x05"[:size]
            message = can.Message(time_s, can_id, is_extended_id=False, data=data, channel="can0")
            writer.on_message_received(message)
    return path


def by_python_can(path: Path) -> Iterable[Any]:
    """What python-can's own reader makes of *path*."""
    extra: dict[str, Any] = {"relative_timestamp": False} if path.suffix == ".asc" else {}
    return can.LogReader(str(path), **extra)


def frame_us(path: Path, read: Callable[[Path], Iterable[Any]]) -> float:
    """Processor time (µs) that *read* takes for each frame of *path*."""
    began = process_time()
    count = sum(1 for _ in read(path))
    return 1e6 * (process_time() - began) / count


def figures(rounds: int) -> Iterator[Figure]:
    """Decoding and reading, each beside python-can's reader."""
    with tempfile.TemporaryDirectory() as folder:
        many = {suffix: record(Path(folder) / f"many{suffix}", FRAMES) for suffix in SUFFIXES}
        few = {suffix: record(Path(folder) / f"few{suffix}", FEW) for suffix in SUFFIXES}
        for suffix, path in many.items():
            pairs = [(frame_us(path, read_recording), frame_us(path, by_python_can)) for _ in range(rounds)]
            own, other = zip(*pairs, strict=True)
            yield Figure(f"a frame of {suffix} read", "µs", own, "python-can's reader", other, most=3)
        for name, suffix, before, behind, most in WAYS:
            pairs = []
            for _ in range(rounds):
                took = [
                    cpu_s(["-c", ENTRY.format(words=[*before, "decode", str(path), *behind])])
                    for path in (many[suffix], few[suffix])
                ]
                other_us = frame_us(many[suffix], by_python_can)
                pairs.append((1e6 * (took[0] - took[1]) / (FRAMES - FEW), other_us))
            own, other = zip(*pairs, strict=True)
            yield Figure(f"a frame: {name}", "µs", own, f"python-can reads {suffix}", other, most=most)
        for (name, suffix, before, behind, _), without in WORDS:
            pairs = []
            for _ in range(rounds):
                entries = [
                    ENTRY.format(words=[*before, "decode", str(path), *behind]) for path in (many[suffix], few[suffix])
                ]
                took = [cpu_s(["-c", code]) for entry in entries for code in (entry, without + entry)]
                own_s, bare_s = took[0] - took[2], took[1] - took[3]
                pairs.append((1e6 * own_s / (FRAMES - FEW), 1e6 * bare_s / (FRAMES - FEW)))
            own, other = zip(*pairs, strict=True)
            yield Figure(f"a frame and its words: {name}", "µs", own, "without words", other, most=MOST_FOR_WORDS)
