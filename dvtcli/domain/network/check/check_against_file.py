"""Rules that compare the network of a file with the nodes on a bus; silent if no comparison is requested."""

from __future__ import annotations

from dvtcli.domain.lint.lint_rule import ERROR, NOTE, check
from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetFound, NetSpot, at


@check("not-on-the-bus", ERROR, "a node of the file is not on the bus", "the network file")
def not_on_the_bus(network: CheckedNetwork) -> NetFound:
    """The node is off, has another node-ID, or the file describes another bus."""
    for node in network.nodes if network.present is not None else ():
        if network.present is not None and node.node_id not in network.present:
            yield at(node), "it does not answer on the bus"


@check("not-in-the-file", NOTE, "a node on the bus is not in the file", "the network file")
def not_in_the_file(network: CheckedNetwork) -> NetFound:
    """Its frames are missing in the file's bus load and in the check of CAN-IDs."""
    for node_id in sorted(network.present or ()):
        master = network.state.master
        if network.state.node(node_id) is None and (master is None or master.node_id != node_id):
            yield NetSpot(node_id), "it is on the bus, but not in the file"
