"""Where Python has no tkinter: a real process whose first `tkinter` cannot be imported."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.harness.sample import heavy
from tests.process import PATIENCE_S, ROOT, environment


@heavy
def test_without_tkinter_one_error_names_the_package(tmp_path: Path) -> None:
    (tmp_path / "tkinter.py").write_text("raise ImportError(\"No module named '_tkinter'\")\n")
    done = subprocess.run(
        [sys.executable, "-m", "dvtcli", "--sim", "gen4", "run", "scripts/pdo_config.tcl"],
        capture_output=True, encoding="utf-8", env=environment() | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"},
        check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 1
    assert "python3-tk" in done.stderr
    assert done.stdout == ""
