"""Export nodes to the format of the file's suffix. Writes nothing to a node."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from dvtcli.device.file_fits import refuse_unlike_file
from dvtcli.device.unnamed_nodes import add_eds
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.network_config import NetworkConfig
from dvtcli.domain.script_line import change_lines
from dvtcli.domain.text import all_nodes, join_some, plural
from dvtcli.errors import NoAnswer, UsageError
from dvtcli.files.dbc import SUFFIX as DBC_SUFFIX
from dvtcli.files.device_file import VALUE_SUFFIXES
from dvtcli.files.eds.writer import eds_bytes
from dvtcli.files.network.write_network import write_network
from dvtcli.files.nodelist import SUFFIX as NODELIST_SUFFIX
from dvtcli.files.nodelist import ListedNode, Nodelist, nodelist_text
from dvtcli.operations.devices.backup_device import (
    dcf_of,
    described,
    export_dcf,
    is_exported,
    left_out,
    read_every_object,
)
from dvtcli.operations.exchange.export_dbc import DbcOptions, export_dbc
from dvtcli.operations.exchange.export_network import SUFFIXES as NETWORK_SUFFIXES
from dvtcli.operations.exchange.export_network import export_node, exported_node, noted
from dvtcli.operations.nodes.find_nodes import find_nodes
from dvtcli.operations.pdos.edit_pdos import Configs, edited_plan
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of, script_of_lines

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.operations.devices.backup_device import WholeDevice
    from dvtcli.operations.session.session import Session, SessionNodes


@dataclass(frozen=True, slots=True)
class ExportRequest:
    """A request: the node *node_id* (None: selected, or all), read *twice*, with *dbc* options."""

    node_id: int | None = None
    twice: bool = False
    dbc: DbcOptions = field(default_factory=DbcOptions)


class ExportFormat:
    """A format, chosen by its *suffixes*; `export --help` shows the first."""

    suffixes: ClassVar[tuple[str, ...]]
    #: whether a file has all nodes
    is_of_all: ClassVar[bool] = False
    #: whether objects can be read twice
    reads_twice: ClassVar[bool] = False
    #: whether it can be wanted otherwise than by default, as a DBC file can
    has_options: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        if "suffixes" not in vars(cls):
            raise TypeError(f'{cls.__module__}: {cls.__name__} needs a line such as suffixes = (".yaml",)')

    def write(self, session: Session, file: str, wanted: ExportRequest) -> Facts:
        """Write the *wanted* node, or all answering nodes or those of -n, to *file*.

        Asks before overwriting. Omissions are in the result's row `left_out`.
        """
        raise NotImplementedError


def export_nodelist(session: SessionNodes, file: str, *, twice: bool = False) -> Facts:
    """Export the answering nodes (or `-n`) to the nodelist *file*, with a DCF each in its folder.

    A node without EDS is listed without a DCF, and reported. Asks before overwriting any file. *twice* reads each
    object twice. Raises NoAnswer if no node answers; else as `export_dcf`.
    """
    path = place_of(file, "nodelist.cpj")
    ask_before_overwriting(session, path)
    notes: list[Hint | str] = []
    ids = session.base.nodes or tuple(row.node for row in find_nodes(session).rows if not row.note)
    if not ids:
        raise NoAnswer(
            "no node answers",
            hint=Hint(Action.CHECK_SETUP, why="check bit rate and supply: {}") + Hint(Action.FIND_NODES, why=", {}"),
        )
    said: list[Hint | str] = []
    nodes = [_listed(session, path, node_id, notes, said, twice=twice) for node_id in sorted(ids)]
    without_dcf = [str(node.node_id) for node in nodes if not node.dcf]
    bare = [session.node(node.node_id) for node in nodes if not node.dcf]
    if len(without_dcf) == len(nodes):
        raise UsageError(
            f"none of the nodes has an EDS ({join_some(without_dcf)}): a nodelist needs their DCFs",
            hint=add_eds(bare, "", " adds it to the library for all nodes of this type; then export again"),
        )
    if without_dcf:
        words = f"{all_nodes(without_dcf)}: no DCF, since there is no EDS; "
        why = add_eds(bare, words, " adds it to the library; then export again")
        notes.insert(0, why)
        said.insert(0, why)
    make_file(session, path, eds_bytes(nodelist_text(Nodelist(path.parent.resolve().name, tuple(nodes)))))
    rows = (
        ("file", file),
        ("nodes", [{"node": node.node_id, "name": node.name, "dcf": node.dcf or None} for node in nodes]),
        ("notes", notes),
    )  # fmt: skip
    dcfs = sum(bool(node.dcf) for node in nodes)
    first = f"{file}: {plural(len(nodes), 'node')}, {plural(dcfs, 'DCF')} beside it"
    return Facts("nodelist", rows, (first, *map(noted, said)))


def _listed(
    session: SessionNodes,
    path: Path,
    node_id: int,
    notes: list[Hint | str],
    said: list[Hint | str],
    *,
    twice: bool,
) -> ListedNode:
    """List the node and write its DCF; omissions are in *notes*, the first also in *said*."""
    node = session.node(node_id)
    if node.dictionary is None:
        return ListedNode(node_id, node.title)
    name = f"node{node_id}.dcf"
    done = dict(export_dcf(session, str(path.with_name(name)), node_id, twice=twice).rows)
    left_out = [f"{entry['object']} left out: {entry['why']}" for entry in done["left_out"]]
    notes += (f"node {node_id}: {line}" for line in left_out)
    if left_out:
        said.append(f"node {node_id}: {join_some(left_out)}")
    return ListedNode(node_id, node.title, name)


class NodelistExport(ExportFormat):
    """All nodes as a nodelist, with a DCF each beside it."""

    suffixes = (NODELIST_SUFFIX,)
    is_of_all = True
    reads_twice = True

    def write(self, session: Session, file: str, wanted: ExportRequest) -> Facts:
        """Write it by `export_nodelist`."""
        return export_nodelist(session, file, twice=wanted.twice)


class DcfExport(ExportFormat):
    """A node's configuration as a DCF or XDC."""

    suffixes = VALUE_SUFFIXES
    reads_twice = True

    def write(self, session: Session, file: str, wanted: ExportRequest) -> Facts:
        """Write it by `export_dcf`."""
        return export_dcf(session, file, wanted.node_id, twice=wanted.twice)


