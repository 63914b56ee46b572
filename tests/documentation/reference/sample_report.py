"""The sample page of `report` that the documentation links to, made from examples/traction.yaml."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import dvtcli
from tests.surroundings import ROOT

SAMPLE = ROOT / "docs" / "sample-report.html"


def sample_report() -> str:
    """Return the page as `dvtcli report` writes it now."""
    with TemporaryDirectory() as folder:
        page = Path(folder) / "traction.html"
        dvtcli.report(page, ROOT / "examples" / "traction.yaml", title="Traction chain of a vehicle")
        return page.read_text("utf-8")
