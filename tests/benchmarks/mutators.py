"""One small fault in a Python file: where one can be made, and the file with it.

Knows syntax only. Leaves alone what is words (strings, f-strings), annotations and decorators.
"""

from __future__ import annotations

import ast
import contextlib
import gc
import importlib
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, NoneType
from typing import Any

_FUNCTION = 0x1  # CO_OPTIMIZED: the code of a function, not of a class
_COMPARED: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,), ast.NotIn: (ast.In,),
}  # fmt: skip
_REPLACED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.FloorDiv, ast.FloorDiv: ast.Mult, ast.Mod: ast.Add,
    ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.BitXor: ast.BitOr, ast.LShift: ast.RShift,
    ast.RShift: ast.LShift, ast.Div: ast.Mult,
}  # fmt: skip


@dataclass(frozen=True, order=True)
class Mutant:
    """Fault *number* of *module*, at *line* in *function*: `what stood there -> what stands there now`."""

    module: str
    number: int
    line: int
    function: str
    change: str

    @property
    def key(self) -> tuple[str, str, str]:
        """What stays the same when lines move."""
        return self.module, self.function, self.change

    def __str__(self) -> str:
        return f"{self.module}:{self.line} {self.function}: {self.change}"


@cache
def mutants(root: Path, module: str) -> tuple[Mutant, ...]:
    """Every fault that can be made in *module*, a path below *root*."""
    faults = Faults(-1)
    faults.visit(ast.parse((root / module).read_text("utf-8")))
    return tuple(Mutant(module, number, *found) for number, found in enumerate(faults.found))


def mutated(text: str, number: int) -> str:
    """The file *text* with fault *number*."""
    return ast.unparse(mutated_tree(text, number)) + "\n"


def mutated_tree(text: str, number: int) -> ast.Module:
    """As `mutated`, with the lines of *text* itself."""
    tree = ast.parse(text)
    Faults(number).visit(tree)
    return ast.fix_missing_locations(tree)


def reach(text: str, mutant: Mutant) -> tuple[int, int]:
    """First and last line whose run may notice *mutant*: those of its innermost function, or of the whole file."""
    found = (1, text.count("\n") + 1)
    for node in ast.walk(ast.parse(text)):  # outer ones come first
        if isinstance(node, ast.FunctionDef) and node.body[0].lineno <= mutant.line <= (node.end_lineno or 0):
            found = (node.body[0].lineno, node.end_lineno or 0)
    return found


def functions_by_file() -> dict[str, list[FunctionType]]:
    """Every function that there is by now, by the file of its code."""
    found: dict[str, list[FunctionType]] = {}
    for one in gc.get_objects():
        if type(one) is FunctionType:
            found.setdefault(one.__code__.co_filename, []).append(one)
    return found


def given_its_code(module: str, text: str, number: int, functions: dict[str, list[FunctionType]] | None = None) -> str:
    """Give what fault *number* of *module* changes its code, here and now, or its values; which of them, "" for none.

    Who has made something else of a value on import keeps that.

    *text* is that of the module's file; *functions* are those of `functions_by_file`, once the module was imported.
    """
    name = module.removesuffix(".py").replace("/", ".")
    path = importlib.import_module(name).__file__ or ""
    right, wrong = (compile(tree, path, "exec") for tree in (ast.parse(text), mutated_tree(text, number)))
    changes = _changes(right, wrong)
    if changes is None:
        return "values" if _given_its_values(name, path, right, wrong) else ""
    done = 0
    for old, new in changes:
        for function in (functions or functions_by_file()).get(path, []):
            if function.__code__ == old and function.__code__.co_qualname == old.co_qualname:
                with contextlib.suppress(ValueError):  # other free variables: only with the file itself
                    function.__code__ = new
                    done += 1
    return "code" if done else ""


