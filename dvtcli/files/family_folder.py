"""Where the families that come with dvtcli are kept: a folder each. Knows names of files, and reads none of them."""

from __future__ import annotations

from pathlib import Path

_FOLDER = Path(__file__).parents[1] / "families"


def families_with(file: str) -> tuple[str, ...]:
    """The families whose folder holds *file*, in alphabetical order."""
    return tuple(sorted(path.parent.name for path in _FOLDER.glob(f"*/{file}")))


def family_path(name: str, file: str) -> Path:
    """Where *file* of family *name* is, whether there is one or not."""
    return _FOLDER / name / file
