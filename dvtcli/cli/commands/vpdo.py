"""List the virtual PDOs inside a node, or tie a pin to an object."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.params import CanopenType, NumberType, ObjectType, ObjectWord
from dvtcli.device.virtual_pdos import apply, group_names, read_pins
from dvtcli.errors import DvtcliError, UsageError
from dvtcli.operations.change import changed

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.plan import ValueChange
    from dvtcli.domain.rules import Finding
    from dvtcli.domain.vpdo import Pins
    from dvtcli.operations.results import Changed, VpdoListing
    from dvtcli.operations.results.vpdos import VpdoRow
    from dvtcli.operations.session import Session

_GROUPS = ("motor", "digital-out", "analogue-out", "digital-in", "analogue-in")
_NONE = "none"


class PinType(CanopenType):
    """A pin's number from 1, or the word `none` for all pins of the group: 0."""

    name = "pin"

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """The pin; 0 for none."""
        return 0 if text.lower() == _NONE else int(NumberType(1, 254, "a pin").parse(text, ctx))


class ObjectOrNone(ObjectType):
    """An object, or the word `none`."""

    def parse(self, text: str, ctx: click.Context | None) -> ObjectWord:
        """The word, `none` in small letters."""
        return ObjectWord(_NONE) if text.lower() == _NONE else ObjectWord(super().parse(text, ctx).text)


@click.command("vpdo", cls=DvtCommand, short_help=__doc__)
@click.argument("group", type=click.Choice(_GROUPS), required=False, metavar="[GROUP]")
@click.argument("pin", type=PinType(), required=False, metavar="[PIN|none]")
@click.argument("object_", type=ObjectOrNone(), required=False, metavar="[OBJECT|none]")
@click.pass_obj
def command(
    session: Session, /, group: str | None, pin: int | None, object_: ObjectWord | None
) -> Changed | VpdoListing:
    """Show what each pin is tied to, or tie PIN of GROUP to OBJECT.

    GROUP is motor, digital-out, analogue-out, digital-in or analogue-in.

    \b
    vpdo
    vpdo digital-in
    vpdo digital-in 1 fwd_switch
    vpdo analogue-out 2 none
    vpdo digital-out none      no active pin in the whole group
    """
    node = session.node()
    if group is None or pin is None:
        return _listing(node, [group] if group else group_names(node))
    if pin and object_ is None:
        raise click.UsageError(f"what shall {group} pin {pin} be tied to? give an object, or none")
    if not pin and object_ is not None:
        raise click.UsageError(f"`vpdo {group} none` takes no object: it unties every pin")
    node.claim()
    pins = read_pins(node, group)
    value = pins.group.none if object_ is None or object_.text == _NONE else _index(node, object_)
    changes, findings = _wanted(node, pins, pin, value)
    if not changes:
        return _listing(node, [group], f"{group} is as wanted already; nothing was written.")
    started = time.monotonic()
    applied = apply(node, changes, findings, force=session.options.force)
    tied = _NONE if value == pins.group.none else f"{value:04X}"
    line = f"vpdo {group} {pin} {tied}" if pin else f"vpdo {group} {_NONE}"
    return changed(session, node, applied, time.monotonic() - started, lines=[line])


def _wanted(node: Node, pins: Pins, pin: int, value: int) -> tuple[list[ValueChange], list[Finding]]:
    """The writes that tie *pin* to the object at index *value*, pin 0 to untie all; and what speaks against it."""
    if not pin:
        return list(pins.count(0)), []
    if pin > len(pins.values):
        have = f"it has 1…{len(pins.values)}" if pins.values else "it has none"
        raise DvtcliError(f"node {node.node_id} has no {pins.name} pin {pin}: {have}", node=node.node_id)
    return list(pins.tie(pin, value, _name(node, value))), list(pins.findings(pin, value, node.dictionary))


def _index(node: Node, word: ObjectWord) -> int:
    index, sub_index = word.resolve(node)
    if sub_index:
        raise UsageError(f"a pin is tied to a whole object: {index:04X}, without a sub-index", node=node.node_id)
    return index


def _name(node: Node, index: int) -> str:
    """What the EDS calls an object, else a name that the profile has for it."""
    if node.dictionary is not None and index in node.dictionary:
        return node.dictionary[index].name
    return next((alias for alias, place in node.profile.aliases.items() if place == f"{index:04X}:00"), "")


def _listing(node: Node, names: list[str], said: str = "") -> VpdoListing:
    from dvtcli.operations.results import VpdoListing

    return VpdoListing(node.node_id, tuple(_row(node, read_pins(node, name)) for name in names), said)


def _row(node: Node, pins: Pins) -> VpdoRow:
    from dvtcli.operations.results.vpdos import PinRow, VpdoRow

    rows = [
        PinRow(number, index, "" if index is None else _name(node, index))
        for number, index in enumerate(pins.tied(), 1)
    ]
    return VpdoRow(pins.name, pins.group.index, len(pins.values), tuple(rows))
