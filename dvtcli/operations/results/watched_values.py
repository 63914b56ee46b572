"""Several objects' values, read once or again and again, as answers. Knows no terminal and no session."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from math import isfinite
from typing import ClassVar

from dvtcli.operations.results.documents import Answer, Document, Short, json_value, physical_document
from dvtcli.operations.results.values import RecordRead, ValueRead

#: number of values kept for an object's picture
MOST_POINTS = 40


@dataclass(frozen=True, slots=True)
class ValuesRead(Answer):
    """The values of several objects in order; *at_s*: since the first read, None for a single read."""

    renderer: ClassVar = "watched_lines:values_lines"

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

    renderer: ClassVar = "watched_lines:watched_lines"

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
