"""Laws 1 and 6: who may import whom, and what may be imported before it is needed."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator

from tests.house.draw import nodes
from tests.house.laws.source_tree import SourceTree, dotted, imported, parsed, typing_only

#: libraries that only some places may touch
ONLY_IN: dict[str, tuple[str, ...]] = {
    "can": (
        "bus/",
        "simulator/network/",
        "files/recorder.py",
        "files/recording.py",
        "files/recording_formats.py",
        "files/pcap.py",
    ),
    "canopen": ("bus/",),
    "prompt_toolkit": (
        "cli/prompt/",
        "cli/monitor/full_screen.py",
        "cli/monitor/monitor_keys.py",
        "cli/monitor/watch_keys.py",
    ),
    "click": ("cli/",),
    "pytest": ("testing.py",),
}
#: rooms that need nothing but the standard library
_GROUND = ("version.py", "domain/", "device/", "simulator/device/", "errors.py")
#: what decides, and is no vocabulary
_JUDGEMENT = ("domain/rules/", "domain/plan.py")
#: what `--help` must not pay for
_HEAVY = {"can", "canopen", "prompt_toolkit", "ruamel", "asyncio", "matplotlib", "cantools", "pytest"}
_LATER = (ast.FunctionDef, ast.AsyncFunctionDef)
_STARTS = (
    "__init__.py",
    "__main__.py",
    "cli/main.py",
    "cli/registry.py",
    "cli/boundary.py",
    "operations/session/session.py",
)


def direction(tree: SourceTree) -> Iterator[str]:
    """Imports run in the order of the rooms, and no files import one another in a circle."""
    house = tree.house
    yield from (f"against the order: {arrow}" for arrow in house.outward())
    yield from (f"in a circle: {file}" for circle in house.circles() for file in circle)


def independence(tree: SourceTree) -> Iterator[str]:
    """The strict device knows the domain's vocabulary, and neither the rules nor the plan."""
    for arrow in tree.house.arrows:
        inside = arrow.target.startswith("simulator/device/")
        vocabulary = arrow.target.startswith("domain/") and not arrow.target.startswith(_JUDGEMENT)
        if arrow.source.startswith("simulator/device/") and not inside and not vocabulary:
            yield str(arrow)


def libraries(tree: SourceTree) -> Iterator[str]:
    """Libraries stay in their rooms, imported or by name; the ground floors need the standard library only."""
    for file, module in tree:
        for_types = typing_only(module)
        for node in nodes(module):
            names = {name.partition(".")[0] for name in imported(node)} if id(node) not in for_types else set()
            names |= {_by_name(node)} - {""}
            for name in names:
                if not file.startswith(ONLY_IN.get(name, (file,))):
                    yield f"{file}:{getattr(node, 'lineno', 0)} imports {name}"
                if file.startswith(_GROUND) and name not in {*sys.stdlib_module_names, "dvtcli"}:
                    yield f"{file}:{getattr(node, 'lineno', 0)} imports {name}, on the ground"


def _by_name(node: ast.AST) -> str:
    """The library that `import_module("x")` or `__import__("x")` imports."""
    if isinstance(node, ast.Call) and dotted(node.func).rpartition(".")[2] in ("import_module", "__import__"):
        first = node.args[0] if node.args else None
        if isinstance(first, ast.Constant) and isinstance(first.value, str):
            return first.value.partition(".")[0]
    return ""


def nothing_heavy_is_eager(tree: SourceTree) -> Iterator[str]:
    """What the program's start imports at the top of files, and they at theirs, holds nothing heavy."""
    way = {start: start for start in _STARTS}
    waiting = [*_STARTS]
    while waiting:
        file = waiting.pop()
        for node, name in _eager(parsed(tree.texts[file])):
            if name.partition(".")[0] in _HEAVY:
                yield f"{way[file]}:{node.lineno} imports {name} at once"
            target = tree.modules.get(name)
            if file == "__init__.py" and target not in (None, "__init__.py", "version.py"):
                yield f"{file}:{node.lineno} imports {name} at once"
            if target is not None and target not in way:
                way[target] = f"{way[file]} -> {target}"
                waiting.append(target)


def _eager(module: ast.AST) -> Iterator[tuple[ast.stmt, str]]:
    """Every import that runs with the module: at its top, also within `try`, `with`, `if` and classes."""
    for_types = typing_only(module) if isinstance(module, ast.Module) else set()
    for node in ast.iter_child_nodes(module):
        if isinstance(node, ast.Import | ast.ImportFrom):
            if id(node) not in for_types:
                yield from ((node, name) for name in imported(node))
        elif isinstance(node, ast.stmt | ast.ExceptHandler) and not isinstance(node, _LATER):
            yield from (found for found in _eager(node) if id(found[0]) not in for_types)
