"""Rules about the nodes themselves: who they are, and what a manager of the network expects of them."""

from __future__ import annotations

from dvtcli.domain.lint.lint_rule import ERROR, NOTE, WARNING, check
from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetFound, at, held
from dvtcli.domain.network.network_state import IDENTITY, NMT_STARTUP, SLAVE_ASSIGNMENT, NodeState

_BOOT = "CiA 302-2, 0x1F80 to 0x1F89"
_NAMES = ("vendor", "product", "revision", "serial")
#: Bit 0 of 0x1F80: NMT master; bit 0 of an entry of 0x1F81: the node is a slave of it.
_MASTER = _SLAVE = 1
_BOOT_IDENTITY = {0x1F85: 1, 0x1F86: 2, 0x1F87: 3, 0x1F88: 4}


@check("identity", ERROR, "a node has another identity (0x1018) than the file asks for", "CiA 301, 7.5.2.19")
def identity(network: CheckedNetwork) -> NetFound:
    """It is another device; its EDS would be wrong for it."""
    for node in network.told:
        for sub_index, name in enumerate(_NAMES, 1):
            wanted, has = node.asked.get(name), node.number(IDENTITY, sub_index)
            if wanted is not None and has is not None and wanted != has:
                yield held(node, IDENTITY, sub_index), f"its {name} is 0x{has:08X}, the file says 0x{wanted:08X}"


@check("eds-identity", ERROR, "the EDS or DCF of a node is for another device than it says in 0x1018",
       "CiA 306, DeviceInfo; CiA 301, 7.5.2.19")  # fmt: skip
def eds_identity(network: CheckedNetwork) -> NetFound:
    """Names and lengths may be another device's."""
    for node in network.told:
        if node.dictionary is None:
            continue
        info = node.dictionary.info
        for sub_index, told in ((1, info.vendor_id), (2, info.product_code)):
            has = node.number(IDENTITY, sub_index)
            if told and has and told != has:
                yield held(node, IDENTITY, sub_index), f"it says 0x{has:08X}, its file is for 0x{told:08X}"


@check("dcf-node-id", WARNING, "a node's DCF was made for another node-ID", "CiA 306, DeviceComissioning: NodeID")
def dcf_node_id(network: CheckedNetwork) -> NetFound:
    """Its values may have that node-ID in them."""
    for node in network.told:
        made_for = None if node.dictionary is None else node.dictionary.info.node_id
        if made_for and made_for != node.node_id:
            yield at(node), f"its DCF is for node-ID {made_for}"


def _managers(network: CheckedNetwork) -> list[NodeState]:
    return [node for node in network.nodes if (node.number(NMT_STARTUP) or 0) & _MASTER]


@check("two-managers", ERROR, "two nodes are NMT master (0x1F80)", _BOOT)
def two_managers(network: CheckedNetwork) -> NetFound:
    """Each starts and stops the nodes of the other."""
    first, *others = [*_managers(network), None]
    for node in others:
        if node is not None and first is not None:
            yield held(node, NMT_STARTUP), f"node {first.node_id} is NMT master, too"
    master = network.state.master
    if first is not None and master is not None and master.node_id not in (None, first.node_id):
        yield held(first, NMT_STARTUP), "the file names a master besides"


@check("slave-missing", ERROR, "a manager waits for a slave that is not there (0x1F81)", _BOOT)
def slave_missing(network: CheckedNetwork) -> NetFound:
    """It may not start the others without it."""
    for node in _managers(network):
        for (index, slave), value in node.numbers.items():
            if index == SLAVE_ASSIGNMENT and value & _SLAVE and network.state.node(slave) is None:
                yield held(node, index, slave), f"node {slave} is assigned, and is none of this network"


@check("slave-not-assigned", WARNING, "a node is not assigned to the manager of the network (0x1F81)", _BOOT)
def slave_not_assigned(network: CheckedNetwork) -> NetFound:
    """Nobody starts it."""
    for manager in _managers(network):
        for node in network.nodes:
            value = manager.number(SLAVE_ASSIGNMENT, node.node_id)
            if node is not manager and value is not None and not value & _SLAVE:
                yield held(manager, SLAVE_ASSIGNMENT, node.node_id), f"node {node.node_id} is not assigned"


@check("boot-identity", ERROR, "a manager expects another identity of a node (0x1F85 to 0x1F88)", _BOOT)
def boot_identity(network: CheckedNetwork) -> NetFound:
    """It refuses to start it."""
    for manager in _managers(network):
        for (index, slave), expected in manager.numbers.items():
            node, part = network.state.node(slave), _BOOT_IDENTITY.get(index)
            if node is None or part is None or not expected:
                continue
            asked = node.asked.get(_NAMES[part - 1])
            has = node.number(IDENTITY, part) if asked is None else asked
            if has is not None and has != expected:
                text = f"{_NAMES[part - 1]} of node {slave} is to be 0x{expected:08X}, and is 0x{has:08X}"
                yield held(manager, index, slave), text


@check("boot-device-type", ERROR, "a manager expects another device type of a node (0x1F84)", _BOOT)
def boot_device_type(network: CheckedNetwork) -> NetFound:
    """It refuses to start it."""
    for manager in _managers(network):
        for (index, slave), expected in manager.numbers.items():
            node = network.state.node(slave)
            has = None if node is None else node.number(0x1000)
            if index == 0x1F84 and expected and has is not None and has != expected:
                yield held(manager, index, slave), f"node {slave} is to be 0x{expected:08X}, and is 0x{has:08X}"


@check("guarded-by-manager", ERROR, "a manager guards a node that sends a heartbeat (0x1F81, guard time)", _BOOT)
def guarded_by_manager(network: CheckedNetwork) -> NetFound:
    """Both use one CAN-ID, and exclude each other."""
    for manager in _managers(network):
        for node in network.nodes:
            value = manager.number(SLAVE_ASSIGNMENT, node.node_id) or 0
            if value >> 16 and value >> 8 & 0xFF and node.heartbeat_ms:
                yield held(manager, SLAVE_ASSIGNMENT, node.node_id), f"node {node.node_id} sends a heartbeat"


@check("nobody-starts", NOTE, "no node is NMT master, and the file names none", _BOOT)
def nobody_starts(network: CheckedNetwork) -> NetFound:
    """Somebody else has to: nodes come up in PRE-OPERATIONAL, unless they start by themselves (0x1F80)."""
    known = [node for node in network.told if node.number(NMT_STARTUP) is not None]
    if known and not _managers(network) and network.state.master is None:
        yield held(known[0], NMT_STARTUP), "no node starts the others, and the file names no master"
