"""Findings of a plan: many that say the same of places in a file are one line, and nothing else is."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from dvtcli.cli.view.error_lines import finding_lines
from dvtcli.cli.view.lines import Cell
from dvtcli.domain.profile import Severity
from dvtcli.domain.rules.finding import FileComplaint, Finding


def found(number: int, text: str, severity: Severity = Severity.WARNING, hint: str | None = None) -> Finding:
    place = FileComplaint("net.yaml", 10 + number, 1, "")
    return Finding("a-rule", severity, f"0x1A0{number}:01", text, hint=hint, complaint=place)


def texts(findings: list[Finding]) -> list[str]:
    return ["".join(each.text for each in row if isinstance(each, Cell)) for row in finding_lines(findings)]


def test_the_same_of_three_nodes_and_pdos_is_one_line_with_all_lines() -> None:
    many = [
        found(number, f"node {number + 1}: TPDO{number + 1} 0x{0x181 + number:03X} waits for SYNC")
        for number in range(3)
    ]
    (line,) = texts(many)
    assert line.endswith("node 1: TPDO1 0x181 waits for SYNC (3 times: also line 11, 12)")


@pytest.mark.parametrize(
    "each",
    [
        lambda number: found(number, f"node 1: it waits 100 ms for node {number + 2}"),
        lambda number: found(number, f"node {number + 1}: the period is {number} ms"),
        lambda number: found(number, f"node {number + 1}: it waits for SYNC", hint=f"set tpdo{number + 1} --event"),
        lambda number: found(number, f"node {number + 1}: it waits for SYNC", Severity.ERROR),
    ],
    ids=["other node", "value", "hint", "error"],
)
def test_other_values_hints_and_errors_have_their_own_lines(each: Callable[[int], Finding]) -> None:
    lines = texts([each(number) for number in range(4)])
    assert len(lines) == 4
    assert not any("times" in line for line in lines)


def test_findings_that_are_not_many_keep_their_order() -> None:
    producers = [9, 1, 9]
    lines = texts([found(at, f"node 5: it does not monitor node {of}") for at, of in enumerate(producers)])
    assert [line.rpartition(" ")[2] for line in lines] == ["9", "1", "9"]
