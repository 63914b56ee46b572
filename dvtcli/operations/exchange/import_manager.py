"""What a CANopen manager downloads to its nodes (CiA 302-3, 0x1F22), as a network file. Writes nothing to a node.

Reads the manager, and of its nodes who they are, where they answer: that only tells which EDS has their names.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_identity
from dvtcli.domain.network.concise_dcf import ConciseEntry, concise_entries
from dvtcli.domain.network.network_state import CONCISE_DCF
from dvtcli.domain.network.wanted_state import NodeWish, WantedIdentity
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.files.profile.library import profile_for_identity, profile_of
from dvtcli.operations.exchange.export_network import network_place
from dvtcli.operations.exchange.exported_node import eds_word
from dvtcli.operations.exchange.node_from_frames import node_from_frames
from dvtcli.operations.exchange.written_network import FoundNode, write_found
from dvtcli.operations.network.described_network import simulated_word
from dvtcli.operations.network.plan_manager import no_manager
from dvtcli.operations.opening.simulated_nodes import file_or_family, read_dictionary
from dvtcli.operations.session.save_script import ask_before_overwriting

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.device.node import Node
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session

#: where a manager has vendor-ID and product code that it expects of each node (CiA 302-3)
_EXPECTED = (0x1F85, 0x1F86)


@dataclass(frozen=True, slots=True)
class _Booted:
    """A node that a manager boots: what it is, as far as anybody knows."""

    node_id: int
    identity: WantedIdentity
    eds: Path | None

    @property
    def dictionary(self) -> ObjectDictionary | None:
        """What its EDS says."""
        return None if self.eds is None else read_dictionary(self.eds)

    @property
    def profile(self) -> DeviceProfile:
        """That of its identity, else of its EDS."""
        if self.identity.vendor:
            return profile_for_identity(self.identity.vendor, self.identity.product or 0)
        return profile_of(self.dictionary)

    @property
    def title(self) -> str:
        """What its EDS calls it."""
        return "" if self.dictionary is None else self.dictionary.info.product_name


def import_manager(session: Session, file: str, manager: int) -> Facts:
    """Write what the node *manager* downloads to each node that boots, or to those of `-n`, to the network file *file*.

    What no file can say is left out and named, and so is what is no concise DCF. Asks before it overwrites. UsageError
    where *manager* keeps no concise DCFs, or only empty ones.
    """
    path = network_place(file, "NAME.yaml")
    ask_before_overwriting(session, path)
    node = session.node(manager)
    node.read_anew()
    notes: list[str] = []
    found: list[FoundNode] = []
    unnamed: list[str] = []
    for node_id, downloads in _downloads(session, node, notes):
        device = _device(session, node, node_id, path, notes)
        exported, unsaid = node_from_frames(device, downloads)
        dcf = None if device.eds is None else eds_word(device.eds, path)
        wish = replace(exported.wish, identity=device.identity, dcf=dcf)
        notes += _notes(wish, unsaid)
        unnamed += [str(node_id)] if device.eds is None else []
        found.append(FoundNode(replace(exported, wish=wish), {}, node.memory))
    if not found:
        why = f": {'; '.join(notes)}" if notes else ""
        raise UsageError(f"node {manager} ({node.title}) downloads nothing to any node{why}", node=manager)
    if unnamed:
        notes.append(f"node {', '.join(unnamed)}: no EDS is known, objects are numbers; `dcf:` names one")
    return write_found(session, path, file, f"What node {manager} downloads to the nodes that it boots", found, notes)


def _notes(wish: NodeWish, unsaid: tuple[str, ...]) -> Iterator[str]:
    if unsaid:
        yield f"node {wish.node_id}: left out: {', '.join(unsaid)}"
    if wish.stamp:
        yield f"node {wish.node_id}: `stamp: true` is for its 0x1020, and gives it another date and time"


def _downloads(session: Session, node: Node, notes: list[str]) -> Iterator[tuple[int, tuple[ConciseEntry, ...]]]:
    """What *node* downloads, by node-ID; what is no concise DCF, or cannot be read, is said."""
    try:
        count = node.observed(partial(node.known_value, CONCISE_DCF, 0))
    except SdoAborted as aborted:
        raise no_manager(node, f"{CONCISE_DCF:04X}:00", aborted) from aborted
    wanted = session.base.nodes
    for node_id in range(1, min(int.from_bytes(count[:1], "little"), 127) + 1):
        if wanted and node_id not in wanted:
            continue
        session.tell.progress(f"node {node.node_id}: reading what it downloads", node_id, 127)
        try:
            data = node.observed(partial(node.known_value, CONCISE_DCF, node_id))
            if any(data):
                yield node_id, concise_entries(data)
        except SdoAborted as aborted:
            notes.append(f"node {node_id} is left out: {aborted.text}")
        except ValueError as wrong:
            notes.append(f"node {node_id} is left out: 0x1F22:{node_id:02X} is no concise DCF: {wrong}")


def _device(session: Session, manager: Node, node_id: int, path: Path, notes: list[str]) -> _Booted:
    """Who the node is: as *manager* expects it, else as it says itself; with the EDS of that."""
    expected = _identity(manager, node_id)
    try:
        files = session.network.files
        held = WantedIdentity(*(read_identity(files.memory(node_id), sub_index) or None for sub_index in (1, 2)))
        if all(wanted in (None, told) for wanted, told in zip(_parts(expected), _parts(held), strict=True)):
            return _Booted(node_id, held, files.eds_path(node_id))
        notes.append(f"node {node_id} is another device than node {manager.node_id} expects (0x1F85, 0x1F86)")
    except (NoAnswer, SdoAborted, SdoProtocolError):
        pass
    word = simulated_word(str(path), NodeWish("", node_id, expected))
    return _Booted(node_id, expected, None if word is None else file_or_family(word))


def _parts(identity: WantedIdentity) -> tuple[int | None, ...]:
    """Vendor and product: a manager checks only what it expects (CiA 302-2, 0x1F85 and 0x1F86: 0 is any)."""
    return identity.vendor, identity.product


def _identity(manager: Node, node_id: int) -> WantedIdentity:
    numbers: list[int | None] = []
    for index in _EXPECTED:
        try:
            data = manager.observed(partial(manager.known_value, index, node_id))
        except SdoAborted:
            data = b""
        numbers.append(int.from_bytes(data, "little") or None)
    return WantedIdentity(*numbers)
