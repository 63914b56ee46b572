"""Families of simulated devices from `families/NAME/simulated.toml`: strict, with line and key in every complaint.

The keys are those of `Family`, plus `like`, the family that a file starts from; each key replaces that one's whole.
Knows where families are. Does not know what a key may say (`family_keys`), nor what the family's profile says.
"""

from __future__ import annotations

import os
from dataclasses import replace
from functools import cache
from pathlib import Path

from dvtcli.errors import InputFileError
from dvtcli.files.device_file import DEVICE_SUFFIXES
from dvtcli.files.family_folder import families_with, family_path
from dvtcli.files.input_file import read_input
from dvtcli.files.toml_item import Item, read_toml, string, suggest
from dvtcli.simulator.device.family import GENERIC, Family
from dvtcli.simulator.network.family_keys import FAMILY_KEYS

_FILE = "simulated.toml"


def family_names() -> tuple[str, ...]:
    """The families that come with dvtcli, in alphabetical order; no file is opened."""
    return families_with(_FILE)


@cache
def family_eds(name: str) -> Path:
    """The EDS file of family *name*, or of the family it is `like`; KeyError where there is no such family."""
    like = next((item for item in _read(name).items() if item.key == "like"), None)
    chosen = name if like is None else _known(like)
    return family_path(chosen, f"{chosen}.eds")


def family_of(eds: Path) -> str | None:
    """The family whose own EDS the file *eds* is; None where it is none's."""
    return next((name for name in family_names() if family_eds(name) == eds), None)


@cache
def load_family(name: str) -> Family:
    """Read family *name*; KeyError where there is no such family, InputFileError where its file is wrong."""
    if name not in family_names():
        raise KeyError(name)
    return read_family(name, family_path(name, _FILE).read_text(encoding="utf-8"), f"{name}/{_FILE}")


def is_family_folder(text: str) -> bool:
    """Whether *text* is the path of a folder with a family's `simulated.toml`."""
    return os.path.isfile(os.path.join(text, _FILE))  # noqa: PTH113, PTH118 - Path raises for a name that is too long


def load_family_folder(folder: Path) -> Family:
    """The family whose `simulated.toml` is in *folder*; InputFileError where that is wrong."""
    path = folder / _FILE
    return read_family(folder.resolve().name, read_text(path), str(path))


def family_folder_eds(folder: Path) -> Path:
    """The EDS in *folder*, else that of the family it is `like`; InputFileError where there is none, or several."""
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in DEVICE_SUFFIXES)
    if len(files) == 1:
        return files[0]
    path = folder / _FILE
    like = next((item for item in read_toml(read_text(path), str(path)).items() if item.key == "like"), None)
    if files or like is None:
        raise InputFileError(f"{folder}: {len(files) or 'no'} EDS files, where a family has one", place=str(folder))
    return family_eds(_known(like))


def read_text(path: Path) -> str:
    """The text of *path*; InputFileError where it cannot be read as UTF-8."""
    try:
        return read_input(path, 1 << 20, "simulated device").decode("utf-8")
    except (OSError, UnicodeDecodeError) as failed:
        raise InputFileError(f"{path}: {getattr(failed, 'strerror', None) or failed}", place=str(path)) from failed


def read_family(name: str, text: str, source: str) -> Family:
    """The family *name* as *text* says it; *source* is the file's name for messages.

    Raises InputFileError, its place `FILE:LINE`, for broken TOML, an unknown key or a value that the key cannot have.
    """
    return _family(name, read_toml(text, source))


def _read(name: str) -> Item:
    if name not in family_names():
        raise KeyError(name)
    return read_toml(family_path(name, _FILE).read_text(encoding="utf-8"), f"{name}/{_FILE}")


def _family(name: str, item: Item) -> Family:
    given = item.table({"like": lambda item: load_family(_known(item)), **FAMILY_KEYS})
    base: Family = given.pop("like", GENERIC)
    return replace(base, name=name, **given)


def _known(item: Item) -> str:
    """The name of a family that there is."""
    name = string(item)
    if name not in family_names():
        item.fail(f"no family is called {name!r}", suggest(name, family_names()))
    return name
