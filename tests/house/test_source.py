"""What holds for every file: sizes, and what is never called."""

from __future__ import annotations

import ast

import pytest

from tests.house.draw import nodes
from tests.house.source import modules

pytestmark = pytest.mark.together

MOST_FUNCTION_LINES = 60
MOST_FILE_LINES = 400
#: longer than that today; the list may only become shorter
LONG_FILES: set[str] = set()

MOST_METHODS = 30
#: wider than that -> what it is, whole; `docs/explanation/architecture.md` says why
WIDE_CLASSES = {
    "CanopenBus": "the contract: everything that may be asked of a bus",
    "Opened": "a session's bus: not yet open, open, a twin's, gone, and back",
}

MODULES = modules()


@pytest.mark.together
def test_files_and_functions_are_short() -> None:
    for module in MODULES:
        for node in nodes(module.tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                assert lines <= MOST_FUNCTION_LINES, f"{module.name}:{node.lineno} {node.name} has {lines} lines"
        if module.name not in LONG_FILES:
            assert module.text.count("\n") <= MOST_FILE_LINES, module.name


@pytest.mark.together
def test_classes_are_narrow() -> None:
    """A class has few methods of its own, besides those of the contract that a bus keeps."""
    classes = [node for module in MODULES for node in nodes(module.tree) if isinstance(node, ast.ClassDef)]
    contract = next(methods(node) for node in classes if node.name == "CanopenBus")
    counted = [(node.name, methods(node) - (set() if node.name in WIDE_CLASSES else contract)) for node in classes]
    wide = {name: len(own) for name, own in counted if len(own) > MOST_METHODS}
    assert wide.keys() == WIDE_CLASSES.keys(), wide


def methods(node: ast.ClassDef) -> set[str]:
    return {one.name for one in node.body if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef)}


@pytest.mark.together
def test_nothing_is_evaluated_or_given_to_a_shell() -> None:
    for module in MODULES:
        for node in nodes(module.tree):
            if not isinstance(node, ast.Call):
                continue
            called = ast.unparse(node.func)
            assert called not in ("eval", "exec", "os.system", "os.popen", "pickle.load", "pickle.loads"), module.name
            shell = next((word.value for word in node.keywords if word.arg == "shell"), None)
            assert shell is None or (isinstance(shell, ast.Constant) and shell.value is False), module.name


def test_every_file_begins_with_what_it_is() -> None:
    for module in MODULES:
        assert module.text == "" or ast.get_docstring(module.tree), module.name
