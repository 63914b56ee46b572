"""Refuse a file for its values if any value cannot be read: the default is not meant.

Findings are those of `eds check`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.file_complaint import FileComplaint
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.several import plural
from dvtcli.errors import InputFileError

if TYPE_CHECKING:
    from dvtcli.files.eds.findings import EdsFinding
    from dvtcli.files.eds.reader import EdsFile
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
        hint=Hint(Action.CHECK_EDS, {"file": file}, "mend the file; {} shows what else is odd in it"),
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
