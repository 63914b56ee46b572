"""Rules about the lists of objects, and about objects in short form (CompactSubObj and its tables)."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.datatypes import DATA_TYPES
from dvtcli.domain.lint.lint_rule import NOTE, WARNING, check
from dvtcli.domain.object_dictionary import ObjectType
from dvtcli.files.eds.ini import IniValue
from dvtcli.files.eds.keys import quoted
from dvtcli.files.eds.lint.linted_text import Found, LintedText
from dvtcli.files.eds.numbers import read_number, without_comment

_LISTS = "CiA 306, 4.6.2"
_COMPACT = "CiA 306, 4.6.3.3"
_MANDATORY = (0x1000, 0x1001, 0x1018)
_MANUFACTURER = range(0x2000, 0x6000)


@check("wrong-list", NOTE, "an object is in a list that is not for it", _LISTS)
def wrong_list(text: LintedText) -> Found:
    """Mandatory ones are 0x1000, 0x1001 and 0x1018, the manufacturer's 0x2000 to 0x5FFF, the rest optional."""
    for name in ("mandatoryobjects", "optionalobjects", "manufacturerobjects"):
        for row, index in _rows(text, name):
            right = "manufacturer" if index in _MANUFACTURER else "mandatory" if index in _MANDATORY else "optional"
            # A profile may make more objects mandatory, and they may be listed so.
            if right not in (name.removesuffix("objects"), "optional") or (
                right == "optional" and name == "manufacturerobjects"
            ):
                yield row.line, f"{index:04X} belongs to [{right.capitalize()}Objects]"


@check("list-numbering", NOTE, "the rows of a list are not numbered 1, 2, 3…", _LISTS)
def list_numbering(text: LintedText) -> Found:
    """Tools that count up from 1 stop at the gap. Said once a list."""
    for name in ("mandatoryobjects", "optionalobjects", "manufacturerobjects"):
        for number, (row, _) in enumerate(_rows(text, name), 1):
            if row.key != str(number):
                yield row.line, f"{quoted(row)} is row {number} of its list"
                break


@check("compact-record", NOTE, "CompactSubObj of what is no ARRAY", _COMPACT)
def compact_record(text: LintedText) -> Found:
    """All its sub-indices would be alike, and a RECORD's are not."""
    for entry in text.objects:
        if "compactsubobj" in entry.values and entry.sub_index is None:
            held = text.file.dictionary[entry.index]
            if len(held.entries) > 1 and held.object_type != ObjectType.ARRAY:
                yield (
                    entry.values["compactsubobj"].line,
                    f"CompactSubObj, but ObjectType is 0x{held.object_type:X}",
                )


@check("compact-and-sub", NOTE, "an object in short form has sections of sub-indices, too", _COMPACT)
def compact_and_sub(text: LintedText) -> Found:
    """They count; some readers take the short form only."""
    for entry in text.objects:
        value = entry.values.get("compactsubobj")
        if (
            value is not None
            and value.value not in ("", "0")
            and entry.sub_index is None
            and entry.index in text.of_many
        ):
            yield value.line, f"{quoted(value)}, and sections of its sub-indices"


@check("table-without-compact", NOTE, "a table of names or values of an object that is not in short form", _COMPACT)
def table_without_compact(text: LintedText) -> Found:
    """Other readers do not look at it."""
    compact = {entry.index for entry in text.objects if "compactsubobj" in entry.values}
    for index in text.file.layout.objects:
        if index not in compact:
            sections = text.file.layout.object_sections(index)
            yield from (
                (part.line, f"[{part.name}], but no CompactSubObj") for part in sections.names + sections.values
            )


@check("missing-deftype", WARNING, "DataType names a type of the device's own that is not in the file",
       "CiA 301, 7.4.1")  # fmt: skip
def missing_deftype(text: LintedText) -> Found:
    """What such an object holds is not known."""
    for entry in text.objects:
        value = entry.values.get("datatype")
        code = None if value is None else _number(value)
        own = code is not None and code not in DATA_TYPES and 0x20 <= code < 0x1000
        if value is not None and own and code not in text.file.dictionary:
            yield value.line, f"{quoted(value)}, but the file has no object {code:04X} (DEFTYPE, DEFSTRUCT)"


def _rows(text: LintedText, name: str) -> Iterator[tuple[IniValue, int]]:
    for key, row in text.values(name).items():
        index = _number(row)
        if key.replace(" ", "") != "supportedobjects" and index is not None:
            yield row, index


def _number(value: IniValue) -> int | None:
    try:
        return read_number(without_comment(value.value))
    except ValueError:
        return None
