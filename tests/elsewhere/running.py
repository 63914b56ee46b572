"""dvtcli in a Python that is another system's, with that system's folders and its own code page."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.process import PATIENCE_S
from tests.surroundings import ROOT, clean_environment

WINDOWS, MACOS = "windows", "macos"
#: what each writes its output in
_ENCODING = {WINDOWS: "cp1252", MACOS: "utf-8"}


def variables(system: str, home: Path, **more: str) -> dict[str, str]:
    """The environment of a user there whose home is *home*."""
    folders = {"HOME": home}
    if system == WINDOWS:
        local, roaming = home / "AppData" / "Local", home / "AppData" / "Roaming"
        folders = {"HOME": home, "USERPROFILE": home, "LOCALAPPDATA": local, "APPDATA": roaming}
    path = os.pathsep.join(str(ROOT / folder) for folder in ("tests/elsewhere/start", ""))
    said = {key: str(folder) for key, folder in folders.items()}
    return clean_environment() | said | {"PYTHONPATH": path, "TESTS_ELSEWHERE": system} | more


def start(system: str, home: Path, *words: str, **more: str) -> subprocess.Popen[bytes]:
    """Start dvtcli there; *more* are variables."""
    return subprocess.Popen(
        [sys.executable, "-m", "dvtcli", *words], env=variables(system, home, **more),
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


class Ran:
    """How a dvtcli ended: its exit code, and what it wrote, as it wrote it and as a user there reads it."""

    def __init__(self, system: str, process: subprocess.Popen[bytes], stdin: bytes = b"") -> None:
        try:
            self.raw, errors = process.communicate(stdin, timeout=PATIENCE_S)
        finally:
            process.kill()
        self.code = process.returncode
        self.raw = self.raw or b""
        self.stdout = self.raw.decode(_ENCODING[system]).replace("\r\n", "\n")
        self.stderr = errors.decode(_ENCODING[system]).replace("\r\n", "\n")


def run(system: str, home: Path, *words: str, stdin: bytes = b"", **more: str) -> Ran:
    """Run dvtcli there to its end."""
    return Ran(system, start(system, home, *words, **more), stdin)
