"""Writing keys into `dvtcli.toml`: what is there stays, comments included.

Does not know which keys there are (`options` does).
"""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path

from dvtcli.errors import InputFileError

Setting = str | int | list[str]


def with_settings(text: str, settings: Mapping[str, Setting]) -> str:
    """*text* with *settings* at its top level; ValueError where that cannot be done without touching the rest."""
    wanted = {**tomllib.loads(text), **settings}
    lines = text.splitlines()
    for key, value in settings.items():
        _set(lines, key, f"{key} = {json.dumps(value, ensure_ascii=False)}")
    result = "\n".join([*lines, ""])
    if tomllib.loads(result) != wanted:
        raise ValueError("its keys are written over several lines")
    return result


def _set(lines: list[str], key: str, line: str) -> None:
    """Replace the line of *key*, or add it before the first table."""
    table = next((number for number, old in enumerate(lines) if old.lstrip().startswith("[")), len(lines))
    for number, old in enumerate(lines[:table]):
        if re.match(rf"\s*{re.escape(key)}\s*=", old):
            lines[number] = line
            return
    lines.insert(table, line)


def save_settings(path: Path, settings: Mapping[str, Setting]) -> None:
    """Write *settings* into the file *path*; InputFileError where it is not one that they can be added to."""
    try:
        text = path.read_text("utf-8") if path.exists() else ""
        written = with_settings(text, settings)
        # a file that others could write would not be taken, whatever the umask says
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644), "w", encoding="utf-8") as file:
            file.write(written)
    except (OSError, ValueError) as failed:
        raise InputFileError(f"{path}: not saved: {failed}", place=str(path)) from failed
