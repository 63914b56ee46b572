"""Values in a file without effect: misspelt keys, sections of no object, rows of no sub-index.

Users of a file's values are warned, because otherwise only `eds check` reports them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.rules.finding import FileComplaint
from dvtcli.domain.text import plural
from dvtcli.errors import InputFileError
from dvtcli.files.eds.reader import EdsFile

if TYPE_CHECKING:
    from dvtcli.files.eds.findings import EdsFinding
    from dvtcli.files.xdd.xdd_reader import XddFile


def must_tell_values(read: EdsFile | XddFile, file: str) -> None:
    """Raise InputFileError if a ParameterValue (actualValue) of *read* is malformed or contradictory.

    The error names all with their lines; *file* is the path. Reading on would replace the value by the DefaultValue, or
    pick either of two.
    """
    lost = [finding for finding in read.findings if finding.value_lost]
    if not lost:
        return
    complaints = _complaints(read, file, {finding.rule for finding in lost})
    error = InputFileError(
        f"{file}: {plural(len(lost), 'value')} cannot be known; nothing was written",
        place=complaints[0].place,
        why="what the file wants there is not known: neither its DefaultValue is it, nor either of two values",
        hint=Hint(Action.CHECK_EDS, {"file": file}, "correct the file; {} shows its other faults"),
    )
    error.complaints, error.outcome = complaints, "nothing was written"
    raise error


def _complaints(read: EdsFile | XddFile, file: str, rules: set[str]) -> tuple[FileComplaint, ...]:
    """Return findings of *rules* about lost values, worded as by `eds check`."""
    from dvtcli.domain.profile import GENERIC
    from dvtcli.files.device_lint import lint_device_file

    found = lint_device_file(read, Path(file).name, rules, GENERIC)
    return tuple(_complaint(file, one, columns) for one, columns in found if one.value_lost)


def _complaint(file: str, one: EdsFinding, columns: tuple[int, int]) -> FileComplaint:
    first, last = columns
    return FileComplaint(file, one.line, first or 1, one.text, max(1, last - first + 1))


#: maximum number of lines to report one by one
_MOST = 4
_VALUE, _NODE_ID = "parametervalue", "nodeid"
#: names similar to an object's: `[0x1017]`, `[1017 sub 1]`, `[2100Values]`
_NEARLY_OBJECT = re.compile(r"(0x)?[0-9a-f]{3,5}h?([^a-z].*|s(ub)?[^a-z]*|val.*)?", re.IGNORECASE)
_HAS_VALUE = re.compile(r"^[ \t]*(parametervalue|nodeid)[ \t]*=[ \t]*[^\s;]", re.IGNORECASE | re.MULTILINE)


def unread_values(read: EdsFile | XddFile, file: str) -> tuple[str, ...]:
    """Return warnings for users of values from *read*, the file at the path *file*; empty if all are read."""
    found = [(finding.line, finding.text) for finding in read.findings if finding.value_unread]
    if isinstance(read, EdsFile):
        found += _passed_by(read, file)
    told = [f"{file}:{line}: {text}" for line, text in sorted(found)]
    if len(told) <= _MOST:
        return tuple(told)
    more = len(told) - _MOST + 1
    return *told[: _MOST - 1], f"{file}: {more} more lines like these; a check of the file names them"


def _passed_by(read: EdsFile, file: str) -> Iterator[tuple[int, str]]:
    """Iterate over unknown keys and sections that look like values, and misplaced values."""
    from dvtcli.files.eds.lint_keys import unknown_keys
    from dvtcli.files.eds.linted_text import LintedText, given, is_head
    from dvtcli.files.eds.numbers import quoted

    text = LintedText(read, file)
    for value, near in unknown_keys(text):
        if near.lower() in (_VALUE, _NODE_ID) and value.value:
            yield value.line, f"{quoted(value)} is not read; did you mean {near}?"
    for entry in text.objects:
        if is_head(text, entry) and (own := given(entry.values, _VALUE)) is not None:
            yield own.line, f"{quoted(own)} is not read: the sub-indices of {entry.index:04X} have their own"
    for section in read.layout.stray:
        if _HAS_VALUE.search(section.text) or ("=" in section.text and _NEARLY_OBJECT.fullmatch(section.name)):
            yield section.line, f"[{section.name[:60]}] is not read: it belongs to no object in this file"
