"""Connect RPDOs to a TPDO of another node."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Literal

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._file_plans import show_plan
from dvtcli.cli.commands._pdo_options import endpoints
from dvtcli.cli.params import Listed, NumberType
from dvtcli.cli.pdo_params import PDO, NodePdo, PdoType
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.operations.results import NetworkApplied

_HEARTBEAT_MS = NumberType(1, 0xFFFF, "a heartbeat in ms")


class LinkEndType(PdoType):
    """A PDO with its node; a network file gets the way to make its links."""

    def parse(self, text: str, ctx: click.Context | None) -> NodePdo:
        """Return the PDO and its node. Raises UsageError for a network file."""
        if text.lower().endswith((".yaml", ".yml")):
            raise UsageError(
                f"link connects two PDOs, and {text} is a network file",
                hint=Hint(Action.PLAN, {"file": text}, "{} shows what its `links:` write")
                + Hint(Action.APPLY_NETWORK, {"file": text}, ", {} makes them"),
            )
        return super().parse(text, ctx)


@click.command("link", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("producer", type=LinkEndType(), metavar="NODE:TPDO")
@click.argument("consumers", cls=Listed, type=PDO, nargs=-1, required=True, metavar="NODE:RPDO...")
@click.option("--heartbeat", type=_HEARTBEAT_MS, metavar="MS", help="Heartbeat time of the producer (0x1017).")
@click.option("--no-heartbeat", "silent", is_flag=True, help="Leave 0x1016 and 0x1017 alone.")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    producer: NodePdo,
    consumers: tuple[NodePdo, ...],
    heartbeat: int | None,
    silent: bool,
) -> NetworkApplied:
    """Connect each RPDO to the TPDO: its objects at their places in the frame, dummies between them, one CAN-ID.

    First map the RPDO, with --off, to the objects that should receive values. Both sides are written and read back
    before the RPDOs are enabled, then the TPDO; if one node fails, none is changed. The consumer also monitors the
    producer's heartbeat.

    \b
    link 1:tpdo1 5:rpdo2
    link 1:tpdo1 5:rpdo2 6:rpdo1
    link 1:tpdo1 5:rpdo2 --heartbeat 200
    """
    from dvtcli.operations.plans.link_pdos import link_pdos

    if silent and heartbeat is not None:
        raise UsageError("--heartbeat and --no-heartbeat exclude each other: give only one of them")
    asked: int | Literal[False] | None = False if silent else heartbeat
    sender, *hearers = endpoints(ctx.obj, (producer, *consumers))
    return link_pdos(ctx.obj, sender, hearers, heartbeat=asked, on_plan=partial(show_plan, ctx.obj.output))
