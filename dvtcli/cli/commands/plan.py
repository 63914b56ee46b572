"""Show what must be written to bring a network to the state in a file; writes nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._file_plans import include as include_option
from dvtcli.cli.commands._file_plans import to_manager
from dvtcli.cli.commands._file_plans import trust_stamp as trust_stamp_option
from dvtcli.cli.params import FILE
from dvtcli.operations.user.options import CASE_FORMATS

if TYPE_CHECKING:
    from dvtcli.operations.results import NetworkPlanned


@click.command("plan", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE, formats=CASE_FORMATS)
@click.argument("file", type=FILE)
@click.option(
    "-o", "saved", type=FILE, metavar="PLAN", help="Save the plan for apply; as PLAN.309: gateway lines (CiA 309-3)."
)
@click.option("--exit-code", "tells", is_flag=True, help="End with 3 if something differs or must be stored.")
@trust_stamp_option
@include_option
@to_manager
@click.pass_context
def command(
    ctx: click.Context,
    /,
    file: str,
    saved: str | None,
    tells: bool,
    trust_stamp: bool,
    include: tuple[str, ...],
    manager: int | None,
) -> NetworkPlanned:
    """Read the nodes of the network FILE and show the differences, and the writes of apply.

    All errors, on all nodes, are shown at once. --format github or junit is for CI. FILE may also be a DCF, an XDC or
    a backup (.jsonl) of the selected node; if no node is selected, of the node whose node-ID it has. A saved plan is
    compared with a new plan.

    \b
    plan press.yaml
    plan press.yaml -o plan.json
    plan press.yaml -o press.309     as lines that any CiA 309-3 gateway carries out
    plan plan.json -o press.309      the same of a saved plan
    plan press.dcf
    plan press.yaml --exit-code      3 if anything differs
    plan press.yaml --format junit   a test case for each PDO, for CI
    plan press.yaml --to-manager 3   the downloads of node 3 to each node that boots
    """
    from dvtcli.operations.network.network_files import plan_file

    return plan_file(ctx.obj, file, saved, tells=tells, trust_stamp=trust_stamp, include=include, manager=manager)
