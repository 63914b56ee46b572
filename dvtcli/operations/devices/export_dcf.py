"""Export a node as DCF or XDC: its EDS or XDD with configured values. Writes nothing to a node."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.file_fits import refuse_unlike_file
from dvtcli.device.read_whole import ReadObject, values_of
from dvtcli.domain.abort import abort_text
from dvtcli.domain.configuration import Configuration
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.text import join_some, plural
from dvtcli.errors import UsageError
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
from dvtcli.operations.devices.read_whole_device import WholeDevice, described, read_every_object
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of

if TYPE_CHECKING:
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.operations.session.session_nodes import SessionNodes

SUFFIXES = VALUE_SUFFIXES
_REVISION = (0x1018, 3)


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
    return _answer(file, whole, text, eds)


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


def _answer(file: str, whole: WholeDevice, text: DcfText, eds: Path) -> Facts:
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
