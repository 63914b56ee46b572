"""The text of every result, found by the result's type; only that type's module is imported."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib import import_module
from typing import Any

from dvtcli.cli.view.lines import Cell, Line
from dvtcli.domain.several import several

#: Type of result -> module of `dvtcli.cli.view` and its function of (result, width in columns).
_RENDERERS = {
    "PdoListing": ("pdo_lines", "listing_lines"),
    "ValueRead": ("value_lines", "value_lines"),
    "ObjectListing": ("value_lines", "object_lines"),
    "Changed": ("change_lines", "change_lines"),
    "ChangedNodes": ("change_lines", "changed_nodes_lines"),
    "Stored": ("change_lines", "stored_lines"),
    "Compared": ("change_lines", "compared_lines"),
    "ComparedNodes": ("change_lines", "compared_nodes_lines"),
    "NodeListing": ("node_lines", "node_lines"),
    "Commanded": ("node_lines", "commanded_lines"),
    "Synced": ("node_lines", "synced_lines"),
    "ProfileListing": ("profile_lines", "profile_list_lines"),
    "ProfileShown": ("profile_lines", "profile_lines"),
    "VpdoListing": ("vpdo_lines", "vpdo_lines"),
    "LoggedIn": ("login_lines", "login_lines"),
    "FileReport": ("file_lines", "file_lines"),
    "FrameSeen": ("frame_lines", "frame_lines"),
    "Plotted": ("frame_lines", "plot_lines"),
    "Facts": ("file_lines", "fact_lines"),
    "DvtAnswer": ("file_lines", "answer_lines"),
    "Diagnosis": ("diagnosis_lines", "diagnosis_lines"),
}


def text(result: Any, width: int) -> Iterable[Line]:
    """The lines of *result* for a screen of *width* columns."""
    module, function = _RENDERERS[type(result).__name__]
    lines: Iterable[Line] = getattr(import_module(f"dvtcli.cli.view.{module}"), function)(result, width)
    return lines


def remarks(result: Any) -> Iterator[Line]:
    """Warnings and notes that belong to *result*; they go to stderr."""
    findings = getattr(result, "findings", ())
    if findings and type(result).__name__ in ("Changed", "ChangedNodes", "Facts", "DvtAnswer"):
        from dvtcli.cli.view.error_lines import finding_line

        yield from map(finding_line, findings)
    lost = getattr(result, "lost", ())
    if lost:
        yield [Cell("warning: ", "yellow"), Cell(f"the reset lost what was not stored: {several(lost)}")]
    for number, reason in enumerate(getattr(result, "reasons", ())):
        yield [Cell("      " if number else "why:  ", "yellow"), Cell(reason)]
    if type(result).__name__ == "DvtAnswer" and result.dry_run:
        yield "dry run: the node's twin answered; nothing was written to the bus"
