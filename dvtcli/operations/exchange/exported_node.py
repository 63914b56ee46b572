"""A node on the bus as a network file says it, so that the file can be read without the bus. Writes to no node."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.network.wanted_state import FileWord
from dvtcli.files.device_library.stored_files import stored_path
from dvtcli.operations.exchange.exported_objects import all_of
from dvtcli.operations.exchange.exported_pdos import Exported, exported
from dvtcli.operations.opening.simulated_nodes import file_or_family
from dvtcli.simulator.network.family_file import family_of

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.operations.session.session import Session


def exported_node(session: Session, node: Node, held: Mapping[Pdo, PdoConfig], path: Path) -> Exported:
    """*node*, whose PDOs are *held*, as the network file *path* says it.

    The EDS that knows its names is always named: what its identity leads to is another file once one is added to the
    library.
    """
    found = exported(node, held, node.memory, all_of(node.dictionary))
    return replace(found, wish=replace(found.wish, dcf=_dcf(session, node, path), profile=session.options.profile))


def _dcf(session: Session, node: Node, path: Path) -> FileWord | None:
    """What leads from the network file *path* to the EDS that *node* is known by; None where it is known by none."""
    if session.options.eds is not None:
        return eds_word(file_or_family(session.options.eds), path)
    eds = session.network.files.eds_path(node.node_id)
    return None if eds is None else eds_word(eds, path)


def eds_word(eds: Path, path: Path) -> FileWord:
    """What the network file *path* says to mean *eds*: its family, its whole name in the library, or where it is."""
    family = family_of(eds)
    if family is not None:
        return FileWord(family)
    return FileWord(eds.name) if stored_path(eds.name) == eds else beside(eds, path)


def beside(eds: Path, path: Path) -> FileWord:
    """Where *eds* is, seen from the folder of the network file *path*."""
    try:
        return FileWord(Path(os.path.relpath(eds, path.parent)).as_posix())
    except ValueError:  # on another drive
        return FileWord(eds.absolute().as_posix())
