"""Values and dictionary entries as answers. Knows no terminal and no session."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from math import isfinite
from typing import ClassVar

from dvtcli.domain.abort import Abort, abort_text
from dvtcli.domain.datatypes import Value
from dvtcli.domain.object_scalings import NOTHING
from dvtcli.domain.scaling import Scaling
from dvtcli.domain.text import join_some
from dvtcli.errors import DvtcliError, ended_with
from dvtcli.operations.results.documents import Answer, Document, Rows, Short, hex_bytes, json_value, physical_document


@dataclass(frozen=True, slots=True)
class ValueRead(Answer):
    """An object's value, raw and decoded, and its physical *meaning*; *written*: set by a write."""

    renderer: ClassVar = "value_lines:value_lines"

    node: int
    object: str
    name: str
    value: Value
    raw: bytes
    type_name: str
    meaning: Scaling = NOTHING
    written: bool = False
    exit_code: int = 0

    @property
    def unit(self) -> str:
        """The physical unit, empty for none."""
        return self.meaning.unit

    @property
    def physical(self) -> float | None:
        """The number in its unit, None if not a number."""
        number = isinstance(self.value, int | float) and self.meaning.has_number
        return self.meaning.number(self.value) if number and isinstance(self.value, int | float) else None

    @property
    def text(self) -> str:
        """The value as on screens: `48.0 V (768)`; empty without a scaling."""
        return self.meaning.text(self.value, 8 * len(self.raw))

    def document(self) -> Document:
        """`dvtcli.value/1`."""
        return {
            "schema": "dvtcli.value/1",
            "node": self.node,
            "object": self.object,
            "value": json_value(self.value),
            "raw": hex_bytes(self.raw),
            "type": self.type_name,
            "name": self.name,
            "physical": physical_document(self.value, self.meaning),
        }


@dataclass(frozen=True, slots=True)
class ObjectRow(Short):
    """A dictionary entry as shown by `objects`."""

    object: str
    name: str
    type_name: str
    access: str
    mappable: str
    default: str


@dataclass(frozen=True, slots=True)
class ObjectListing(Answer, Rows[ObjectRow]):
    """Entries of the object dictionary, a list of rows; *total* is their number in the file."""

    renderer: ClassVar = "value_lines:object_lines"
    use_pager: ClassVar = True

    node: int | None
    source: str
    rows: tuple[ObjectRow, ...]
    total: int
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.objects/1`."""
        rows = [
            {
                "object": row.object,
                "name": row.name,
                "type": row.type_name,
                "access": row.access,
                "mappable": row.mappable.split(),
            }
            for row in self.rows
        ]
        return {"schema": "dvtcli.objects/1", "node": self.node, "source": self.source, "objects": rows}


@dataclass(frozen=True, slots=True)
class EntryUnread(Short):
    """An unread entry: refused with *abort*, None: not read, for the reason *why*."""

    object: str
    name: str
    abort: int | None
    why: str = ""

    @property
    def text(self) -> str:
        """The reason for the missing value."""
        return self.why if self.abort is None else abort_text(self.abort)

    def document(self) -> Document:
        """Its part of `dvtcli.value/1`."""
        abort = None if self.abort is None else f"0x{self.abort:08X}"
        return {"object": self.object, "value": None, "name": self.name, "abort": abort, "text": self.text}


@dataclass(frozen=True, slots=True)
class RecordRead(Answer):
    """A record or an array: sub-index 0 as *head*, and the entries; a list of entries."""

    renderer: ClassVar = "value_lines:record_lines"

    head: ValueRead
    entries: tuple[ValueRead | EntryUnread, ...]

    @property
    def node(self) -> int:
        """The node-ID, 1…127."""
        return self.head.node

    @property
    def value(self) -> Value:
        """Sub-index 0: the highest sub-index."""
        return self.head.value

    @property
    def exit_code(self) -> int:
        """1 if the device refused an entry, unless it is write-only."""
        refused = (entry.abort for entry in self.entries if isinstance(entry, EntryUnread))
        return int(any(abort not in (None, Abort.WRITE_ONLY) for abort in refused))

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
        unread = [f"{entry.object} ({entry.text})" for entry in self.entries if isinstance(entry, EntryUnread)]
        return ended_with(1, f"node {self.node} refused {join_some(unread)}") if self.exit_code else None

    def document(self) -> Document:
        """`dvtcli.value/1` of sub-index 0, with the *entries*."""
        entries = [{key: said for key, said in entry.document().items() if key != "schema"} for entry in self.entries]
        return {**self.head.document(), "schema": "dvtcli.value/1", "entries": entries}


#: number of values kept for an object's picture
MOST_POINTS = 40


@dataclass(frozen=True, slots=True)
class ValuesRead(Answer):
    """The values of several objects in order; *at_s*: since the first read, None for a single read."""

    renderer: ClassVar = "value_lines:values_lines"

    values: tuple[ValueRead | RecordRead, ...]
    at_s: float | None = None
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.values/1`."""
        values = [{key: said for key, said in value.document().items() if key != "schema"} for value in self.values]
        time = {} if self.at_s is None else {"time_s": round(self.at_s, 3)}
        return {"schema": "dvtcli.values/1", **time, "values": values}


@dataclass(slots=True)
class ObjectCourse(Short):
    """An object's trend: number of reads, minimum and maximum, last values."""

    samples: int = 0
    last: ValueRead | None = None
    least: float | None = None
    most: float | None = None
    points: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_POINTS))

    def add(self, value: ValueRead) -> None:
        """Add a value."""
        self.samples += 1
        self.last = value
        number = value.value
        if isinstance(number, int | float) and isfinite(number):
            self.least = number if self.least is None else min(self.least, number)
            self.most = number if self.most is None else max(self.most, number)
            self.points.append(number)


@dataclass(frozen=True, slots=True)
class ValuesWatched(Answer):
    """The trends of several objects, each read at least once; *file* is the CSV file."""

    renderer: ClassVar = "value_lines:watched_lines"

    courses: tuple[ObjectCourse, ...]
    file: str | None = None
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.watched-values/1`."""
        objects = [
            {
                "node": course.last.node,
                "object": course.last.object,
                "samples": course.samples,
                "least": course.least,
                "most": course.most,
                "last": json_value(course.last.value),
                "physical": physical_document(course.last.value, course.last.meaning),
            }
            for course in self.courses
            if course.last is not None
        ]
        return {"schema": "dvtcli.watched-values/1", "objects": objects, "file": self.file}
