"""Rules about FileInfo: what a file says about itself."""

from __future__ import annotations

import re
from datetime import date

from dvtcli.domain.lint.lint_rule import NOTE, WARNING, check
from dvtcli.files.eds.ini import IniValue
from dvtcli.files.eds.keys import quoted
from dvtcli.files.eds.lint.linted_text import Found, LintedText, all_given, given
from dvtcli.files.eds.lint.needed_section import missing_keys, no_section
from dvtcli.files.eds.numbers import read_number

_SOURCE = "CiA 306, FileInfo"
_NEEDED = ("FileName", "FileVersion", "FileRevision", "EDSVersion", "Description", "CreationTime", "CreationDate",
           "CreatedBy", "ModificationTime", "ModificationDate", "ModifiedBy")  # fmt: skip
_DATE = re.compile(r"([0-9]{2})-([0-9]{2})-([0-9]{4})")
_TIME = re.compile(r"(0[1-9]|1[0-2]):[0-5][0-9](AM|PM)")


@check("no-file-info", WARNING, "there is no FileInfo", _SOURCE)
def no_file_info(text: LintedText) -> Found:
    """Nobody can tell two versions of the file."""
    return no_section(text, "FileInfo", "nobody can tell two versions of the file")


@check("missing-file-info", NOTE, "FileInfo lacks keys that it must have", _SOURCE)
def missing_file_info(text: LintedText) -> Found:
    """Said once, with all of them."""
    return missing_keys(text, "FileInfo", _NEEDED)


@check("file-name", NOTE, "FileName is not the file's name", _SOURCE)
def file_name(text: LintedText) -> Found:
    """A copy under another name, or a copied FileInfo."""
    named = given(text.values("fileinfo"), "filename")
    if named is not None and re.split(r"[\\/]", named.value)[-1].lower() != text.name.lower():
        yield named.line, f"{quoted(named)}, but the file is called {text.name}"


@check("file-version", WARNING, "FileVersion or FileRevision is not within 0..255", _SOURCE)
def file_version(text: LintedText) -> Found:
    """Tools compare them as numbers."""
    for value in all_given(text.values("fileinfo"), ("fileversion", "filerevision")):
        if not _is_byte(value.value):
            yield value.line, f"{quoted(value)} is not within 0..255"


@check("eds-version", NOTE, "EDSVersion is no version of the standard (3.0, 4.0)", _SOURCE)
def eds_version(text: LintedText) -> Found:
    """Absent, it means 3.0."""
    value = given(text.values("fileinfo"), "edsversion")
    if value is not None and value.value not in ("3.0", "4.0"):
        yield value.line, f"{quoted(value)}: the versions are 3.0 and 4.0"


@check("file-date", NOTE, "a date is not written MM-DD-YYYY, or is none", _SOURCE)
def file_date(text: LintedText) -> Found:
    """The day stands in the middle."""
    for value in all_given(text.values("fileinfo"), ("creationdate", "modificationdate")):
        if _day(value) is None:
            yield value.line, f"{quoted(value)} is no date; one is written MM-DD-YYYY"


@check("file-time", NOTE, "a time is not written HH:MMAM or HH:MMPM", _SOURCE)
def file_time(text: LintedText) -> Found:
    """Of twelve hours."""
    for value in all_given(text.values("fileinfo"), ("creationtime", "modificationtime")):
        if not _TIME.fullmatch(value.value.upper()):
            yield value.line, f"{quoted(value)} is no time; one is written HH:MMAM or HH:MMPM"


@check("modified-before-created", NOTE, "the file was modified before it was created", _SOURCE)
def modified_before_created(text: LintedText) -> Found:
    """One of the dates is another file's."""
    values = text.values("fileinfo")
    created, modified = (given(values, key) for key in ("creationdate", "modificationdate"))
    if created is None or modified is None:
        return
    first, last = _day(created), _day(modified)
    if first is not None and last is not None and last < first:
        yield modified.line, f"modified on {last}, created on {first}"


def _day(value: IniValue) -> date | None:
    parts = _DATE.fullmatch(value.value)
    try:
        return date(int(parts[3]), int(parts[1]), int(parts[2])) if parts else None
    except ValueError:
        return None


def _is_byte(text: str) -> bool:
    try:
        return 0 <= read_number(text) <= 0xFF
    except ValueError:
        return False
