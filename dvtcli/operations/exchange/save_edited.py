"""Save the edited PDOs of one node: as a network file, a DCF or XDC, or a script of the changes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.file_fits import refuse_unlike_file
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.network_config import NetworkConfig
from dvtcli.domain.script_line import change_lines
from dvtcli.domain.text import join_some, plural
from dvtcli.errors import UsageError
from dvtcli.files.device_file import VALUE_SUFFIXES
from dvtcli.files.network.write_network import write_network
from dvtcli.operations.devices.export_dcf import dcf_of, is_exported, left_out
from dvtcli.operations.devices.read_whole_device import described, read_every_object
from dvtcli.operations.exchange.export_network import SUFFIXES as NETWORK_SUFFIXES
from dvtcli.operations.exchange.export_network import exported_node
from dvtcli.operations.pdos.edit_pdos import Configs, edited_plan
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of, script_of_lines

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.operations.devices.read_whole_device import WholeDevice
    from dvtcli.operations.session.session_nodes import SessionNodes


def save_edited(session: SessionNodes, node: Node, held: Configs, changed: Configs, file: str) -> str:
    """Write *node* with its *changed* PDOs, which it *held* otherwise, to *file*; returns what was written.

    By the suffix, a network file of all its PDOs, a DCF or XDC of its whole configuration, else a script of the
    changes. Asks before it overwrites. Raises UsageError for a script without changes.
    """
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
