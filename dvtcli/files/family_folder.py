"""Where the families that come with dvtcli are kept: a folder each. Knows names of files, and reads none of them."""

from __future__ import annotations

import atexit
from contextlib import ExitStack
from functools import cache
from pathlib import Path

_FOLDER = Path(__file__).parents[1] / "families"
#: The files of each family.
FAMILIES: dict[str, tuple[str, ...]] = {
    "canopennode": ("canopennode.eds", "profile.toml", "simulated.toml"),
    "curtis": ("profile.toml",),
    "curtis-reversed": ("profile.toml",),
    "espac": ("espac.eds", "profile.toml", "simulated.toml"),
    "gen4": ("gen4.eds", "profile.toml", "simulated.toml"),
    "gen4-locked": ("simulated.toml",),
    "generic": ("generic.eds", "profile.toml", "simulated.toml"),
    "lely": ("lely.eds", "simulated.toml"),
    "loader": ("loader.eds", "profile.toml", "simulated.toml"),
    "lss-echo": ("simulated.toml",),
    "lss-reset": ("simulated.toml",),
    "no-boot-up": ("simulated.toml",),
    "no-entry-zero": ("simulated.toml",),
    "roboteq": ("profile.toml", "roboteq.eds", "simulated.toml"),
    "standard": ("cia301.toml", "cia401.toml", "cia402.toml"),
    "tmcm": ("profile.toml", "simulated.toml", "tmcm.eds"),
}


def families_with(file: str) -> tuple[str, ...]:
    """The families that have a *file* of this name, in alphabetical order."""
    return tuple(name for name, files in FAMILIES.items() if file in files)


@cache
def family_path(name: str, file: str) -> Path:
    """Where *file* of the family *name* is; if the package is in an archive, a copy that goes with this process."""
    path = _FOLDER / name / file
    if file not in FAMILIES.get(name, ()) or path.is_file():
        return path
    from importlib.resources import files
    from tempfile import TemporaryDirectory

    kept = ExitStack()
    atexit.register(kept.close)
    copy = Path(kept.enter_context(TemporaryDirectory(prefix="dvtcli-"))) / file
    copy.write_bytes((files("dvtcli") / "families" / name / file).read_bytes())
    return copy
