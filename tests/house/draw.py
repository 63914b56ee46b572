"""The house as its own code draws it: rooms, their order, every import between files, and what runs against the order.

`python -m tests.house.draw` prints it, `--package DIR` looks at another copy. Counted are imports at the top, in
functions and for the type checker, and every module that a string names (`import_module("dvtcli.x")`,
`f"dvtcli.x.{name}"`, `python -m`): who imports by name imports.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from pathlib import Path

#: The rooms from the ground up, each with what lives there; a file may import its own room and those above its own
#: line. The one table of the order.
ROOMS: dict[str, str] = {
    "version": "which dvtcli this is",
    "interpreter": "the Python that runs code of ours in another process",
    "domain": "what a PDO is, what is legal, what must be written",
    "errors": "the one tree of failures",
    "device": "one device over the seams: reading, changing, rolling back",
    "bus": "ways to a bus, the strict SDO client, discovery",
    "watch": "frames as they pass or were recorded",
    "files": "one file or folder a format",
    "families": "data: profile, simulated behaviour and EDS of a device family",
    "simulator": "the strict device, and networks of it",
    "operations": "the use cases and what they answer",
    "results": "names of what calls answer",
    "__init__": "the public face: `import dvtcli`",
    "testing": "simulated nodes for the tests of others",
    "cli": "words and screens",
    "__main__": "the program's start",
}
PACKAGE = Path(__file__).resolve().parents[2] / "dvtcli"


@dataclass(frozen=True, slots=True)
class Arrow:
    """One import: file -> file, both as paths within the package; *how* is `top`, `lazy`, `type` or `named`."""

    source: str
    line: int
    target: str
    how: str

    @property
    def rooms(self) -> tuple[str, str]:
        """The rooms at both ends."""
        return room_of(self.source), room_of(self.target)

    @property
    def outward(self) -> bool:
        """Whether it runs against the order of the rooms; a room that is not in the table may be imported by none."""
        source, target = map(_floor, self.rooms)
        return target > source

    def __str__(self) -> str:
        return f"{self.source}:{self.line} -> {self.target} ({self.how})"


@cache
def parsed(text: str) -> ast.Module:
    """The tree of *text*, which nobody changes: each text is parsed once."""
    return ast.parse(text)


@cache
def nodes(tree: ast.Module) -> tuple[ast.AST, ...]:
    """All nodes of a tree that nobody changes: each tree is walked once, whoever looks at it."""
    return tuple(ast.walk(tree))


def room_of(file: str) -> str:
    """The room of a file: its first folder, or its own name where it stands beside the rooms."""
    return file.split("/", 1)[0].removesuffix(".py")


def _floor(room: str) -> int:
    return [*ROOMS, room].index(room)


class House:
    """All files of a package, and every arrow between them; *texts* are its files, None for those on the disk."""

    def __init__(self, package: Path = PACKAGE, texts: Mapping[str, str] | None = None) -> None:
        self.package = package
        self.files = dict(sorted((_read(package) if texts is None else texts).items()))
        self._of: dict[str, tuple[Arrow, ...]] = {}
        self._modules = {self._dotted(file): file for file in self.files}

    def altered(self, file: str, text: str) -> House:
        """A copy with *text* in *file*; arrows of other files are not looked for again unless the file is new."""
        other = House(self.package, {**self.files, file: text})
        if file in self.files:
            other._of = {one: arrows for one, arrows in self._arrows_by_file().items() if one != file}
        return other

    def _arrows_by_file(self) -> dict[str, tuple[Arrow, ...]]:
        for file, text in self.files.items():
            if file not in self._of:
                self._of[file] = tuple(self._of_file(file, text))
        return self._of

    def _dotted(self, file: str) -> str:
        whole = f"{self.package.name}/{file}".removesuffix(".py").removesuffix("/__init__")
        return whole.replace("/", ".")

    @cached_property
    def arrows(self) -> tuple[Arrow, ...]:
        """Every import of one file of the package by another, once for each line."""
        found = {arrow for arrows in self._arrows_by_file().values() for arrow in arrows}
        return tuple(sorted(found, key=lambda arrow: (arrow.source, arrow.line, arrow.target, arrow.how)))

    def arrows_of(self, file: str) -> tuple[Arrow, ...]:
        """The imports of one file."""
        return self._arrows_by_file()[file]

    def outward(self) -> list[Arrow]:
        """The arrows that run against the order of the rooms."""
        return [arrow for arrow in self.arrows if arrow.outward]

    def circles(self) -> list[list[str]]:
        """Files that import one another in a circle, lazy, type-only and named imports included; the largest first."""
        edges: dict[str, set[str]] = {file: set() for file in self.files}
        for arrow in self.arrows:
            edges[arrow.source].add(arrow.target)
        return sorted((sorted(each) for each in strongly_connected(edges) if len(each) > 1), key=len, reverse=True)

    def _of_file(self, file: str, text: str) -> Iterator[Arrow]:
        tree = parsed(text)
        for node, how in _with_kind(tree):
            for target in self._targets(node, file, tree):
                if target != file:
                    yield Arrow(file, getattr(node, "lineno", 0), target, how)

    def _targets(self, node: ast.AST, file: str, tree: ast.Module) -> Iterable[str]:
        if isinstance(node, ast.Import):
            return [self._modules[alias.name] for alias in node.names if alias.name in self._modules]
        if isinstance(node, ast.ImportFrom):
            return self._from(node, file)
        if isinstance(node, ast.Attribute):
            return self._longest(_chain(node))
        if isinstance(node, ast.List | ast.Tuple):
            words = [part.value for part in node.elts if isinstance(part, ast.Constant)]
            run = any(pair == ("-m", self.package.name) for pair in pairwise(words))
            return [self._modules[f"{self.package.name}.__main__"]] if run else []
        if isinstance(node, ast.JoinedStr):
            said = [part.value if isinstance(part, ast.Constant) else "{}" for part in node.values]
            return self._named("".join(map(str, said)), tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            return self._named(node.value, tree)
        return []

    def _from(self, node: ast.ImportFrom, file: str) -> Iterator[str]:
        module = node.module or ""
        if node.level:  # a package's __init__ counts as one of its own files
            above = f"{self.package.name}/{file}".split("/")[: -node.level]
            module = ".".join([*above, *([module] if module else [])])
        for alias in node.names:
            whole = f"{module}.{alias.name}"
            if whole in self._modules:
                yield self._modules[whole]
            elif module in self._modules:
                yield self._modules[module]

    def _longest(self, dotted: str) -> list[str]:
        """The file of the longest beginning of *dotted* that is a module: `dvtcli.device.node.Node`."""
        while "." in dotted:
            if dotted in self._modules:
                return [self._modules[dotted]]
            dotted = dotted.rpartition(".")[0]
        return []

    def _named(self, said: str, tree: ast.Module) -> list[str]:
        """The files that a string names: `dvtcli.x.y` anywhere in it one; `dvtcli.x.`, `dvtcli.x.{}` and `dvtcli.{}.y`
        those files that other strings of the file name, where none is named all that the string may mean. `%s` is as
        `{}`. `dvtcli.x/1` is a document's name.
        """
        said = re.sub(r"%\w|\{\w*\}", "{}", said)
        whole = re.findall(rf"(?<![\w./]){self.package.name}(?:\.\w+)+(?![\w/.{{])", said)
        if found := [file for name in whole for file in self._longest(name)]:
            return found
        match = re.fullmatch(rf"{self.package.name}\.[\w.{{}}]*", said)
        if match is None or not (said.endswith(".") or "{}" in said):
            return []
        pattern = re.escape(said + "{}" * said.endswith(".")).replace(r"\{\}", r"(\w+)")
        fits = ((re.fullmatch(pattern, name), file) for name, file in self._modules.items())
        members = [(fit[1], file) for fit, file in fits if fit]
        words = {word.partition(":")[0] for word in _texts(tree)}
        return [file for name, file in members if name in words] or [file for _, file in members]


def _read(package: Path) -> dict[str, str]:
    paths = (path for path in package.rglob("*.py") if "__pycache__" not in path.parts)
    return {path.relative_to(package).as_posix(): path.read_text("utf-8") for path in paths}


def _chain(node: ast.AST) -> str:
    """`a.b.c` of an attribute of a name, or nothing."""
    if isinstance(node, ast.Attribute):
        above = _chain(node.value)
        return above and f"{above}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def typing_only(tree: ast.Module) -> set[int]:
    """The nodes that only a type checker looks at."""
    return {
        id(child)
        for node in nodes(tree)
        if isinstance(node, ast.If) and _chain(node.test).endswith("TYPE_CHECKING")
        for statement in node.body
        for child in ast.walk(statement)
    }


def _texts(tree: ast.Module) -> Iterator[str]:
    for node in nodes(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


_NAMING = ast.List | ast.Tuple | ast.Attribute | ast.Constant | ast.JoinedStr


def _with_kind(tree: ast.Module) -> Iterator[tuple[ast.AST, str]]:
    """Every node that may name a module, with how it does."""
    typing_only = {
        id(child)
        for node in nodes(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for statement in node.body
        for child in ast.walk(statement)
    }
    top = {id(statement) for statement in tree.body}
    prose = {id(node.value) for node in nodes(tree) if isinstance(node, ast.Expr)}
    prose |= {id(part) for node in nodes(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in nodes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node, "type" if id(node) in typing_only else "top" if id(node) in top else "lazy"
        elif isinstance(node, _NAMING) and id(node) not in prose:
            yield node, "named"


def strongly_connected(edges: Mapping[str, set[str]]) -> Iterator[list[str]]:
    """Groups of files each of which reaches all others of its group (Tarjan 1972), without recursion."""
    number: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    for root in edges:
        work = [(root, iter(sorted(edges[root])))] if root not in number else []
        while work:
            file, targets = work[-1]
            if file not in number:
                number[file] = low[file] = len(number)
                stack.append(file)
            for target in targets:
                if target not in number:
                    work.append((target, iter(sorted(edges[target]))))
                    break
                if target in stack:
                    low[file] = min(low[file], number[target])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[file])
                if low[file] == number[file]:
                    at = stack.index(file)
                    yield stack[at:]
                    del stack[at:]


def text(house: House) -> Iterator[str]:
    """The house in words, the roof first."""
    pairs = Counter(arrow.rooms for arrow in house.arrows)
    sizes = Counter(map(room_of, house.files))
    unknown = [room for room in sizes if room not in ROOMS]
    for room in [*reversed(ROOMS), *unknown]:
        below = [f"{target} {count}" for (source, target), count in pairs.items() if source == room != target]
        about = ROOMS.get(room, "IN NO TABLE")
        yield f"{room:12}{sizes[room]:4} files  {about}"
        if below:
            yield f"{'':12}     imports  {', '.join(sorted(below))}"
    outward = house.outward()
    yield f"\n{len(outward)} of {len(house.arrows)} arrows against the order"
    yield from (f"  {arrow}" for arrow in outward)
    circles = house.circles()
    yield f"\n{len(circles)} circles"
    yield from (f"  {len(circle)} files: {', '.join(circle)}" for circle in circles)


def main(words: list[str] | None = None) -> int:
    """Draw what was asked for; 1 where an arrow runs against the order or files stand in a circle."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--package", type=Path, default=PACKAGE)
    asked = parser.parse_args(words)
    house = House(asked.package)
    print("\n".join(text(house)))
    return int(bool(house.outward() or house.circles()))


if __name__ == "__main__":
    sys.exit(main())
