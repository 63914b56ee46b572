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

#: Packages whose modules are imported by names that only running code knows (commands and results, python-can's
#: interfaces), and the distributions whose metadata name their entry points and versions.
WHOLE_PACKAGES = {"dvtcli": "canopen-dvtcli", "can": "python-can"}
#: The program: dvtcli, or the Python that dvtcli asks for (`dvtcli.interpreter`).
START = """
import runpy
import sys

from dvtcli.interpreter import AS_PYTHON

if sys.argv[1:2] == [AS_PYTHON]:
    words = sys.argv[2:]
    while words[0] in ("-I", "-S", "-P"):
        del words[0]
    if words[0] == "-m":
        sys.argv = words[1:]
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    else:
        sys.argv = ["-c", *words[2:]]
        exec(words[1], {"__name__": "__main__"})
else:
    from dvtcli.__main__ import entry

    sys.exit(entry())
"""


def freeze(folder: Path, *, one_file: bool = False) -> Path:
    """The program in *folder*, made anew; SystemExit with the reason if PyInstaller is missing or fails."""
    try:
        from PyInstaller.__main__ import run
    except ImportError as missing:
        raise SystemExit("PyInstaller is not installed: pip install '.[freeze]'") from missing
    name = title() if one_file else "dvtcli"
    words = ["--name", name, "--onefile" if one_file else "--onedir", "--console", "--noconfirm", "--clean"]
    if sys.platform == "linux" and shutil.which("strip"):  # half of the size, which one file unpacks at each start
        words.append("--strip")
    words += ["--log-level", "WARN", "--distpath", str(folder), "--collect-data", "dvtcli"]
    for package, distribution in WHOLE_PACKAGES.items():
        words += ["--collect-submodules", package, "--recursive-copy-metadata", distribution]
    with TemporaryDirectory(prefix="dvtcli-freeze-") as work:
        start = Path(work, "start_dvtcli.py")
        start.write_text(START, encoding="utf-8")
        run([str(start), *words, "--workpath", str(Path(work, "work")), "--specpath", work])
    suffix = ".exe" if sys.platform == "win32" else ""
    if one_file:
        return folder / f"{name}{suffix}"
    write_bill(folder / "dvtcli" / "sbom.cdx.json")
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
