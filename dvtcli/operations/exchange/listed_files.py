"""The device files of a network that a nodelist (CiA 306-3) names. Opens no device file, and needs no bus."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from dvtcli.domain.several import join_some
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.input_file import read_input
from dvtcli.files.nodelist import MOST_BYTES, SUFFIX, ListedNode, read_nodelist


@dataclass(frozen=True, slots=True)
class ListedFile:
    """The file of one node: where it is, and the *node_id* and *name* that the nodelist gives it."""

    path: Path
    node_id: int
    name: str


def nodelist_in(place: Path) -> Path | None:
    """The nodelist that *place* is, or the only one of a folder; None where there is none. UsageError for several."""
    if place.suffix.lower() == SUFFIX and place.is_file():
        return place
    found = sorted(path for path in place.iterdir() if path.suffix.lower() == SUFFIX) if place.is_dir() else []
    if len(found) > 1:
        names = join_some(path.name for path in found)
        raise UsageError(f"{place} has several nodelists: {names}", hint=f"name one: {found[0]}")
    return found[0] if found else None


def listed_files(nodelist: Path, notes: list[str]) -> list[ListedFile]:
    """The files that *nodelist* names, in order of node-ID; what is left out of it is added to *notes*.

    InputFileError where it is none, or where a file that it names is not there; UsageError where it cannot be read.
    """
    try:
        networks = read_nodelist(read_input(nodelist, MOST_BYTES, "nodelist"), nodelist.name)
    except OSError as failed:
        raise UsageError(f"{nodelist}: {failed.strerror or failed}", place=str(nodelist)) from failed
    first, *others = networks
    notes += (
        f"{nodelist.name}: network {other.name or 'without a name'} is left out: one file, one bus" for other in others
    )
    if first.absent:
        notes.append(f"{nodelist.name}: not present: node {join_some(map(str, first.absent))}")
    found = []
    for node in first.nodes:
        if node.dcf:
            found.append(ListedFile(_file(nodelist, node), node.node_id, node.name))
        else:
            notes.append(f"node {node.node_id} is left out: {nodelist.name} names no DCF of it")
    if not found:
        raise UsageError(f"{nodelist} names no DCF", place=str(nodelist), hint="NodeXDCFName says which")
    return found


def _file(nodelist: Path, node: ListedNode) -> Path:
    """The DCF of *node*, beside the nodelist; such lists come from where case does not matter, and \\ parts folders."""
    path = nodelist.parent / node.dcf.replace("\\", "/")
    if os.path.isfile(path):  # noqa: PTH113 - Path.is_file raises OSError for a name that is too long
        return path
    near = path.parent.iterdir() if os.path.isdir(path.parent) else ()  # noqa: PTH112
    same = [neighbour for neighbour in near if neighbour.name.lower() == path.name.lower()]
    if len(same) != 1:
        raise InputFileError(
            f"{nodelist.name}:{node.line}: the DCF of node {node.node_id} is not there: {node.dcf}",
            place=f"{nodelist}:{node.line}", hint="it is looked for beside the nodelist",
        )  # fmt: skip
    return same[0]
