"""The kind of a device's file (DCF, EDS, XDD, XDC, backup) by its suffix."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    pass


_HOLDS, _DESCRIBES = (".dcf", ".xdc", ".jsonl"), (".eds", ".xdd")


def is_about_device(file: str) -> bool:
    """Tell whether *file* is about a device, and not about a network."""
    return file.lower().endswith((*_HOLDS, *_DESCRIBES))


def holds_values(file: str) -> bool:
    """Tell whether *file* has a device's values: a DCF, an XDC or a backup's JSON lines."""
    return file.lower().endswith(_HOLDS)
