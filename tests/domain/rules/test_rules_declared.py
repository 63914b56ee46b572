"""Every rule is declared once, in the `RULES` of a file, with what it really says; and every declared rule is used."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import pytest

from dvtcli.domain.abort import Abort
from dvtcli.domain.profile import Severity
from tests.documentation.reference.rules import declared
from tests.house.draw import nodes
from tests.house.source import modules
from tests.surroundings import ROOT

pytestmark = pytest.mark.together

#: what makes a finding -> how strongly it is meant; None where the call says it
MAKERS = {"error": Severity.ERROR, "warning": Severity.WARNING, "note": Severity.NOTE, "Finding": None}
FINDING = "dvtcli.domain.rules.finding"


@dataclass(frozen=True)
class Use:
    """A call in *place* (`FILE:LINE`) that makes a finding; *rule* is None where it is no literal."""

    place: str
    rule: str | None
    severity: Severity | None
    aborts: frozenset[int]


@cache
def uses() -> tuple[Use, ...]:
    """Every call of what `finding` hands out to make findings."""
    return tuple(_uses())


def _uses() -> Iterator[Use]:
    for module in modules():
        imported = {
            alias.asname or alias.name: alias.name
            for node in nodes(module.tree)
            if isinstance(node, ast.ImportFrom) and node.module in (FINDING, "dvtcli.domain.rules")
            for alias in node.names
            if alias.name in MAKERS
        }
        if module.name.endswith("rules/finding.py"):
            continue
        for call in (node for node in nodes(module.tree) if isinstance(node, ast.Call)):
            if isinstance(call.func, ast.Name) and call.func.id in imported:
                first = call.args[0] if call.args else None
                rule = first.value if isinstance(first, ast.Constant) else None
                codes = {
                    int(Abort[node.attr])
                    for argument in call.args
                    for node in ast.walk(argument)
                    if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "Abort"
                }
                yield Use(f"{module.name}:{call.lineno}", rule, MAKERS[imported[call.func.id]], frozenset(codes))


def test_a_rule_is_named_where_it_is_used() -> None:
    assert not [use.place for use in uses() if not isinstance(use.rule, str)]


def test_every_rule_that_is_used_is_declared() -> None:
    names = {rule.name for rule in declared()}
    missing = sorted(f"{use.place}: {use.rule}" for use in uses() if use.rule not in names)
    assert not missing, f"declare in the file's RULES: {missing}"


def test_every_rule_that_is_declared_is_used_and_declared_once() -> None:
    count = Counter(rule.name for rule in declared())
    assert not [name for name, times in count.items() if times > 1]
    assert not set(count) - {use.rule for use in uses()}


def test_every_rule_is_named_by_a_test_of_a_room() -> None:
    """One that no test names may never be found, or always: no test would tell."""
    rooms = (
        path
        for path in (ROOT / "tests").rglob("*.py")
        if path.relative_to(ROOT).parts[1] not in ("house", "documentation")
    )
    words = {word for path in rooms for word in re.findall(r"[a-z0-9]+(?:-[a-z0-9]+)*", path.read_text("utf-8"))}
    assert not sorted({rule.name for rule in declared()} - words)


def test_rules_speak_as_strongly_as_they_declare() -> None:
    for rule in declared():
        mine = [use for use in uses() if use.rule == rule.name]
        said = {use.severity for use in mine}
        assert said - {None} <= set(rule.severities), rule.name
        assert None in said or said == set(rule.severities), rule.name


def test_rules_declare_the_abort_codes_that_they_give() -> None:
    for rule in declared():
        given = {code for use in uses() if use.rule == rule.name for code in use.aborts}
        assert given <= set(rule.aborts), rule.name


def test_a_declaration_says_something() -> None:
    for rule in declared():
        assert rule.sense, rule.name
        assert rule.source, rule.name
        assert list(rule.severities) == sorted(set(rule.severities), key=list(Severity).index), rule.name
