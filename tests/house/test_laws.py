"""Each law is broken in several ways, in a copy of the source, to see that it bites; `test_direction` keeps them."""

from __future__ import annotations

import ast
import inspect
from collections import Counter, defaultdict
from functools import cache

import pytest

from tests.house.draw import nodes
from tests.house.laws import LAWS
from tests.house.laws.askers import ASKED_BY, HARMLESS, is_sender
from tests.house.laws.breaks import BREAKS
from tests.house.laws.breaks.way import Break
from tests.house.laws.effects import MAY_READ_AND_SEND
from tests.house.laws.failures import INNER
from tests.house.laws.imports import by_name
from tests.house.laws.imports_allowed import DOORS, ONLY_IN
from tests.house.laws.makers import names, numbers
from tests.house.laws.senders import MAY_SEND
from tests.house.laws.source_tree import SourceTree, imported
from tests.house.laws.uses import taken

pytestmark = pytest.mark.together

HOUSE = SourceTree.of_the_package()
#: laws about how files hang together: the others look at one file at a time
WHOLE = {"direction", "folders", "independence", "laziness", "errors", "results", "effects"}


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
    runners = Counter(way.law for way in BREAKS)
    assert runners.keys() == LAWS.keys()
    assert min(runners.values()) >= 3, runners


def test_a_broken_file_is_told_from_the_house_as_it_is() -> None:
    for way in BREAKS:
        assert way.text not in HOUSE.texts.get(way.file, ""), way


def test_no_permission_is_left_over() -> None:
    assert [file for file in MAY_SEND if not sends(file)] == []
    classes = {f"{file}:{node.name}" for file, tree in HOUSE for node in nodes(tree) if isinstance(node, ast.ClassDef)}
    assert classes >= INNER
    for library, places in (ONLY_IN | DOORS).items():
        assert [at for at in places if not any(file.startswith(at) for file in importers()[library])] == [], library


def test_each_that_sends_has_its_askers() -> None:
    """None is without, and none who stands there does without, or without what is said to send nothing."""
    assert ASKED_BY.keys() == MAY_SEND.keys() - {"domain/ports.py"}
    asked = {(top[0], file) for file, tree in HOUSE for _, _, top in taken(HOUSE, file, tree) if is_sender(top)}
    for target, askers in ASKED_BY.items():
        assert [
            one for one in askers if not any((target, file) in asked for file in HOUSE.texts if file.startswith(one))
        ] == []
    took = {top for file, tree in HOUSE for _, _, top in taken(HOUSE, file, tree) if file != top[0]}
    assert {(file, name) for file, names in HARMLESS.items() for name in names} <= took


def test_a_command_that_reads_and_sends_needs_its_permission(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of them its own: a look at the whole for each would take a second of each command."""
    commands = set(MAY_READ_AND_SEND)
    for command in commands:
        monkeypatch.delitem(MAY_READ_AND_SEND, command)
    said = {line.partition(" ")[0] for line in LAWS["effects"](HOUSE)}
    assert said == {f"cli/commands/{command}.py" for command in commands}


@cache
def importers() -> dict[str, set[str]]:
    """Who imports each module, by the first part of its name."""
    found: dict[str, set[str]] = defaultdict(set)
    for file, tree in HOUSE:
        for node in nodes(tree):
            for name in [by_name(tree, node), *imported(node)]:
                found[name.partition(".")[0]].add(file)
    return found


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
