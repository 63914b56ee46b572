"""Read a whole device for an operation: file, configuration, progress."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.device.read_whole import ReadObject, read_whole
from dvtcli.domain.configuration import Configuration, device_types
from dvtcli.domain.datatypes import Kind
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import SdoAborted, UsageError
from dvtcli.operations.objects.object_files import transfer_progress

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.read_whole import OnObject
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.profile import ObjectAddress, Range
    from dvtcli.operations.session.session_nodes import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


@dataclass(frozen=True, slots=True)
class WholeDevice:
    """A *node* with *objects* as read, and its configuration objects (*known*)."""

    node: Node
    dictionary: ObjectDictionary
    known: Configuration
    objects: Mapping[ObjectAddress, ReadObject]


def read_every_object(
    session: SessionNodes,
    node: Node,
    *,
    twice: bool = False,
    only: Callable[[ReadObject, Configuration], bool] = lambda _one, _known: True,
) -> WholeDevice:
    """Read every object of *node* in its file that *only* accepts; *twice* reads each again.

    Objects that an RPDO or another master may write, by the file, are always read twice. Raises UsageError without a
    file.
    """
    dictionary = described(node)
    known = configuration(node, dictionary)
    entries = [entry for entry in dictionary.entries() if only(ReadObject(entry), known)]

    def again(one: ReadObject) -> bool:
        return twice or (bool(one.entry.pdo_mapping) and one.entry.access.writable)

    return WholeDevice(node, dictionary, known, read_entries(session, node, entries, known, again))


def read_entries(
    session: SessionNodes,
    node: Node,
    entries: Iterable[OdEntry],
    known: Configuration,
    again: Callable[[ReadObject], bool],
) -> Mapping[ObjectAddress, ReadObject]:
    """Read *entries* of *node*, twice if *again* returns true, with progress."""

    def around(entry: OdEntry) -> AbstractContextManager[None]:
        if entry.data_type is None or entry.data_type.kind is not Kind.OCTETS:
            return nullcontext()
        text = f"node {node.node_id}: reading 0x{entry.index:04X}:{entry.sub_index:02X}"
        return transfer_progress(session, node.node_id, text)

    listed = list(entries)
    return session.read_together(
        lambda: read_whole(node, listed, known, again=again, on_object=told(session, node), around=around)
    )


def told(session: SessionUser, node: NodeDescription) -> OnObject:
    """Return a callback that reports the progress of reading *node*."""

    def report(index: int, sub_index: int, done: int, total: int, left_s: float | None) -> None:
        left = "" if left_s is None else f", {duration(left_s)} left"
        text = f"node {node.node_id}: reading 0x{index:04X}:{sub_index:02X}, {done + 1} of {total}{left}"
        session.reporter.progress(text, done, total)

    return report


def described(node: NodeDescription) -> ObjectDictionary:
    """Return the dictionary of *node*; raises UsageError without a file."""
    if node.dictionary is None:
        raise UsageError(
            f"node {node.node_id} has no EDS: its objects are unknown",
            node=node.node_id,
            hint=Hint(Action.GIVE_EDS, why="names the EDS")
            + Hint(Action.ADD_EDS, why=", {} adds it to the library for all nodes of this type"),
        )
    return node.dictionary


def configuration(node: ReadableNode, dictionary: ObjectDictionary, included: Collection[Range] = ()) -> Configuration:
    """Return the configuration of *node* by its device profiles and those of its file."""

    def held(index: int) -> bytes | None:
        try:
            return node.read_cache.upload(index, 0)
        except SdoAborted:
            return None

    return Configuration(node.profile, device_types(dictionary, held), included=included, dictionary=dictionary)


def duration(seconds: float) -> str:
    """A time for people: `40 s`, `3 min`."""
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
