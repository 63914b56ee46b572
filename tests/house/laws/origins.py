"""What a name of a file stands for, by whatever way it came there: `say` for `print` after `from builtins import …`.

Knows imports, and names that are given other names (`out = sys.stdout`, `ALL = (Exception,)`); nothing is run.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from typing import TypeGuard

from tests.house.draw import nodes
from tests.house.laws.source_tree import dotted

#: how many names may stand for one another in a row
_MOST = 4
#: what has a name, or was made by what has one: `stop = KeyboardInterrupt()`
_NAMED = ast.Name | ast.Attribute | ast.Call
_LOAD = ast.Load()


@cache
def _aliases(module: ast.Module) -> dict[str, list[str]]:
    """What each name that is imported or assigned may stand for."""
    found: dict[str, list[str]] = {}
    for node in nodes(module):
        for name, origin in _bound(node):
            if name != origin:
                found.setdefault(name, []).append(origin)
    return found


def _bound(node: ast.AST) -> Iterator[tuple[str, str]]:
    if isinstance(node, ast.Import):
        yield from ((alias.asname, alias.name) for alias in node.names if alias.asname)
    elif isinstance(node, ast.ImportFrom):
        yield from ((alias.asname or alias.name, f"{node.module}.{alias.name}") for alias in node.names)
    elif isinstance(node, ast.AnnAssign | ast.NamedExpr) and isinstance(node.target, ast.Name) and node.value:
        yield from ((node.target.id, dotted(one)) for one in [node.value] if isinstance(one, _NAMED))
    elif isinstance(node, ast.Assign):
        names = [target.id for target in node.targets if isinstance(target, ast.Name)]
        values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value]
        said = [dotted(value) for value in values if isinstance(value, _NAMED)]
        yield from ((name, one) for name in names for one in said)


def origins(module: ast.Module, node: ast.AST) -> frozenset[str]:
    """The dotted names that *node*, a name or an attribute of one, may stand for; builtins by their bare name."""
    return _origins(module, dotted(node))


@cache
def _origins(module: ast.Module, name: str) -> frozenset[str]:
    found = waiting = {name}
    for _ in range(_MOST):
        waiting = {other for one in waiting for other in _replaced(module, one)} - found
        found = found | waiting
    return frozenset(one.removeprefix("builtins.") for one in found)


def _replaced(module: ast.Module, name: str) -> Iterator[str]:
    first, dot, rest = name.partition(".")
    yield from (f"{one}{dot}{rest}" for one in _aliases(module).get(first, ()))


@cache
def named(module: ast.Module) -> tuple[tuple[ast.Name | ast.Attribute | ast.Call, frozenset[str]], ...]:
    """Every name and attribute that is used in a file, called or handed on, with what it may stand for."""
    used = (node for node in nodes(module) if isinstance(node, ast.Name | ast.Attribute) or _by_getattr(node))
    return tuple((node, origins(module, node)) for node in used if isinstance(getattr(node, "ctx", _LOAD), ast.Load))


def _by_getattr(node: ast.AST) -> TypeGuard[ast.Call]:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "getattr"
