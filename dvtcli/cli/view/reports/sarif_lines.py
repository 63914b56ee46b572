"""SARIF 2.1.0: findings for code scanning services, in one run for all files."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from dvtcli.cli.view.lines import Line
from dvtcli.cli.view.typed_hints import advised
from dvtcli.operations.results.checked_files import FileFinding, Report, Reported
from dvtcli.version import __version__

_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def sarif_lines(result: Reported, _width: int) -> Iterator[Line]:
    """Show the whole document, with all rules applied, for services that track fixed findings."""
    reports = result.reports
    rules = list({rule.name: rule for report in reports for rule in report.rules}.values())
    places = {rule.name: number for number, rule in enumerate(rules)}
    driver = {"name": "dvtcli", "version": __version__, "rules": [_rule(rule) for rule in rules]}
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "artifacts": [{"location": {"uri": _uri(report.path)}} for report in reports],
        "results": [_result(report, finding, places) for report in reports for finding in report.findings],
    }
    yield from json.dumps({"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]}, indent=1).splitlines()


def _result(report: Report, finding: FileFinding, places: Mapping[str, int]) -> dict[str, Any]:
    region = {"startLine": finding.line}
    if finding.column:  # the end is the column behind it (3.30.8)
        region |= {"startColumn": finding.column, "endColumn": finding.end_column + 1}
    location = {"artifactLocation": {"uri": _uri(report.path)}, "region": region}
    return {
        "ruleId": finding.rule,
        "ruleIndex": places[finding.rule],
        "level": finding.severity,
        "message": {"text": advised(finding)},
        "locations": [{"physicalLocation": location}],
    }


def _rule(rule: Any) -> dict[str, Any]:
    return {
        "id": rule.name,
        "shortDescription": {"text": rule.sense},
        "help": {"text": f"{rule.sense} ({rule.source})"},
        "defaultConfiguration": {"level": rule.severity},
    }


def _uri(path: str) -> str:
    """Return a path as a reference; relative paths stay relative, for the service's repository."""
    return Path(path).as_uri() if Path(path).is_absolute() else quote(os.fsencode(Path(path).as_posix()))
