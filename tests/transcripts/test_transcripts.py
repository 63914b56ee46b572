"""Golden sessions: every `*.txt` here is a session at a shell, run for real and compared with what it says.

`pytest tests/transcripts --update-transcripts` rewrites them; look at the difference before keeping it.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.console import compare, rewritten, workplace

FILES = sorted(Path(__file__).parent.glob("*.txt"))


@pytest.mark.drawn(8)
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_session(file: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    lines = file.read_text("utf-8").splitlines()
    start = next(number for number, line in enumerate(lines) if line.startswith("$ "))
    assert all(line.startswith("#") or not line for line in lines[:start]), "a session begins with what it shows"
    folder = workplace(tmp_path)
    if request.config.getoption("--update-transcripts"):
        file.write_text("\n".join([*lines[:start], *rewritten(lines[start:], folder), ""]), encoding="utf-8")
    else:
        compare(lines[start:], folder)
