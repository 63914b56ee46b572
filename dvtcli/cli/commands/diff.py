"""Compare a network with its file; exit code 3 if it differs."""

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


@click.command("diff", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE, formats=CASE_FORMATS)
@click.argument("file", type=FILE)
@trust_stamp_option
@include_option
@to_manager
@click.pass_context
def command(
    ctx: click.Context, /, file: str, trust_stamp: bool, include: tuple[str, ...], manager: int | None
) -> NetworkPlanned:
    """Read the nodes of the network FILE and show the differences: plan, with exit code 3 if something differs.

    FILE may also be a DCF, an XDC or a backup (.jsonl) of the selected node; if no node is selected, of the node whose
    node-ID it has. A setting that differs and that apply does not write counts as well, and is listed with the reason.

    \b
    diff press.yaml
    diff press.dcf
    diff press.yaml --json
    """
    from dvtcli.operations.network.network_files import plan_file

    return plan_file(ctx.obj, file, None, tells=True, trust_stamp=trust_stamp, include=include, manager=manager)
