"""A file whose values are wanted, and in which one of them cannot be read, is refused: the default is not meant.

By what `eds check` says of it. Does not know what the values are for, nor how the file is written.
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
    """InputFileError where a ParameterValue (actualValue) of *read* is none of its data type, or there are two.

    It names every one with its line; *file* is its path. Reading on would put the DefaultValue, or one of the two, in
    its place.
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
    """What *rules* say of lost values, in the words of `eds check`."""
    from dvtcli.domain.profile import GENERIC
    from dvtcli.files.device_lint import lint_device_file

    found = lint_device_file(read, Path(file).name, rules, GENERIC)
    return tuple(_complaint(file, one, columns) for one, columns in found if one.value_lost)


def _complaint(file: str, one: EdsFinding, columns: tuple[int, int]) -> FileComplaint:
    first, last = columns
    return FileComplaint(file, one.line, first or 1, one.text, max(1, last - first + 1))