class DbcExport(ExportFormat):
    """The enabled PDOs of all nodes as a DBC file."""

    suffixes = (DBC_SUFFIX,)
    is_of_all = True
    has_options = True

    def write(self, session: Session, file: str, wanted: ExportRequest) -> Facts:
        """Write it by `export_dbc`."""
        return export_dbc(session, file, wanted.dbc)


class NetworkFileExport(ExportFormat):
    """A node's PDOs, as a network file."""

    suffixes = (".yaml", ".yml")

    def write(self, session: Session, file: str, wanted: ExportRequest) -> Facts:
        """Write it by `export_node`; raises UsageError for another suffix."""
        return export_node(session, file, wanted.node_id)


@cache
def export_formats() -> Mapping[str, ExportFormat]:
    """Map suffixes to formats."""
    formats: tuple[ExportFormat, ...] = (DbcExport(), DcfExport(), NetworkFileExport(), NodelistExport())
    return {suffix: format_ for format_ in formats for suffix in format_.suffixes}


def is_of_all_nodes(file: str) -> bool:
    """Tell whether the format of *file* has all nodes in one file."""
    return _format_of(file).is_of_all


def export_file(
    session: Session, file: str, node_id: int | None = None, *, twice: bool = False, options: DbcOptions | None = None
) -> Facts:
    """Export the node with *node_id* (None: the selected node) to *file*: a network file, a DCF or an XDC.

    A nodelist or a DBC file has all nodes, as in `export_all`. *twice* reads each object of a DCF twice. Raises as
    `export_node` and `export_dcf`; UsageError for *twice* with another format, or *options* without a DBC file.
    """
    kind = _format_of(file)
    if options and not kind.has_options:
        raise UsageError(
            f"{file} is not a DBC file; the option is for DBC files only",
            given=dict.fromkeys(options.named),
            hint=Hint(Action.EXPORT, {"file": "NAME.dbc", "services": "emcy,heartbeat"}),
        )
    if twice and not kind.reads_twice:
        raise UsageError(
            f"{file} is not a DCF or XDC: only their objects are read twice",
            given={"twice": True},
            hint=Hint(Action.EXPORT, {"file": "NAME.dcf", "twice": True}),
        )
    return kind.write(session, file, ExportRequest(node_id, twice, options or DbcOptions()))


