"""dvtcli as a process of its own, as a user's shell starts it."""

from __future__ import annotations

import atexit
import json
import os
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = ROOT / "scripts"


@cache
def home() -> Path:
    """A home folder without anybody's settings; gone when the tests end."""
    folder = Path(tempfile.mkdtemp(prefix="dvtcli-home-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def environment() -> dict[str, str]:
    """This process's environment without what would change dvtcli's behaviour, and with UTF-8 streams."""
    dropped = ("DVTCLI_", "CAN_", "XDG_", "FORCE_COLOR", "NO_COLOR", "COLUMNS")
    kept = {key: value for key, value in os.environ.items() if not key.startswith(dropped)}
    return kept | {"PYTHONIOENCODING": "utf-8", "HOME": str(home())}


def dvtcli(*words: str, stdin: str = "", cwd: Path = ROOT, merge: bool = False) -> subprocess.CompletedProcess[str]:
    """Run dvtcli with *words*; with *merge* stderr comes in stdout, in the order it was written."""
    return subprocess.run(
        [sys.executable, "-m", "dvtcli", *words],
        input=stdin,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT if merge else subprocess.PIPE,
        encoding="utf-8",
        cwd=cwd,
        env=environment(),
        timeout=60,
        check=False,
    )


def documents(stdout: str) -> list[dict[str, Any]]:
    """The JSON documents of a run with --json, one a line."""
    return [json.loads(line) for line in stdout.splitlines()]
