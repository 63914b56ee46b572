"""Law 5: behaviours, not vendors. Makers' names and identity numbers come from the family data."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterable, Iterator
from functools import cache

from tests.house.draw import nodes
from tests.house.laws.source_tree import SourceTree
from tests.house.source import PACKAGE

FAMILIES = PACKAGE / "families"
#: what is no maker's: how CiA 301 alone behaves, CiA 302-3, what the standards' objects mean, one behaviour alone
_NOBODY = (
    "generic", "loader", "standard", "lss-echo", "lss-reset", "no-boot-up", "no-entry-zero", "coupler", "mpdo",
    "safety",
)  # fmt: skip
#: makers whose devices have no family here
_OTHERS = ("borgwarner", "maxon", "schunk", "faulhaber", "systec", "ingenia", "axiomatic")
#: a word that has a maker's name in it by chance
_CHANCE = re.compile("namespace", re.I)
#: a number up to here is more often a CAN-ID, a length or a time than a maker's
_CAN_ID = 0x7FF
_PROSE = ("help", "hint", "epilog", "short_help")


@cache
def names() -> frozenset[str]:
    """Names of families, and of their makers as EDS files say them; a title may begin with any word."""
    found = {*_OTHERS}
    for folder in FAMILIES.iterdir():
        if folder.name in _NOBODY or not folder.is_dir():
            continue
        found.add(folder.name.partition("-")[0])
        for eds in folder.glob("*.eds"):
            said = re.findall(r"^(?:VendorName|ProductName) *= *(\w+)", eds.read_text("latin-1"), re.M | re.I)
            found |= {word.lower() for word in said}
    return frozenset(found - {"canopen", "cia", "dvtcli", ""})


@cache
def numbers() -> frozenset[int]:
    """Vendor-IDs, product codes and their masks."""
    found: set[int] = set()
    for file in FAMILIES.glob("*/profile.toml"):
        profile = tomllib.loads(file.read_text("utf-8"))
        found |= {*profile.get("vendor_ids", []), *profile.get("product_codes", [])}
        found |= {value for pair in profile.get("product_masks", []) for value in pair}
    return frozenset(found)


def behaviours_not_vendors(tree: SourceTree) -> Iterator[str]:
    """No maker's name stands in code, nor in the name of a file, and no identity number that is written as one."""
    for file, module in tree:
        if found := _maker(file):
            yield f"{file}: {found}"
        for line, text in texts(module):
            if found := _maker(text):
                yield f"{file}:{line} {found}"
        yield from (f"{file}:{line} {what}" for line, what in _numbers_in(tree.texts[file], module))


@cache
def _maker(text: str) -> str:
    """The maker's name in *text*, or nothing."""
    found = _pattern().search(_CHANCE.sub("", text))
    return found[0] if found else ""


@cache
def _pattern() -> re.Pattern[str]:
    return re.compile("|".join(sorted(names(), key=len, reverse=True)), re.I)


def _numbers_in(source: str, module: ast.Module) -> Iterator[tuple[int, str]]:
    """Identity numbers: large ones, and any that an identity is compared with, or that is called one."""
    compared = {id(inner) for node in nodes(module) if _asks_for_identity(node) for inner in _meant(module, node)}
    for node in nodes(module):
        if isinstance(node, ast.Constant) and type(node.value) is int and node.value in numbers():
            written = ast.get_source_segment(source, node) or ""
            if node.value > _CAN_ID or id(node) in compared:
                yield node.lineno, f"{written} is an identity number in families/: what the family does is a key there"


def _meant(module: ast.Module, asking: ast.AST) -> Iterator[ast.AST]:
    """All of what asks, and what the names in it were given: `_FIRST = 0x1E`, `_FAST = {0x1E: 1.0}`."""
    used = {inner.id for inner in ast.walk(asking) if isinstance(inner, ast.Name)}
    yield from ast.walk(asking)
    for node in nodes(module):
        if isinstance(node, ast.Assign) and any(isinstance(one, ast.Name) and one.id in used for one in node.targets):
            given = node.value.keys if isinstance(node.value, ast.Dict) else [node.value]
            yield from (one for one in given if isinstance(one, ast.Constant))


def _asks_for_identity(node: ast.AST) -> bool:
    """Whether *node* compares, or sets, something that is called a vendor or a product."""
    match node:
        case ast.Compare():
            asked = [ast.unparse(node)]
        case ast.Subscript(slice=one) | ast.Call(func=ast.Attribute(attr="get"), args=[one, *_]):
            asked = [ast.unparse(one)]
        case ast.Match(subject=one) | ast.AnnAssign(target=one):
            asked = [ast.unparse(one)]
        case ast.Assign(targets=several):
            asked = [ast.unparse(one) for one in several]
        case ast.keyword(arg=name):
            asked = [name or ""]
        case _:
            return False
    return any(re.search("vendor|product|identity|maker", one, re.IGNORECASE) for one in asked)


def texts(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Names and strings of a file, without docstrings, help texts and hints, which may give examples."""
    prose = set(_prose(tree))
    for node in nodes(tree):
        line = getattr(node, "lineno", 0)
        if isinstance(node, ast.Constant | ast.JoinedStr | ast.BinOp):
            if id(node) not in prose and (text := _put_together(node)):
                yield line, text
        else:
            yield from ((line, name) for name in _names_in(node))


def _names_in(node: ast.AST) -> Iterable[str]:
    """The names that *node* itself gives or uses."""
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name) | ast.FunctionDef(name=name) | ast.ClassDef(name=name):
            return [name]
        case ast.arg(arg=name) | ast.keyword(arg=str(name)) | ast.ExceptHandler(name=str(name)):
            return [name]
        case ast.MatchAs(name=str(name)) | ast.MatchStar(name=str(name)):
            return [name]
        case ast.alias(name=name, asname=other):
            return [name, other or ""]
        case ast.Global(names=several) | ast.Nonlocal(names=several) | ast.MatchClass(kwd_attrs=several):
            return several
    return ()


def _put_together(node: ast.AST) -> str:
    """The text that *node* comes to, as far as it stands there: `"a" + "b"`, `f"a{1}"`, `b"a"`; empty for no text."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.Constant(value=bytes(data)):
            return data.decode("latin-1")
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return _put_together(left) + _put_together(right)
        case ast.JoinedStr(values=values):
            parts = [value.value if isinstance(value, ast.FormattedValue) else value for value in values]
            return "".join(str(part.value) if isinstance(part, ast.Constant) else " " for part in parts)
    return ""


def _prose(tree: ast.Module) -> Iterator[int]:
    for node in nodes(tree):
        if isinstance(node, ast.Expr):
            yield id(node.value)
        elif isinstance(node, ast.Call):
            yield from (id(inner) for word in node.keywords if word.arg in _PROSE for inner in ast.walk(word.value))
        elif isinstance(node, ast.Dict):
            for key, value in zip(node.keys, node.values, strict=True):
                if isinstance(key, ast.Constant) and key.value == "help":
                    yield from map(id, ast.walk(value))
