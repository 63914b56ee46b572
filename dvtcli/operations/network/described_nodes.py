"""What describes a node whose frames are read: a network file, the node itself, or its EDS. Asks no node."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.operations.values.object_values import scalings_of
from dvtcli.watch.known_node import KnownNode

if TYPE_CHECKING:
    from dvtcli.domain.network.network_config import NetworkConfig
    from dvtcli.operations.session.session import SessionNodes

#: suffixes of network files
NETWORK_SUFFIXES = (".yaml", ".yml")


def network_config_of(file: str | None) -> NetworkConfig | None:
    """Read the network file *file*, known by its suffix; None for a DBC file, and for none. Raises as its reading."""
    if file is None or Path(file).suffix.lower() not in NETWORK_SUFFIXES:
        return None
    from dvtcli.operations.plans.read_network_config import read_network_config

    return read_network_config(file)


def described_nodes(
    session: SessionNodes, file: str | None = None, config: NetworkConfig | None = None
) -> Callable[[int], KnownNode]:
    """Return what describes a node-ID: the network file, else the node if met, else --eds, of the nodes of -n if given.

    *config* is the network file as read, if read already. Asks no node. Raises the errors of
    reading the files now, and none later.
    """
    config = config or network_config_of(file)
    known = {} if file is None or config is None else _network_nodes(file, config)
    offline: list[KnownNode] = []
    if session.base.eds is not None:
        from dvtcli.operations.session.device_files import offline_dictionaries

        offline = [
            KnownNode(dictionary, scalings_of(profile, dictionary))
            for dictionary, profile in offline_dictionaries(session.base)
        ]
    nobody = KnownNode(None, scalings_of(None, None))

    def described(node_id: int) -> KnownNode:
        node = session.network.nodes.get(node_id) if session.is_open else None
        if node is not None and node_id not in known:
            known[node_id] = KnownNode(node.dictionary, scalings_of(node.profile, node.dictionary))
        is_of_eds = not session.base.nodes or node_id in session.base.nodes
        return known.get(node_id) or (next(iter(offline), nobody) if is_of_eds else nobody)

    return described


def _network_nodes(file: str, config: NetworkConfig) -> dict[int, KnownNode]:
    """Return the nodes of the network *file*, read as *config*, of which nothing is planned."""
    from dvtcli.files.network.read_node import rules_by_node
    from dvtcli.operations.network.described_network import simulation_of, words_of
    from dvtcli.operations.session.device_files import offline_dictionaries

    own, words = rules_by_node(config.nodes), words_of(file, config)
    devices = offline_dictionaries(simulation_of(words))
    told = dict(zip(words, devices, strict=True))
    return {
        node.node_id: KnownNode(dictionary, scalings_of(profile, dictionary, [own.get(node.node_id, {})]))
        for node in config.nodes
        for dictionary, profile in (told.get(node.node_id, (None, None)),)
    }
