"""Law 1: who may import whom."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator

from tests.house.draw import nodes, typing_only
from tests.house.laws.imports_allowed import DOORS, KNOWN, ONLY_IN
from tests.house.laws.origins import named, origins
from tests.house.laws.source_tree import SourceTree, dotted, imported

#: rooms that need nothing but the standard library
_GROUND = ("version.py", "domain/", "device/", "simulator/device/", "errors.py")
#: what decides, and is no vocabulary
_JUDGEMENT = ("domain/rules/", "domain/plan.py")
_DEVICE = "simulator/device/"
#: our modules whose names are libraries in them, as others would take them
_MODULES = ("python_can", "dvtcli")
#: what imports or runs what a string says
_RUNS = ("exec", "eval")
#: what loads a file as a module
_LOADS = ("SourceFileLoader", "SourcelessFileLoader", "ExtensionFileLoader", "spec_from_file_location")
#: what starts another program, besides `subprocess`
_PROCESSES = re.compile(r"os\.(?:posix_spawnp?|spawn\w+|popen|system|startfile)")
BY_NAME = ("import_module", "__import__", "find_spec", "run_module", "resolve_name", "load_module", *_LOADS, *_RUNS)
#: who imports what another's string names, with what for
_MAY_NAME = {
    "__init__.py": "its own table of names",
    "files/extras.py": "an extra that a caller names, below",
    "operations/results/__init__.py": "its own table of names",
}


def direction(tree: SourceTree) -> Iterator[str]:
    """Imports run in the order of the rooms, and no files import one another in a circle."""
    house = tree.house
    yield from (f"against the order: {arrow}" for arrow in house.outward())
    yield from (f"in a circle: {file}" for circle in house.circles() for file in circle)


def independence(tree: SourceTree) -> Iterator[str]:
    """The strict device knows the domain's vocabulary, by no way the rules or the plan, and no profile."""
    judging = _reaching_judgement(tree)
    for arrow in tree.house.arrows:
        inside = arrow.target.startswith(_DEVICE)
        vocabulary = arrow.target.startswith("domain/") and arrow.target not in judging
        if arrow.source.startswith(_DEVICE) and not inside and not vocabulary:
            yield str(arrow)
    for file, module in tree:
        for node in nodes(module) if file.startswith(_DEVICE) else ():
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and "profile.toml" in node.value:
                yield f"{file}:{node.lineno} {node.value}"
            elif isinstance(node, ast.ImportFrom) and node.module in ("dvtcli", "dvtcli.domain", "dvtcli.families"):
                yield f"{file}:{node.lineno} {ast.unparse(node)}: a room, and not what is needed of it"
            elif _looks_for_files(node):
                yield f"{file}:{getattr(node, 'lineno', 0)} {ast.unparse(node)}: looks for the package's files"


def _looks_for_files(node: ast.AST) -> bool:
    """Whether *node* is where this package lies, or the name of its folder of families."""
    if isinstance(node, ast.Name):
        return node.id == "__file__"
    return isinstance(node, ast.Constant) and node.value in ("families", "dvtcli", "dvtcli.families")


def _reaching_judgement(tree: SourceTree) -> dict[str, str]:
    """The files of the domain from which rules or the plan are reached, each with the next one on the way."""
    found = {file: file for file in tree.house.files if file.startswith(_JUDGEMENT)}
    waiting = list(found)
    while waiting:
        file = waiting.pop()
        for arrow in tree.house.arrows:
            if arrow.target == file and arrow.source not in found and arrow.source.startswith("domain/"):
                found[arrow.source] = file
                waiting.append(arrow.source)
    return found


def libraries(tree: SourceTree) -> Iterator[str]:
    """Libraries and doors stay in their rooms, imported or by name; the ground floors need the standard one only."""
    for file, module in tree:
        for_types = typing_only(module)
        for node in nodes(module):
            names = {name.partition(".")[0] for name in imported(node)} if id(node) not in for_types else set()
            names |= _handed_on(module, node) | {by_name(module, node)} - {""}
            for name in names:
                line = f"{file}:{getattr(node, 'lineno', 0)}"
                if name not in KNOWN:
                    yield f"{line} imports {name}, which stands in no table"
                elif not file.startswith((ONLY_IN | DOORS).get(name, (file,))):
                    yield f"{line} imports {name}"
                if file.startswith(_GROUND) and name not in {*sys.stdlib_module_names, "dvtcli"}:
                    yield f"{line} imports {name}, on the ground"
        yield from (f"{file}:{line} {what}" for line, what in _unreadable(file, module))
        for used, origin in named(module):
            yield from (f"{file}:{used.lineno} {name}" for name in origin if _PROCESSES.fullmatch(name))


def _handed_on(module: ast.Module, node: ast.AST) -> set[str]:
    """The libraries that one of our modules has imported, and another takes from it."""
    if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("dvtcli"):
        return {alias.name for alias in node.names} & ONLY_IN.keys()
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.attr in ONLY_IN:
        ours = any(name.partition(".")[0] in _MODULES for name in origins(module, node.value))
        return {node.attr} if ours else set()
    return set()


def by_name(module: ast.Module, node: ast.AST) -> str:
    """The library that `import_module("x")`, `__import__("x")` or `sys.modules["x"]` names."""
    named: ast.expr | None = None
    if isinstance(node, ast.Call) and _reads_name(module, node) and dotted(node.func).rpartition(".")[2] not in _RUNS:
        named = next(iter([*node.args, *(word.value for word in node.keywords if word.arg == "name")]), None)
    elif isinstance(node, ast.Call) and "sys.modules.get" in origins(module, node.func):
        named = next(iter(node.args), None)
    elif isinstance(node, ast.Subscript) and "sys.modules" in origins(module, node.value):
        named = node.slice
    if isinstance(named, ast.Constant) and isinstance(named.value, str) and not named.value.startswith("."):
        return named.value.partition(".")[0]
    return ""


def _reads_name(module: ast.Module, node: ast.Call) -> bool:
    return any(name.rpartition(".")[2] in BY_NAME for name in origins(module, node.func))


def _unreadable(file: str, module: ast.Module) -> Iterator[tuple[int, str]]:
    """Imports by a name that nobody can read: neither a string, nor one that begins with one of our folders."""
    for node in nodes(module):
        if not isinstance(node, ast.Call) or not _reads_name(module, node) or file in _MAY_NAME:
            continue
        called = dotted(node.func)
        if called.rpartition(".")[2] in _RUNS:
            if called in _RUNS:  # Tcl has an `eval`, too
                yield node.lineno, f"runs what a string says: {ast.unparse(node)}"
            continue
        first = node.args[0] if node.args else None
        if isinstance(first, ast.JoinedStr):
            first = first.values[0]
        name = first.value if isinstance(first, ast.Constant) and isinstance(first.value, str) else ""
        if not name or name.startswith(".") or (name.startswith("dvtcli") and len(name.split(".")) < 3):
            yield node.lineno, f"imports what cannot be read here: {ast.unparse(node)}"
