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


def digest(path: str, data: bytes) -> str:
    """The SHA-256 of a settings file, of its absolute *path* and of its content *data*, in hexadecimal."""
    from hashlib import sha256

    return sha256(os.fsencode(os.path.abspath(path)) + b"\0" + data).hexdigest()  # noqa: PTH100


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


def forget(known: str) -> bool:
    """Trust the file of the digest *known* no longer; whether it was trusted. OSError where that cannot be kept."""
    was = is_trusted(known)
    _file(known).unlink(missing_ok=True)
    return was


def _file(known: str) -> Path:
    return user_folder("state") / "settings" / known


def _said(known: str) -> str:
    """What is kept of the file, empty where nothing is, or somebody else could have put it there."""
    try:
        from dvtcli.device.trust import check_folder

        path = _file(known)
        check_folder(path.parent)
        with os.fdopen(open_private(path, os.O_RDONLY), "rb") as file:
            word = file.read(100).split(b"\n")[0].decode("ascii", "replace")
    except (OSError, SafetyRefusal):
        return ""
    return word if word in (_TRUSTED, _USED) else ""


def _keep(known: str, word: str, path: str) -> None:
    from dvtcli.device.change.private_file import write_private

    write_private(_file(known), f"{word}\n{os.path.abspath(path)!r}\n")  # noqa: PTH100
