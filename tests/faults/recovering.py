"""Finishing one interrupted change, as `recover` does it."""

from __future__ import annotations

from dvtcli.device.change.changeable import Changeable
from dvtcli.device.change.journal import Journal
from dvtcli.device.change.recovery import Recovery, recover_together
from dvtcli.domain.plan import Plan
from dvtcli.domain.rules import Finding


def recover(node: Changeable, journal: Journal) -> tuple[Plan, tuple[Finding, ...]]:
    """Put back what *journal* tells; what was to be written, and what the device did not take back."""
    recovery = Recovery.begin(node, journal)
    for failed in recover_together([recovery]).values():
        raise failed
    return recovery.end()
