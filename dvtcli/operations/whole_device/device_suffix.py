"""Which files say what one device is to hold, by their suffix. Opens none."""

from __future__ import annotations

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import UsageError

_HOLDS, _DESCRIBES = (".dcf", ".xdc", ".jsonl"), (".eds", ".xdd")


def is_about_device(file: str) -> bool:
    """Whether *file* is about one device, whatever it says of it, and not about a network."""
    return file.lower().endswith((*_HOLDS, *_DESCRIBES))


def holds_values(file: str) -> bool:
    """Whether *file* says what one device is to hold: a DCF, an XDC or a backup's JSON lines."""
    return file.lower().endswith(_HOLDS)


def refuse_kind(file: str) -> None:
    """UsageError where *file* is none that says what a device is to hold."""
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
