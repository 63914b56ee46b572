"""Read several objects, once or repeatedly, with trends. Only reads."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import UsageError
from dvtcli.files.values.text_values import csv_text
from dvtcli.operations.objects.read_record import read_whole
from dvtcli.operations.results.values import ObjectCourse, ValuesRead, ValuesWatched
from dvtcli.operations.session.save_script import ask_before_overwriting, place_of
from dvtcli.operations.values.named_objects import means_whole, object_at, one_name
from dvtcli.operations.values.object_values import scalings_of, value_result

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.domain.datatypes import DataType
    from dvtcli.operations.results.values import ValueRead
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

#: an object as typed, and its node
Asked = tuple[str, int | None]
_Place = tuple["Node", int, int]
Show = Callable[[Iterable[ValuesRead]], None]


def read_objects(session: SessionNodes, objects: Sequence[Asked], data_type: DataType | None = None) -> ValuesRead:
    """Read *objects* in turn, as *data_type* or the file's type; raises as `read_object`."""
    places = _places(session, objects)
    return ValuesRead(
        tuple(
            read_whole(place[0], text, data_type) if means_whole(place[0], text) else _read(place, data_type)
            for place, (text, _) in zip(places, objects, strict=True)
        )
    )


def watch_objects(
    session: SessionNodes,
    objects: Sequence[Asked],
    every_s: float,
    for_s: float | None,
    show: Show,
    *,
    data_type: DataType | None = None,
    file: str | None = None,
) -> ValuesWatched:
    """Read *objects* every *every_s* seconds for *for_s* (None: until Ctrl-C), and *show* them each time.

    Also as rows of the CSV *file*. If reading takes longer than *every_s*, times are skipped. Raises as `read_object`:
    an error ends it.
    """
    places, courses = _places(session, objects), [ObjectCourse() for _ in objects]
    with _rows(session, places, file, data_type) as write:
        try:
            for at_s in _moments(session, every_s, for_s):
                values = tuple(_read(place, data_type) for place in places)
                for course, value in zip(courses, values, strict=True):
                    course.add(value)
                write([f"{at_s:.3f}", *(_cell(value) for value in values)])
                show([ValuesRead(values, at_s)])
        except KeyboardInterrupt:
            if not courses[0].samples:
                raise
    return ValuesWatched(tuple(courses), file)


class ObjectRound:
    """*objects*, found once, to be read again and again; UsageError as `read_object`."""

    def __init__(self, session: SessionNodes, objects: Sequence[Asked]) -> None:
        self._places = _places(session, objects)

    @property
    def objects(self) -> list[tuple[int, int, int]]:
        """Return node-ID, index and sub-index of each object."""
        return [(node.node_id, index, sub_index) for node, index, sub_index in self._places]

    def read(self, number: int) -> ValueRead:
        """Read the object at position *number*; raises as `read_object`."""
        return _read(self._places[number], None)


def _places(session: SessionNodes, objects: Sequence[Asked]) -> list[_Place]:
    nodes = [(session.node(node_id), text) for text, node_id in objects]
    try:
        return [(node, *object_at(node, text)) for node, text in nodes]
    except UsageError as wrong:
        said = one_name([text for text, _ in objects], lambda name: _is_object(nodes[0][0], name))
        if said is None:
            raise
        raise UsageError(said, node=wrong.node) from wrong


def _is_object(node: NodeDescription, text: str) -> bool:
    try:
        object_at(node, text)
    except UsageError:
        return False
    return True


def _cell(read: ValueRead) -> object:
    """Return the number in its unit; bytes as hex."""
    if read.physical is not None:
        return read.physical
    return csv_text(read.value)


def _head(place: _Place, data_type: DataType | None) -> str:
    """Name an object's column with its unit: `3:5100:01 [V]`."""
    node, index, sub_index = place
    name = f"{node.node_id}:{index:04X}:{sub_index:02X}"
    unit = "" if data_type else scalings_of(node.profile, node.dictionary).of(index, sub_index).unit
    return f"{name} [{unit}]" if unit else name


def _read(place: _Place, data_type: DataType | None) -> ValueRead:
    node, index, sub_index = place
    return value_result(node, index, sub_index, node.sdo.upload(index, sub_index), data_type)


def _moments(session: SessionNodes, every_s: float, for_s: float | None) -> Iterator[float]:
    """When to read, in seconds since the first time; waits for each."""
    bus = session.bus
    started_s, number = bus.now_s(), 0
    while for_s is None or number * every_s <= for_s + every_s / 1000:
        bus.sleep(started_s + number * every_s - bus.now_s())
        yield bus.now_s() - started_s
        number = max(number + 1, int((bus.now_s() - started_s) / every_s))


@contextmanager
def _rows(
    session: SessionUser, places: Sequence[_Place], file: str | None, data_type: DataType | None
) -> Iterator[Callable[[list[object]], None]]:
    """Open a writer of CSV rows, or a dummy without *file*."""
    if file is None:
        yield lambda _row: None
        return
    if not file.lower().endswith(".csv"):
        raise UsageError(
            f"{file}: values that are read again and again go into a .csv file",
            hint=Hint(Action.READ_VALUES, {"objects": ("6041", "606C"), "time": "100ms", "file": "run.csv"}),
        )
    path = place_of(file, "NAME.csv")
    ask_before_overwriting(session, path)
    try:
        with Path(path).open("w", encoding="utf-8", newline="") as opened:
            session.made.append(file)
            writer = csv.writer(opened)
            writer.writerow(["time_s", *(_head(place, data_type) for place in places)])
            yield writer.writerow
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed
