"""What a device's file says about itself: [FileInfo] of an EDS or DCF, the attributes of the body of an XDD or XDC.

In the keys and the form of an EDS (CiA 306, FileInfo). Does not know what the file says about the device.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import datetime
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.files.eds.reader import EdsFile
    from dvtcli.files.xdd.xdd_reader import XddFile

#: What is true of the file that is written, and not of the one it was made of.
NEW = frozenset({"FileName"})
#: What an XDD, which must say a date, says where nobody knows when the description was made.
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
#: What only an XDD says so
_OF_XDD = {
    "CreationDate": re.compile(r"\d{4}-.*"),
    "CreationTime": re.compile(r"[^:\n]*:[^:\n]*:.*"),
    "ModificationDate": re.compile(r"\d{4}-.*"),
    "ModificationTime": re.compile(r"[^:\n]*:[^:\n]*:.*"),
    "FileVersion": re.compile(r"[^.\n]*\..*"),
}


def file_info(file: EdsFile | XddFile) -> dict[str, str]:
    """What *file* says about itself by the keys of FileInfo, without what is empty and what is `NEW` in a copy."""
    from dvtcli.files.eds.reader import EdsFile

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
    """Those of the keys *said* that an XDD can say, as its attributes."""
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
    """Those of the keys *said* that FileInfo can say: of an XDD no seconds, no zone and no version with a point."""
    return {key: value for key, value in said.items() if key not in _OF_XDD or not _OF_XDD[key].fullmatch(value)}


def _in_form(value: str, before: str, after: str) -> str:
    """A date or a time in another form; empty where it has not the one *before*, or would lose anything."""
    try:
        text = datetime.strptime(value.strip().upper(), before).strftime(after)
        back = datetime.strptime(text, after).strftime(before)
    except ValueError:
        return ""
    return text if back.lstrip("0") == value.strip().upper().lstrip("0") else ""
