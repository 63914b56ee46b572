"""Save a whole device: all that can be read as a backup, or its EDS or XDD with configured values. Only reads."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.file_fits import refuse_unlike_file
from dvtcli.device.read_whole import AREAS, ReadObject, read_whole, scan_objects, values_of
from dvtcli.domain.abort import abort_text
from dvtcli.domain.configuration import Configuration, device_types
from dvtcli.domain.datatypes import Kind
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.objects import IDENTITY
from dvtcli.domain.text import join_some, plural
from dvtcli.domain.times import utc
from dvtcli.errors import SdoAborted, UsageError
from dvtcli.files.device_file import (
    VALUE_SUFFIXES,
    XDD_SUFFIXES,
    connected_file,
    device_file_bytes,
    is_xml,
    parse_device_file,
)
from dvtcli.files.eds.ini import MOST_BYTES
from dvtcli.files.eds.numbers import same_value
from dvtcli.files.eds.write_dcf import Commissioned, DcfText, refuse_unlike_values, write_dcf
from dvtcli.files.input_file import read_input
from dvtcli.files.whole_device_file import SUFFIX, KeptDevice, KeptObject, read_whole_device, whole_device_text
from dvtcli.operations.objects.write_object import transfer_progress
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of

if TYPE_CHECKING:
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.read_whole import OnObject
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.profile import ObjectAddress, Range
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


def backup_device(
    session: SessionNodes,
    file: str,
    node_id: int | None = None,
    *,
    twice: bool = False,
    areas: tuple[range, ...] = AREAS,
) -> Facts:
    """Save every object of the node with *node_id* (None: the selected node) to *file*.

    A `.dcf` or `.xdc` is the node's EDS with the values. A `.jsonl` also has the aborts, and needs no EDS: without an
    EDS each index of *areas* is read. *twice* reads every object twice and leaves out changed values. Asks before
    overwriting. Raises UsageError for another suffix, for a DCF without an EDS, if nothing could be read, or if FILE
    cannot be written.
    """
    suffix = Path(file).suffix.lower()
    if suffix not in (*SUFFIXES, SUFFIX):
        hint = f"{SUFFIX} takes devices without an EDS, too"
        raise UsageError(f"{file}: a backup ends in {', '.join(SUFFIXES)} or {SUFFIX}", hint=hint)
    path = place_of(file, f"NAME{SUFFIX}")
    node = session.node(node_id)
    if suffix in SUFFIXES:
        described(node)
        refuse_unlike_file(node.node_id, node.unlike_file, force=session.options.force)
    ask_before_overwriting(session, path)
    if suffix in SUFFIXES:
        return _as_dcf(session, node, path, file, twice=twice)
    return _as_lines(session, node, path, file, *session.read_together(lambda: _held(session, node, twice, areas)))


def _held(
    session: SessionNodes, node: Node, twice: bool, areas: tuple[range, ...]
) -> tuple[Mapping[ObjectAddress, ReadObject], Identity]:
    """Read every object of *node* and its identity, without a restart in between."""
    if node.dictionary is None:
        return scan_objects(node, Configuration(node.profile), areas, told(session, node)), node.identity()
    return read_every_object(session, node, twice=twice).objects, node.identity()


def _as_dcf(session: SessionNodes, node: Node, path: Path, file: str, *, twice: bool) -> Facts:
    def read() -> tuple[WholeDevice, DcfText]:
        whole = read_every_object(session, node, twice=twice)
        return whole, dcf_of(session, whole, path.name)[0]

    whole, text = session.read_together(read)
    _must_have_read(node, len(text.said), left_out(whole, text))
    make_file(session, path, text.data)
    return _answer(file, node, len(text.said), left_out(whole, text))


def _as_lines(
    session: SessionUser,
    node: NodeDescription,
    path: Path,
    file: str,
    found: Mapping[ObjectAddress, ReadObject],
    identity: Identity,
) -> Facts:
    eds = "" if node.dictionary is None else node.dictionary.source
    kept = {place: _kept(found_object) for place, found_object in found.items()}
    out = {
        f"{place[0]:04X}:{place[1]:02X}": kept_object.why
        for place, kept_object in sorted(kept.items())
        if kept_object.data is None
    }
    _must_have_read(node, len(kept) - len(out), out)
    text = whole_device_text(KeptDevice(node.node_id, identity, utc(time.time()), kept, eds))
    make_file(session, path, text, read_whole_device)
    answer = _answer(file, node, len(kept) - len(out), out)
    if node.dictionary is not None:
        return answer
    needs = Hint(
        Action.APPLY, {"file": file}, f"note: node {node.node_id} has no EDS: {{}} of this file needs an EDS"
    ) + Hint(Action.COMPARE, {"file": file}, ", {} does not")
    return replace(answer, text=(*answer.text, needs))


def _must_have_read(node: NodeDescription, count: int, out: Mapping[str, str]) -> None:
    """Raises UsageError if nothing was read: a file without an object is not a backup."""
    if not count:
        raise UsageError(
            f"no object of node {node.node_id} could be read: no file was written",
            node=node.node_id,
            why=join_some(f"{place} ({why})" for place, why in out.items()),
            hint=Hint(Action.SHOW_NODE, why="is its EDS for another device? {} shows it"),
        )


def _kept(one: ReadObject) -> KeptObject:
    why, kind = why_unread(one), one.entry.data_type
    return KeptObject(None if why else one.data, why, "" if kind is None else kind.short)


def _answer(file: str, node: NodeDescription, count: int, out: Mapping[str, str]) -> Facts:
    kept = f"{verbatim(file)}: node {node.node_id}, {plural(count, 'object')} as read now. Compare: {{}}"
    said: list[Hint | str] = [Hint(Action.COMPARE, {"file": file}, kept)]
    if out:
        said.append(f"note: left out: {join_some(f'{place} ({why})' for place, why in out.items())}")
    rows = (
        ("file", file), ("node", node.node_id), ("objects", count),
        ("left_out", [{"object": place, "why": why} for place, why in out.items()]),
    )  # fmt: skip
    return Facts("backup", rows, tuple(said))


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


SUFFIXES = VALUE_SUFFIXES
_REVISION = (IDENTITY, 3)


def export_dcf(session: SessionNodes, file: str, node_id: int | None = None, *, twice: bool = False) -> Facts:
    """Export the configuration of the node with *node_id* (None: the selected node) to *file*.

    By the suffix, a DCF, which keeps all bytes of the EDS that need no change, or an XDC. *twice* reads every object
    twice and leaves out changed values. Asks before overwriting. Raises UsageError if the node has no EDS or FILE
    cannot be written; SafetyRefusal if the EDS is another device's.
    """
    path = place_of(file, f"NAME{SUFFIXES[0]}")
    node = session.node(node_id)
    described(node)
    refuse_unlike_file(node.node_id, node.unlike_file, force=session.options.force)
    ask_before_overwriting(session, path)
    whole = read_every_object(session, node, twice=twice, only=is_exported)
    text, eds = dcf_of(session, whole, path.name)
    make_file(session, path, text.data)
    return _dcf_answer(file, whole, text, eds)


def is_exported(one: ReadObject, known: Configuration) -> bool:
    """Tell whether a DCF has the object: configuration, also the maker's, or a value in its file."""
    why = known.why_not(one.entry)
    return why is None or why.may_be_setting or one.entry.value is not None


