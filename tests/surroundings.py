"""What a test finds around it: a home, XDG folders, a working folder and variables of its own, and nobody else's.

Does not know what dvtcli does with them.
"""

from __future__ import annotations

import itertools
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: what a machine needs to start programs at all; every other variable of whoever runs the tests is dropped
_KEPT = ("PATH", "PATHEXT", "SYSTEMROOT", "TEMP", "TMP", "TMPDIR", "LD_LIBRARY_PATH", "VIRTUAL_ENV")
_KEPT_BEGINNINGS = ("PYTEST_VERSION", "PYTEST_XDIST_", "PYTEST_CURRENT_TEST", "PYTEST_MUTATION_", "TESTS_")


#: what of the project is found in a working folder
_LINKED = ("scripts", "tests")

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
    _make_place(folder)
    with _in_place(folder) as work:
        yield work


class Places:
    """Places below *folder*, as `own_place` has them, one after the other.

    One that is found as it was made is given again: most tests leave nothing in theirs, and making it takes longer.
    """

    def __init__(self, folder: Path) -> None:
        self._folders = (folder / str(number) for number in itertools.count(1))
        self._last, self._as_made = folder, list[tuple[object, ...]]()

    @contextmanager
    def another(self) -> Iterator[Path]:
        """A working folder in which nothing is but the project's `scripts` and `tests`, with an empty home."""
        if not self._as_made or _seen(self._last) != self._as_made:
            self._last = next(self._folders)
            _make_place(self._last)
            self._as_made = _seen(self._last)
        with _in_place(self._last) as work:
            yield work


def _make_place(folder: Path) -> None:
    for made in (folder, folder / "home", folder / "work"):
        made.mkdir()
    for name in _LINKED:
        (folder / "work" / name).symlink_to(ROOT / name)


def _seen(folder: Path) -> list[tuple[object, ...]]:
    """What a place is like: whose its folders are, what is in them, and where that leads. Empty where one is gone."""
    seen: list[tuple[object, ...]] = []
    with suppress(OSError):
        for one in (str(folder), f"{folder}/home", f"{folder}/work"):
            status = os.stat(one)  # noqa: PTH116 - strings: this is done for each test
            with os.scandir(one) as entries:
                names = sorted((entry.name, os.readlink(entry) if entry.is_symlink() else "") for entry in entries)  # noqa: PTH115
            seen.append((status.st_mode, status.st_uid, status.st_gid, names))
        return seen
    return []


@contextmanager
def _in_place(folder: Path) -> Iterator[Path]:
    work = folder / "work"
    before, variables = Path.cwd(), dict(os.environ)
    os.environ |= _at_home(folder / "home")
    os.chdir(work)
    try:
        yield work
    finally:
        os.chdir(before)
        set_environment(variables)
