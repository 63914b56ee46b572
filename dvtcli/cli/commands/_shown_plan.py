"""Show a plan for a network before applying it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.cli.view.output import Output
    from dvtcli.domain.network.network_plan import NetworkPlan


def show_plan(output: Output, plan: NetworkPlan) -> None:
    """Show the planned writes and the findings as a part of the answer; not with JSON, which has them anyway."""
    if output.json:
        return
    from dvtcli.cli.view.answers.network_lines import plan_lines
    from dvtcli.cli.view.error_lines import finding_line
    from dvtcli.domain.profile import Severity
    from dvtcli.operations.results.networks import network_findings

    findings = network_findings(plan)
    shown = (finding for finding in findings if not output.quiet or finding.severity is not Severity.NOTE)
    output.lines(map(finding_line, shown))
    if plan.to_do:
        output.said(plan_lines(plan, output.width), error=False)