def dcf_of(session: SessionNodes, whole: WholeDevice, file_name: str) -> tuple[DcfText, Path]:
    """Return *whole* as DCF or XDC for *file_name*, and its source EDS or XDD."""
    node = whole.node
    path = session.network.files.eds_path(node.node_id)
    if path is None:
        raise UsageError(
            f"node {node.node_id} has no EDS here", node=node.node_id, hint=Hint(Action.GIVE_EDS, why="names the EDS")
        )
    rate, identity = node.bus.runs_at, node.identity()
    device = Commissioned(
        file_name, node.node_id, datetime.now().astimezone(), rate // 1000 if rate else None,
        identity["serial"], identity["revision"],
    )  # fmt: skip
    modules = session.network.files.modules(node.node_id, path)
    text = write_dcf(
        _eds_of(path, modules, device.made), path.name, _own_revision(whole) | values_of(whole.objects), device
    )
    text = replace(text, said=tuple(place for place in text.said if place in whole.objects))
    return (_as_xdc(text, whole, device) if file_name.lower().endswith(XDD_SUFFIXES) else text), path


def _own_revision(whole: WholeDevice) -> dict[ObjectAddress, bytes]:
    """Return 0x1018:03 if the revision differs from the EDS: not a setting, but it identifies the file."""
    revision = whole.node.identity()["revision"]
    if revision in (None, whole.dictionary.info.revision_number) or whole.dictionary.entry(*_REVISION) is None:
        return {}
    return {_REVISION: revision.to_bytes(4, "little")}


