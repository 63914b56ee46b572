"""The text of every result, found by the result's type; only that type's module is imported."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib import import_module
from typing import Any

from dvtcli.domain.several import several
from dvtcli.view.lines import Cell, Line

#: Type of result -> module of `dvtcli.view` and its function of (result, width in columns).
_RENDERERS = {
    "PdoListing": ("pdos", "listing_lines"),
    "ValueRead": ("values", "value_lines"),
    "ObjectListing": ("values", "object_lines"),
    "Changed": ("changes", "change_lines"),
    "Stored": ("changes", "stored_lines"),
    "Compared": ("changes", "compared_lines"),
    "NodeListing": ("nodes", "node_lines"),
    "Commanded": ("nodes", "commanded_lines"),
    "Synced": ("nodes", "synced_lines"),
    "ProfileListing": ("profiles", "profile_list_lines"),
    "ProfileShown": ("profiles", "profile_lines"),
    "VpdoListing": ("vpdos", "vpdo_lines"),
    "LoggedIn": ("access", "login_lines"),
    "FileReport": ("files", "file_lines"),
    "FrameSeen": ("frames", "frame_lines"),
    "Plotted": ("frames", "plot_lines"),
    "Facts": ("files", "fact_lines"),
    "DvtAnswer": ("files", "answer_lines"),
    "Diagnosis": ("health", "diagnosis_lines"),
}


def text(result: Any, width: int) -> Iterable[Line]:
    """The lines of *result* for a screen of *width* columns."""
    module, function = _RENDERERS[type(result).__name__]
    lines: Iterable[Line] = getattr(import_module(f"dvtcli.view.{module}"), function)(result, width)
    return lines


def remarks(result: Any) -> Iterator[Line]:
    """Warnings and notes that belong to *result*; they go to stderr."""
    findings = getattr(result, "findings", ())
    if findings and type(result).__name__ in ("Changed", "Facts", "DvtAnswer"):
        from dvtcli.view.errors import finding_line

        yield from map(finding_line, findings)
    lost = getattr(result, "lost", ())
    if lost:
        yield [Cell("warning: ", "yellow"), Cell(f"the reset lost what was not stored: {several(lost)}")]
    for number, reason in enumerate(getattr(result, "reasons", ())):
        yield [Cell("      " if number else "why:  ", "yellow"), Cell(reason)]
    if type(result).__name__ == "DvtAnswer" and result.dry_run:
        yield "dry run: the node's twin answered; nothing was written to the bus"
