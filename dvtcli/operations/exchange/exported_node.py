"""A node on the bus as a network file says it, so that the file can be read without the bus. Writes to no node."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.network.wanted_state import FileWord
from dvtcli.operations.exchange.exported_pdos import Exported, exported
from dvtcli.operations.network.described_network import simulated_word
from dvtcli.operations.opening.simulated_nodes import SIMULATED, file_or_family
from dvtcli.simulator.network.family_file import family_eds, family_names, family_of

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.operations.session.session import Session


def exported_node(session: Session, node: Node, held: Mapping[Pdo, PdoConfig], path: Path) -> Exported:
    """*node*, whose PDOs are *held*, as the network file *path* says it.

    Its EDS and its profile are named where somebody chose them, where nothing else in the file leads to that EDS, and
    where it is a family's: a file that is added to the library later would go before that.
    Where that cannot be said either, objects are numbers, and their names are remarked.
    """
    found = _named(exported(node, held, node.memory, whole=True), _chosen(session, path), session.options.profile)
    told = session.network.files.choice(node.node_id)
    if told is None:
        return found
    family = family_of(told.path)
    if _leads_to(path, found, told.path) and (family is None or _is_said(found)):
        return found
    if family is not None or told.why == SIMULATED:
        named = _named(found, FileWord(family) if family else beside(told.path, path), session.options.profile)
        if _leads_to(path, named, told.path):
            return named
    numbered = exported(node, held, node.memory, with_names=False, whole=True)
    return _named(numbered, found.wish.dcf, found.wish.profile)


def beside(eds: Path, path: Path) -> FileWord:
    """Where *eds* is, seen from the folder of the network file *path*."""
    try:
        return FileWord(Path(os.path.relpath(eds, path.parent)).as_posix())
    except ValueError:  # on another drive
        return FileWord(eds.absolute().as_posix())


def _chosen(session: Session, path: Path) -> FileWord | None:
    eds = session.options.eds
    return None if eds is None else beside(file_or_family(eds), path)


def _named(found: Exported, dcf: FileWord | None, profile: str | None) -> Exported:
    return replace(found, wish=replace(found.wish, dcf=dcf, profile=profile))


def _is_said(found: Exported) -> bool:
    """Whether *found* says itself what describes it, whatever the library has."""
    return found.wish.dcf is not None or found.wish.profile in family_names()


def _leads_to(path: Path, found: Exported, eds: Path) -> bool:
    """Whether the network file *path*, with what is *found* in it, finds *eds* without the node."""
    word = simulated_word(str(path), found.wish)
    if word is None:
        return False
    described = family_eds(word) if word in family_names() else Path(word)
    return described.resolve() == eds.resolve()
