"""dvtcli as a process of its own, as a user's shell starts it."""

from __future__ import annotations

import atexit
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from tests.harness.forked import Forked, Fresh
from tests.surroundings import ROOT, clean_environment

SCRIPTS = ROOT / "scripts"
#: whether each dvtcli gets a Python of its own (`--fresh-python`), as a frozen program has
FRESH_PYTHON = os.name != "posix" or "TESTS_PROGRAM" in os.environ
#: how long a process may take on a busy, or an emulated, machine (s)
PATIENCE_S = 240.0

Ran = subprocess.CompletedProcess[str]


@cache
def home() -> Path:
    """A home folder without anybody's settings; gone when the tests end."""
    folder = Path(tempfile.mkdtemp(prefix="dvtcli-home-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def environment() -> dict[str, str]:
    """A clean environment with UTF-8 streams, in which this tree is what is imported, whatever the folder.

    Its home is the test's own; what is no test, as a benchmark, has one too.
    """
    tested = "PYTEST_VERSION" in os.environ
    variables = dict(os.environ) if tested else clean_environment() | {"HOME": str(home())}
    return variables | {"PYTHONIOENCODING": "utf-8", "PYTHONPATH": _path()}


def _path() -> str:
    """Where a Python finds this tree, and another system's double where this one is one."""
    double = [str(ROOT / "tests/elsewhere/start")] if "TESTS_ELSEWHERE" in os.environ else []
    return os.pathsep.join([*double, str(ROOT)])


def dvtcli(*words: str, stdin: str = "", cwd: Path | None = None, merge: bool = False) -> Ran:
    """Run dvtcli with *words* in *cwd*, else in the test's own folder.

    With *merge* stderr comes in stdout, in the order it was written.
    """
    return run(words, stdin=stdin, cwd=cwd, merge=merge)


def run(words: Sequence[str], *, env: Mapping[str, str] | None = None, **how: Any) -> Ran:
    """Run dvtcli with *words* to its end, in a clean environment or in *env*; *how* is as for `start`."""
    process = start(words, env=env, **how)
    try:
        stdout, stderr = process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
    return Ran(process.args, process.returncode, stdout, stderr)


def start(words: Sequence[str], *, env: Mapping[str, str] | None = None, **how: Any) -> Forked:
    """Start dvtcli with *words*, in a clean environment or in *env*.

    It is forked from a process that has read dvtcli's code, unless `--fresh-python` is given, or *env* says something
    to the interpreter, which only a new one hears.
    """
    usual = environment()
    variables = usual if env is None else env
    said = (key for key in (*variables, *usual) if key.startswith(("PYTHON", "LC_", "LANG")))
    fresh = FRESH_PYTHON or any(variables.get(key) != usual.get(key) for key in said)
    return (Fresh if fresh else Forked)(words, env=variables, **how)


def documents(stdout: str) -> list[dict[str, Any]]:
    """The JSON documents of a run with --json, one a line."""
    return [json.loads(line) for line in stdout.splitlines()]
