"""Findings of `check` in few lines: none is hidden behind another one, and none gets another one's values."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.cli.view.answers.check_lines import network_check_lines
from dvtcli.cli.view.lines import Cell, Line
from dvtcli.operations.results.checks import FileRule, NetworkFinding, NetworkReport, NetworksChecked

#: what rules say of a node, of a PDO and of an object
NODE_TEXTS = ("node {node}: EMCY 0x{value:04X}, device specific", "node {node}: its boot-up message was received")
PDO_TEXTS = (
    "node {node} {label}: no RPDO of the network receives 0x{can_id:03X}",
    "node {node} {label}: it maps {value} bits",
    "node {node} {label}: it receives 0x{can_id:03X} instead of 0x{value:03X}",
)
OBJECT_TEXTS = ("node {node} 0x{object}: its vendor is 0x0000001E, the file says 0x{value:08X}",)
_VALUES = st.sampled_from([0x111, 0x222, 0x3FF])


@st.composite
def findings(draw: st.DrawFn) -> NetworkFinding:
    node, value, line = draw(st.integers(1, 6)), draw(_VALUES), draw(st.integers(0, 9))
    kind = draw(st.sampled_from(["node", "pdo", "object"]))
    pdo = draw(st.sampled_from(["tpdo1", "tpdo2", "rpdo1"])) if kind == "pdo" else None
    entry = f"1018:0{draw(st.integers(1, 4))}" if kind == "object" else ""
    texts = {"node": NODE_TEXTS, "pdo": PDO_TEXTS, "object": OBJECT_TEXTS}[kind]
    number = draw(st.integers(0, len(texts) - 1))
    label = "" if pdo is None else pdo.upper()
    text = texts[number].format(node=node, label=label, can_id=0x180 + node, value=value, object=entry)
    severity = draw(st.sampled_from(["error", "warning", "note"]))
    rule, column = f"{severity}-{kind}-{number}", min(line, 1)
    return NetworkFinding(line or 1, severity, rule, entry, text, column, node=node, pdo=pdo)


def shown(found: list[NetworkFinding]) -> list[str]:
    """The lines of a report with *found* and a second rule, without the sum."""
    rules = (FileRule("a", "error", "", ""), FileRule("b", "error", "", ""))
    *lines, _ = network_check_lines(NetworksChecked((NetworkReport("net", rules, tuple(found)),)), 80)
    return [written(line) for line in lines]


def written(line: Line) -> str:
    """A line's text."""
    return line if isinstance(line, str) else "".join(cell.text for cell in line if isinstance(cell, Cell))


def numbers(text: str) -> set[int]:
    """The numbers in `1, 3-5`."""
    ends = [part.split("-") for part in text.split(", ")]
    return {number for end in ends for number in range(int(end[0]), int(end[-1]) + 1)}


def named(line: str, first: NetworkFinding) -> tuple[set[tuple[str, int]], set[int]]:
    """The PDOs or objects with their nodes, and the lines of the file, that *line* names beside those of *first*."""
    also = re.search(r"times: also (.*)\) \[", line)
    places, lines = set[tuple[str, int]](), set[int]()
    for part in also[1].split("; ") if also else ():
        what, _, listed = re.sub(r" \(0x.*\)|(?<=node)s", "", part).rpartition("node ")
        if part.startswith("line "):
            lines = numbers(part.removeprefix("line "))
        else:
            places |= {(what.removesuffix(" of ") or of(first)[0], number) for number in numbers(listed)}
    return places, lines


def of(finding: NetworkFinding) -> tuple[str, int]:
    """The PDO or object of *finding*, and its node."""
    assert finding.node is not None
    return (finding.pdo or "").upper() or (f"0x{finding.object}" if finding.object else ""), finding.node


@given(st.lists(findings(), max_size=25))
def test_each_finding_is_a_line_or_named_by_one_that_says_the_same(found: list[NetworkFinding]) -> None:
    lines = shown(found)
    for finding in found:
        place = f"net:{finding.line}:1: " if finding.column else "net: "
        own = f"{place}{finding.severity}: {finding.text} "
        if any(line.startswith(own) for line in lines):
            continue
        assert finding.severity != "error"
        firsts = [other for other in found if other.rule == finding.rule and as_at(other, finding) == finding.text]
        behind = [(line, first) for line in lines for first in firsts if f": {first.text} (" in line]
        assert any(of(finding) in places or of(finding) == of(first) for line, first in behind
                   for places, _ in [named(line, first)])  # fmt: skip
        if finding.column:
            assert any(finding.line in {first.line, *in_file} for line, first in behind
                       for _, in_file in [named(line, first)])  # fmt: skip


def as_at(first: NetworkFinding, other: NetworkFinding) -> str:
    """The text of *first*, as its rule would write it about the node, PDO and object of *other*."""
    text = first.text.replace(f"node {first.node}", f"node {other.node}").replace(of(first)[0] or "\0", of(other)[0])
    return text.replace(f"receives 0x{0x180 + (first.node or 0):03X}", f"receives 0x{0x180 + (other.node or 0):03X}")


@pytest.mark.parametrize("text", [
    "node {node}: EMCY 0xFF0{node}, device specific",
    "node {node}: its vendor is 0x0000001E, the file says 0x00000{node}{node}{node}",
    "node {node}: for node 9: 0x6040:00 becomes 0x1{node}, not 0x02",
])  # fmt: skip
def test_other_values_are_other_lines(text: str) -> None:
    found = [NetworkFinding(1, "warning", "emergency", "", text.format(node=node), node=node) for node in range(1, 5)]
    assert shown(found) == [f"net: warning: {finding.text} [emergency]" for finding in found]
    same = [replace(finding, text=f"node {finding.node}: EMCY 0xFF01") for finding in found]
    assert shown(same) == ["net: warning: node 1: EMCY 0xFF01 (4 times: also nodes 2-4) [emergency]"]


def test_pdos_without_lines_are_named() -> None:
    """A bus has no lines."""
    found = [
        NetworkFinding(
            1, "note", "tpdo-without-consumer", "", f"node {node} {pdo.upper()}: no RPDO receives 0x18{node}",
            node=node, pdo=pdo,
        ) for node in (1, 2, 3) for pdo in ("tpdo1", "tpdo2")
    ]  # fmt: skip
    (line,) = shown(found)
    assert "(6 times: also TPDO2 of nodes 1-3 (0x181-0x183); TPDO1 of nodes 2, 3 (0x182, 0x183))" in line


@pytest.mark.parametrize(("can_ids", "named"), [
    ((0x210, 0x233, 0x222), " (0x233, 0x222)"),
    ((0x210, 0x222, 0x223), " (0x222, 0x223)"),
    ((0x210, 0x222, 0x222), " (0x222, 0x222)"),
])  # fmt: skip
def test_can_ids_stand_in_the_order_of_their_nodes(can_ids: tuple[int, ...], named: str) -> None:
    found = [
        NetworkFinding(
            1, "note", "rpdo-without-producer", "", f"node {node} RPDO1: no node of the network transmits 0x{can_id:X}",
            node=node, pdo="rpdo1",
        ) for node, can_id in enumerate(can_ids, 1)
    ]  # fmt: skip
    (line,) = shown(found)
    assert f"(3 times: also nodes 2, 3{named})" in line
