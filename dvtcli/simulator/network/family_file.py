"""Read families of simulated devices from `families/NAME/simulated.toml`; errors name line and key.

The keys are those of `Family`, plus `like`, the base family of the file; each key replaces the base's whole value.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TypeVar

from dvtcli.domain.nmt import NmtState
from dvtcli.domain.object_dictionary import Access
from dvtcli.domain.pdo import Direction
from dvtcli.domain.profile import BitPolicy
from dvtcli.errors import InputFileError
from dvtcli.files.device_file import DEVICE_SUFFIXES
from dvtcli.files.input_file import read_input
from dvtcli.files.toml_item import (
    Item,
    Schema,
    alternatives,
    boolean,
    each_of,
    integer,
    integers,
    members,
    number_range,
    number_ranges,
    object_address,
    one_of,
    read_toml,
    string,
    suggest,
)
from dvtcli.files.user_folders import families_with, family_path
from dvtcli.simulator.device.family import GENERIC, ErrorList, Family, Login, MotorCopy, PinCopy
from dvtcli.simulator.device.pdo_checks import CHECKS

#: The one thing that moves in a simulation: a CiA 402 motor.
_PLANT = "cia402"
_T = TypeVar("_T")


def _numbered(high: int, read: Callable[[Item], _T]) -> Callable[[Item], dict[int, _T]]:
    """A reader of tables with numeric keys within 0..*high*, decimal or with 0x."""
    return lambda item: {_number(member, high): read(member) for member in item.items()}


def _number(item: Item, high: int) -> int:
    try:
        number = int(item.key, 0)
    except ValueError:
        item.fail("the key must be a number")
    if not 0 <= number <= high:
        item.fail(f"the key is not within 0..{high}")
    return number


def _accesses(item: Item) -> frozenset[Access]:
    return frozenset(one_of(Access)(member) for member in members(item))


def _login(item: Item) -> Login:
    return Login(**item.table(_LOGIN, required=(key for key in _LOGIN if key != "start")))


def _pins(item: Item) -> tuple[PinCopy, ...]:
    return tuple(PinCopy(**member.table(_PIN, required=("selector", "pins", "to_pin"))) for member in members(item))


def _motors(item: Item) -> MotorCopy:
    return MotorCopy(**item.table(_MOTOR, required=_MOTOR))


def _error_list(item: Item) -> ErrorList:
    return ErrorList(**item.table(_ERROR_LIST, required=_ERROR_LIST))


def _plant(item: Item) -> str:
    if string(item) != _PLANT:
        item.fail(f"must be {_PLANT}, not {item.shown}")
    return _PLANT


def _of_some(read: Callable[[Item], _T]) -> Callable[[Item], dict[Direction, _T]]:
    """A reader of tables by direction; a direction may be missing."""
    names = [way.value for way in Direction]
    return lambda item: {Direction(key): given for key, given in item.table(dict.fromkeys(names, read)).items()}


def _answers(item: Item) -> dict[str, int]:
    """Abort codes by the names of checks."""
    return item.table(dict.fromkeys(CHECKS, _ABORT))


def _types(item: Item) -> tuple[tuple[int, int, int], ...]:
    """Ranges of transmission types, each with its abort code."""
    found = []
    for member in members(item):
        numbers = integers(0, 0xFFFF_FFFF)(member)
        if len(numbers) != 3 or not numbers[0] <= numbers[1] <= 255:
            item.fail(f"must be a first and a last type and an abort code, not {member.shown}")
        found.append((numbers[0], numbers[1], numbers[2]))
    return tuple(found)


def _absent(item: Item) -> dict[tuple[int, int], int]:
    """Abort codes by objects: `1803:05` is a sub-index, `1804` a whole object."""
    return {_place(member): integer(1, 0xFFFF_FFFF)(member) for member in item.items()}


def _place(item: Item) -> tuple[int, int]:
    found = re.fullmatch(r"([0-9A-F]{4})(?::([0-9A-F]{2}))?", item.key)
    if not found:
        item.fail("the key must be an object such as 1804 or '1803:05'")
    return int(found[1], 16), int(found[2] or "0", 16)


def _boot_state(item: Item) -> NmtState:
    words = [state.name for state in NmtState]
    if item.value not in words:
        item.fail(f"must be {alternatives(words)}, not {item.shown}", suggest(str(item.value), words))
    return NmtState[str(item.value)]


_INDEX = integer(1, 0xFFFF)
_ABORT = integer(0, 0xFFFF_FFFF)
_LOGIN: Schema = {
    "index": _INDEX,
    "level": integer(1, 0xFF),
    "writes": number_ranges(0xFFFF),
    "passcodes": _numbered(0xFFFF, integer(0, 0xFF)),
    "start": integer(0, 0xFF),
}
_PIN: Schema = {
    "selector": _INDEX,
    "pins": lambda item: tuple(object_address(member) for member in members(item)),
    "to_pin": boolean,
    "bitwise": boolean,
}
_MOTOR: Schema = {
    "selector": _INDEX,
    "down": _numbered(0xFF, object_address),
    "up": _numbered(0xFF, object_address),
}
_ERROR_LIST: Schema = {"count": object_address, "position": object_address, "code": object_address}
FAMILY_KEYS: Schema = {
    "title": string,
    "about": string,
    "absent": _absent,
    "granularity": integer(1, 64),
    "max_entries": integer(1, 64),
    "max_entry_bits": integer(1, 64),
    "dummies": lambda item: frozenset(integers(1, 7)(item)),
    "rtr_bit": each_of(Direction, one_of(BitPolicy)),
    "extended_ids": boolean,
    "transmission_types": number_ranges(255),
    "rpdo_counts_syncs": boolean,
    "reports_long_rpdos": boolean,
    "answers_remote_frames": boolean,
    "tpdo_access": _accesses,
    "rpdo_access": _accesses,
    "pdo_rules_always": boolean,
    "mapping_in_use": _ABORT,
    "same_mapping_accepted": boolean,
    "entry_length_checked": boolean,
    "entry_access_codes": boolean,
    "tpdo_dummies": _ABORT,
    "count_within_entries": boolean,
    "empty_entries_counted": boolean,
    "zero_bits_counted": boolean,
    "empty_pdos_enabled": boolean,
    "restricted_ids_refused": boolean,
    "answers": _of_some(_answers),
    "pdo_types": _of_some(_types),
    "max_inhibit_time": integer(0, 0xFFFF),
    "max_event_timer": integer(0, 0xFFFF),
    "filler": integer(0, 0xFFFF_FFFF),
    "pre_operational_writes": number_ranges(0xFFFF),
    "wrong_state": _ABORT,
    "needs_store": number_range(0xFFFF),
    "save_command": object_address,
    "store_capability": integer(0, 0xFFFF_FFFF),
    "restore_capability": integer(0, 0xFFFF_FFFF),
    "wrong_signature": _ABORT,
    "save_answer": _ABORT,
    "store_lasts": boolean,
    "communication_reset_reloads": boolean,
    "clears_stamp": boolean,
    "login": _login,
    "extended_error": object_address,
    "reasons": _numbered(0xFFFF_FFFF, integer(0, 0xFFFF)),
    "error_list": _error_list,
    "state_object": object_address,
    "state_request": object_address,
    "master_object": object_address,
    "stays_operational": boolean,
    "block_size": integer(0, 127),
    "block_crc": boolean,
    "boot_loader": boolean,
    "flash_busy": _ABORT,
    "pins": _pins,
    "motors": _motors,
    "plant": _plant,
    "boot_state": _boot_state,
    "boot_up_message": boolean,
    "lss_echo": boolean,
    "lss_wakes": boolean,
    "lss_tells_pending": boolean,
    "learnt": boolean,
    "modules": integers(1, 0xFFFF),
}


_FILE = "simulated.toml"


def family_names() -> tuple[str, ...]:
    """The families included with dvtcli, in alphabetical order; opens no file."""
    return families_with(_FILE)


@cache
def family_eds(name: str) -> Path:
    """The EDS file of family *name*, or of its base family. Raises KeyError for an unknown family."""
    like = next((item for item in _read(name).items() if item.key == "like"), None)
    chosen = name if like is None else _known(like)
    return family_path(chosen, f"{chosen}.eds")


def family_of(eds: Path) -> str | None:
    """The family with the EDS file *eds*, or None."""
    return next((name for name in family_names() if family_eds(name) == eds), None)


@cache
def load_family(name: str) -> Family:
    """Read family *name*. Raises KeyError for an unknown family, InputFileError for an invalid file."""
    if name not in family_names():
        raise KeyError(name)
    return read_family(name, family_path(name, _FILE).read_text(encoding="utf-8"), f"{name}/{_FILE}")


def is_family_folder(text: str) -> bool:
    """True if *text* is the path of a folder with a family's `simulated.toml`."""
    return os.path.isfile(os.path.join(text, _FILE))  # noqa: PTH113, PTH118 - Path raises for a name that is too long


