"""The user's own collection of EDS and DCF files, found again by a node's identity (0x1018).

A file's name begins with its identity, `0000001E-0705302D-00010025_gen4.eds`, so that nothing is opened to find one.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from dvtcli.domain.object_dictionary import DeviceInfo
from dvtcli.errors import InputFileError
from dvtcli.files.user_folders import user_folder


def folder() -> Path:
    """Where the collection is kept, whether it exists or not."""
    return user_folder("data") / "eds"


def add(path: Path, info: DeviceInfo) -> Path:
    """Copy the file at *path* into the collection; InputFileError where it names no vendor and product."""
    if info.vendor_id is None or info.product_code is None:
        raise InputFileError(
            f"{path}: no vendor or product number, so no node's identity can match it",
            place=str(path),
            hint=f"give it on the command line: --eds {path}",
        )
    target = folder() / f"{_prefix(info.vendor_id, info.product_code)}{info.revision_number or 0:08X}_{path.name}"
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(path, target)
    return target


def find(vendor_id: int, product_code: int, revision: int | None) -> Path | None:
    """The file for an identity: the same revision first, else the highest one; None where there is none."""
    if not folder().is_dir():
        return None
    prefix = _prefix(vendor_id, product_code)
    files = sorted(path for path in folder().iterdir() if path.name.startswith(prefix))
    exact = [path for path in files if path.name.startswith(f"{prefix}{revision or 0:08X}_")]
    candidates = exact or files
    return candidates[-1] if candidates else None


def _prefix(vendor_id: int, product_code: int) -> str:
    return f"{vendor_id:08X}-{product_code:08X}-"
