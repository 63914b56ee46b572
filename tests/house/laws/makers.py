"""Law 5: behaviours, not vendors. Makers' names and identity numbers come from the family data."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from functools import cache

from tests.house.draw import nodes
from tests.house.laws.source_tree import SourceTree
from tests.house.source import PACKAGE

FAMILIES = PACKAGE / "families"
#: what is no maker's: how CiA 301 alone behaves, CiA 302-3, and what the standards' objects mean
_NOBODY = ("generic", "loader", "standard")
#: makers whose devices have no family here
_OTHERS = ("borgwarner", "maxon", "schunk", "faulhaber", "systec", "ingenia", "axiomatic")
#: a word that has a maker's name in it by chance
_CHANCE = re.compile("namespace", re.I)
_PROSE = ("help", "hint", "epilog", "short_help")


@cache
def names() -> frozenset[str]:
    """Names of families, and of their makers as titles and EDS files say them."""
    found = {*_OTHERS}
    for folder in FAMILIES.iterdir():
        if folder.name in _NOBODY or not folder.is_dir():
            continue
        found.add(folder.name.partition("-")[0])
        for file in folder.glob("*.toml"):
            title = tomllib.loads(file.read_text("utf-8")).get("title", "")
            found |= {word.lower() for word in title.split()[:1]}
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
    """No maker's name stands in code, and no identity number that is written as one."""
    pattern = re.compile("|".join(sorted(names(), key=len, reverse=True)), re.I)
    for file, module in tree:
        for node, text in texts(module):
            if found := pattern.search(_CHANCE.sub("", text)):
                yield f"{file}:{node.lineno} {found[0]}"
        for node in nodes(module):
            if isinstance(node, ast.Constant) and type(node.value) is int and node.value in numbers():
                written = ast.get_source_segment(tree.texts[file], node) or ""
                if node.value > 0xFF or written.lower().startswith("0x"):
                    yield f"{file}:{node.lineno} {written}"


def texts(tree: ast.Module) -> Iterator[tuple[ast.stmt | ast.expr, str]]:
    """Names and strings of a file, without docstrings, help texts and hints, which may give examples."""
    prose = set(_prose(tree))
    for node in nodes(tree):
        if isinstance(node, ast.Name):
            yield node, node.id
        elif isinstance(node, ast.Attribute):
            yield node, node.attr
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node, node.name
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in prose:
            yield node, node.value


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
