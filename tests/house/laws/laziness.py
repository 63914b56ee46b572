"""Law 6: nothing is imported, opened or parsed before it is needed."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from tests.house.draw import parsed, typing_only
from tests.house.laws.imports import BY_NAME
from tests.house.laws.imports_allowed import ONLY_IN
from tests.house.laws.source_tree import SourceTree, dotted, imported

#: what `--help` must not pay for: every library but click, and what of the standard library is large
_HEAVY = (
    *ONLY_IN.keys() - {"click"}, "matplotlib", "pyarrow", "asammdf", "intelhex", "asyncio", "multiprocessing",
    "subprocess", "xml", "http", "urllib", "email", "ssl", "unittest", "pydoc", "sqlite3", "concurrent",
    "tkinter", "logging",
    "dvtcli.simulator", "dvtcli.cli.prompt", "dvtcli.bus.python_can",
)  # fmt: skip
#: what opens or parses something
_PARSES = ("open", "read_text", "read_bytes", "load", "loads", "parse", "fromstring", "read_dictionary", "load_family")
_LATER = (ast.FunctionDef, ast.AsyncFunctionDef)
_STARTS = (
    "__init__.py",
    "__main__.py",
    "cli/main.py",
    "cli/registry.py",
    "cli/boundary.py",
    "operations/session/session.py",
)


def nothing_heavy_is_eager(tree: SourceTree) -> Iterator[str]:
    """What the program and its commands import at the top of files, and they at theirs, holds nothing heavy.

    Nor does any file open or parse something while it is imported.
    """
    commands = [file for file in tree.texts if file.startswith("cli/commands/")]
    way = {start: start for start in (*_STARTS, *commands)}
    waiting = [*way]
    while waiting:
        file = waiting.pop()
        for node, name in _eager(parsed(tree.texts[file])):
            if any(name == heavy or name.startswith(f"{heavy}.") for heavy in _HEAVY):
                yield f"{way[file]}:{node.lineno} imports {name} at once"
            target = tree.modules.get(name)
            if file == "__init__.py" and target not in (None, "__init__.py", "version.py"):
                yield f"{file}:{node.lineno} imports {name} at once"
            if target is not None and target not in way:
                way[target] = f"{way[file]} -> {target}"
                waiting.append(target)
    for file, module in tree:
        for part in _at_once(module):
            if isinstance(part, ast.Call) and _opens(part, module):
                yield f"{file}:{part.lineno} {ast.unparse(part.func)} while it is imported"


def _opens(call: ast.Call, module: ast.Module) -> bool:
    """Whether *call* opens or parses something, or is of a function of this file that does."""
    called = dotted(call.func)
    own = [one for one in module.body if isinstance(one, ast.FunctionDef) and one.name == called]
    calls = [call, *(inner for one in own for inner in ast.walk(one) if isinstance(inner, ast.Call))]
    return any(dotted(one.func).rpartition(".")[2] in (*_PARSES, *BY_NAME) for one in calls)


def _at_once(node: ast.AST) -> Iterator[ast.AST]:
    """Everything that runs with the module: what stands in functions does not, their defaults and decorators do."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, _LATER):
            yield from (inner for one in [child.args, *child.decorator_list] for inner in ast.walk(one))
        elif isinstance(child, ast.Lambda):
            yield from ast.walk(child.args)
        else:
            yield child
            yield from _at_once(child)


def _eager(module: ast.Module) -> Iterator[tuple[ast.stmt, str]]:
    """Every import that runs with the module: at its top, also within `try`, `with`, `if`, `match` and classes."""
    for_types = typing_only(module)
    for node in _at_once(module):
        if isinstance(node, ast.Import | ast.ImportFrom) and id(node) not in for_types:
            yield from ((node, name) for name in imported(node))
