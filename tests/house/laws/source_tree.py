"""The package's source as text, of which a copy can have other text in one file. Reads each file once."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from functools import cache, cached_property

from tests.house.draw import House, parsed


class SourceTree:
    """*texts* by file, as people say it: `device/node.py`. *house* has their rooms and arrows."""

    def __init__(self, texts: Mapping[str, str], house: House) -> None:
        self.texts = dict(texts)
        self.house = house

    @classmethod
    @cache
    def of_the_package(cls) -> SourceTree:
        """That of the disk; the same one for all who ask, since looking at it takes seconds."""
        house = House()
        return cls(house.files, house)

    def altered(self, file: str, text: str) -> SourceTree:
        """A copy with *text* in *file*, which may be new."""
        return SourceTree({**self.texts, file: text}, self.house.altered(file, text))

    def only(self, file: str) -> SourceTree:
        """One file of it, with what it imports and is imported by as in the whole."""
        return SourceTree({file: self.texts[file]}, self.house)

    def __iter__(self) -> Iterator[tuple[str, ast.Module]]:
        return ((file, parsed(text)) for file, text in self.texts.items())

    def parsed(self, file: str) -> ast.Module:
        """The tree of one file."""
        return parsed(self.house.files[file])

    @cached_property
    def modules(self) -> dict[str, str]:
        """Each file by its dotted name."""
        return {_dotted(file): file for file in self.house.files}


def _dotted(file: str) -> str:
    return f"dvtcli.{file}".removesuffix(".py").removesuffix("/__init__").replace("/", ".").removesuffix(".__init__")


def imported(node: ast.AST) -> list[str]:
    """The modules that a statement may import: `from a import b` may mean a or a.b."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        return [node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)]
    return []


def dotted(node: ast.AST) -> str:
    """`a.b.c` of a name, an attribute (also by `getattr`), or a call of one; `?` stands for what is neither."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    match node:
        case ast.Call(func=ast.Name(id="getattr"), args=[of, ast.Constant(value=str(name)), *_]):
            return f"{dotted(of)}.{name}"
        case ast.Call(func=func):
            return dotted(func)
    return "?"
