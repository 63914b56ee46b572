"""Names in docstrings and comments: a module, a class or a member that a backticked dotted name points to is there."""

from __future__ import annotations

import ast
import builtins
import re
from collections.abc import Iterator
from functools import cache

import pytest

import dvtcli
from tests.house.draw import nodes
from tests.house.source import Module, modules

pytestmark = pytest.mark.together

#: variables that docstrings name beside modules of the same name, and their classes
_VARIABLES = {"bus": "CanopenBus", "plan": "NetworkPlan", "seen": "FrameSeen", "session": "Conversation"}
#: names of files, and a key of profiles
_NO_NAMES = ("dvtcli.toml", "nodelist.cpj", "run.parquet", "store.timeout_s")
#: bases from elsewhere that add no names; "*" stands for the members of the others
_WITHOUT_MEMBERS = ("ABC", "Protocol", "NamedTuple", "Generic", "object")
_DOTTED = re.compile(r"`((?:[A-Za-z_]\w*\.)+[A-Za-z_]\w*)(?:\(\))?`")


@cache
def paths() -> frozenset[str]:
    """Modules and packages by the ends of their names: `domain.plan`, `plan`."""
    found = set[str]()
    for module in modules():
        parts = module.name.removesuffix(".py").removesuffix("/__init__").split("/")
        for end in range(1, len(parts) + 1):
            found |= {".".join(parts[begin:end]) for begin in range(end)}
    return frozenset(found)


@cache
def members() -> dict[str, set[str]]:
    """What each class and each module has by name: methods, fields, functions, constants, and what is set on `self`."""
    found: dict[str, set[str]] = {}
    bases: dict[str, list[str]] = {}
    for module in modules():
        own = {name for node in module.tree.body for name in bound(node)}
        for end in ends(module):
            found.setdefault(end, set()).update(own)
        for node in nodes(module.tree):
            if isinstance(node, ast.ClassDef):
                inside = {name for each in ast.walk(node) for name in bound(each)}
                found.setdefault(node.name, set()).update(inside)
                bases.setdefault(node.name, []).extend(
                    ast.unparse(base).partition("[")[0].rpartition(".")[2] for base in node.bases
                )
    for name in bases:
        for base in ancestors(name, bases):
            found[name] |= found.get(base, set() if base in _WITHOUT_MEMBERS else {"*"})
    return found


def ancestors(name: str, bases: dict[str, list[str]]) -> Iterator[str]:
    """The base classes of *name*, and theirs."""
    for base in bases.get(name, ()):
        yield base
        yield from ancestors(base, bases)


def ends(module: Module) -> Iterator[str]:
    """The names by which a docstring may call *module*."""
    parts = module.name.removesuffix(".py").removesuffix("/__init__").split("/")
    yield from (".".join(parts[begin:]) for begin in range(len(parts)))


def bound(node: ast.AST) -> Iterator[str]:
    """The names that *node* defines."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        yield node.name
    elif isinstance(node, ast.Import | ast.ImportFrom):
        yield from ((alias.asname or alias.name).partition(".")[0] for alias in node.names)
    elif isinstance(node, ast.Assign | ast.AnnAssign | ast.NamedExpr | ast.AugAssign):
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        for target in targets:
            for each in ast.walk(target):
                if isinstance(each, ast.Name):
                    yield each.id
                elif isinstance(each, ast.Attribute):
                    yield each.attr


def is_known(name: str) -> bool:
    """Whether dotted *name* points to something, or to nothing of this package."""
    if name.removeprefix("dvtcli.") in paths() or name in _NO_NAMES:
        return True
    owner, _, member = name.removeprefix("dvtcli.").rpartition(".")
    if not owner:
        return hasattr(dvtcli, member)
    owner = _VARIABLES.get(owner, owner)
    last = owner.rpartition(".")[2]
    if owner in members() or last in members():
        has = members().get(owner, set()) | members().get(last, set())
        return member in has or "*" in has or f"{owner}.{member}" in paths()
    return not (last[0].isupper() and not hasattr(builtins, last))


def words(module: Module) -> Iterator[str]:
    """The docstrings and comments of *module*."""
    for line in module.text.splitlines():
        if "#" in line:
            yield line.partition("#")[2]
    for node in nodes(module.tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield ast.get_docstring(node) or ""


@pytest.mark.parametrize(("name", "is_there"), [
    ("domain.plan", True), ("domain.proof", False), ("rules.finding", True), ("rules.rule", False),
    ("Reporter.progress", True), ("Reporter.nothing", False), ("Telling.progress", False), ("bus.boot_ups", True),
    ("bus.boots", False), ("dvtcli.domain.rules", True), ("time.monotonic", True), ("CanBus.send", True),
])  # fmt: skip
def test_a_name_without_a_thing_is_seen(name: str, is_there: bool) -> None:
    assert is_known(name) == is_there


def test_a_name_in_a_docstring_points_to_something() -> None:
    found = sorted(
        f"{module.name}: `{name}`"
        for module in modules()
        for text in words(module)
        for name in _DOTTED.findall(text)
        if not is_known(name)
    )
    assert not found, "\n".join(found)