def export_all(session: Session, file: str, *, twice: bool = False, options: DbcOptions | None = None) -> Facts:
    """Export all answering nodes, or `-n`, to *file*: a nodelist with DCFs, or a DBC file.

    *twice* and *options*, and their errors, as in `export_file`. Raises NoAnswer if no node answers.
    """
    if not is_of_all_nodes(file):
        others = " or ".join(
            sorted(suffix for suffix, export_format in export_formats().items() if export_format.is_of_all)
        )
        raise UsageError(f"{file}: unknown format", hint=f"a name that ends in {others}")
    return export_file(session, file, twice=twice, options=options)


def _format_of(file: str) -> ExportFormat:
    """Return the format of *file*; for an unknown suffix raises UsageError with all formats."""
    known, name = export_formats(), file.lower()
    found = next((export_format for suffix, export_format in known.items() if name.endswith(suffix)), None)
    if found is None:
        hint = Hint(
            Action.SAVE_SCRIPT, {"all": True}, f"a name that ends in {', '.join(sorted(known))}; {{}} writes a script"
        )
        raise UsageError(f"{file}: unknown format", hint=hint)
    return found


#: suffixes of the files that `save_edited` writes
_SAVED = (".dvt", *NETWORK_SUFFIXES, *VALUE_SUFFIXES)


def refuse_suffix(file: str) -> None:
    """Raise UsageError if the suffix of *file* is none that `save_edited` writes."""
    if not file.lower().endswith(_SAVED):
        raise UsageError(f"{file} is not written: its suffix is to be one of {' '.join(_SAVED)}")


def save_edited(session: SessionNodes, node: Node, held: Configs, changed: Configs, file: str) -> str:
    """Write *node* with its *changed* PDOs, which it *held* otherwise, to *file*; returns what was written.

    By the suffix, a network file of all its PDOs, a DCF or XDC of its whole configuration, or a script of the
    changes. Asks before it overwrites. Raises UsageError for another suffix, or a script without changes.
    """
    refuse_suffix(file)
    name, path = file.lower(), place_of(file)
    if name.endswith(NETWORK_SUFFIXES):
        return _save_network(session, node, {**held, **changed}, path)
    if name.endswith(VALUE_SUFFIXES):
        return _save_dcf(session, node, held, changed, path)
    if not changed:
        raise UsageError(
            "no device is changed; a script has the changes",
            hint=Hint(Action.SAVE_SCRIPT, {"all": True}, "{} writes all values of the node"),
        )
    ask_before_overwriting(session, path)
    lines = change_lines(edited_plan(node.node_id, held, changed))
    make_file(session, path, script_of_lines(session, node.node_id, lines))
    return f"{path}: a script of {plural(len(lines), 'line')}"


def _save_network(session: SessionNodes, node: Node, pdos: Configs, path: Path) -> str:
    found = exported_node(session, node, pdos, path)
    ask_before_overwriting(session, path)
    text = write_network(NetworkConfig((found.config,)), f"Node {node.node_id} as edited", found.remarks)
    make_file(session, path, text)
    note = f"; {found.left_out_note}" if found.left_out else ""
    return f"{path}: a network file with {plural(len(found.config.pdos), 'PDO')}{note}"


def _save_dcf(session: SessionNodes, node: Node, held: Configs, changed: Configs, path: Path) -> str:
    described(node)
    refuse_unlike_file(node.node_id, node.unlike_file, force=session.options.force)
    ask_before_overwriting(session, path)
    whole = _with_edited(read_every_object(session, node, only=is_exported), held, changed)
    text, _eds = dcf_of(session, whole, path.name)
    make_file(session, path, text.data)
    out = left_out(whole, text)
    note = f"; left out: {join_some(f'{place} ({why})' for place, why in out.items())}" if out else ""
    return f"{path}: the node with {plural(len(text.said), 'object')}{note}"


def _with_edited(whole: WholeDevice, held: Configs, changed: Configs) -> WholeDevice:
    """Return *whole* with the values that the *changed* PDOs come to, which it *held* otherwise.

    Raises UsageError if the EDS lacks an object of them.
    """
    objects = dict(whole.objects)
    for _change, step in edited_plan(whole.node.node_id, held, changed).steps_in_order():
        place = step.index, step.sub_index
        if place not in objects:
            raise UsageError(f"a DCF cannot have {step.object}: it is not in the EDS", node=whole.node.node_id)
        objects[place] = replace(objects[place], data=step.after, abort=None, unread=None, changes=False)
    return replace(whole, objects=objects)
