"""Which ways the product's code went in this process: `pytest --branches FOLDER` counts them, in each worker.

A mark stands where a way begins: at both ends of an `if`, in and after a loop, at each `case`, at an `except`, at each
function. They are put in when the code is compiled, so that nothing is traced: a trace function sees each line of
libraries and tests, too, which takes thrice the processor time of the whole run. `branch_report` reports.
"""

from __future__ import annotations

import ast
import json
import marshal
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import cache_from_source
from pathlib import Path
from types import CodeType, ModuleType

from tests.surroundings import ROOT

PACKAGE = ROOT / "dvtcli"
#: a module's own array of what was gone
_MARKS = "__ways_gone__"
#: each file's, whoever imports it again
_GONE: dict[str, bytearray] = {}


@dataclass(frozen=True)
class Way:
    """A way through the code: what begins at *line* (`if`, `else`, `for`, `case`, `except`, `def`)."""

    line: int
    kind: str


class Marker(ast.NodeTransformer):
    """Puts a mark at the beginning of every way of a file, and knows them by its number."""

    def __init__(self) -> None:
        self.runners: list[Way] = []

    def _marked(self, body: list[ast.stmt], line: int, kind: str) -> list[ast.stmt]:
        """*body* behind a mark; a docstring stays what it is."""
        self.runners.append(Way(line, kind))
        mark = ast.parse(f"{_MARKS}[{len(self.runners) - 1}] = 1").body[0]
        ast.increment_lineno(mark, (body[0].lineno if body else line) - 1)
        begin = int(kind == "def" and isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant))
        return [*body[:begin], mark, *body[begin:]]

    def visit_If(self, node: ast.If) -> ast.AST:
        """Both ways, but for what only a type checker reads."""
        if not ast.unparse(node.test).endswith("TYPE_CHECKING"):
            node.body = self._marked(node.body, node.lineno, "if")
            node.orelse = self._marked(node.orelse, node.lineno, "else")
        return self.generic_visit(node)

    def _loop(self, node: ast.For | ast.While) -> ast.AST:
        node.body = self._marked(node.body, node.lineno, "loop")
        if not (isinstance(node, ast.While) and isinstance(node.test, ast.Constant)):
            node.orelse = self._marked(node.orelse, node.lineno, "loop's end")
        return self.generic_visit(node)

    visit_For = visit_While = _loop  # noqa: N815

    def visit_Match(self, node: ast.Match) -> ast.AST:
        """Each case, and none of them where none takes all."""
        last = node.cases[-1]
        takes_all = last.guard is None and isinstance(last.pattern, ast.MatchAs) and last.pattern.pattern is None
        for case in node.cases:
            case.body = self._marked(case.body, case.pattern.lineno, "case")
        if not takes_all:
            node.cases.append(ast.match_case(ast.MatchAs(), body=self._marked([], node.lineno, "no case")))
        return self.generic_visit(node)

    def visit_ExceptHandler(self, node: ast.ExceptHandler) -> ast.AST:
        """What is done about a failure."""
        node.body = self._marked(node.body, node.lineno, "except")
        return self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        """What is called at all, but for what has only words, as a protocol's methods have."""
        if not all(isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant) for one in node.body):
            node.body = self._marked(node.body, node.lineno, "def")
        return self.generic_visit(node)


def marked(source: bytes, path: str) -> tuple[CodeType, list[Way]]:
    """The code of *source* with a mark at each of its ways."""
    marker = Marker()
    tree = ast.fix_missing_locations(marker.visit(ast.parse(source)))
    return compile(tree, path, "exec", dont_inherit=True), marker.runners


class MarkedLoader(SourceFileLoader):
    """Loads a file of the product with marks; what it compiled once is kept beside other compiled code."""

    def get_code(self, fullname: str) -> CodeType:
        """The code with marks; its file's array is long enough from here on."""
        status = Path(self.path).stat()
        kept = Path(cache_from_source(self.path, optimization="ways"))
        stamp = (status.st_mtime_ns, status.st_size, sys.hexversion, _OWN)
        found: tuple[tuple[object, ...], CodeType | None, int] = ((), None, 0)
        if kept.exists():
            found = marshal.loads(kept.read_bytes())  # noqa: S302 - our own
        if found[0] != stamp:
            compiled, runners = marked(Path(self.path).read_bytes(), self.path)
            found = (stamp, compiled, len(runners))
            kept.parent.mkdir(exist_ok=True)
            new = kept.with_suffix(f".{os.getpid()}")
            new.write_bytes(marshal.dumps(found))
            new.replace(kept)
        _, code, count = found
        _GONE.setdefault(_name(self.path), bytearray(count))
        assert isinstance(code, CodeType)
        return code

    def exec_module(self, module: ModuleType) -> None:
        """Run the module, whose marks go where those of its file are."""
        code = self.get_code(module.__name__)
        vars(module)[_MARKS] = _GONE[_name(self.path)]
        exec(code, vars(module))  # noqa: S102 - as every loader


#: whoever changes what is marked compiles all again
_OWN = Path(__file__).stat().st_mtime_ns


class _Finder(MetaPathFinder):
    """Finds the product's own files, for `MarkedLoader`."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname.partition(".")[0] != PACKAGE.name:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = MarkedLoader(fullname, spec.loader.path)
        return spec


def _name(path: str) -> str:
    return Path(path).relative_to(PACKAGE).as_posix()


def count() -> None:
    """Count in this process from now on; none of the product must be imported yet."""
    early = [name for name in sys.modules if name.partition(".")[0] == PACKAGE.name]
    assert not early, f"imported before it could be counted: {early[:3]}"
    sys.meta_path.insert(0, _Finder())


def is_counting() -> bool:
    """Whether this process counts."""
    return any(isinstance(one, _Finder) for one in sys.meta_path)


def compile_ahead(paths: Iterable[Path]) -> None:
    """Compile *paths* with marks, for all processes."""
    for path in paths:
        MarkedLoader("", str(path)).get_code("")


def write(folder: Path) -> None:
    """Write what was gone in this process into *folder*."""
    folder.mkdir(parents=True, exist_ok=True)
    gone = {name: [number for number, one in enumerate(marks) if one] for name, marks in _GONE.items()}
    (folder / f"{os.environ.get('PYTEST_XDIST_WORKER', 'main')}.json").write_text(json.dumps(gone), encoding="utf-8")
