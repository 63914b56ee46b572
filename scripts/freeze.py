"""Make dvtcli for machines without Python: a folder, and with options one file and archives.

    python scripts/freeze.py [FOLDER]              FOLDER/dvtcli/dvtcli with its own Python (FOLDER: `dist`)
    python scripts/freeze.py FOLDER --one-file     also FOLDER/dvtcli-VERSION-SYSTEM, which unpacks itself when started
    python scripts/freeze.py FOLDER --archive      also FOLDER/dvtcli-VERSION-SYSTEM.tar.gz (Windows: .zip) of it

It takes dvtcli and the packages of the environment that it runs in, which needs PyInstaller beside them
(`pip install '.[freeze]'`). Drivers of adapters' makers are found on the machine, as python-can finds them; none is
included. `sbom.cdx.json` in the folder lists what is.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import sys
import tarfile
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

from bill_of_materials import write_bill

RECIPE = Path(__file__).parent / "frozen" / "dvtcli.spec"


def freeze(folder: Path, *, one_file: bool = False) -> Path:
    """The program in *folder*, made anew; SystemExit with the reason if PyInstaller is missing or fails."""
    try:
        from PyInstaller.__main__ import run
    except ImportError as missing:
        raise SystemExit("PyInstaller is not installed: pip install '.[freeze]'") from missing
    with TemporaryDirectory(prefix="dvtcli-freeze-") as work:
        words = ["--noconfirm", "--clean", "--log-level", "WARN", "--distpath", str(folder), "--workpath", work]
        run([*words, str(RECIPE), "--", title(), "one-file" if one_file else "folder"])
    suffix = ".exe" if sys.platform == "win32" else ""
    if one_file:
        return folder / f"{title()}{suffix}"
    write_bill(folder / "dvtcli" / "sbom.cdx.json", frozen=True)
    return folder / "dvtcli" / f"dvtcli{suffix}"


def title() -> str:
    """dvtcli, its version, and the system that the program runs on."""
    return f"dvtcli-{version('canopen-dvtcli')}-{platform.system().lower()}-{platform.machine().lower()}"


def archive(folder: Path) -> Path:
    """Pack *folder*/dvtcli, with all times SOURCE_DATE_EPOCH's (1980 without it) and no owner."""
    target = folder / title()
    if sys.platform == "win32":
        return Path(shutil.make_archive(str(target), "zip", folder, "dvtcli"))
    moment = int(os.environ.get("SOURCE_DATE_EPOCH", "315532800"))

    def plain(member: tarfile.TarInfo) -> tarfile.TarInfo:
        member.mtime, member.uid, member.gid, member.uname, member.gname = moment, 0, 0, "", ""
        member.mode = 0o755 if member.isdir() or member.mode & 0o100 else 0o644
        return member

    with tarfile.open(packed := Path(f"{target}.tar.gz"), "w:gz") as file:
        file.add(folder / "dvtcli", "dvtcli", filter=plain)
    return packed


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Make dvtcli for machines without Python.")
    parser.add_argument("folder", nargs="?", type=Path, default=Path("dist"))
    parser.add_argument("--one-file", action="store_true")
    parser.add_argument("--archive", action="store_true")
    asked = parser.parse_args()
    print(freeze(asked.folder))
    if asked.archive:
        print(archive(asked.folder))
    if asked.one_file:
        print(freeze(asked.folder, one_file=True))
