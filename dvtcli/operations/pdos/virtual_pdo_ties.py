"""Virtual PDOs inside a node: list and set the objects tied to pins."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import ABSENT
from dvtcli.device.virtual_pdos import apply, group_names, read_pins
from dvtcli.errors import DvtcliError, SdoAborted
from dvtcli.operations.changes.change import change_result
from dvtcli.operations.results import VpdoListing
from dvtcli.operations.results.pdos import PinRow, VpdoRow
from dvtcli.operations.values.named_objects import object_index, tied_name

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.virtual_pdos import Pins
    from dvtcli.domain.plan import ValueChange
    from dvtcli.domain.rules import Finding
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session.session import SessionNodes

_NONE = "none"


def list_ties(session: SessionNodes, group: str | None = None, node_id: int | None = None) -> VpdoListing:
    """List the objects tied to pins of *group* (None: all groups) of *node_id*, else the selected node.

    Of all groups, those that the device lacks are named in a note. Raises UsageError for an unknown group, DvtcliError
    if the node has no virtual PDOs, SdoAborted if it lacks *group*, or all of them.
    """
    node = session.node(node_id)
    if group is not None:
        return _listing(node, [group])
    rows, lacking = list[VpdoRow](), dict[str, SdoAborted]()
    for name in group_names(node):
        try:
            rows.append(_row(node, read_pins(node, name)))
        except SdoAborted as absent:
            if absent.code not in ABSENT:
                raise
            lacking[name] = absent
    if lacking and not rows:
        raise next(iter(lacking.values()))
    for name, refused in lacking.items():
        session.reporter.note(f"node {node.node_id} lacks {name}: {refused.text}")
    return VpdoListing(node.node_id, tuple(rows))


def tie_pin(
    session: SessionNodes, group: str, pin: int, object_: str | None = None, node_id: int | None = None
) -> Changed | VpdoListing:
    """Tie *pin* (1 and up) of *group* to *object_*, None to untie it; pin 0 unties all pins of the group.

    Lists the group if nothing changes. Raises UsageError for an unknown object or group, DvtcliError for a missing pin.
    """
    node = session.node(node_id)
    node.begin_change()
    pins = read_pins(node, group)
    value = pins.group.none if object_ is None else object_index(node, object_)
    changes, findings = _wanted(node, pins, pin, value)
    if not changes:
        return _listing(node, [group], f"{group} is already as requested; nothing was written.")
    started = time.monotonic()
    applied = apply(node, changes, findings, force=session.options.force)
    tied = _NONE if value == pins.group.none else f"{value:04X}"
    line = f"vpdo {group} {pin} {tied}" if pin else f"vpdo {group} {_NONE}"
    return change_result(session, node, applied, time.monotonic() - started, lines=[line])


def _wanted(node: NodeDescription, pins: Pins, pin: int, value: int) -> tuple[list[ValueChange], list[Finding]]:
    """Return the writes that tie *pin* to object *value* (pin 0: untie all), and findings."""
    if not pin:
        return list(pins.count(0)), []
    if pin > len(pins.values):
        have = f"it has 1…{len(pins.values)}" if pins.values else "it has none"
        raise DvtcliError(f"node {node.node_id} has no {pins.name} pin {pin}: {have}", node=node.node_id)
    return list(pins.tie(pin, value, tied_name(node, value))), list(pins.findings(pin, value, node.dictionary))


def _listing(node: ReadableNode, names: list[str], said: str = "") -> VpdoListing:
    return VpdoListing(node.node_id, tuple(_row(node, read_pins(node, name)) for name in names), said)


def _row(node: NodeDescription, pins: Pins) -> VpdoRow:
    rows = [
        PinRow(number, index, "" if index is None else tied_name(node, index))
        for number, index in enumerate(pins.tied(), 1)
    ]
    return VpdoRow(pins.name, pins.group.index, len(pins.values), tuple(rows))
