"""A plan for a network, shown before it is carried out."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.cli.view.output import Output
    from dvtcli.domain.network.network_plan import NetworkPlan


def show_plan(output: Output, plan: NetworkPlan) -> None:
    """Say what is about to be written, as a part of the answer; with JSON that says it."""
    from dvtcli.cli.view.network_lines import plan_lines

    if not output.json:
        output.said(plan_lines(plan, output.width), error=False)
