"""Find device profiles: built-in profiles, and the user's own in the configuration folder.

A user's profile replaces a built-in profile of the same name.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from dvtcli.domain.object_dictionary import ObjectDictionary, normalised
from dvtcli.domain.object_scalings import ObjectRange, ScalingRule, Standard
from dvtcli.domain.pdo import Direction
from dvtcli.domain.process_data import STATES
from dvtcli.domain.profile import (
    CRC32,
    GENERIC,
    BitPolicy,
    DeviceProfile,
    FaultList,
    KnownFault,
    LoginPolicy,
    MappingAdvice,
    ObjectAddress,
    PreOperational,
    Severity,
    StepKind,
    StorePolicy,
    VpdoGroup,
)
from dvtcli.domain.scaling import Scaling, State, parse_exact_scale, parse_factor, spelled
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.input_file import read_input
from dvtcli.files.toml_item import (
    Item,
    Schema,
    alternatives,
    boolean,
    by_number,
    each_of,
    integer,
    integers,
    key_range,
    members,
    number_range,
    number_ranges,
    object_address,
    one_of,
    pair,
    read_toml,
    seconds,
    string,
    suggest,
)
from dvtcli.files.user_folders import families_with, family_path, file_state, user_folder

if TYPE_CHECKING:
    from dvtcli.domain.object_scalings import Rules

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


def physical_rules(item: Item) -> dict[ObjectRange, ScalingRule]:
    """Read meanings (`"1/256 V"`, or a table) by objects (`"5100:01"`, `"6C01:01-05"`, `2220-2224`)."""
    return {_place(member): _meaning(member) for member in item.items()}


def _place(item: Item) -> ObjectRange:
    match = _PLACE.fullmatch(item.key)
    if match is None:
        item.fail("the key must be an object such as 5100:01, or several: 2220-2224, 6C01:01-05")
    first, sub = int(match["first"], 16), int(match["sub"] or "0", 16)
    place = ObjectRange(first, int(match["last"] or match["first"], 16), sub, int(match["last_sub"] or f"{sub:X}", 16))
    if place.first > place.last or place.first_sub > place.last_sub:
        item.fail("the lower number comes first")
    return place


def _meaning(item: Item) -> ScalingRule:
    if isinstance(item.value, str):
        try:
            factor, unit = parse_exact_scale(string(item))
        except ValueError as wrong:
            item.fail(str(wrong))
        return ScalingRule(Scaling(unit, factor))
    said = item.table(_MEANING)
    if not said:
        item.fail("says nothing: give a unit, a factor, values or bits")
    numbered = {key: said.pop(key) for key in ("numbered", "per") if key in said}
    return ScalingRule(Scaling(**said), **numbered)


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


#: The word for "no remark", since TOML has no null.
_FINE = "fine"
#: The highest number of a program of one device (CiA 302-3).
_PROGRAMS = 254
#: The lines of a built-in profile with its vendors and its base profile.
_VENDORS, _LIKE = re.compile(r"^vendor_ids = \[([^\[\]]*)\]", re.M), re.compile(r'^like = "([^"]*)"', re.M)


def builtin_names() -> tuple[str, ...]:
    """Return the names of the built-in profiles, sorted, without opening files."""
    return families_with(_FILE)


def builtin_path(name: str) -> Path:
    """Return the path of the built-in profile *name*."""
    return family_path(name, _FILE)


@cache
def builtin_profile(name: str) -> DeviceProfile:
    """Read the built-in profile *name*, once. Raises InputFileError with line and key if malformed."""
    return read_profile(builtin_path(name).read_text(encoding="utf-8"), f"{name}/{_FILE}")


def may_be_of(name: str, vendor_id: int) -> bool:
    """Whether the built-in profile *name* may apply to the vendor *vendor_id*, without parsing it."""
    text = builtin_path(name).read_text(encoding="utf-8")
    if said := _VENDORS.search(text):
        return vendor_id in [int(number, 0) for number in said[1].split(",") if number.strip()]
    base = _LIKE.search(text)
    return base is not None and may_be_of(base[1], vendor_id)


def read_profile(text: str, source: str) -> DeviceProfile:
    """Read a profile file's *text*; *source* is its name for messages.

    Raises InputFileError, its place `FILE:LINE`, for broken TOML, an unknown or missing key, a value of the wrong
    type or out of its range.
    """
    fields = read_toml(text, source).table(_PROFILE, required=("name", "title"))
    base: DeviceProfile = fields.pop("like", GENERIC)
    return replace(base, **{key: _over(getattr(base, key), value) for key, value in fields.items()})


def _over(base: Any, given: Any) -> Any:
    """Merge a profile's value over its base profile's; a table replaces only its own keys."""
    if isinstance(base, StorePolicy) and isinstance(given, dict):
        return replace(base, **given)
    return {**base, **given} if isinstance(base, dict) and isinstance(given, dict) else given


def _base(item: Item) -> DeviceProfile:
    if item.value not in builtin_names():
        item.fail(f"unknown built-in profile {item.shown}", suggest(str(item.value), builtin_names()))
    return builtin_profile(str(item.value))


def _name(item: Item) -> str:
    if not re.fullmatch(r"[a-z][a-z0-9_-]*", string(item)):
        item.fail(f"{item.shown} is not a profile name; use small letters, digits, - and _")
    return string(item)


def _masks(item: Item) -> tuple[tuple[int, int], ...]:
    masks = tuple(pair(0xFFFF_FFFF)(member) for member in members(item))
    for mask, value in masks:
        if value & ~mask:
            item.fail(f"0x{value:08X} has bits that the mask 0x{mask:08X} hides: it can never match")
    return masks


def _severity(item: Item) -> Severity | None:
    if item.value == _FINE:
        return None
    words = [*(severity.value for severity in Severity), _FINE]
    if item.value not in words:
        item.fail(f"must be {alternatives(words)}, not {item.shown}", suggest(str(item.value), words))
    return Severity(item.value)


def _aliases(item: Item) -> dict[str, str]:
    for member in item.items():
        object_address(member)
        if normalised(member.key) != member.key:
            hint = f"did you mean {normalised(member.key)!r}?"
            member.fail("an alias is written in small letters, digits and _", hint)
    return {member.key: string(member) for member in item.items()}


def _advice(item: Item) -> tuple[MappingAdvice, ...]:
    return tuple(MappingAdvice(*key_range(member, 16, 0xFFFF), string(member)) for member in item.items())


def _store(item: Item) -> dict[str, object]:
    return item.table(_STORE)


def _hints(item: Item) -> dict[StepKind, dict[int, str]]:
    tables = item.table(dict.fromkeys([kind.value for kind in StepKind], _by_abort))
    return {StepKind(key): hints for key, hints in tables.items()}


def _by_abort(item: Item) -> dict[int, str]:
    for member in item.items():
        if not re.fullmatch(r"0x[0-9A-Fa-f]{8}", member.key):
            member.fail("the key must be an abort code such as 0x06040041")
    return {int(member.key, 16): string(member) for member in item.items()}


def _login(item: Item) -> LoginPolicy:
    return LoginPolicy(**item.table(_LOGIN, required=(key for key in _LOGIN if key != "user")))


def _vpdo(item: Item) -> dict[str, VpdoGroup]:
    return {
        member.key: VpdoGroup(**member.table(_VPDO, required=("index", "values", "none"))) for member in item.items()
    }


def _fault_list(item: Item) -> FaultList:
    return FaultList(**item.table(_FAULT_LIST, required=_FAULT_LIST))


def _faults(item: Item) -> dict[int, KnownFault]:
    """Read, by error code, the meaning and the remedy: a text, or a list of the two."""
    found = {}
    for member in item.items():
        if not re.fullmatch(r"0x[0-9A-Fa-f]{4}", member.key):
            member.fail("the key must be an error code such as 0x4481")
        texts = [string(member)] if isinstance(member.value, str) else [string(part) for part in members(member)]
        if not 1 <= len(texts) <= 2:
            member.fail("must be what it means, or that and what helps")
        found[int(member.key, 16)] = KnownFault(*texts)
    return found


def _software_identification(item: Item) -> dict[int, int | str]:
    """Read, by program, the value of 0x1F56 for the right program."""
    found: dict[int, int | str] = {}
    for member in item.items():
        if not (re.fullmatch(r"[1-9][0-9]{0,2}", member.key) and int(member.key) <= _PROGRAMS):
            member.fail(f"the key must be a program, 1…{_PROGRAMS}")
        found[int(member.key)] = CRC32 if member.value == CRC32 else integer(0, 0xFFFF_FFFF)(member)
    return found


def _physical(item: Item) -> Rules:

    return physical_rules(item)


_STORE: Schema = {
    "sub_indices": integers(1, 0x7F),
    "timeout_s": seconds,
    "only_pre_operational": boolean,
    "covers": number_range(0xFFFF),
    "never_after": integers(0, 0xFFFF_FFFF),
    "instead": string,
    "saved_by": object_address,
}
_LOGIN: Schema = {
    "level": object_address,
    "passcode": object_address,
    "user_id": object_address,
    "needed": integer(1, 0xFF),
    "highest": integer(1, 0xFF),
    "covers": number_ranges(0xFFFF),
    "user": integer(1, 0xFFFF),
}
_VPDO: Schema = {
    "index": integer(1, 0xFFFF),
    "values": number_ranges(0xFFFF),
    "none": integer(0, 0xFFFF),
    "drives": number_ranges(0xFFFF),
}
_FAULT_LIST: Schema = {"count": object_address, "position": object_address, "code": object_address}
_PROFILE: Schema = {
    "like": _base,
    "name": _name,
    "title": string,
    "vendor_ids": integers(0, 0xFFFF_FFFF),
    "product_codes": integers(0, 0xFFFF_FFFF),
    "product_masks": _masks,
    "pdo_count": integer(1, 512),
    "max_entries": integer(1, 64),
    "max_entry_bits": integer(1, 64),
    "granularity": integer(1, 64),
    "rtr_bit": each_of(Direction, one_of(BitPolicy)),
    "extended_ids": boolean,
    "transmission_types": number_ranges(255),
    "event_timer_types": number_ranges(255),
    "max_time_count": integer(1, 0xFFFF),
    "partial_entries": boolean,
    "rw_in_tpdo": _severity,
    "rww_in_tpdo": _severity,
    "rw_in_rpdo": _severity,
    "pre_operational_gate": one_of(PreOperational),
    "state_object": object_address,
    "state_request": object_address,
    "master_object": object_address,
    "extended_error": object_address,
    "reasons": by_number(0xFFFF),
    "dummies": lambda item: frozenset(integers(1, 7)(item)),
    "store": _store,
    "login": _login,
    "hints": _hints,
    "reversed_entries": boolean,
    "filler": integer(0, 0xFFFF_FFFF),
    "silent_rpdo": string,
    "fault_list": _fault_list,
    "faults": _faults,
    "software_identification": _software_identification,
    "physical": _physical,
    "aliases": _aliases,
    "type_texts": by_number(255),
    "type_notes": by_number(255),
    "warn_mapped": _advice,
    "vpdo": _vpdo,
    "configuration": number_ranges(0xFFFF),
    "no_configuration": number_ranges(0xFFFF),
    "learnt": boolean,
}
_PLACE = re.compile(
    r"(?P<first>[0-9A-F]{4})(?:-(?P<last>[0-9A-F]{4}))?(?::(?P<sub>[0-9A-F]{2})(?:-(?P<last_sub>[0-9A-F]{2}))?)?"
)


def _fraction(item: Item) -> Fraction:
    """Read a number, or a text like `1/256`."""
    if isinstance(item.value, bool) or not isinstance(item.value, int | float | str):
        item.fail(f"must be a number, or a text such as '1/256', not {item.shown}")
    try:
        return parse_factor(str(item.value))
    except ValueError as wrong:
        item.fail(str(wrong))


def _offset(item: Item) -> Fraction:
    return Fraction(0) if item.value == 0 and not isinstance(item.value, bool) else _fraction(item)


def _unit(item: Item) -> str:
    return spelled(string(item))


def _texts(low: int, high: int) -> Any:
    """Return a reader of tables number -> text, numbers within *low*..*high*."""

    def read(item: Item) -> dict[int, str]:
        texts = {}
        for member in item.items():
            number = int(member.key) if re.fullmatch(r"-?[0-9]{1,10}", member.key) else None
            if number is None or not low <= number <= high:
                member.fail(f"the key must be a number within {low}..{high}")
            texts[number] = string(member)
        return texts

    return read


def _states(item: Item) -> tuple[State, ...]:
    """Read a list of [mask, bits, text], or `"statusword"` for a drive's states."""
    if item.value == "statusword":
        return tuple(State(*row) for row in STATES)
    states = []
    for member in members(item):
        parts = members(member)
        if len(parts) != 3:
            member.fail("must be a mask, the bits in it, and a text")
        mask, bits = integers(0, 0xFFFF_FFFF)(Item([parts[0].value, parts[1].value], *_rest(member)))
        if bits & ~mask:
            member.fail(f"0x{bits:X} has bits that the mask 0x{mask:X} hides: it can never match")
        states.append(State(mask, bits, string(parts[2])))
    return tuple(states)


def _rest(item: Item) -> tuple[Any, ...]:
    return item.path, item.source, item.lines


_MEANING: Schema = {
    "unit": _unit,
    "factor": _fraction,
    "offset": _offset,
    "values": _texts(-(1 << 31), (1 << 32) - 1),
    "states": _states,
    "bits": _texts(0, 63),
    "numbered": string,
    "per": integer(1, 64),
}
