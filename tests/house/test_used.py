"""The product has nothing that only its tests use."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator

import pytest

from dvtcli import Bus, Node, results, testing
from tests.house.draw import nodes
from tests.house.laws.source_tree import SourceTree, dotted

pytestmark = pytest.mark.together

HOUSE = SourceTree.of_the_package()
#: what programs of others use
PUBLIC = {*vars(Bus), *vars(Node), *results.__all__, *testing.__all__}


def defined() -> Iterator[tuple[str, str]]:
    """Every function, method and class with its place, without what a library calls by its name."""
    classes = [node for _, tree in HOUSE for node in nodes(tree) if isinstance(node, ast.ClassDef)]
    own = {node.name for node in classes}  # without those with a base of a library
    while found := {node.name for node in classes if any(_last(base) not in own for base in node.bases)} & own:
        own -= found
    called_back = {id(one) for node in classes if node.name not in own for one in node.body}
    for file, tree in HOUSE:
        for node in nodes(tree):
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("__"):
                kept_by_decorator = any(isinstance(one, ast.Call) for one in node.decorator_list)
                if id(node) not in called_back and (isinstance(node, ast.ClassDef) or not kept_by_decorator):
                    yield node.name, f"{file}:{node.lineno}"


def _last(node: ast.expr) -> str:
    return dotted(node).rpartition(".")[2]


def test_everything_is_used_by_the_product_itself() -> None:
    words = Counter(word for text in HOUSE.texts.values() for word in re.findall(r"\w+", text))
    unused = [f"{place} {name}" for name, place in defined() if words[name] == 1 and name not in PUBLIC]
    assert unused == [], (
        "nothing in dvtcli uses it. New? Call it, or put it where its like is found: a recording's format into its "
        "file's FORMATS, a result's text into its `renderer`. What only tests use goes to them, the rest goes"
    )
