"""Making one device what a file about one says: `apply` of such a file in Python, and `clone`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.operations.plans.apply_network import apply_network
from dvtcli.operations.whole_device.plan_device import DeviceOptions, plan_device

if TYPE_CHECKING:
    from dvtcli.domain.network.network_plan import NetworkPlan
    from dvtcli.operations.results import NetworkApplied
    from dvtcli.operations.session.session import Session


def apply_device(
    session: Session,
    file: str,
    options: DeviceOptions,
    *,
    on_plan: Callable[[NetworkPlan], None] = lambda _plan: None,
) -> NetworkApplied:
    """Make nodes what *file* (a DCF, an XDC or a backup) says by *options*; *on_plan* is told what is to be written.

    Asks first. A fault brings them back. A clone of which settings differ still is not done: exit code 3.
    Raises as `plan_device` and `apply_network`.
    """
    plan = plan_device(session, file, options)
    on_plan(plan)
    done = apply_network(session, plan, name=f"{'clone' if options.is_clone else 'apply'} {file}")
    return replace(done, is_clone=options.is_clone)
