"""Remember trusted and used project settings files, by the hash of path and contents.

Changed contents need new trust.
"""

from __future__ import annotations

import os
from pathlib import Path

from dvtcli.device.change.private_file import open_private, write_private
from dvtcli.errors import SafetyRefusal
from dvtcli.files.user_folders import user_folder

_TRUSTED, _USED = "trusted", "used"
#: an entry is a word and a path (bytes)
_MOST_BYTES = 20_000


def real_path(path: str) -> str:
    """Return the absolute path of a settings file, with links of its folder resolved."""
    folder, name = os.path.split(path)
    return os.path.join(os.path.realpath(folder or os.curdir), name)  # noqa: PTH118


def digest(path: str, data: bytes) -> str:
    """Return the SHA-256 (hexadecimal) of a settings file's real *path* and contents *data*."""
    from hashlib import sha256

    return sha256(os.fsencode(real_path(path)) + b"\0" + data).hexdigest()


def is_trusted(known: str) -> bool:
    """Tell whether the user trusts the file with digest *known*."""
    return _said(known) == _TRUSTED


def is_used(known: str) -> bool:
    """Tell whether the file with digest *known* was used or trusted before."""
    return _said(known) != ""


def trust(known: str, path: str) -> None:
    """Record trust in *path* with digest *known*; raises OSError or SafetyRefusal if impossible."""
    _keep(known, _TRUSTED, path)


def note_use(known: str, path: str) -> None:
    """Record the use of *path* with digest *known*; if impossible, each use counts as the first."""
    try:
        _keep(known, _USED, path)
    except (OSError, SafetyRefusal):
        return


def revoke(path: str, *, dry_run: bool = False) -> bool:
    """End the trust in *path*, even if the file is gone; returns whether it was trusted.

    *dry_run* changes nothing. Raises OSError if impossible.
    """
    was, folder = False, _folder()
    wanted = {repr(real_path(path)), repr(os.path.abspath(path))}  # noqa: PTH100
    for entry in sorted(folder.iterdir()) if folder.is_dir() else ():
        word, of = _entry(entry)
        if of not in wanted:
            continue
        was = was or word == _TRUSTED
        if not dry_run:
            entry.unlink(missing_ok=True)
    return was


def _folder() -> Path:
    return user_folder("state") / "settings"


def _file(known: str) -> Path:
    return _folder() / known


def _said(known: str) -> str:
    """Return the record of the file, empty if none, or if another user may have written it."""
    try:
        from dvtcli.device.change.private_file import check_folder

        check_folder(_folder())
    except (OSError, SafetyRefusal):
        return ""
    return _entry(_file(known))[0]


def _entry(entry: Path) -> tuple[str, str]:
    """Return record and file name of *entry*; empty if another user made it."""
    try:
        with os.fdopen(open_private(entry, os.O_RDONLY), "rb") as file:
            word, _, of = file.read(_MOST_BYTES).decode("utf-8", "replace").partition("\n")
    except (OSError, SafetyRefusal):
        return "", ""
    return (word, of.strip()) if word in (_TRUSTED, _USED) else ("", "")


def _keep(known: str, word: str, path: str) -> None:
    write_private(_file(known), f"{word}\n{real_path(path)!r}\n")
