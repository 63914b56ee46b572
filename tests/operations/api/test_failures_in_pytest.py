"""A test of a user that fails with an expected error shows the test's own line, and the error's text."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.process import environment

TEST = """
def asked(node):
    node.map("tpdo1", "1018:1")

def test_refused(dvtcli_node):
    asked(dvtcli_node)
"""


@pytest.mark.parametrize(("options", "is_short"), [((), True), (("--full-trace",), False)])
def test_the_traceback_ends_at_the_tests_own_line(tmp_path: Path, options: tuple[str, ...], is_short: bool) -> None:
    (tmp_path / "conftest.py").write_text('pytest_plugins = ["dvtcli.testing"]\n')
    (tmp_path / "test_it.py").write_text(TEST)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", str(tmp_path), *options]
    ran = subprocess.run(command, cwd=tmp_path, env=environment(), capture_output=True, encoding="utf-8", check=False)
    assert ran.returncode == 1
    assert 'node.map("tpdo1", "1018:1")' in ran.stdout
    assert "rule: mappable at 0x1A00:01" in ran.stdout
    assert ("python_node.py" not in ran.stdout) is is_short
