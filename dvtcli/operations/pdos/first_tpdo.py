"""Find the TPDO for an object if none is given: the first suitable."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import MAX_ENTRIES, Pdo, PdoConfig, PdoMappingEntry
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import DeviceRefused
from dvtcli.operations.changes.change import configure

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.rules import Finding
    from dvtcli.operations.session.session_nodes import SessionNodes

_MOST_BITS = 64


def map_in_tpdo(
    session: SessionNodes, node_id: int, index: int, sub_index: int, can_id: int | None = None
) -> tuple[Finding, ...]:
    """Map an object behind the entries of the first enabled TPDO with room, else in the first disabled TPDO.

    Sets type 1 (every SYNC), inhibit time 0 and event timer 0, and stores nothing. Does nothing if an enabled TPDO maps
    the object. *can_id* selects the TPDO with this CAN-ID, else sets it on a disabled TPDO.
    """
    node = session.node(node_id)
    node.begin_change()
    tpdos = _tpdos(node)
    if any(_position(config, index, sub_index) is not None for config in tpdos.values() if config.enabled):
        return ()
    bits = node.length_of(index, sub_index) or 8 * len(node.upload(index, sub_index))
    pdo, kept = _with_room(node, tpdos, bits, can_id)
    asked = PdoRequest(
        cob_id=can_id, transmission_type=1, enabled=True,
        inhibit_time=None if tpdos[pdo].communication.inhibit_time is None else 0,
        event_timer=None if tpdos[pdo].communication.event_timer is None else 0,
        objects=(*kept, PdoMappingEntry(index, sub_index, bits)),
    )  # fmt: skip
    return configure(session, session.node(node_id), {pdo: asked}).findings


def _tpdos(node: ReadableNode) -> dict[Pdo, PdoConfig]:
    return {pdo: config for pdo, config in node.pdos().items() if pdo.is_tpdo}


def _with_room(
    node: ReadableNode, tpdos: Mapping[Pdo, PdoConfig], bits: int, can_id: int | None
) -> tuple[Pdo, tuple[PdoMappingEntry, ...]]:
    """Return a TPDO with room for *bits*, and its remaining entries; raises DeviceRefused if there is none."""
    usable = {pdo: config for pdo, config in tpdos.items() if node.is_dynamic(pdo) and not _is_odd(config)}
    for pdo, config in usable.items():
        right = can_id in (None, config.communication.cob_id.can_id)
        if config.enabled and right and config.bits + bits <= _MOST_BITS and _takes_entry(node, pdo, config):
            return pdo, config.mapping
    for pdo, config in usable.items():
        if not config.enabled:
            return pdo, ()
    raise DeviceRefused(
        f"no TPDO of node {node.node_id} has {bits} bits of room, and none is disabled",
        node=node.node_id,
        hint=Hint(Action.CLEAR, why="a TPDO first")
        + Hint(Action.MAP, {"pdo": "tpdo1"}, ", or map into one by name: {}"),
    )


def _is_odd(config: PdoConfig) -> bool:
    return config.mpdo is not None or bool(config.inconsistency)


def _takes_entry(node: NodeDescription, pdo: Pdo, config: PdoConfig) -> bool:
    object_ = node.dictionary[pdo.mapping_index] if node.dictionary and pdo.mapping_index in node.dictionary else None
    subs = len(object_.entries.keys() - {0}) if object_ is not None else 0
    return len(config.mapping) < min(subs or MAX_ENTRIES, node.profile.max_entries or MAX_ENTRIES)


def _position(config: PdoConfig, index: int, sub_index: int) -> int | None:
    """Return the first bit of an object in a PDO's frame, None if not mapped."""
    start = 0
    for entry in config.mapping:
        if (entry.index, entry.sub_index) == (index, sub_index):
            return start
        start += entry.bits
    return None


def locate_tpdo(session: SessionNodes, node_id: int, index: int, sub_index: int) -> str:
    """Return `TPDO1 0x181 bit 0` for the first TPDO with the object, enabled first; else `not mapped`."""
    tpdos = _tpdos(session.node(node_id))
    for pdo, config in sorted(tpdos.items(), key=lambda item: not item[1].enabled):
        start = _position(config, index, sub_index)
        if start is not None:
            where = str(config.communication.cob_id) if config.enabled else "off"
            return f"{pdo.label} {where} bit {start}"
    return "not mapped"
