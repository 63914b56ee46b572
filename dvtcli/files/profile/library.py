"""Find device profiles: built-in profiles, and the user's own in the configuration folder.

A user's profile replaces a built-in profile of the same name.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

from dvtcli.domain.object_dictionary import ObjectDictionary, normalised
from dvtcli.domain.object_scalings import Standard
from dvtcli.domain.profile import GENERIC, DeviceProfile, ObjectAddress
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.input_file import read_input
from dvtcli.files.profile.toml import (
    builtin_names,
    builtin_path,
    builtin_profile,
    may_be_of,
    physical_rules,
    read_profile,
)
from dvtcli.files.toml_item import Item, Schema, integer, read_toml, string, suggest
from dvtcli.files.user_folders import family_path, file_state, user_folder

_HEADER = re.compile(r"\s*\[+(?!\[)([^\]]+)\]+\s*(?:#.*)?")


class Reason(NamedTuple):
    """A key (with its tables, `store.timeout_s`), its value as written, and why; *line* is from 1.

    *reason* is the comment behind the value, else the comment above the table; empty if none.
    """

    key: str
    value: str
    reason: str
    line: int


def reasons(text: str) -> Iterator[Reason]:
    """Iterate over values in a profile's *text* that have a line of their own."""
    table = above = previous = ""
    for number, line in enumerate(text.splitlines(), 1):
        content, comment = split_comment(line)
        if header := _HEADER.fullmatch(line):
            table, above = f"{header[1].strip()}.", comment or split_comment(previous)[1]
        elif "=" in content:
            key, _, value = content.partition("=")
            yield Reason(table + key.strip(), value.strip(), comment or (above if table else ""), number)
        previous = line


def split_comment(line: str) -> tuple[str, str]:
    """Split a line into contents and comment; a `#` inside a TOML string begins none."""
    quote = ""
    for place, char in enumerate(line):
        if quote:
            quote = "" if char == quote else quote
        elif char in "\"'":
            quote = char
        elif char == "#":
            return line[:place], line[place + 1 :].strip()
    return line, ""


_FOLDER, _FILES = "standard", ("cia301.toml", "cia401.toml", "cia402.toml")


@cache
def standards() -> tuple[Standard, ...]:
    """Return all standards, read once."""
    return tuple(_read(name) for name in _FILES)


def _read(name: str) -> Standard:
    text = family_path(_FOLDER, name).read_text(encoding="utf-8")
    said = read_toml(text, f"{_FOLDER}/{name}").table(_KEYS, required=_KEYS)
    return Standard(said["number"], said["physical"], said["names"])


def _names(item: Item) -> dict[int, str]:
    return {int(member.key, 16): normalised(string(member)) for member in item.items()}


_KEYS: Schema = {"number": integer(301, 999), "physical": physical_rules, "names": _names}


#: Maximum size of a profile (bytes), normally a page of text.
_MOST_BYTES = 1_000_000
#: The profile's file in the folder of a simulated family.
_FILE = "profile.toml"
#: the user's own files, each with its `file_state`
OwnFiles = tuple[tuple[Path, tuple[int, ...]], ...]


def folder() -> Path:
    """Return the folder of the user's own profiles, existing or not."""
    return user_folder("config") / "profiles"


def own_names() -> tuple[str, ...]:
    """Return the names of the user's own profiles, sorted, without opening files."""
    return tuple(sorted(path.stem for path in _own_paths()))


def _own_paths() -> list[Path]:
    """Return the user's own files, sorted. Does not use `glob`, which is slow: each node of a bus asks for them."""
    own = folder()
    try:
        names = sorted(os.listdir(own))  # noqa: PTH208 - `iterdir` makes a Path of every name
    except (FileNotFoundError, NotADirectoryError, PermissionError):  # then the built-in profiles count
        return []
    return [own / name for name in names if os.path.normcase(name).endswith(".toml")]


def _own_files() -> OwnFiles:
    """Return the present state of the user's own files, to detect outdated caches."""
    found = []
    for path in _own_paths():
        with suppress(OSError):  # a link to nowhere: whoever reads it says so
            found.append((path, file_state(path)))
    return tuple(found)


