"""List the virtual PDOs inside a node, or connect a pin to an object."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.object_params import ObjectParam, ObjectWord
from dvtcli.cli.params import CanopenType, NumberType

if TYPE_CHECKING:
    from dvtcli.operations.results import Changed, VpdoListing
    from dvtcli.operations.session.session import Session

_GROUPS = ("motor", "digital-out", "analogue-out", "digital-in", "analogue-in")
_NONE = "none"


class PinType(CanopenType):
    """A pin's number from 1, or the word `none` for all pins of the group: 0."""

    name = "pin"

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """The pin; 0 for none."""
        return 0 if text.lower() == _NONE else int(NumberType(1, 254, "a pin").parse(text, ctx))


class ObjectOrNone(ObjectParam):
    """An object, or the word `none`."""

    def parse(self, text: str, ctx: click.Context | None) -> ObjectWord:
        """The word, `none` in small letters."""
        return ObjectWord(_NONE) if text.lower() == _NONE else ObjectWord(super().parse(text, ctx).text)


@click.command("vpdo", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("group", type=click.Choice(_GROUPS), required=False, metavar="[GROUP]")
@click.argument("pin", type=PinType(), required=False, metavar="[PIN|none]")
@click.argument("object_", type=ObjectOrNone(), required=False, metavar="[OBJECT|none]")
@click.pass_obj
def command(
    session: Session, /, group: str | None, pin: int | None, object_: ObjectWord | None
) -> Changed | VpdoListing:
    """Show the object of each pin, or connect PIN of GROUP to OBJECT.

    GROUP is motor, digital-out, analogue-out, digital-in or analogue-in.

    \b
    vpdo
    vpdo digital-in
    vpdo digital-in 1 fwd_switch
    vpdo analogue-out 2 none
    vpdo digital-out none      no active pin in the whole group
    """
    from dvtcli.operations.pdos.virtual_pdo_ties import list_ties, tie_pin

    if group is None or pin is None:
        return list_ties(session, group)
    if pin and object_ is None:
        raise click.UsageError(f"give the object to link {group} pin {pin} to, or none")
    if not pin and object_ is not None:
        raise click.UsageError(f"`vpdo {group} none` takes no object: it unlinks every pin")
    return tie_pin(session, group, pin, None if object_ is None or object_.text == _NONE else object_.text)
