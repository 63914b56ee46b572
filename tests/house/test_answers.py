"""Answers are known to type checkers, and their text is lines."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import dvtcli

HOME = Path(dvtcli.__file__).parent / "operations" / "results"
FILES = sorted(HOME.glob("[a-z]*.py"))


def test_type_checkers_know_every_file_of_answers() -> None:
    tree = ast.parse((HOME / "__init__.py").read_text("utf-8"))
    known = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    lines = [f"from dvtcli.operations.results.{file.stem} import *  # noqa: F403" for file in FILES]
    lacking = [line for line in lines if line.split()[1] not in known]
    assert not lacking, "operations/results/__init__.py lacks, below TYPE_CHECKING: " + "; ".join(lacking)


def letters(tree: ast.AST) -> list[str]:
    """The answers that are shown by their `text`, which is one string: it would be shown with a letter a line."""
    answers = [
        one for one in ast.walk(tree)
        if isinstance(one, ast.ClassDef) and any(ast.unparse(base) == "Answer" for base in one.bases)
    ]  # fmt: skip
    plain = [one for one in answers if "renderer" not in {ast.unparse(at) for at in targets(one)}]
    return [f"{one.name}.text" for one in plain if text_type(one) == "str"]


def targets(answer: ast.ClassDef) -> list[ast.expr]:
    return [line.target for line in answer.body if isinstance(line, ast.AnnAssign)]


def text_type(answer: ast.ClassDef) -> str:
    for line in answer.body:
        if isinstance(line, ast.FunctionDef) and line.name == "text" and line.returns is not None:
            return ast.unparse(line.returns)
        if isinstance(line, ast.AnnAssign) and ast.unparse(line.target) == "text":
            return ast.unparse(line.annotation)
    return ""


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_text_is_lines(file: Path) -> None:
    found = letters(ast.parse(file.read_text("utf-8")))
    assert not found, f"{file.name}: {' '.join(found)} is a tuple of lines, not one string"


def test_a_text_of_one_string_is_noticed() -> None:
    assert letters(ast.parse("class Said(Answer):\n    @property\n    def text(self) -> str: ...")) == ["Said.text"]
    assert letters(ast.parse("class Said(Answer):\n    text: str")) == ["Said.text"]
    assert not letters(ast.parse("class Said(Answer):\n    text: tuple[str, ...]"))
