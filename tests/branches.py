"""Which branches the product's code took in this process: `pytest --branches FOLDER` counts them, in each worker.

SlipCover puts its marks into the code when that is imported, so that nothing is traced: a trace function sees each line
of libraries and tests, too, which takes more processor time than all tests together. `house.branches` reports.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import slipcover

from tests.surroundings import ROOT

PACKAGE = ROOT / "dvtcli"
#: no mark is taken out again while tests run: that would be by their functions' names, from any thread
_NEVER = sys.maxsize


def count() -> slipcover.Slipcover:
    """Count in this process from now on; none of the product must be imported yet."""
    early = [name for name in sys.modules if name.partition(".")[0] == PACKAGE.name]
    assert not early, f"imported before it could be counted: {early[:3]}"
    counter = slipcover.Slipcover(branch=True, d_miss_threshold=_NEVER)
    slipcover.ImportManager(counter, slipcover.FileMatcher(sources=[str(PACKAGE)])).__enter__()
    return counter


def write(counter: slipcover.Slipcover, folder: Path) -> None:
    """Write what was counted in this process into *folder*."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{os.environ.get('PYTEST_XDIST_WORKER', 'main')}.json"
    file.write_text(json.dumps(counter.get_coverage()), encoding="utf-8")
