"""The code of a fresh checkout is compiled once by all workers together: each takes a share of it first.

Else each of them would compile all of it, at the same time. Where it is compiled already this takes nothing.
"""

from __future__ import annotations

import compileall
import os
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import pytest

from tests.harness import branches
from tests.surroundings import ROOT


def compile_share() -> None:
    """Compile this worker's share of the product and of all tests; not where there are no workers."""
    worker, count = os.environ.get("PYTEST_XDIST_WORKER", ""), int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    if count == 1 or not worker.startswith("gw"):
        return
    number = int(worker.removeprefix("gw"))
    share = list(_files("dvtcli", "*.py"))[number::count]
    if branches.is_counting():
        branches.compile_ahead(share)
    for path in share:
        compileall.compile_file(path, quiet=2)
    for path in list(_files("tests", "test_*.py"))[number::count]:
        with suppress(Exception, pytest.skip.Exception):  # whoever collects it says it
            import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))  # with pytest's own compiler


def _files(folder: str, pattern: str) -> Iterator[Path]:
    return (path for path in sorted((ROOT / folder).rglob(pattern)) if "__pycache__" not in path.parts)
