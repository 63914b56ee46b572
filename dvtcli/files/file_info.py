"""A file's statements about itself: [FileInfo] of an EDS or DCF, attributes of the body of an XDD or XDC.

Uses the keys and the form of an EDS (CiA 306, FileInfo).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import datetime
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.files.eds.reader import EdsFile
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
