"""What a node holds, as a network file that says the same. Writes nothing to a node."""

from __future__ import annotations

import re
import shlex
from typing import TYPE_CHECKING

from dvtcli.domain.network.wanted_state import FileWord, NetworkWish, NodeWish, PdoWish, WantedIdentity
from dvtcli.domain.object_dictionary import normalised
from dvtcli.domain.object_syntax import MappedObject, resolve_entry
from dvtcli.domain.profile import BitPolicy
from dvtcli.domain.several import plural, several
from dvtcli.errors import UsageError
from dvtcli.files.network.write_network import write_network
from dvtcli.operations.results import Facts
from dvtcli.operations.save_script import ask_before_overwriting, place_of, write_whole

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.mapping import PdoMappingEntry
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.operations.session import Session

SUFFIXES = (".yaml", ".yml")


def export_node(session: Session, file: str, node_id: int | None = None) -> Facts:
    """Write every PDO of the node with *node_id* (None: the selected one), as it is now, to the network file *file*.

    Asks before it overwrites. What is no whole PDO, or an MPDO, is left out and said. UsageError for another suffix,
    or where the file cannot be written.
    """
    if not file.lower().endswith(SUFFIXES):
        raise UsageError(f"{file}: a network file ends in .yaml", hint="`save FILE.dvt --all` writes a script")
    path = place_of(file, "export {}/NAME.yaml")
    node = session.node(node_id)
    held = node.pdos()
    left_out = [pdo.label for pdo, config in held.items() if not _is_whole(config)]
    remarks: dict[str, str] = {}
    wishes = tuple(_pdo(node, pdo, config, remarks) for pdo, config in held.items() if _is_whole(config))
    ask_before_overwriting(session, path)
    wish = NodeWish(_name(node), node.node_id, _identity(node), pdos=wishes)
    write_whole(path, write_network(NetworkWish((wish,)), f"What node {node.node_id} held", remarks))
    said = [f"{file}: node {node.node_id}, {plural(len(wishes), 'PDO')}. Check it: dvtcli check {shlex.quote(file)}"]
    if left_out:
        verb = "is no whole PDO" if len(left_out) == 1 else "are no whole PDOs"
        said.append(f"note: left out: {several(left_out)} {verb}, or multiplexed; `pdo` shows what is held")
    rows = (("file", file), ("node", node.node_id), ("pdos", len(wishes)), ("left_out", left_out))
    return Facts("export", rows, tuple(said))


def _is_whole(config: PdoConfig) -> bool:
    return config.mpdo is None and not config.inconsistency


def _name(node: Node) -> str:
    """The node's name in the file: what its device is called, and its node-ID, so that two of a kind differ."""
    word = re.sub(r"[^a-z0-9_]", "", normalised(node.title).replace(".", "_"))
    return f"{word}_{node.node_id}" if word and word[0].isalpha() else f"node_{node.node_id}"


def _identity(node: Node) -> WantedIdentity:
    """Which kind of device it is: another one of the same kind may have the file, too."""
    found = node.identity()
    return WantedIdentity(found["vendor"], found["product"])


def _pdo(node: Node, pdo: Pdo, config: PdoConfig, remarks: dict[str, str]) -> PdoWish:
    held = config.communication
    cob_id = held.cob_id
    named = bool(cob_id.can_id)  # a COB-ID of 0 that is off is no CAN-ID
    unlike_others = cob_id.rtr_allowed and node.profile.rtr_bit[pdo.direction] is BitPolicy.SET
    return PdoWish(
        pdo,
        enabled=cob_id.valid,
        cob_id=cob_id.can_id if named else None,
        extended=cob_id.extended and named,
        rtr_allowed=cob_id.rtr_allowed if not cob_id.rtr_allowed or unlike_others else None,
        transmission_type=held.transmission_type,
        inhibit_time=held.inhibit_time if pdo.is_tpdo else None,
        event_timer=held.event_timer,
        sync_start_value=held.sync_start_value if pdo.is_tpdo else None,
        mapping=tuple(_entry(node, entry, remarks) for entry in config.mapping),
    )


def _entry(node: Node, entry: PdoMappingEntry, remarks: dict[str, str]) -> FileWord:
    """The entry by its object's name where that means it alone, else by its number; the other one is its remark."""
    name = "" if node.dictionary is None else node.dictionary.display_name(entry.index, entry.sub_index)
    word = "" if entry.is_dummy else _named(node, name, entry)
    remarks[word or str(entry)] = f"skips {entry.bits} bits" if entry.is_dummy else str(entry) if word else name
    return FileWord(word or str(entry))


def _named(node: Node, name: str, entry: PdoMappingEntry) -> str:
    """The name as one word, where the device's file knows the object by it, with the length that is mapped."""
    word = normalised(name)
    if not re.fullmatch(r"[a-z_][a-z0-9_]*", word) or node.dictionary is None:
        return ""
    try:
        found = resolve_entry(word, node.dictionary, node.profile.aliases)
    except ValueError:
        return ""  # the name of several objects
    alone = found == MappedObject(entry.index, entry.sub_index)
    described = node.dictionary.entry(entry.index, entry.sub_index)
    return word if alone and described is not None and described.bits == entry.bits else ""