def _given_its_values(name: str, path: str, right: CodeType, wrong: CodeType) -> bool:
    """Give module *name* the constants and defaults that differ, and whoever imported them; False where others do."""
    spaces: list[dict[str, Any]] = [{"__name__": name, "__file__": path} for _ in range(2)]
    try:
        for code, space in zip((right, wrong), spaces, strict=True):
            exec(code, space)  # noqa: S102 - our own module, with a fault in it
    except Exception:  # noqa: BLE001 - whoever imports the file will notice that
        return False
    differing = [
        key for key, value in spaces[0].items() if repr(value) != repr(spaces[1].get(key)) and _is_plain(value)
    ]
    modules = [one for key, one in sys.modules.items() if key.partition(".")[0] in ("dvtcli", "tests")]
    for key in differing:
        for module in modules:
            if repr(vars(module).get(key)) == repr(spaces[0][key]):
                setattr(module, key, spaces[1][key])
    done = len(differing)
    held = dict(_defaults(vars(sys.modules[name]), name))
    others = dict(_defaults(spaces[1], name))
    for place, before in _defaults(spaces[0], name):
        after = others.get(place)
        if after is not None and place in held and _told(before) != _told(after):
            held[place].__defaults__, held[place].__kwdefaults__ = after.__defaults__, after.__kwdefaults__
            done += 1
    return done > 0


def _is_plain(value: object) -> bool:
    """Whether *value* is made of numbers, words and bytes only: what a copy of it can stand for."""
    if isinstance(value, dict):
        return all(_is_plain(one) for pair in value.items() for one in pair)
    if isinstance(value, tuple | list | set | frozenset):
        return all(map(_is_plain, value))
    return type(value) in (int, float, bool, str, bytes, range, NoneType)


def _defaults(space: dict[str, Any], module: str) -> Iterator[tuple[str, FunctionType]]:
    """The functions of a module's namespace, and those of its classes, by name."""
    for name, value in list(space.items()):
        for key, one in [("", value), *(vars(value).items() if isinstance(value, type) else ())]:
            function = getattr(one, "__func__", one)
            if isinstance(function, FunctionType) and getattr(value, "__module__", "") == module:
                yield f"{name}.{key}", function


def _told(function: FunctionType) -> str:
    return repr((function.__defaults__, function.__kwdefaults__))


def _changes(right: CodeType, wrong: CodeType) -> list[tuple[CodeType, CodeType]] | None:
    """The functions that differ, right and wrong; None where what stands around them does."""
    if right.co_flags & _FUNCTION:
        return [] if right == wrong else [(right, wrong)]
    same = right.co_code == wrong.co_code and len(right.co_consts) == len(wrong.co_consts)
    if not same or right.co_names != wrong.co_names:
        return None
    found: list[tuple[CodeType, CodeType]] = []
    for one, other in zip(right.co_consts, wrong.co_consts, strict=True):
        if isinstance(one, CodeType) and isinstance(other, CodeType):
            inner = _changes(one, other)
            if inner is None:
                return None
            found += inner
        elif one != other or type(one) is not type(other):
            return None
    return found


class Faults(ast.NodeTransformer):
    """Finds every fault of a tree in a fixed order; makes the one with the number *wanted*."""

    def __init__(self, wanted: int) -> None:
        self.found: list[tuple[int, str, str]] = []
        self._wanted = wanted
        self._inside: list[str] = []

    def visit(self, node: ast.AST) -> ast.AST:
        """The node, or what stands in its place."""
        if isinstance(node, ast.JoinedStr) or _is_docstring(node) or _is_for_types(node):
            return node
        made: ast.AST | None = None
        for other in _others(node):
            text = f"{_text(node)} -> {_text(other)}"
            if len(self.found) == self._wanted:
                made = other
            self.found.append((getattr(node, "lineno", 0), ".".join(self._inside), text))
        name = [node.name] if isinstance(node, ast.FunctionDef | ast.ClassDef) else []
        self._inside += name
        self._visit_fields(node)
        del self._inside[len(self._inside) - len(name) :]
        return node if made is None else made

    def _visit_fields(self, node: ast.AST) -> None:
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list", "bases", "type_params"):
                continue
            if isinstance(value, list):
                value[:] = [self.visit(one) if isinstance(one, ast.AST) else one for one in value]
            elif isinstance(value, ast.AST):
                setattr(node, name, self.visit(value))


