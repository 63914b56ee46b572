"""Law 1 at its seam: a bus is what its contract says, and who uses one does not ask of which kind it is."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache

from tests.house.draw import nodes, typing_only
from tests.house.laws.origins import origins
from tests.house.laws.source_tree import SourceTree, dotted

#: where buses are made of one another
_MAKERS = ("bus/", "simulator/network/")
#: the contract itself, whose classes nobody need hide
_CONTRACT = "domain/ports.py"
_TELLS = ("isinstance", "issubclass", "type")
#: what finds out by a name whether a bus can do something, instead of asking it
_PEEKS = ("hasattr", "getattr", "dir")
_ANCESTOR = "WatchedBus"


def no_kind_of_bus_is_asked_for(tree: SourceTree) -> Iterator[str]:
    """Outside the rooms that make buses no class of one is compared, matched or looked through for what it has."""
    for file, module in tree:
        if file.startswith((*_MAKERS, _CONTRACT)):
            continue
        for_types = typing_only(module)
        for node in nodes(module):
            if id(node) not in for_types and (what := _asks(module, node, _kinds())):
                yield f"{file}:{getattr(node, 'lineno', 0)} {what}"


@cache
def _kinds() -> frozenset[str]:
    """The names of all classes of buses: those that stand on one another from the first on, and the contract's."""
    classes = [
        node for _, module in SourceTree.of_the_package() for node in nodes(module) if isinstance(node, ast.ClassDef)
    ]
    found = {_ANCESTOR, "CanopenBus"} | {one.name for one in classes if one.name.endswith("Bus")}
    while more := {one.name for one in classes if _bases(one) & found} - found:
        found |= more
    return frozenset(found)


def _bases(node: ast.ClassDef) -> set[str]:
    """The names of a class's bases, without their parameters."""
    return {_last(base.value if isinstance(base, ast.Subscript) else base) for base in node.bases}


def _asks(module: ast.Module, node: ast.AST, kinds: frozenset[str]) -> str:
    """What *node* finds out of a bus's kind; nothing where it does not."""
    if isinstance(node, ast.Call):
        called = {name.rpartition(".")[2] for name in origins(module, node.func)}
        if called & {*_TELLS} and _named(module, node.args[1:]) & kinds:
            return f"asks of which kind a bus is: {ast.unparse(node)}"
        if called & {*_PEEKS} and node.args and _is_bus(module, node.args[0]):
            return f"looks through a bus for what it has: {ast.unparse(node)}"
        if called & {"register"} and _named(module, node.args) & kinds:
            return f"does another thing for each kind of bus: {ast.unparse(node)}"
    if (
        isinstance(node, ast.Dict)
        and _named(module, [key for key in node.keys if isinstance(key, ast.Name | ast.Attribute)]) & kinds
    ):
        return f"has something for each kind of bus: {ast.unparse(node)}"
    if isinstance(node, ast.Try) and (used := _tried(module, node)):
        return f"looks through a bus for what it has: {used}, except AttributeError"
    if isinstance(node, ast.MatchClass) and _named(module, [node.cls]) & kinds:
        return f"asks of which kind a bus is: case {ast.unparse(node)}"
    if isinstance(node, ast.Compare) and _of_type(node) and _named(module, [node.left, *node.comparators]) & kinds:
        return f"asks of which kind a bus is: {ast.unparse(node)}"
    return ""


def _tried(module: ast.Module, node: ast.Try) -> str:
    """What of a bus is used where an AttributeError is caught, if that is."""
    kinds = {_last(one) for each in node.handlers if each.type for one in ast.walk(each.type)}
    used = [inner for one in node.body for inner in ast.walk(one) if isinstance(inner, ast.Attribute)]
    found = [one for one in used if _is_bus(module, one.value)]
    return ast.unparse(found[0]) if found and "AttributeError" in kinds else ""


def _is_bus(module: ast.Module, node: ast.expr) -> bool:
    return any(name.rpartition(".")[2].lstrip("_") in ("bus", "wire") for name in origins(module, node))


def _of_type(node: ast.Compare) -> bool:
    """Whether `type(x)`, `x.__class__` or its name is compared."""
    parts = [inner for one in (node.left, *node.comparators) for inner in ast.walk(one)]
    asked = [one for one in parts if isinstance(one, ast.Call) and dotted(one.func) == "type"]
    return bool(asked) or any(isinstance(one, ast.Attribute) and one.attr == "__class__" for one in parts)


def _named(module: ast.Module, found: list[ast.expr]) -> set[str]:
    """The last parts of all names in *found*, and the words in it, also by what they stand for."""
    parts = [inner for one in found for inner in ast.walk(one)]
    names = {name for one in parts if isinstance(one, ast.Name | ast.Attribute) for name in origins(module, one)}
    words = {one.value for one in parts if isinstance(one, ast.Constant) and isinstance(one.value, str)}
    return {name.rpartition(".")[2] for name in names} | words


def _last(node: ast.AST) -> str:
    return dotted(node).rpartition(".")[2]
