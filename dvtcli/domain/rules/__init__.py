"""Rules that check a change before the first write.

A rule yields findings about one `Proposal`; it judges only changed parts, so that a device
with an odd factory setting can still be changed elsewhere. Rules never write.
"""

from __future__ import annotations

from dvtcli.domain.profile import Severity
from dvtcli.domain.rules.can_id import can_id_findings
from dvtcli.domain.rules.communication import communication_findings
from dvtcli.domain.rules.finding import Finding, Proposal
from dvtcli.domain.rules.pdo_mapping import mapping_findings, whole_findings

__all__ = ["Finding", "Proposal", "check_pdo", "errors_in"]

_RANK = {Severity.ERROR: 0, Severity.WARNING: 1, Severity.NOTE: 2}


def check_pdo(proposal: Proposal) -> tuple[Finding, ...]:
    """All findings about *proposal*: errors first, each kind in frame order."""
    findings = [
        *whole_findings(proposal),
        *mapping_findings(proposal),
        *communication_findings(proposal),
        *can_id_findings(proposal),
    ]
    return tuple(sorted(findings, key=lambda finding: _RANK[finding.severity]))


def errors_in(findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Findings that stop a change."""
    return tuple(finding for finding in findings if finding.severity is Severity.ERROR)
