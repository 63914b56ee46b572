"""Trusting a project's settings file as it is now, and taking that back."""

from __future__ import annotations

import os

from dvtcli.errors import UsageError
from dvtcli.operations.results import Facts
from dvtcli.operations.user.settings import File
from dvtcli.operations.user.settings_search import NAME, Found, project_file
from dvtcli.operations.user.trusted_settings import forget, is_trusted, trust


def trust_settings(path: str | None = None, *, remove: bool = False) -> Facts:
    """Let all that the settings file *path* says count, as long as it stays as it is; with *remove* no longer.

    None takes the project's file that counts here. InputFileError where it is wrong or cannot be read, SafetyRefusal
    where somebody else can write it, UsageError where there is none.
    """
    file = _file(path)
    try:
        if remove:
            changed = forget(file.digest)
        else:
            changed = not is_trusted(file.digest)
            trust(file.digest, file.path)
    except OSError as failed:
        why = failed.strerror or str(failed)
        raise UsageError(f"trust cannot be kept: {why}", hint="is the state folder on a disk that is full?") from failed
    rows = (
        ("file", file.path),
        ("sha256", file.digest),
        ("trusted", not remove),
        ("changed", changed),
        ("keys", list(file.keys)),
        ("never_taken", [name.replace("_", "-") for name in file.ignored]),
    )
    return Facts("trust", rows, tuple(_lines(file, remove=remove, changed=changed)))


def _file(path: str | None) -> File:
    if path is not None:
        return File(Found(os.path.abspath(path)), users_own=False, believed=True)  # noqa: PTH100
    found = project_file()
    if found is None:
        raise UsageError(f"there is no {NAME} here or above", hint="name the file")
    return File(Found(found.path), users_own=False, believed=True)


def _lines(file: File, *, remove: bool, changed: bool) -> list[str]:
    if remove:
        return [f"{file.path} is not trusted any more" if changed else f"{file.path} was not trusted"]
    lines = [f"{file.path} is trusted until it changes{'' if changed else ', as before'}"]
    sets = [f"{name} = {_shown(value)}" for name, (value, _) in file.layer.items()]
    for bus, layer in file.buses.items():
        sets += [f"[bus.{bus}] {name} = {_shown(value)}" for name, (value, _) in layer.items()]
    sets += [f"alias {word} = {text}" for word, text in file.aliases.items()]
    lines += [f"  {line}" for line in sets]
    if file.ignored:
        lines.append(f"never taken from a project's file: {', '.join(file.ignored)}")
    return lines


def _shown(value: object) -> str:
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)
