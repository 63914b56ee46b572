"""What each function, class and value at the top of a file uses of other files, by its name: finer than arrows.

Knows imports, at the top and within. Not what the methods of a value do that was handed in.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from functools import cache

from tests.house.draw import nodes, typing_only
from tests.house.laws.source_tree import SourceTree, dotted

#: a name at the top of a file: the file, and the name
Top = tuple[str, str]
#: for a name: the module itself, and whatever `import *` gives
ALL, STAR = "(all)", "*"


def taken(tree: SourceTree, file: str, module: ast.Module) -> Iterator[tuple[int, str, Top]]:
    """Every name that *file* takes from a file of ours: line, the name here, and what it is there.

    What only a type checker reads is not taken.
    """
    for_types = typing_only(module)
    for node in nodes(module):
        if id(node) not in for_types and isinstance(node, ast.Import | ast.ImportFrom):
            yield from ((node.lineno, here, top) for here, top in _taken(tree, file, node))


def _taken(tree: SourceTree, file: str, node: ast.Import | ast.ImportFrom) -> Iterator[tuple[str, Top]]:
    if isinstance(node, ast.Import):
        for alias in node.names:
            if alias.name in tree.modules:
                yield alias.asname or alias.name.partition(".")[0], (tree.modules[alias.name], ALL)
        return
    above = ["dvtcli", *file.split("/")][: -node.level] if node.level else []
    name = ".".join([*above, *([node.module] if node.module else [])])
    for alias in node.names:
        if f"{name}.{alias.name}" in tree.modules:
            yield alias.asname or alias.name, (tree.modules[f"{name}.{alias.name}"], ALL)
        elif name in tree.modules:
            yield alias.asname or alias.name, (tree.modules[name], alias.name)


#: classes whose methods do anything: who uses one is not followed into all of them
_HANDED_IN = ("Session", "Node")


class Uses:
    """What names use which, over the whole package."""

    def __init__(self, tree: SourceTree) -> None:
        self._tree = tree
        self._of = cache(self._of_file)

    def reached(self, start: Top, ends: Callable[[Top], bool]) -> dict[Top, Top | None]:
        """All that *start* uses, by however many steps, each with what uses it; nothing behind what *ends* it."""
        found: dict[Top, Top | None] = {start: None}
        waiting = [start]
        while waiting:
            user = waiting.pop(0)
            for used in () if ends(user) else self._used(user):
                if used not in found:
                    found[used] = user
                    waiting.append(used)
        return found

    def _used(self, user: Top) -> set[Top]:
        file, name = user
        if name in _HANDED_IN:
            return set()
        own = self._of(file)
        return set().union(*own.values()) if name in (ALL, STAR) else own.get(name, set())

    def _of_file(self, file: str) -> dict[str, set[Top]]:
        """What each name at the top of *file* uses."""
        module = self._tree.parsed(file)
        here: dict[str, set[Top]] = {}
        for _, name, top in taken(self._tree, file, module):
            here.setdefault(name, set()).add(top)
        tops = {name: statement for statement in module.body for name in _named(statement)}
        own: dict[str, set[Top]] = {name: set(found) for name, found in here.items()}
        for name, statement in tops.items():
            used = {part.id for part in ast.walk(statement) if isinstance(part, ast.Name)} - {name} | {STAR}
            parts = [part for part in ast.walk(statement) if isinstance(part, ast.Attribute)]
            own[name] = {(file, one) for one in used & tops.keys()}
            own[name] |= {top for one in used & here.keys() for top in _narrowed(here[one], one, parts)}
        return own


def _narrowed(tops: set[Top], name: str, parts: list[ast.Attribute]) -> Iterator[Top]:
    """Of a module that is used only by `module.name`, these names."""
    of_it = {part.attr for part in parts if dotted(part.value) == name}
    for file, what in tops:
        yield from ((file, one) for one in of_it) if what == ALL and of_it else [(file, what)]


def _named(statement: ast.stmt) -> list[str]:
    """The names that a statement at the top of a file gives."""
    match statement:
        case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
            return [name]
        case ast.Assign(targets=targets):
            return [one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)]
        case ast.AnnAssign(target=ast.Name(id=name)):
            return [name]
    return []