def _eds_of(path: Path, modules: tuple[int, ...] | None, made: datetime) -> bytes:
    """Return the EDS at *path*; an XDD is converted, and so is an EDS to which *modules* add objects."""
    if modules:
        return connected_file(path, modules)
    try:
        data = read_input(path, MOST_BYTES, "EDS")
    except OSError as failed:
        raise UsageError(f"{path}: {failed.strerror or failed}", place=str(path)) from failed
    if not is_xml(data, path.name):
        return data
    dictionary = parse_device_file(data, path.name).dictionary
    return device_file_bytes(dictionary, path.with_suffix(".eds").name, f"made from {path.name}", made)


def _as_xdc(text: DcfText, whole: WholeDevice, device: Commissioned) -> DcfText:
    """Convert the DCF *text* to an XDC with the same values."""
    dictionary = parse_device_file(text.data, "a.dcf").dictionary
    data = device_file_bytes(dictionary, device.file_name, "", device.made)
    values = {place: held for place in text.said if (held := whole.objects[place].data) is not None}
    refuse_unlike_values(parse_device_file(data, device.file_name).dictionary, values, device.node_id)
    return replace(text, data=data)


def left_out(whole: WholeDevice, text: DcfText) -> dict[str, str]:
    """Map objects missing in the DCF to reasons."""
    found = dict(text.left_out)
    for place, kept_object in whole.objects.items():
        if why := why_unread(kept_object):
            found[place] = why
    return {f"{index:04X}:{sub:02X}": why for (index, sub), why in sorted(found.items())}


def why_unread(one: ReadObject) -> str:
    """Explain why an object could not be read; empty if it was."""
    if one.abort is not None:
        return f"{abort_text(one.abort)} (0x{one.abort:08X})"
    if one.unread is not None:
        return str(one.unread)
    return "it changes by itself" if one.changes else ""


def _dcf_answer(file: str, whole: WholeDevice, text: DcfText, eds: Path) -> Facts:
    node, out = whole.node, left_out(whole, text)
    others = _other_than_default(whole, text)
    written = (
        f"{verbatim(file)}: node {node.node_id}, {plural(len(text.said), 'object')}, {len(others)} of them "
        f"other than the defaults of {verbatim(eds.name)}. Compare: {{}}"
    )
    said: list[Hint | str] = [Hint(Action.COMPARE, {"file": file}, written)]
    if out:
        said.append(f"note: left out: {join_some(f'{place} ({why})' for place, why in out.items())}")
    rows = (
        ("file", file), ("node", node.node_id), ("eds", eds.name), ("objects", len(text.said)),
        ("not_default", [_label(place) for place in others]),
        ("left_out", [{"object": place, "why": why} for place, why in out.items()]),
    )  # fmt: skip
    return Facts("dcf", rows, tuple(said))


def _other_than_default(whole: WholeDevice, text: DcfText) -> list[ObjectAddress]:
    """List values that differ from the EDS's defaults."""
    found = []
    for place in text.said:
        one = whole.objects[place]
        default = replace(one.entry, value=None).initial(whole.node.node_id)
        if default is not None and not same_value(one.entry.data_type, default, one.data):
            found.append(place)
    return found


def _label(place: ObjectAddress) -> str:
    return f"{place[0]:04X}:{place[1]:02X}"
