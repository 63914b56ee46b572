"""What holds for every file: sizes, what is never called, and no maker's name in code."""

from __future__ import annotations

import ast
import re

from tests.house.source import modules

MOST_FUNCTION_LINES = 60
MOST_FILE_LINES = 400
#: longer than that today; the list may only become shorter
LONG_FILES: set[str] = set()
MAKERS = re.compile(
    r"sevcon|borgwarner|trinamic|tmcm|roboteq|gen4|espac|curtis|maxon|schunk|faulhaber|systec|ingenia|axiomatic", re.I
)

MODULES = modules()


def test_files_and_functions_are_short() -> None:
    for module in MODULES:
        for node in ast.walk(module.tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                assert lines <= MOST_FUNCTION_LINES, f"{module.name}:{node.lineno} {node.name} has {lines} lines"
        if module.name not in LONG_FILES:
            assert module.text.count("\n") <= MOST_FILE_LINES, module.name


def test_nothing_is_evaluated_or_given_to_a_shell() -> None:
    for module in MODULES:
        for node in ast.walk(module.tree):
            if not isinstance(node, ast.Call):
                continue
            called = ast.unparse(node.func)
            assert called not in ("eval", "exec", "os.system", "os.popen", "pickle.load", "pickle.loads"), module.name
            shell = next((word.value for word in node.keywords if word.arg == "shell"), None)
            assert shell is None or (isinstance(shell, ast.Constant) and shell.value is False), module.name


def test_only_the_program_itself_exits() -> None:
    for module in MODULES:
        for node in ast.walk(module.tree):
            if isinstance(node, ast.Call):
                called = ast.unparse(node.func)
                assert called != "sys.exit" or module.name in ("cli/main.py", "__main__.py"), (
                    f"{module.name}:{node.lineno}"
                )


def test_no_makers_name_stands_in_code() -> None:
    for module in MODULES:
        for node, text in texts(module.tree):
            assert not MAKERS.search(text), f"{module.name}:{node.lineno}: {text!r}; behaviours, not vendors"


def texts(tree: ast.Module) -> list[tuple[ast.stmt | ast.expr, str]]:
    """Names and strings of a file, without docstrings, help texts and hints, which may give examples."""
    prose = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
        words = [word.value for word in call.keywords if word.arg in ("help", "hint", "epilog", "short_help")]
        prose |= {id(child) for word in words for child in ast.walk(word)}
    prose |= {
        id(child)
        for node in ast.walk(tree)
        if isinstance(node, ast.Dict)
        for key, value in zip(node.keys, node.values, strict=True)
        if isinstance(key, ast.Constant) and key.value == "help"
        for child in ast.walk(value)
    }
    found: list[tuple[ast.stmt | ast.expr, str]] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            found.append((node, node.id))
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.append((node, node.name))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in prose:
            found.append((node, node.value))
    return found


def test_every_file_begins_with_what_it_is() -> None:
    for module in MODULES:
        assert module.text == "" or ast.get_docstring(module.tree), module.name
