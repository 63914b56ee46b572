"""Network files, checked: all that can be said of them without a node. Needs no bus and no session."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.several import plural
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.network.read_network import read_network_file
from dvtcli.operations.results import Facts

if TYPE_CHECKING:
    from dvtcli.domain.file_complaint import FileComplaint
    from dvtcli.domain.network.wanted_state import NetworkWish


def read_wish(file: str) -> NetworkWish:
    """What the network file *file* wants; UsageError where it cannot be read, InputFileError with all that is wrong."""
    try:
        return read_network_file(Path(file))
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed


def check_networks(files: Sequence[str]) -> Facts:
    """Look at each of *files*; InputFileError with all that is wrong in all of them, else what they hold."""
    wishes: dict[str, NetworkWish] = {}
    complaints: list[FileComplaint] = []
    for file in dict.fromkeys(files):
        try:
            wishes[file] = read_wish(file)
        except InputFileError as wrong:
            if not wrong.complaints:
                raise
            complaints += wrong.complaints
    if complaints:
        error = InputFileError(f"{plural(len(complaints), 'error')}; nothing was sent", place=complaints[0].place)
        error.complaints = tuple(complaints)
        raise error
    text = tuple(line for file, wish in wishes.items() for line in _lines(file, wish))
    rows = (("files", [_row(file, wish) for file, wish in wishes.items()]),)
    return Facts("network-check", rows, text)


def _row(file: str, wish: NetworkWish) -> dict[str, object]:
    return {
        "file": file,
        "nodes": [{"name": node.name, "node": node.node_id, "pdos": len(node.pdos)} for node in wish.nodes],
        "links": len(wish.links),
        "notes": [{"line": one.mark.line, "column": one.mark.column, "times": one.times, "text": one.text}
                  for one in wish.notes],
    }  # fmt: skip


def _lines(file: str, wish: NetworkWish) -> Iterator[str]:
    for note in wish.notes:
        times = f" ({note.times} times)" if note.times > 1 else ""
        yield f"{file}:{note.mark.line}:{note.mark.column}: note: {note.text}{times}"
    pdos = sum(len(node.pdos) for node in wish.nodes)
    links = f", {plural(len(wish.links), 'link')}" if wish.links else ""
    yield f"{file}: {plural(len(wish.nodes), 'node')}, {plural(pdos, 'PDO')}{links}; no error"
