"""What a test finds around it: a home, XDG folders, a working folder and variables of its own, and nobody else's.

Does not know what dvtcli does with them.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: what a machine needs to start programs at all; every other variable of whoever runs the tests is dropped
_KEPT = ("PATH", "PATHEXT", "SYSTEMROOT", "TEMP", "TMP", "TMPDIR", "LD_LIBRARY_PATH", "VIRTUAL_ENV")
_KEPT_BEGINNINGS = ("PYTEST_VERSION", "PYTEST_XDIST_", "PYTEST_CURRENT_TEST", "PYTEST_MUTATION_")
_KEPT_BEGINNINGS += ("COVERAGE_", "COV_CORE_", "TESTS_")


#: the variables that say where the user's files are, each on one system or another
HOMES = (
    *("HOME", "XDG_DATA_HOME", "XDG_STATE_HOME", "XDG_CONFIG_HOME"),
    *("LOCALAPPDATA", "APPDATA", "WIN_PD_OVERRIDE_LOCAL_APPDATA", "WIN_PD_OVERRIDE_APPDATA"),
)


def homes(folder: Path) -> dict[str, str]:
    """The variables that make *folder* the place of all of the user's files."""
    return dict.fromkeys(HOMES, str(folder))


def kept_in(folder: Path) -> Path:
    """Where dvtcli's own files are below *folder*, which `homes` names: Windows' folders have the maker's name, too."""
    return folder / "dvtcli" / "dvtcli" if sys.platform == "win32" else folder / "dvtcli"


def clean_environment() -> dict[str, str]:
    """This process's variables without those that say something to dvtcli, Python, python-can or a terminal program.

    XDG folders are named by none of them, so that they are those of HOME.
    """
    kept = {key: value for key, value in os.environ.items() if key in _KEPT or key.startswith(_KEPT_BEGINNINGS)}
    return kept | {"LANG": "C.UTF-8", "TERM": "xterm-256color"}


def set_environment(variables: dict[str, str]) -> None:
    """Make *variables* all that there are."""
    if dict(os.environ) != variables:
        os.environ.clear()
        os.environ.update(variables)


def own_ground(folder: Path) -> Path:
    """*folder*, beyond whose root nobody looks for settings: a `dvtcli.toml` above the temporary folders is ignored."""
    (folder / ".git").mkdir(parents=True, exist_ok=True)
    return folder


def _at_home(home: Path) -> dict[str, str]:
    """The variables that make *home* the user's home, and the place of the user's settings and state."""
    variables = {"HOME": str(home)}
    if sys.platform == "win32":
        local, roaming = str(home / "AppData" / "Local"), str(home / "AppData" / "Roaming")
        variables |= {"USERPROFILE": str(home), "LOCALAPPDATA": local, "APPDATA": roaming}
        # platformdirs asks Windows itself, unless it is told
        variables |= {"WIN_PD_OVERRIDE_LOCAL_APPDATA": local, "WIN_PD_OVERRIDE_APPDATA": roaming}
    return variables


@contextmanager
def own_place(folder: Path) -> Iterator[Path]:
    """A new *folder* with a home and a working folder, and this process in it; afterwards all is as it was.

    The project's `scripts` and `tests` are to be found in the working folder, which is what is yielded.
    """
    home, work = folder / "home", folder / "work"
    for made in (folder, home, work):
        made.mkdir()
    for name in ("scripts", "tests"):
        (work / name).symlink_to(ROOT / name)
    before, variables = Path.cwd(), dict(os.environ)
    os.environ |= _at_home(home)
    os.chdir(work)
    try:
        yield work
    finally:
        os.chdir(before)
        set_environment(variables)