def load_family_folder(folder: Path) -> Family:
    """Read the family in the `simulated.toml` of *folder*. Raises InputFileError if invalid."""
    path = folder / _FILE
    return read_family(folder.resolve().name, read_text(path), str(path))


def family_folder_eds(folder: Path) -> Path:
    """The EDS in *folder*, else the EDS of its base family. Raises InputFileError for none or several."""
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in DEVICE_SUFFIXES)
    if len(files) == 1:
        return files[0]
    path = folder / _FILE
    like = next((item for item in read_toml(read_text(path), str(path)).items() if item.key == "like"), None)
    if files or like is None:
        raise InputFileError(f"{folder}: {len(files) or 'no'} EDS files, where a family has one", place=str(folder))
    return family_eds(_known(like))


def read_text(path: Path) -> str:
    """The text of *path*. Raises InputFileError if unreadable as UTF-8."""
    try:
        return read_input(path, 1 << 20, "simulated device").decode("utf-8")
    except (OSError, UnicodeDecodeError) as failed:
        raise InputFileError(f"{path}: {getattr(failed, 'strerror', None) or failed}", place=str(path)) from failed


def read_family(name: str, text: str, source: str) -> Family:
    """The family *name* in *text*; *source* is the file name for messages.

    Raises InputFileError at `FILE:LINE` for broken TOML, an unknown key or an invalid value.
    """
    return _family(name, read_toml(text, source))


def _read(name: str) -> Item:
    if name not in family_names():
        raise KeyError(name)
    return read_toml(family_path(name, _FILE).read_text(encoding="utf-8"), f"{name}/{_FILE}")


def _family(name: str, item: Item) -> Family:
    given = item.table({"like": lambda item: load_family(_known(item)), **FAMILY_KEYS})
    base: Family = given.pop("like", GENERIC)
    return base._replace(name=name, **given)


def _known(item: Item) -> str:
    """The name of an existing family."""
    name = string(item)
    if name not in family_names():
        item.fail(f"unknown family {name!r}", suggest(name, family_names()))
    return name
