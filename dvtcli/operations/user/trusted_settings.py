"""Which settings files of projects the user trusts, by the hash of path and content; and which were used before.

Another content is another file, which nobody trusted yet. Does not know what settings mean.
"""

from __future__ import annotations

import os
from pathlib import Path

from dvtcli.device.trust import open_private
from dvtcli.errors import SafetyRefusal
from dvtcli.files.user_folders import user_folder

_TRUSTED, _USED = "trusted", "used"
#: an entry is a word and a path (bytes)
_MOST_BYTES = 20_000


def real_path(path: str) -> str:
    """The absolute *path* of a settings file: its folder by whichever link it is reached, the file's name as it is."""
    folder, name = os.path.split(path)
    return os.path.join(os.path.realpath(folder or os.curdir), name)  # noqa: PTH118


def digest(path: str, data: bytes) -> str:
    """The SHA-256 of a settings file, of its real *path* and of its content *data*, in hexadecimal."""
    from hashlib import sha256

    return sha256(os.fsencode(real_path(path)) + b"\0" + data).hexdigest()


def is_trusted(known: str) -> bool:
    """Whether the user trusts the file of the digest *known*."""
    return _said(known) == _TRUSTED


def is_used(known: str) -> bool:
    """Whether the file of the digest *known* was used, or trusted, before."""
    return _said(known) != ""


def trust(known: str, path: str) -> None:
    """Keep that the user trusts the file *path* of the digest *known*; OSError or SafetyRefusal if nothing is kept."""
    _keep(known, _TRUSTED, path)


def note_use(known: str, path: str) -> None:
    """Keep that the file *path* of the digest *known* was used; where nothing can be kept, each use is the first."""
    try:
        _keep(known, _USED, path)
    except (OSError, SafetyRefusal):
        return


def forget(path: str, *, dry_run: bool = False) -> bool:
    """Trust no content of the file *path* any longer, also if the file is gone; whether one was trusted.

    With *dry_run* nothing is removed. OSError where that cannot be kept.
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
    """What is kept of the file, empty where nothing is, or somebody else could have put it there."""
    try:
        from dvtcli.device.trust import check_folder

        check_folder(_folder())
    except (OSError, SafetyRefusal):
        return ""
    return _entry(_file(known))[0]


def _entry(entry: Path) -> tuple[str, str]:
    """What *entry* says, and of which file, as `repr` has it; empty texts where somebody else made it."""
    try:
        with os.fdopen(open_private(entry, os.O_RDONLY), "rb") as file:
            word, _, of = file.read(_MOST_BYTES).decode("utf-8", "replace").partition("\n")
    except (OSError, SafetyRefusal):
        return "", ""
    return (word, of.strip()) if word in (_TRUSTED, _USED) else ("", "")


def _keep(known: str, word: str, path: str) -> None:
    from dvtcli.device.change.private_file import write_private

    write_private(_file(known), f"{word}\n{real_path(path)!r}\n")
