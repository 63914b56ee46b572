"""A file's statements about itself and its device: [FileInfo], [DeviceComissioning], and an XDD's body attributes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from dvtcli.errors import InputFileError
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import MOST_BYTES, EditedText, section_values, split_sections
from dvtcli.files.eds.reader import EdsFile
from dvtcli.files.input_file import read_input

if TYPE_CHECKING:
    from dvtcli.files.xdd.xdd_reader import XddFile

#: Keys about the new file itself, not about its original.
NEW = frozenset({"FileName"})
#: The date in an XDD (mandatory) if the description's date is unknown.
NO_DATE = "1970-01-01"
_KEYS = (
    "FileName", "FileVersion", "FileRevision", "EDSVersion", "Description", "CreationTime", "CreationDate", "CreatedBy",
    "ModificationTime", "ModificationDate", "ModifiedBy", "LastEDS",
)  # fmt: skip
_STANDARD = {key.lower(): key for key in _KEYS}
_DATE, _TIME = "%m-%d-%Y", "%I:%M%p"
#: Keys that are attributes of an XDD: which, and the form that a date or a time has in an EDS and there.
_ATTRIBUTES = {
    "CreatedBy": ("fileCreator", None), "FileVersion": ("fileVersion", None),
    "CreationDate": ("fileCreationDate", (_DATE, "%Y-%m-%d")),
    "CreationTime": ("fileCreationTime", (_TIME, "%H:%M:%S")),
    "ModifiedBy": ("fileModifiedBy", None),
    "ModificationDate": ("fileModificationDate", (_DATE, "%Y-%m-%d")),
    "ModificationTime": ("fileModificationTime", (_TIME, "%H:%M:%S")),
}  # fmt: skip
#: Forms known to an XDD only
_OF_XDD = {
    "CreationDate": re.compile(r"\d{4}-.*"),
    "CreationTime": re.compile(r"[^:\n]*:[^:\n]*:.*"),
    "ModificationDate": re.compile(r"\d{4}-.*"),
    "ModificationTime": re.compile(r"[^:\n]*:[^:\n]*:.*"),
    "FileVersion": re.compile(r"[^.\n]*\..*"),
}


def file_info(file: EdsFile | XddFile) -> dict[str, str]:
    """Return the self-description of *file* by keys of FileInfo, without empty keys and `NEW` keys of a copy."""

    if isinstance(file, EdsFile):
        said = {_STANDARD.get(key, one.key): one.value for key, one in file.values("fileinfo").items()}
    else:
        body = next(file.tree.root.anywhere("ProfileBody"), None)
        said = {} if body is None else dict(_of_attributes(body.attributes))
    return {key: value for key, value in said.items() if value and key not in NEW}


def _of_attributes(attributes: Mapping[str, str]) -> list[tuple[str, str]]:
    found = []
    for key, (name, forms) in _ATTRIBUTES.items():
        value = attributes.get(name, "").strip().removeprefix(NO_DATE)
        found.append((key, value if forms is None else _in_form(value, forms[1], forms[0]) or value))
    return found


def as_attributes(said: Mapping[str, str]) -> dict[str, str]:
    """Convert *said* to attributes of an XDD, as far as possible."""
    found = {}
    for key, (name, forms) in _ATTRIBUTES.items():
        value = said.get(key, "")
        if text := value if forms is None else _in_form(value, *forms):
            found[name] = text
    return found


def in_order(said: Mapping[str, str]) -> dict[str, str]:
    """The keys *said* in the order in which the standard has them, others behind them."""
    return {key: said[key] for key in (*_KEYS, *said) if key in said}


def as_keys(said: Mapping[str, str]) -> dict[str, str]:
    """Limit *said* to values of FileInfo: of an XDD no seconds, no zone and no version with a point."""
    return {key: value for key, value in said.items() if key not in _OF_XDD or not _OF_XDD[key].fullmatch(value)}


def _in_form(value: str, before: str, after: str) -> str:
    """Convert a date or time from form *before* to *after*; empty if *value* does not fit or would lose detail."""
    try:
        text = datetime.strptime(value.strip().upper(), before).strftime(after)
        back = datetime.strptime(text, after).strftime(before)
    except ValueError:
        return ""
    return text if back.lstrip("0") == value.strip().upper().lstrip("0") else ""


_FILE_INFO, _DEVICE_INFO, _COMMISSIONING = "FileInfo", "DeviceInfo", "DeviceComissioning"
_MAKER = "dvtcli"


class Device(Protocol):
    """The device of a DCF."""

    @property
    def file_name(self) -> str:
        """The name of the DCF."""
        ...

    @property
    def node_id(self) -> int:
        """The node-ID."""
        ...

    @property
    def made(self) -> datetime:
        """The time of reading."""
        ...

    @property
    def bit_rate_kbit(self) -> int | None:
        """The bit rate of the bus (kbit/s)."""
        ...

    @property
    def serial(self) -> int | None:
        """The serial number (0x1018:4)."""
        ...

    @property
    def revision(self) -> int | None:
        """The revision number (0x1018:3)."""
        ...


def write_device_keys(eds: EdsFile, text: EditedText, source: str, device: Device) -> None:
    """Write author, date, *source* and node data into the device sections of *text*."""
    _set_keys(eds, text, _FILE_INFO, _file_info(eds, source, device), before_first=True)
    if device.revision not in (None, eds.dictionary.info.revision_number):  # it is of the device, not of its EDS
        _set_keys(eds, text, _DEVICE_INFO, {"RevisionNumber": f"0x{device.revision:08X}"})
    said = {"NodeID": device.node_id, "Baudrate": device.bit_rate_kbit, "LSS_SerialNumber": device.serial}
    keys = {key: str(value) for key, value in said.items() if value is not None}
    _set_keys(eds, text, _COMMISSIONING, keys, gone=[key.lower() for key, value in said.items() if value is None])


def is_read_out(path: Path) -> bool:
    """Whether the file at *path* is a DCF that dvtcli made from a device, so that each value was read."""
    try:
        sections = split_sections(read_input(path, MOST_BYTES, "DCF")).sections
    except (OSError, InputFileError):
        return False
    values = section_values([section for section in sections if section.name.lower() == _FILE_INFO.lower()], Findings())
    return "lasteds" in values and "modifiedby" in values and values["modifiedby"].value == _MAKER


def _file_info(eds: EdsFile, source: str, device: Device) -> dict[str, str]:
    """Return the new keys of [FileInfo]; a DCF keeps the name of its original EDS."""
    made = {"ModificationTime": device.made.strftime("%I:%M%p"), "ModificationDate": device.made.strftime("%m-%d-%Y"),
            "ModifiedBy": _MAKER}  # fmt: skip
    of_dcf = "devicecomissioning" in eds.layout.device and eds.values(_FILE_INFO).get("lasteds") is not None
    return {"FileName": device.file_name, **made, **({} if of_dcf else {"LastEDS": source})}


def _set_keys(
    eds: EdsFile,
    text: EditedText,
    section: str,
    keys: Mapping[str, str],
    *,
    before_first: bool = False,
    gone: list[str] | None = None,
) -> None:
    """Set *keys* in *section* and remove *gone*; adds the section if the file has none."""
    parts = eds.layout.device.get(section.lower(), [])
    if not parts:
        lines = [f"[{section}]", *(f"{key}={_fitting(text, value)}" for key, value in keys.items())]
        _add_section(eds, text, lines, before_first=before_first)
        return
    given = section_values(parts, Findings())
    last = max((value.line for value in given.values()), default=parts[-1].line)
    for key, value in keys.items():
        if key.lower() in given:
            if given[key.lower()].value != value:
                text.set_value(given[key.lower()].line, _fitting(text, value), is_text=True)
        else:
            text.insert_key(last, key, _fitting(text, value))
    for key in gone or ():
        if key in given:
            text.remove(given[key].line)


def _add_section(eds: EdsFile, text: EditedText, lines: list[str], *, before_first: bool) -> None:
    """Insert a section before the first, or before the lists of objects; append if the file has none."""
    lists = [parts[0].line for name, parts in eds.layout.device.items() if name.endswith("objects")]
    first = eds.text.sections[0].line if before_first else min(lists, default=0)
    if first:
        text.insert(first - 1, [*lines, ""])
    else:
        text.insert(text.last_line, ["", *lines])


def _fitting(text: EditedText, value: str) -> str:
    """Replace characters of *value* that end a line, steer a terminal or are missing in the file's encoding."""
    return "".join(char if char.isprintable() and text.can_hold(char) else "?" for char in value).strip()