def _others(node: ast.AST) -> list[ast.AST]:
    """What may wrongly stand in the place of *node*."""
    for kind, make in _MAKERS.items():
        if isinstance(node, kind):
            return make(node)
    return []


def _compared(node: ast.Compare) -> list[ast.AST]:
    return [
        ast.Compare(node.left, [*node.ops[:place], other(), *node.ops[place + 1 :]], node.comparators)
        for place, operator in enumerate(node.ops)
        for other in _COMPARED[type(operator)]
    ]


def _constant(node: ast.Constant) -> list[ast.AST]:
    value = node.value
    if isinstance(value, bool):
        return [ast.Constant(not value)]
    if isinstance(value, int | float):
        return [ast.Constant(value + 1), *([ast.Constant(value - 1)] if value > 1 else [])]
    return [ast.Constant(bytes([value[0] ^ 1]) + value[1:])] if isinstance(value, bytes) and value else []


def _calculated(node: ast.BinOp | ast.AugAssign) -> list[ast.AST]:
    other = _REPLACED.get(type(node.op))
    if other is None:
        return []
    if isinstance(node, ast.AugAssign):
        return [ast.AugAssign(node.target, other(), node.value), ast.Pass()]
    return [ast.BinOp(node.left, other(), node.right)]


def _joined(node: ast.BoolOp) -> list[ast.AST]:
    return [ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)]


def _opposite(node: ast.UnaryOp) -> list[ast.AST]:
    return [node.operand] if isinstance(node.op, ast.Not) else []


def _decided(node: ast.If | ast.While | ast.IfExp) -> list[ast.AST]:
    """A condition that is neither compared nor joined, the other way round."""
    if isinstance(node.test, ast.Compare | ast.BoolOp | ast.UnaryOp | ast.Constant):
        return []
    negated = ast.UnaryOp(ast.Not(), node.test)
    if isinstance(node, ast.IfExp):
        return [ast.IfExp(negated, node.body, node.orelse)]
    return [type(node)(negated, node.body, node.orelse)]


def _ordered(node: ast.Call) -> list[ast.AST]:
    turned = isinstance(node.func, ast.Name) and node.func.id == "reversed"
    return [ast.Call(ast.Name("list", ast.Load()), node.args, [])] if turned else []


def _returned(node: ast.Return) -> list[ast.AST]:
    empty = node.value is None or (isinstance(node.value, ast.Constant) and node.value.value is None)
    return [] if empty else [ast.Return(ast.Constant(None))]


def _left_out(node: ast.stmt) -> list[ast.AST]:
    if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name | ast.Tuple):
        return []  # the name would be missing: noticed by whoever uses it
    return [ast.Pass()]


_MAKERS: dict[type[ast.AST], Callable[..., list[ast.AST]]] = {
    ast.Compare: _compared, ast.Constant: _constant, ast.BinOp: _calculated, ast.AugAssign: _calculated,
    ast.BoolOp: _joined, ast.UnaryOp: _opposite, ast.If: _decided, ast.While: _decided, ast.IfExp: _decided,
    ast.Return: _returned, ast.Expr: _left_out, ast.Assign: _left_out, ast.Raise: _left_out, ast.Delete: _left_out,
    ast.Call: _ordered, ast.Continue: _left_out, ast.Break: _left_out,
}  # fmt: skip


def _is_docstring(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _is_for_types(node: ast.AST) -> bool:
    protocol = isinstance(node, ast.ClassDef) and any("Protocol" in ast.unparse(base) for base in node.bases)
    return protocol or (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")


def _text(node: ast.AST) -> str:
    if isinstance(node, ast.If | ast.While):
        return f"{type(node).__name__.lower()} {ast.unparse(node.test)}"
    return " ".join(ast.unparse(ast.fix_missing_locations(node)).split())[:160]
