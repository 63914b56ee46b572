"""SARIF 2.1.0: findings as code scanning services take them. One run, one file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

from dvtcli.cli.view.lines import Line
from dvtcli.operations.results.checked_files import FileReport
from dvtcli.version import __version__

_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def sarif_lines(result: FileReport, _width: int) -> Iterator[Line]:
    """The whole document, with every rule that was asked: who reads it sees what is settled since."""
    places = {rule.name: number for number, rule in enumerate(result.rules)}
    location = {"uri": _uri(result.path)}
    driver = {"name": "dvtcli", "version": __version__, "rules": [_rule(rule) for rule in result.rules]}
    results = [
        {
            "ruleId": finding.rule,
            "ruleIndex": places[finding.rule],
            "level": finding.severity,
            "message": {"text": finding.text},
            "locations": [
                {"physicalLocation": {"artifactLocation": location, "region": {"startLine": finding.line}}},
            ],
        }
        for finding in result.findings
    ]
    run = {"tool": {"driver": driver}, "artifacts": [{"location": location}], "results": results}
    yield from json.dumps({"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]}, indent=1).splitlines()


def _rule(rule: Any) -> dict[str, Any]:
    return {
        "id": rule.name,
        "shortDescription": {"text": rule.sense},
        "help": {"text": f"{rule.sense} ({rule.source})"},
        "defaultConfiguration": {"level": rule.severity},
    }


def _uri(path: str) -> str:
    """A path as a reference: relative ones stay so, which is how a service finds the file in its repository."""
    return Path(path).as_uri() if Path(path).is_absolute() else quote(Path(path).as_posix())
