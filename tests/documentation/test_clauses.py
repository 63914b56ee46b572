"""Clauses of CiA 301: one number for each object, wherever it is cited."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest

from dvtcli.domain.standard_objects import CLAUSES, source
from tests.house.draw import nodes
from tests.house.source import Module, modules
from tests.surroundings import ROOT

pytestmark = pytest.mark.together

_CITED, _INDEX = re.compile(r"\b7\.5\.2\.\d+"), re.compile(r"\b0x1[0-9A-F]{3}\b")


def test_the_series_has_its_known_numbers() -> None:
    """Of each end, and of what others cite: store and restore, consumer heartbeat, SYNC counter, SDO server."""
    known = {0x1000: 1, 0x1010: 13, 0x1011: 14, 0x1016: 19, 0x1019: 22, 0x1029: 32, 0x1200: 33, 0x1A00: 38, 0x1FD0: 40}
    assert {index: CLAUSES[index] for index in known} == {index: f"7.5.2.{number}" for index, number in known.items()}
    assert source(0x1016) == "CiA 301, 7.5.2.19"
    assert source(0x1000, 0x1010, 0x1011) == "CiA 301, 7.5.2.1, 7.5.2.13 and 7.5.2.14"


def clause_of(index: int) -> str | None:
    """The clause of *index*, also within a range of records."""
    first = index & 0xFF80 if 0x1200 <= index < 0x1300 else index & 0xFE00 if 0x1400 <= index < 0x1C00 else index
    return CLAUSES.get(first)


def texts(module: Module) -> Iterator[str]:
    """Each comment with the line that it is about, each docstring, and each call with texts."""
    comment = ""
    for line in module.text.splitlines():
        if line.lstrip().startswith("#"):
            comment += f"{line}\n"
        elif comment or "#" in line:
            yield f"{comment}{line}"
            comment = ""
    for node in nodes(module.tree):
        if isinstance(node, ast.Call):
            yield ast.unparse(node)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def contradictions(text: str) -> list[str]:
    """The clauses in *text* that are none of its objects', if it names objects that have one."""
    own = {clause for index in _INDEX.findall(text) if (clause := clause_of(int(index, 16)))}
    cited = set(_CITED.findall(text))
    return sorted(cited) if own and not own & cited else []


@pytest.mark.parametrize(("text", "wrong"), [
    ("consumer heartbeat times (0x1016, CiA 301, 7.5.2.17)", ["7.5.2.17"]),
    ("consumer heartbeat times (0x1016, CiA 301, 7.5.2.19)", []),
    ("a mapping (0x1A03, CiA 301, 7.5.2.38)", []),
    ("CiA 301, 7.5.2.17", []),
    ("0x1016", []),
])  # fmt: skip
def test_a_contradiction_is_seen(text: str, wrong: list[str]) -> None:
    assert contradictions(text) == wrong


def test_a_clause_beside_an_object_is_that_objects() -> None:
    found = {
        f"{module.name}: {', '.join(wrong)}: {' '.join(text.split())[:120]}"
        for module in modules()
        for text in texts(module)
        if (wrong := contradictions(text))
    }
    pages = sorted((ROOT / "docs").rglob("*.md"))
    found |= {
        f"{page.name}: {', '.join(wrong)}: {line[:120]}"
        for page in pages
        for line in page.read_text("utf-8").splitlines()
        if (wrong := contradictions(line))
    }
    assert not found, "\n".join(sorted(found))


@pytest.mark.parametrize(("words", "index"), [
    ("heartbeat-late", 0x1017), ("identity", 0x1018), ("emcy-twice", 0x1014), ("two-times", 0x1012),
    ("heartbeat-of-itself", 0x1016), ("goes-on-after-error", 0x1029), ("sync-counter", 0x1019), ("vendor-id", 0x1018),
])  # fmt: skip
def test_a_rule_has_the_clause_of_its_object(words: str, index: int) -> None:
    pages = [
        (ROOT / "docs/reference" / f"{page}-rules.md").read_text("utf-8") for page in ("network", "eds", "recording")
    ]
    rows = [line for page in pages for line in page.splitlines() if line.startswith(f"| `{words}` ")]
    assert rows
    assert all(re.search(rf"{re.escape(CLAUSES[index])}\b", row) for row in rows)
