"""A network of twins for a dry run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.plan import Plan
from dvtcli.operations.session.open_network import Network
from dvtcli.operations.session.simulated_nodes import family_named, learnt_family
from dvtcli.simulator.device.strict_device import ReversedDevice, StrictDevice
from dvtcli.simulator.network.twin_bus import TwinBus

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.simulator.device.family import Family


def twin_of(network: Network) -> Network:
    """Return copy-on-write twins of *network*'s nodes: their writes never reach the bus.

    Twins know the changes of the nodes and their order, so that `undo` can be tried.
    """

    def device_for(node_id: int, backing: Callable[[int, int], bytes]) -> StrictDevice:
        node = network.node(node_id)
        kind = ReversedDevice if node.profile.reversed_entries else StrictDevice
        family = _family(network, node)._replace(filler=node.profile.filler or 0)
        return kind(node.dictionary or ObjectDictionary({}), family, node_id, backing=backing)

    bus = TwinBus(network.bus, device_for)

    def done_before(node_id: int) -> list[Plan]:
        return list(network.nodes[node_id].history) if node_id in network.nodes else []

    return replace(
        network, bus=bus, files=replace(network.files, bus=bus, _memories={}), change_files=None, nodes={},
        change_order=list(network.change_order), done_before=done_before, warn=lambda _text: None,
        note=lambda _text: None, met=lambda: list(network.nodes), comes_back=False, left={},
    )  # fmt: skip


def _family(network: Network, node: NodeDescription) -> Family:
    """Return the family of *node*: as learnt, else of its profile."""
    folder = next(
        (simulated.folder for simulated in network.files.simulated if simulated.node_id == node.node_id), None
    )
    learnt = learnt_family(node.profile, folder)
    return family_named(node.profile.name) if learnt is None else learnt
