"""The rules of `check` about recordings, from the declarations beside what checks them."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.profile import Severity
from dvtcli.watch.recording_checks.recording_rules import RECORDING_RULES, UNREADABLE
from tests.documentation.reference.markdown import cell, code
from tests.documentation.reference.markdown import table as markdown_table


def table() -> Iterator[str]:
    """Name, sense and source of each rule, by severity and name."""
    for severity in Severity:
        mine = sorted(rule for rule in (*RECORDING_RULES, UNREADABLE) if rule.severity is severity)
        yield from ("", f"## {str(severity).capitalize()}s ({len(mine)})", "")
        yield from markdown_table(
            ("rule", "finding", "source"),
            ((code(rule.name), cell(rule.sense), cell(rule.source)) for rule in mine),
        )
