"""Check device files for a program; findings are values. Opens no bus and prints nothing."""

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
    """Check EDS, DCF, XDD and XDC *files*; findings have lines. The result is true if no file is invalid.

    A name with `*`, `?` or `[` stands for matching files. Applies *rules* (empty: all) except *without*; *strict*
    treats warnings as errors. *profile* is the device family for the rules on PDOs. Raises UsageError for an unknown
    rule or family, or if a single file does not exist, InputFileError if a single file is unreadable; of several files
    these are findings.
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
