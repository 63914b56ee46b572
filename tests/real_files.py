"""The real EDS and DCF files of the folder that `--eds-corpus` names."""

from __future__ import annotations

from pathlib import Path

import pytest


def real_files(config: pytest.Config, suffixes: tuple[str, ...] = (".eds", ".dcf")) -> list[Path]:
    """Their absolute paths; none without a folder."""
    folder = config.getoption("--eds-corpus")
    files = Path(folder).iterdir() if folder else ()
    return sorted(path for path in files if path.suffix.lower() in suffixes)
