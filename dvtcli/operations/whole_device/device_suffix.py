"""Tell by suffix which files are about a device. Opens none."""

from __future__ import annotations

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import UsageError

_HOLDS, _DESCRIBES = (".dcf", ".xdc", ".jsonl"), (".eds", ".xdd")


def is_about_device(file: str) -> bool:
    """Tell whether *file* is about a device, and not about a network."""
    return file.lower().endswith((*_HOLDS, *_DESCRIBES))


def holds_values(file: str) -> bool:
    """Tell whether *file* has a device's values: a DCF, an XDC or a backup's JSON lines."""
    return file.lower().endswith(_HOLDS)


def refuse_kind(file: str) -> None:
    """Raises UsageError if *file* has no device's values by its suffix."""
    if not holds_values(file):
        raise UsageError(
            f"{file} does not say what a device is to hold",
            place=file,
            hint=Hint(
                Action.RESTORE,
                why="a DCF, an XDC or a backup (.jsonl) does; an EDS or XDD says what there is, and {} brings its "
                "defaults",
            ),
        )
