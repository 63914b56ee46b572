"""Each law is broken in several ways, in a copy of the source, to see that it bites; `test_direction` keeps them."""

from __future__ import annotations

import ast
import inspect
from collections import Counter

import pytest

from tests.house.draw import nodes
from tests.house.laws import LAWS
from tests.house.laws.breaks import BREAKS, Break
from tests.house.laws.failures import INNER
from tests.house.laws.imports import DOORS, ONLY_IN
from tests.house.laws.makers import names, numbers
from tests.house.laws.senders import ASKED_BY, MAY_SEND
from tests.house.laws.source_tree import SourceTree

pytestmark = pytest.mark.together

HOUSE = SourceTree.of_the_package()
#: laws about how files hang together: the others look at one file at a time
WHOLE = {"direction", "folders", "independence", "laziness", "errors", "results"}


@pytest.mark.drawn(8)
@pytest.mark.parametrize("way", BREAKS, ids=lambda way: f"{way.law}-{way.file}")
def test_it_bites(way: Break) -> None:
    broken = HOUSE.altered(way.file, with_text(HOUSE.texts.get(way.file, '"""New."""\n'), way.text))
    found = list(LAWS[way.law](broken if way.law in WHOLE else broken.only(way.file)))
    assert any(way.file in said for said in found), found


def with_text(source: str, text: str) -> str:
    """*source* with *text* behind its imports."""
    body = ast.parse(source).body
    last = max((node.end_lineno or 0 for node in body if isinstance(node, ast.Import | ast.ImportFrom)), default=1)
    lines = source.splitlines()
    return "\n".join([*lines[:last], text, *lines[last:], ""])


def test_each_law_is_broken_in_three_ways_at_least() -> None:
    ways = Counter(way.law for way in BREAKS)
    assert ways.keys() == LAWS.keys()
    assert min(ways.values()) >= 3, ways


def test_a_broken_file_is_told_from_the_house_as_it_is() -> None:
    for way in BREAKS:
        assert way.text not in HOUSE.texts.get(way.file, ""), way


def test_no_permission_is_left_over() -> None:
    assert [file for file in MAY_SEND if not sends(file)] == []
    classes = {f"{file}:{node.name}" for file, tree in HOUSE for node in nodes(tree) if isinstance(node, ast.ClassDef)}
    assert classes >= INNER
    for library, places in (ONLY_IN | DOORS).items():
        assert all(any(library in HOUSE.texts[file] for file in HOUSE.texts if file.startswith(at)) for at in places)
    for target, askers in ASKED_BY.items():
        sources = {arrow.source for arrow in HOUSE.house.arrows if arrow.target == target and arrow.how != "type"}
        assert all(any(source.startswith(asker) for source in sources) for asker in askers), target


@pytest.mark.parametrize(("law", "table"), [
    ("exits", "MAY_EXIT"),
    ("exits", "MAY_INTERRUPT"),
    ("swallowing", "MAY_CATCH_ALL"),
    ("swallowing", "MAY_LEAVE_UNSAID"),
    ("printing", "MAY_PRINT"),
])  # fmt: skip
def test_who_has_a_permission_needs_it(law: str, table: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module = inspect.getmodule(LAWS[law])
    permitted = getattr(module, table)
    monkeypatch.setattr(module, table, ())
    assert [file for file in permitted if not list(LAWS[law](HOUSE.only(file)))] == []


def sends(file: str) -> bool:
    whole = HOUSE.only(file)
    return file == "domain/ports.py" or any(
        isinstance(node, ast.Attribute) and node.attr in {"download", "send", "send_nmt"}
        for _, tree in whole
        for node in nodes(tree)
    )


def test_makers_come_from_the_family_data() -> None:
    assert names() >= {"sevcon", "gen4", "trinamic", "tmcm", "roboteq", "curtis", "lely", "espac"}
    assert numbers() >= {0x1E, 0x286, 0x4349, 0x469}
