"""Type checkers know every file of answers."""

from __future__ import annotations

import ast
from pathlib import Path

import dvtcli

HOME = Path(dvtcli.__file__).parent / "operations" / "results"
FILES = sorted(HOME.glob("[a-z]*.py"))


def test_type_checkers_know_every_file_of_answers() -> None:
    tree = ast.parse((HOME / "__init__.py").read_text("utf-8"))
    known = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    lines = [f"from dvtcli.operations.results.{file.stem} import *  # noqa: F403" for file in FILES]
    lacking = [line for line in lines if line.split()[1] not in known]
    assert not lacking, "operations/results/__init__.py lacks, below TYPE_CHECKING: " + "; ".join(lacking)
