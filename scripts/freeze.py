"""Make a folder with dvtcli, its data and Python, for machines without Python: `python scripts/freeze.py [FOLDER]`.

It takes dvtcli and the packages of the environment that it runs in, which needs PyInstaller beside them
(`pip install '.[freeze]'`), and leaves `FOLDER/dvtcli/dvtcli` (by default in `dist`).
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

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


def freeze(folder: Path) -> Path:
    """The program in *folder*, made anew; SystemExit with the reason if PyInstaller is missing or fails."""
    try:
        from PyInstaller.__main__ import run
    except ImportError as missing:
        raise SystemExit("PyInstaller is not installed: pip install '.[freeze]'") from missing
    words = ["--name", "dvtcli", "--onedir", "--console", "--noconfirm", "--clean", "--log-level", "WARN"]
    words += ["--distpath", str(folder), "--collect-data", "dvtcli"]
    for package, distribution in WHOLE_PACKAGES.items():
        words += ["--collect-submodules", package, "--recursive-copy-metadata", distribution]
    with TemporaryDirectory(prefix="dvtcli-freeze-") as work:
        start = Path(work, "start_dvtcli.py")
        start.write_text(START, encoding="utf-8")
        run([str(start), *words, "--workpath", str(Path(work, "work")), "--specpath", work])
    return folder / "dvtcli" / ("dvtcli.exe" if sys.platform == "win32" else "dvtcli")


if __name__ == "__main__":
    print(freeze(Path(sys.argv[1] if len(sys.argv) > 1 else "dist")))
