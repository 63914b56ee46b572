"""The real EDS and DCF files of the folder that `--eds-corpus` names."""

from __future__ import annotations

from pathlib import Path

import pytest


def real_files(config: pytest.Config, suffixes: tuple[str, ...] = (".eds", ".dcf")) -> list[Path]:
    """Their paths, absolute, since each test has a working folder of its own; none where no folder is given."""
    folder = config.getoption("--eds-corpus")
    files = Path(folder).resolve().iterdir() if folder else ()
    return sorted(path for path in files if path.suffix.lower() in suffixes)
