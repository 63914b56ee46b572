"""Every hint that the product's rooms say, as it stands in their source; most placeholders are a number."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from functools import cache

from tests.house.draw import nodes
from tests.house.source import Module, modules

ROOMS = ("domain", "device", "operations", "bus", "files", "simulator")
#: functions that make a finding -> where its hint stands among the arguments, where it is not named
_FINDINGS = {"error": 4, "warning": 3}
#: what a placeholder may hold that is not a number: its source -> a text
_FILLED = {
    "who_else": "somebody else changed it",
    "word": "accept",
    "word_of(index)": "store",
    "word.removesuffix('d')": "store",
    "first": "",
    "cure": "",
    "trusting": "",
    "PDO": "tpdo1",
    "pdo": "tpdo1",
    "producer": "2:tpdo1",
    "other": "2:tpdo1",
    "kind.suffix": ".dcf",
    "known": "500000",
}
_TEXTS = (ast.Constant, ast.JoinedStr)


@cache
def all_hints() -> dict[str, str]:
    """Each hint -> the file and line where it stands."""
    found: dict[str, str] = {}
    for module in modules():
        if module.room in ROOMS and not module.name.startswith("operations/api/"):
            for asked in _asked(module):
                for text, line in _texts(module, asked, frozenset()):
                    if text:
                        found.setdefault(text, f"{module.name}:{line}")
    return found


def _asked(module: Module) -> Iterator[ast.expr]:
    """What is given as a hint: by its name, by its place, by an assignment, or as what a function of that name says."""
    for node in nodes(module.tree):
        if isinstance(node, ast.keyword) and node.arg == "hint":
            yield node.value
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            place = _FINDINGS.get(node.func.id)
            if place is not None and len(node.args) > place:
                yield node.args[place]
        elif isinstance(node, ast.Assign) and any(
            isinstance(one, ast.Attribute) and one.attr == "hint" for one in node.targets
        ):
            yield node.value
        elif isinstance(node, ast.FunctionDef) and "hint" in node.name:
            yield from _returned(node)


def _texts(module: Module, asked: ast.expr, seen: frozenset[str]) -> Iterator[tuple[str, int]]:
    """The texts that an expression may be, with their lines."""
    text = _text(asked)
    if text is not None:
        yield text, asked.lineno
    elif isinstance(asked, ast.IfExp):
        for one in (asked.body, asked.orelse):
            yield from _texts(module, one, seen)
    elif isinstance(asked, ast.BoolOp | ast.Tuple):
        for one in asked.values if isinstance(asked, ast.BoolOp) else asked.elts:
            yield from _texts(module, one, seen)
    elif isinstance(asked, ast.Subscript):
        yield from _texts(module, asked.value, seen)
    elif isinstance(asked, ast.Dict):
        for one in asked.values:
            yield from _texts(module, one, seen)
    else:
        yield from _elsewhere(module, asked, seen)


def _elsewhere(module: Module, asked: ast.expr, seen: frozenset[str]) -> Iterator[tuple[str, int]]:
    """The texts of a name that is assigned in this file, or of a function of any."""
    if isinstance(asked, ast.Name) and asked.id not in seen:
        for one in _assigned(module)[asked.id]:
            yield from _texts(module, one, seen | {asked.id})
    elif isinstance(asked, ast.Call):
        name = asked.func.attr if isinstance(asked.func, ast.Attribute) else ast.unparse(asked.func)
        if name not in seen:
            for home, function in _functions()[name]:
                for one in _returned(function):
                    yield from _texts(home, one, seen | {name})


def _text(asked: ast.expr) -> str | None:
    if isinstance(asked, ast.Constant):
        return asked.value if isinstance(asked.value, str) else None
    if isinstance(asked, ast.JoinedStr):
        return "".join(map(_part, asked.values))
    if isinstance(asked, ast.BinOp) and isinstance(asked.op, ast.Add):
        sides = _text(asked.left), _text(asked.right)
        return None if None in sides else "".join(map(str, sides))
    return None


def _part(part: ast.expr) -> str:
    if isinstance(part, ast.Constant):
        return str(part.value)
    assert isinstance(part, ast.FormattedValue)
    source = ast.unparse(part.value)
    name = source.split("(")[0] if source.startswith("who_else") else source
    return _FILLED.get(name, "5")


def _returned(function: ast.FunctionDef) -> Iterator[ast.expr]:
    return (one.value for one in ast.walk(function) if isinstance(one, ast.Return) and one.value is not None)


@cache
def _assigned(module: Module) -> defaultdict[str, list[ast.expr]]:
    found: defaultdict[str, list[ast.expr]] = defaultdict(list)
    for node in nodes(module.tree):
        if isinstance(node, ast.Assign):
            for target in node.targets:
                if isinstance(target, ast.Name):
                    found[target.id].append(node.value)
    for name, values in _imported(module).items():
        found[name] += values
    return found


def _imported(module: Module) -> dict[str, list[ast.expr]]:
    """What constants that *module* imports from another file are."""
    found: dict[str, list[ast.expr]] = {}
    for node in nodes(module.tree):
        home = _by_dotted_name().get(node.module or "") if isinstance(node, ast.ImportFrom) else None
        if home is not None and isinstance(node, ast.ImportFrom):
            for alias in node.names:
                if alias.name.isupper():
                    found[alias.name] = _assigned(home)[alias.name]
    return found


@cache
def _by_dotted_name() -> dict[str, Module]:
    return {f"dvtcli.{one.name.removesuffix('.py').replace('/', '.')}": one for one in modules()}


@cache
def _functions() -> defaultdict[str, list[tuple[Module, ast.FunctionDef]]]:
    found: defaultdict[str, list[tuple[Module, ast.FunctionDef]]] = defaultdict(list)
    for module in modules():
        for node in nodes(module.tree):
            if isinstance(node, ast.FunctionDef):
                found[node.name].append((module, node))
    return found
