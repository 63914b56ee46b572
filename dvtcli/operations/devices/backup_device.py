"""Back up a whole device: all readable objects. Writes nothing to a node."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.file_fits import refuse_unlike_file
from dvtcli.device.read_whole import AREAS, scan_objects
from dvtcli.domain.configuration import Configuration
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.text import join_some, plural
from dvtcli.domain.times import utc
from dvtcli.errors import UsageError
from dvtcli.files.whole_device_file import SUFFIX, KeptDevice, KeptObject, read_whole_device, whole_device_text
from dvtcli.operations.devices.export_dcf import SUFFIXES, dcf_of, left_out, why_unread
from dvtcli.operations.devices.read_whole_device import described, read_every_object, told
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.device.read_whole import ReadObject
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.files.eds.write_dcf import DcfText
    from dvtcli.operations.devices.read_whole_device import WholeDevice
    from dvtcli.operations.session.session_nodes import SessionNodes
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
    """Raises UsageError if nothing was read: a file without an object is no backup."""
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
