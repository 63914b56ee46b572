"""The nodes of a picture, with their PDOs and what their frames hold, and the links between them. Reads no node."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from dvtcli.domain.frame import layout
from dvtcli.domain.network.check.checked_network import CheckedNetwork
from dvtcli.domain.network.links import agrees
from dvtcli.domain.network.network_state import EMCY_COB_ID, SYNC_PERIOD
from dvtcli.domain.network.picture import PictureField, PictureLink, PictureNode, PicturePdo
from dvtcli.domain.network.wanted_state import Endpoint
from dvtcli.operations.meanings.physical_meanings import meanings_of

if TYPE_CHECKING:
    from dvtcli.domain.frame import Field
    from dvtcli.domain.meanings import Meanings, Rules
    from dvtcli.domain.network.network_state import NetworkState, NodeState
    from dvtcli.domain.pdo import Pdo, PdoConfig


def drawn_links(state: NetworkState) -> Iterator[PictureLink]:
    """Every enabled RPDO with each TPDO of another node that it hears."""
    for connection in CheckedNetwork(state, None).heard:
        producer, consumer = (
            Endpoint(connection.producer.node_id, connection.tpdo),
            Endpoint(connection.consumer.node_id, connection.rpdo),
        )
        cob_id = connection.sends.communication.cob_id
        fits = not _is_known(connection.sends, connection.takes) or agrees(
            connection.sends.mapping, connection.takes.mapping
        )
        yield PictureLink(producer, consumer, (cob_id.can_id, cob_id.extended), fits)


def _is_known(*configs: PdoConfig) -> bool:
    """Whether it is told what each of them maps."""
    return all(config.has_mapping and config.mpdo is None for config in configs)


def drawn_nodes(state: NetworkState, said: Mapping[int, Rules]) -> Iterator[PictureNode]:
    """Every node with all of its PDOs, also those that are off; *said*, by node-ID, goes before profiles and files."""
    partners: dict[Endpoint, list[Endpoint]] = {}
    for link in drawn_links(state):
        partners.setdefault(link.producer, []).append(link.consumer)
        partners.setdefault(link.consumer, []).append(link.producer)
    for node in state.nodes:
        meanings = meanings_of(node.profile, node.dictionary, [said.get(node.node_id, {})])
        pdos = (_pdo(node, pdo, config, meanings, partners) for pdo, config in sorted(node.pdos.items()))
        is_told = node.node_id not in state.untold
        yield PictureNode(node.node_id, node.name, node.title, tuple(_facts(node)), tuple(pdos), is_told)


def _pdo(
    node: NodeState, pdo: Pdo, config: PdoConfig, meanings: Meanings, partners: dict[Endpoint, list[Endpoint]]
) -> PicturePdo:
    end = Endpoint(node.node_id, pdo)
    fields = tuple(_field(node, field, meanings) for field in layout(config.mapping))
    return PicturePdo(end, config, fields, tuple(partners.get(end, ())))


def _field(node: NodeState, one: Field, meanings: Meanings) -> PictureField:
    entry = one.entry
    if entry.is_dummy:
        return PictureField(one.start_bit, one.bits, entry.object, is_dummy=True)
    described = node.dictionary.entry(entry.index, entry.sub_index) if node.dictionary else None
    name = node.dictionary.display_name(entry.index, entry.sub_index) if node.dictionary and described else ""
    kind = described.data_type.short if described and described.data_type else ""
    return PictureField(one.start_bit, one.bits, entry.object, name, kind, meanings.of(entry.index, entry.sub_index))


def _facts(node: NodeState) -> Iterator[tuple[str, str]]:
    """What else is to be told of a node: what it produces, and whom it watches."""
    if node.heartbeat_ms:
        yield "heartbeat", f"every {node.heartbeat_ms} ms"
    elif node.is_guarded:
        yield "heartbeat", "none; it is guarded (0x100C, 0x100D)"
    if node.watched:
        yield (
            "watches",
            ", ".join(f"node {node_id} ({time_ms} ms)" for node_id, time_ms in sorted(node.watched.items())),
        )
    if node.produces_sync:
        yield "SYNC", f"every {(node.number(SYNC_PERIOD) or 0) / 1000:g} ms"
    if node.emcy is not None:
        yield "EMCY", f"0x{node.emcy[0]:03X}"
    elif node.number(EMCY_COB_ID) is not None:
        yield "EMCY", "off"
