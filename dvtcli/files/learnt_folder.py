"""The folder of `learn --save`: a profile, an equivalent simulated family, the EDS, and the values."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.learning.probe import Conclusions, Learnt, Value
from dvtcli.domain.profile import DeviceProfile
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.device_file import DEVICE_SUFFIXES
from dvtcli.files.input_file import read_input, read_input_head
from dvtcli.files.profiles import folder as profile_folder
from dvtcli.files.profiles import read_profile
from dvtcli.files.sim_state import Kept, read_state, write_state

#: Keys whose numbers are abort codes.
_CODES = ("absent.", "answers.", "tpdo_dummies", "wrong_signature", "wrong_state", "save_answer")


def toml_text(head: Iterable[str], rows: Iterable[Learnt]) -> str:
    """Return the lines *head*, then *rows*; rows with a dot in their key go into tables."""
    plain, tables = [], dict[str, list[str]]()
    for row in rows:
        table, _, key = row.key.rpartition(".")
        line = f"{key if key.replace('_', '').isalnum() else _quoted(key)} = {_value(row)}  # {_one_line(row.evidence)}"
        if table:
            tables.setdefault(table, []).append(line)
        else:
            plain.append(line)
    text = [*head, "", *plain]
    for table, lines in tables.items():
        text += ["", f"[{table}]", *lines]
    return "\n".join(text) + "\n"


def quoted(text: str) -> str:
    """Return *text* as a TOML string on one line."""
    return _quoted(_one_line(text))


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _one_line(text: str) -> str:
    """Replace characters of *text*, from a device or file, that end a comment or a string."""
    return "".join(char if char.isprintable() else "?" for char in text)


def _value(row: Learnt) -> str:
    if isinstance(row.value, int) and not isinstance(row.value, bool) and row.key.startswith(_CODES):
        return f"0x{row.value:08X}" if row.value else "0"
    if row.key.startswith("pdo_types.") and isinstance(row.value, list):
        return "[" + ", ".join(_type_range(each) for each in row.value if isinstance(each, list)) + "]"
    return _plain(row.value)


def _type_range(each: list[Value]) -> str:
    first, last, code = each
    return f"[{first}, {last}, 0x{code:08X}]" if code else f"[{first}, {last}, 0]"


def _plain(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(_plain, value)) + "]"
    return _quoted(value) if isinstance(value, str) else str(value)


PROFILE, SIMULATED, FOUND = "profile.toml", "simulated.toml", "found.json"
#: The first line of every file that `learn` writes.
_MARK = "# Learnt by dvtcli"


@dataclass(frozen=True, slots=True)
class Origin:
    """A learnt family's *name*, *title*, similar profile and family, *vendor* and *product* (0x1018).

    *said* are comment lines: when, from which node.
    """

    name: str
    title: str
    like_profile: str
    like_family: str
    vendor: int | None
    product: int | None
    said: Sequence[str]


_OTHER_NAME = Hint(Action.GIVE_NAME, why="{} takes another name")


def refuse_foreign(name: str) -> None:
    """Raise UsageError if a folder or profile *name* exists that was not learnt."""
    folder = Path(name)
    for own in (own_path(name), own_family_path(name)):
        if own.exists() and not is_learnt(own):
            raise UsageError(f"{own} exists, and was not learnt", hint=_OTHER_NAME)
    if not folder.exists():
        return
    if not folder.is_dir() or not all(is_learnt(folder / name) for name in (PROFILE, SIMULATED)):
        raise UsageError(f"{folder} exists, and was not learnt", hint=_OTHER_NAME)


def kept_profiles(name: str) -> Iterator[tuple[Path, DeviceProfile]]:
    """Iterate over profiles saved as *name* with their paths: in the folder, and the user's own.

    Raises InputFileError if a profile is malformed.
    """
    for path in (Path(name) / PROFILE, own_path(name)):
        if path.exists():
            yield path, read_profile(read_input(path, 1 << 20, "profile").decode("utf-8"), str(path))


def is_learnt(path: Path) -> bool:
    """Whether `learn` wrote the file at *path*."""
    try:
        return read_input_head(path, len(_MARK.encode())) == _MARK.encode()
    except (OSError, InputFileError):
        return False


def profile_text(origin: Origin, learnt: Conclusions) -> str:
    """Return the profile as TOML, each value with its evidence."""
    known = bool(origin.vendor)
    head = [
        *_mark(origin),
        "",
        f"like = {quoted(origin.like_profile)}  # what was not asked is as there",
        "learnt = true  # from a device: it shares its evidence with the simulated family beside it",
        f"name = {quoted(origin.name)}  # as it was saved",
        f"title = {quoted(origin.title)}  # the device's name in its EDS, or its family's",
        f"vendor_ids = [{f'0x{origin.vendor:X}' if known else ''}]  # learnt: 0x1018:01",
        f"product_codes = [{f'0x{origin.product or 0:X}' if known else ''}]  # learnt: 0x1018:02",
    ]
    return toml_text(head, learnt.profile)


def simulated_text(origin: Origin, learnt: Conclusions) -> str:
    """Return the simulated family as TOML, each value with its evidence."""
    head = [
        *_mark(origin),
        "# It shares its evidence with the profile beside it: neither is a second opinion on the other.",
        "",
        f"like = {quoted(origin.like_family)}  # what was not asked is as there",
        "learnt = true",
        f"title = {quoted(origin.title)}",
        f"about = {quoted(f'learnt from a device, as {origin.name}')}",
    ]
    return toml_text(head, learnt.family)


def _mark(origin: Origin) -> list[str]:
    return [f"{_MARK}: {origin.said[0]}", *(f"# {line}" for line in origin.said[1:])]


def found_state(folder: Path) -> Kept:
    """Return the node-ID and values of the device before learning; empty if *folder* has none.

    Raises InputFileError if the file is malformed.
    """
    return read_state(folder / FOUND)


def write_folder(folder: Path, origin: Origin, learnt: Conclusions, eds: Path | str, found: Kept) -> list[Path]:
    """Write the family and its EDS into *folder*, and copies to the user's own; returns the files in order.

    *eds* is a file to copy, or a text; *found* is the initial state of the simulated device.
    """
    folder.mkdir(exist_ok=True)
    files = {PROFILE: profile_text(origin, learnt), SIMULATED: simulated_text(origin, learnt)}
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    write_state(folder / FOUND, found.node_id or 1, found.values)
    target = _write_eds(folder, origin.name, eds)
    own = {own_family_path(origin.name): files[SIMULATED], own_path(origin.name): files[PROFILE]}
    for path, text in own.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return [*(folder / name for name in (*files, FOUND)), target, *own]


def _write_eds(folder: Path, name: str, eds: Path | str) -> Path:
    """Write *eds* into *folder* as the only EDS; removes others except the source."""
    source = None if isinstance(eds, str) else eds.resolve()
    target = folder / f"{name}{'.eds' if source is None else source.suffix.lower()}"
    for old in folder.iterdir():
        if old.suffix.lower() in DEVICE_SUFFIXES and old != target and old.resolve() != source:
            old.unlink()
    if isinstance(eds, str):
        target.write_text(eds, encoding="utf-8", newline="\r\n")
    elif source != target.resolve():
        shutil.copyfile(eds, target)
    return target


def own_path(name: str) -> Path:
    """Return the path of the user's profile *name*, by which nodes of its identity are recognised."""
    return profile_folder() / f"{name}.toml"


def own_family_path(name: str) -> Path:
    """Return the path of the simulated family for the learnt profile *name*, used for dry runs."""
    return profile_folder().parent / "families" / f"{name}.toml"
