"""Device files for a program: what is odd in them, as values. Opens no bus and prints nothing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.errors import UsageError
from dvtcli.operations.api.called_hints import errors_in_calls
from dvtcli.operations.api.checks import flags, path, word, words

if TYPE_CHECKING:
    from dvtcli.operations.results import FileReports


def check_eds(
    *files: str | Path,
    rules: Sequence[str] = (),
    without: Sequence[str] = (),
    strict: bool = False,
    profile: str | None = None,
) -> FileReports:
    """What is odd in EDS, DCF, XDD and XDC *files*, each finding with its line; true where no file is wrong.

    A name with `*`, `?` or `[` stands for the files that it matches. Only *rules* are asked (none: all), and none of
    *without*; with *strict* a warning is wrong, too. *profile* is the device family by which PDOs are judged.
    UsageError for a rule or family that there is not, and where the one file that is given cannot be opened.
    InputFileError where it cannot be read; of several that is a finding.
    """
    from dvtcli.operations.known_devices import eds_files
    from dvtcli.operations.results import FileReports

    chosen = [str(path("files", file)) for file in files]
    flags(strict=strict)
    if profile is not None:
        word("profile", profile, "the name of a device family, as `dvtcli.profiles()` lists them")
    if not chosen:
        raise UsageError("which files? 'drive.eds', …")
    with errors_in_calls():
        found = eds_files.check_eds(
            chosen, words("rules", rules), words("without", without), strict=strict, family=profile
        )
    return found if isinstance(found, FileReports) else FileReports((found,))
