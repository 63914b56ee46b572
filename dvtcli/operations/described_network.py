"""A network as its file describes it, without a bus: its nodes simulated from their EDS, DCF or family, and set up.

Sends nothing to any real bus. Judges nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.mapping import PdoMappingEntry
from dvtcli.domain.network.network_state import NetworkState, NodeState
from dvtcli.domain.network.wanted_state import FileWord, NetworkWish, NodeWish, PdoWish, WantedIdentity
from dvtcli.domain.object_syntax import MappedObject, Skipped, UnknownName, resolve_entry
from dvtcli.domain.pdo import PdoCommunicationParameter, PdoConfig
from dvtcli.files.network.file_log import FileLog
from dvtcli.operations.network_states import network_after, network_state, with_wish
from dvtcli.operations.network_wish import read_wish
from dvtcli.operations.options import Options
from dvtcli.operations.plan_network import plan_wish
from dvtcli.operations.session import Session

if TYPE_CHECKING:
    from dvtcli.operations.telling import Teller


def described_network(
    file: str, tell: Teller | None = None, *, for_rules: bool = False, with_links: bool = True
) -> NetworkState:
    """What the nodes of the network *file* hold once it is applied to devices that are as new.

    A node is what its `dcf` describes, else its `profile`'s family, else the family or the file of `eds add` that its
    identity is of. Of one that is none of these only what the file says is known. InputFileError with all that the file
    cannot mean, RuleError where what it wants cannot be made. Without *with_links* its links are left out.
    """
    wish = read_wish(file) if with_links else replace(read_wish(file), links=())
    words = {node.node_id: word for node in wish.nodes if (word := simulated_word(file, node))}
    known = tuple(replace(node, identity=WantedIdentity()) for node in wish.nodes if node.node_id in words)
    links = tuple(
        link for link in wish.links if {end.node_id for end in (link.producer, *link.consumers)} <= words.keys()
    )
    state = NetworkState(file=file, master=wish.master, links=links)
    if known:
        state = _simulated(file, replace(wish, nodes=known, links=links), words, tell, for_rules=for_rules)
    named = {node.node_id: node for node in wish.nodes}
    met = [with_wish(node, named[node.node_id]) for node in state.nodes]
    untold = [node for node in wish.nodes if node.node_id not in words]
    nodes = sorted([*met, *map(told_state, untold)], key=lambda one: one.node_id)
    return replace(state, nodes=tuple(nodes), untold=tuple(node.node_id for node in untold))


def _simulated(
    file: str, wish: NetworkWish, words: Mapping[int, str], tell: Teller | None, *, for_rules: bool
) -> NetworkState:
    options = Options(sim=tuple(f"{word}@{node_id}" for node_id, word in words.items()), force=True)
    with Session(options, tell) as session:
        plan = plan_wish(session, wish, FileLog(file, Path(file).read_text("utf-8-sig")))
        nodes = [session.node(node.node_id) for node in wish.nodes]
        return network_after(network_state(nodes, for_rules=for_rules), plan, wish)


def simulated_word(file: str, node: NodeWish) -> str | None:
    """What `--sim` takes for *node* of the network *file*, without a node-ID; None where nothing describes it."""
    from dvtcli.files.eds.own_files import find
    from dvtcli.files.profile.library import profile_for_identity
    from dvtcli.simulator.network.family_file import family_names

    if node.dcf is not None and (path := Path(file).parent / node.dcf.text).is_file():
        return str(path)
    if node.profile in family_names():
        return node.profile
    vendor, product = node.identity.vendor, node.identity.product
    if vendor is None or product is None:
        return None
    own = find(vendor, product, node.identity.revision)
    if own is not None:
        return str(own)
    profile = profile_for_identity(vendor, product)
    return profile.name if profile.matches(vendor, product) and profile.name in family_names() else None


def told_state(wish: NodeWish) -> NodeState:
    """A node of which nothing but *wish* is known: PDOs that it names are enabled unless it says otherwise."""
    numbers = {(one.index, one.sub_index): int.from_bytes(one.data, "little") for one in wish.objects}
    for sub_index, watch in enumerate(wish.watches, 1):
        numbers[0x1016, sub_index] = watch.producer << 16 | watch.time_ms
    pdos = {one.pdo: config for one in wish.pdos if (config := _told_pdo(wish.node_id, one)) is not None}
    return with_wish(NodeState(wish.node_id, wish.name, pdos, numbers), wish)


def _told_pdo(node_id: int, wish: PdoWish) -> PdoConfig | None:
    default = wish.pdo.default_can_id(node_id)
    can_id = wish.cob_id if isinstance(wish.cob_id, int) else default
    if can_id is None:
        return None
    cob_id = CobId(can_id, wish.enabled is not False, wish.rtr_allowed is not False, wish.extended)
    communication = PdoCommunicationParameter(
        cob_id, wish.transmission_type, wish.inhibit_time, wish.event_timer, wish.sync_start_value
    )
    entries = None if wish.mapping is None else [_told_entry(word) for word in wish.mapping]
    if entries is None or None in entries:
        return PdoConfig(communication, (), unread=((wish.pdo.mapping_index, 0),))
    return PdoConfig(communication, tuple(entry for one in entries if one is not None for entry in one))


def _told_entry(word: FileWord) -> tuple[PdoMappingEntry, ...] | None:
    """What a word maps, None where only a dictionary could tell."""
    from dvtcli.domain.mapping import DUMMY_BITS, split_dummy

    try:
        found = resolve_entry(word.text, None, {})
        if isinstance(found, Skipped):
            return tuple(split_dummy(found.bits, DUMMY_BITS))
    except (UnknownName, ValueError):
        return None
    return _entry(found)


def _entry(found: MappedObject) -> tuple[PdoMappingEntry, ...] | None:
    if found.bits is None:
        return None
    return (PdoMappingEntry(found.index, found.sub_index, found.bits),)
