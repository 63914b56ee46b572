"""What commands that plan a file share: more of a file as configuration, and the plan before it is applied."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.params import NODE_ID, TEXT

if TYPE_CHECKING:
    from dvtcli.cli.view.output import Output
    from dvtcli.domain.network.network_plan import NetworkPlan


def show_plan(output: Output, plan: NetworkPlan) -> None:
    """Show the planned writes and the findings as a part of the answer; not with JSON, which has them anyway."""
    if output.json:
        return
    from dvtcli.cli.view.answers.network_lines import plan_lines
    from dvtcli.cli.view.error_lines import finding_lines
    from dvtcli.domain.profile import Severity
    from dvtcli.operations.results.networks import network_findings

    findings = network_findings(plan)
    shown = (finding for finding in findings if not output.quiet or finding.severity is not Severity.NOTE)
    output.lines(finding_lines(shown))
    if plan.to_do:
        output.said(plan_lines(plan, output.width), error=False)


trust_stamp = click.option(
    "--trust-stamp",
    is_flag=True,
    help="Skip nodes whose 0x1020 has the stamp of this file (stamp: true), and name them.",
)


to_manager = click.option(
    "--to-manager",
    "manager",
    type=NODE_ID,
    metavar="NODE",
    help="Write NODE, a CANopen manager, which downloads it to each node that boots (0x1F22).",
)


include = click.option(
    "--include",
    type=TEXT,
    multiple=True,
    metavar="OBJECT",
    help="With a DCF, an XDC or a backup: treat the manufacturer-specific OBJECT (3001, or 3001:1 alone) as "
    "configuration, too; 2000-2FFF for a range, in which objects that an RPDO can map count only if their names show "
    "that they are settings.",
)
