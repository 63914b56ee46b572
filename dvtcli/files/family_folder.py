"""Where the families that come with dvtcli are kept: a folder each. Knows names of files, and reads none of them."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

_FOLDER = Path(__file__).parents[1] / "families"


@cache
def families_with(file: str) -> tuple[str, ...]:
    """The families whose folder holds *file*, in alphabetical order."""
    return tuple(sorted(name for name in os.listdir(_FOLDER) if family_path(name, file).is_file()))  # noqa: PTH208


def family_path(name: str, file: str) -> Path:
    """Where *file* of family *name* is, whether there is one or not."""
    return _FOLDER / name / file
