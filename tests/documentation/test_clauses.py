"""The clauses of CiA 301 that code and documentation name beside an object are those of that object."""

from __future__ import annotations

import re
from itertools import chain

import pytest

from tests.surroundings import ROOT

#: The objects of clauses 7.5.2.1, 7.5.2.2, …, in their order.
_OBJECTS = [
    *range(0x1000, 0x1004),
    *range(0x1005, 0x100B),
    0x100C,
    0x100D,
    *range(0x1010, 0x101A),
    *range(0x1020, 0x102A),
    0x1200,
]
_CLAUSES = {index: f"7.5.2.{number}" for number, index in enumerate(_OBJECTS, 1)}
_INDEX, _CLAUSE = re.compile(r"0x(10[0-2][0-9A-F]|1200)\b"), re.compile(r"\b7\.5\.2\.\d+")
_FILES = [
    path.relative_to(ROOT).as_posix()
    for path in chain((ROOT / "dvtcli").rglob("*.py"), (ROOT / "docs/reference").glob("*rules.md"))
    if "7.5.2." in path.read_text("utf-8")
]


@pytest.mark.parametrize("file", _FILES)
def test_a_line_with_one_object_and_one_clause_has_that_of_the_object(file: str) -> None:
    for number, line in enumerate((ROOT / file).read_text("utf-8").splitlines(), 1):
        objects, clauses = {int(found, 16) for found in _INDEX.findall(line)}, set(_CLAUSE.findall(line))
        if len(objects) == len(clauses) == 1:
            assert clauses == {_CLAUSES[objects.pop()]}, f"{file}:{number}: {line}"


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
    assert all(re.search(rf"{re.escape(_CLAUSES[index])}\b", row) for row in rows)
