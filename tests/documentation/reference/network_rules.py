"""The rules of `check`, from the declarations beside what checks them."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.network.check.network_rules import NETWORK_RULES
from dvtcli.domain.profile import Severity
from dvtcli.operations.network.check_networks import FILE_RULES
from tests.documentation.reference.markdown import cell, code
from tests.documentation.reference.markdown import table as markdown_table


def table() -> Iterator[str]:
    """Name, sense and source of each rule, by severity and name."""
    for severity in Severity:
        mine = sorted(rule for rule in (*FILE_RULES, *NETWORK_RULES) if rule.severity is severity)
        yield from ("", f"## {str(severity).capitalize()}s ({len(mine)})", "")
        yield from markdown_table(
            ("rule", "finding", "source"),
            ((code(rule.name), cell(rule.sense), cell(rule.source)) for rule in mine),
        )
