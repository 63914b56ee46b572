"""What holds for every file: sizes, and what is never called."""

from __future__ import annotations

import ast

import pytest

from tests.house.draw import nodes
from tests.house.source import modules

pytestmark = pytest.mark.together

MOST_FUNCTION_LINES = 70
MOST_FILE_LINES = 600

MODULES = modules()


@pytest.mark.together
def test_files_and_functions_are_short() -> None:
    for module in MODULES:
        for node in nodes(module.tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                assert lines <= MOST_FUNCTION_LINES, f"{module.name}:{node.lineno} {node.name} has {lines} lines"
        assert module.text.count("\n") <= MOST_FILE_LINES, module.name


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
