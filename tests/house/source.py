"""dvtcli's own source as the house tests look at it: modules, what they import, and their functions."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from tests.house.draw import nodes, parsed, room_of, typing_only
from tests.surroundings import ROOT

PACKAGE = ROOT / "dvtcli"


@dataclass(frozen=True)
class Module:
    """One file of the package."""

    path: Path

    @cached_property
    def name(self) -> str:
        """`device/read.py`, as people say it."""
        return self.path.relative_to(PACKAGE).as_posix()

    @property
    def room(self) -> str:
        """The folder it lives in, or its own name where it is a flat file."""
        return room_of(self.name)

    @cached_property
    def text(self) -> str:
        return self.path.read_text("utf-8")

    @cached_property
    def tree(self) -> ast.Module:
        return parsed(self.text)

    def imports(self) -> Iterator[tuple[str, int, bool]]:
        """Every imported module with its line, and whether it is for the type checker only."""
        for_types = typing_only(self.tree)
        for node in nodes(self.tree):
            if isinstance(node, ast.ImportFrom):
                assert not node.level, f"{self.name}:{node.lineno}: a relative import"
                names = [node.module or ""]
                if node.module == "dvtcli":
                    names = [f"dvtcli.{alias.name}" for alias in node.names]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            else:
                continue
            yield from ((name, node.lineno, id(node) in for_types) for name in names)


@cache
def modules() -> tuple[Module, ...]:
    """Every Python file of the package, read and parsed once."""
    return tuple(Module(path) for path in sorted(PACKAGE.rglob("*.py")))
