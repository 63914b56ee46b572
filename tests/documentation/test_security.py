"""Each promise of SECURITY.md names a test, which is there."""

from __future__ import annotations

import re

from tests.process import ROOT

_ROW = re.compile(r"^\| .+ \| `(tests/[\w/]+\.py)::(test_\w+)` \|$")


def test_each_promise_has_its_test() -> None:
    text = (ROOT / "SECURITY.md").read_text("utf-8")
    _, _, table = text.partition("| promise | test |\n|---|---|\n")
    rows = table.strip().splitlines()
    assert len(rows) > 30
    for row in rows:
        found = _ROW.fullmatch(row)
        assert found is not None, row
        assert f"def {found[2]}(" in (ROOT / found[1]).read_text("utf-8"), row