def profile_names() -> tuple[str, ...]:
    """Return the names of all profiles, sorted, without opening files."""
    return tuple(sorted({*builtin_names(), *own_names()}))


def profile_path(name: str) -> Path:
    """Return the file of profile *name*. Raises UsageError, with the nearest name as hint, if unknown."""
    if name in own_names():
        return folder() / f"{name}.toml"
    if name in builtin_names():
        return builtin_path(name)
    hint = suggest(name, profile_names()) or ", ".join(profile_names())
    raise UsageError(f"unknown profile {name!r}", hint=hint)


def profile_text(name: str) -> str:
    """Return the text of profile *name*. Raises InputFileError if it is not text of a sensible size."""
    return _text(profile_path(name))


def _text(path: Path) -> str:
    try:
        data = read_input(path, _MOST_BYTES, "profile")
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as wrong:
        number = data[: wrong.start].count(b"\n") + 1
        raise InputFileError(f"{path}: not UTF-8 text", place=f"{path}:{number}") from wrong
    except OSError as failed:
        raise InputFileError(f"{path}: {failed.strerror or failed}", place=str(path)) from failed


def has_profile(family: Path) -> bool:
    """Whether the folder *family* of a simulated device has a profile."""
    return os.path.isfile(family / _FILE)  # noqa: PTH113 - Path raises for a name that is too long


def load_folder_profile(family: Path) -> DeviceProfile:
    """Load the profile in the folder *family*. Raises InputFileError with line and key if malformed."""
    path = family / _FILE
    return read_profile(_text(path), str(path))


def load_profile(name: str) -> DeviceProfile:
    """Load the profile *name*.

    Raises UsageError if unknown, InputFileError with line and key if malformed.
    """
    return _loaded(name, _own_files())


@cache
def _loaded(name: str, _own: OwnFiles) -> DeviceProfile:
    path = profile_path(name)
    profile = read_profile(profile_text(name), str(path)) if name in own_names() else builtin_profile(name)
    if profile.name != name:
        raise InputFileError(
            f"{path}: the profile is called {profile.name!r}, and its file {path.name}",
            place=str(path),
            hint="give both the same name",
        )
    return profile


def profile_for_identity(vendor_id: int, product_code: int) -> DeviceProfile:
    """Return the profile for an identity (0x1018:1 and :2), the generic profile if none fits.

    A profile for the exact product ranks before a mask, and a mask before all of the vendor's products; among equals
    the user's own ranks first.
    """
    return _fitting(vendor_id, product_code, profile_names(), _own_files())


def builtin_for_identity(vendor_id: int, product_code: int) -> DeviceProfile:
    """Return the built-in profile for an identity, ignoring the user's own."""
    return _fitting(vendor_id, product_code, tuple(builtin_names()), _own_files())


@cache
def _fitting(vendor_id: int, product_code: int, names: tuple[str, ...], _own: OwnFiles) -> DeviceProfile:
    own = set(own_names())
    possible = (name for name in names if name in own or may_be_of(name, vendor_id))
    fitting = [profile for profile in map(load_profile, possible) if profile.matches(vendor_id, product_code)]
    fitting.sort(
        key=lambda profile: (product_code in profile.product_codes, bool(profile.product_masks), profile.name in own)
    )
    return fitting[-1] if fitting else load_profile("generic")


def passcode_objects() -> frozenset[ObjectAddress]:
    """Return the passcode objects of all families, whose values must be kept secret."""
    return _passcode_objects(_own_files())


@cache
def _passcode_objects(_own: OwnFiles) -> frozenset[ObjectAddress]:
    profiles = map(load_profile, profile_names())
    return frozenset(profile.login.passcode for profile in profiles if profile.login is not None)


def profile_of(dictionary: ObjectDictionary | None) -> DeviceProfile:
    """Return the profile for a file's device (`[DeviceInfo]`), the generic profile if unnamed."""
    if dictionary is None or dictionary.info.vendor_id is None:
        return GENERIC
    return profile_for_identity(dictionary.info.vendor_id, dictionary.info.product_code or 0)
