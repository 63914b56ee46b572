"""Rules about nodes: identity, presence on the bus, and the NMT master with nodes to start and downloads."""

from __future__ import annotations

from dvtcli.domain.lint import ERROR, NOTE, WARNING, check
from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetFound, NetSpot, at, held
from dvtcli.domain.network.concise_dcf import read_concise_dcf
from dvtcli.domain.network.network_state import IDENTITY_NAMES, NodeState
from dvtcli.domain.objects import (
    BOOT_TIME,
    CONCISE_DCF,
    DEVICE_TYPE,
    EXPECTED_DEVICE_TYPE,
    EXPECTED_PRODUCT,
    EXPECTED_REVISION,
    EXPECTED_SERIAL,
    EXPECTED_VENDOR,
    IDENTITY,
    NMT_STARTUP,
    REQUEST_GUARDING,
    REQUEST_NMT,
    SLAVE_ASSIGNMENT,
)
from dvtcli.domain.standard_objects import source
from dvtcli.domain.text import join_some


@check("identity", ERROR, "a node has another identity (0x1018) than the file asks for", source(0x1018))
def identity(network: CheckedNetwork) -> NetFound:
    """The node is another device, so its EDS does not fit."""
    for node in network.described:
        for sub_index, name in enumerate(IDENTITY_NAMES, 1):
            wanted, has = node.asked.get(name), node.number(IDENTITY, sub_index)
            if wanted is not None and has is not None and wanted != has:
                yield held(node, IDENTITY, sub_index), f"its {name} is 0x{has:08X}, the file says 0x{wanted:08X}"


@check("eds-identity", ERROR, "the EDS, DCF, XDD or XDC of a node is for a device with another identity (0x1018)",
       f"CiA 306, DeviceInfo; {source(0x1018)}")  # fmt: skip
def eds_identity(network: CheckedNetwork) -> NetFound:
    """Names and lengths may be another device's."""
    for node in network.described:
        if node.dictionary is None:
            continue
        info = node.dictionary.info
        for sub_index, of_file in ((1, info.vendor_id), (2, info.product_code)):
            has = node.number(IDENTITY, sub_index)
            if of_file and has and of_file != has:
                yield held(node, IDENTITY, sub_index), f"it is 0x{has:08X}, its file is for 0x{of_file:08X}"


@check("dcf-node-id", WARNING, "a node's DCF was made for another node-ID", "CiA 306, DeviceComissioning: NodeID")
def dcf_node_id(network: CheckedNetwork) -> NetFound:
    """The DCF's values may contain the other node-ID."""
    for node in network.described:
        made_for = None if node.dictionary is None else node.dictionary.info.node_id
        if made_for and made_for != node.node_id:
            yield at(node), f"its DCF is for node-ID {made_for}"


_BOOT = "CiA 302-2, 0x1F80 to 0x1F89"
_DOWNLOAD = "CiA 302-3, 0x1F22: concise DCF"
#: Bit 0 of 0x1F80: NMT master; in an entry of 0x1F81 bit 0: its slave, bit 3: mandatory slave.
_MASTER = _SLAVE = 1
_MANDATORY = 1 << 3
#: Value in 0x1F82 for a missing node.
_MISSING = 1
_BOOT_IDENTITY = {EXPECTED_VENDOR: 1, EXPECTED_PRODUCT: 2, EXPECTED_REVISION: 3, EXPECTED_SERIAL: 4}


def _managers(network: CheckedNetwork) -> list[NodeState]:
    return [node for node in network.nodes if (node.number(NMT_STARTUP) or 0) & _MASTER]


@check("two-managers", ERROR, "two nodes are NMT masters (0x1F80)", _BOOT)
def two_managers(network: CheckedNetwork) -> NetFound:
    """Each master starts and stops the nodes of the other."""
    first, *others = [*_managers(network), None]
    for node in others:
        if node is not None and first is not None:
            yield held(node, NMT_STARTUP), f"node {first.node_id} is NMT master, too"
    master = network.state.master
    if first is not None and master is not None and master.node_id not in (None, first.node_id):
        yield held(first, NMT_STARTUP), "the file names another master"


@check("slave-missing", ERROR, "a manager waits for a missing slave (0x1F81)", _BOOT)
def slave_missing(network: CheckedNetwork) -> NetFound:
    """The manager may refuse to start the other nodes without it."""
    for node in _managers(network):
        for (index, slave), value in node.numbers.items():
            if index == SLAVE_ASSIGNMENT and value & _SLAVE and network.state.node(slave) is None:
                yield held(node, index, slave), f"node {slave} is assigned, but not in this network"


@check("slave-not-assigned", WARNING, "a node is not assigned to the manager of the network (0x1F81)", _BOOT)
def slave_not_assigned(network: CheckedNetwork) -> NetFound:
    """The manager does not start the node."""
    for manager in _managers(network):
        for node in network.nodes:
            value = manager.number(SLAVE_ASSIGNMENT, node.node_id)
            if node is not manager and value is not None and not value & _SLAVE:
                yield held(manager, SLAVE_ASSIGNMENT, node.node_id), f"node {node.node_id} is not assigned"


@check("boot-identity", ERROR, "a manager expects another identity of a node (0x1F85 to 0x1F88)", _BOOT)
def boot_identity(network: CheckedNetwork) -> NetFound:
    """The manager refuses to start the node."""
    for manager in _managers(network):
        for (index, slave), expected in manager.numbers.items():
            node, part = network.state.node(slave), _BOOT_IDENTITY.get(index)
            if node is None or part is None or not expected:
                continue
            asked = node.asked.get(IDENTITY_NAMES[part - 1])
            has = node.number(IDENTITY, part) if asked is None else asked
            if has is not None and has != expected:
                name = IDENTITY_NAMES[part - 1]
                text = f"{name} of node {slave} is 0x{has:08X}, but the manager expects 0x{expected:08X}"
                yield held(manager, index, slave), text


@check("boot-device-type", ERROR, "a manager expects another device type of a node (0x1F84)", _BOOT)
def boot_device_type(network: CheckedNetwork) -> NetFound:
    """The manager refuses to start the node."""
    for manager in _managers(network):
        for (index, slave), expected in manager.numbers.items():
            node = network.state.node(slave)
            has = None if node is None else node.number(DEVICE_TYPE)
            if index == EXPECTED_DEVICE_TYPE and expected and has is not None and has != expected:
                yield held(manager, index, slave), f"node {slave} is to be 0x{expected:08X}, and is 0x{has:08X}"


@check(
    "guarded-by-manager", ERROR, "a manager guards a node that sends a heartbeat (guard time in 0x1F81; 0x1F83)", _BOOT
)
def guarded_by_manager(network: CheckedNetwork) -> NetFound:
    """Heartbeat and guarding use the same CAN-ID and exclude each other."""
    for manager in _managers(network):
        for node in network.nodes:
            value = manager.number(SLAVE_ASSIGNMENT, node.node_id) or 0
            if value >> 16 and value >> 8 & 0xFF and node.heartbeat_ms:
                yield held(manager, SLAVE_ASSIGNMENT, node.node_id), f"node {node.node_id} sends a heartbeat"
            elif manager.number(REQUEST_GUARDING, node.node_id) == 1 and node.heartbeat_ms:
                yield held(manager, REQUEST_GUARDING, node.node_id), f"node {node.node_id} sends a heartbeat"


@check("nobody-starts", NOTE, "no node is NMT master, and the file names no master", _BOOT)
def nobody_starts(network: CheckedNetwork) -> NetFound:
    """Another master must start them: nodes come up in PRE-OPERATIONAL, unless they start by themselves (0x1F80)."""
    known = [node for node in network.described if node.number(NMT_STARTUP) is not None]
    if known and not _managers(network) and network.state.master is None:
        yield held(known[0], NMT_STARTUP), "no node starts the others, and the file names no master"


@check("manager-misses", WARNING, "a manager reports a node of the network as missing (0x1F82)", _BOOT)
def manager_misses(network: CheckedNetwork) -> NetFound:
    """The node answers, but has another node-ID or identity, or booted too late for the manager."""
    for manager in _managers(network):
        for node in network.nodes:
            if node is not manager and manager.number(REQUEST_NMT, node.node_id) == _MISSING:
                yield held(manager, REQUEST_NMT, node.node_id), f"node {node.node_id} is present"


@check(
    "boot-time",
    WARNING,
    "the boot time (0x1F89) of a manager ends before a mandatory slave sends its first heartbeat",
    _BOOT,
)
def boot_time(network: CheckedNetwork) -> NetFound:
    """The manager then starts no node."""
    for manager in _managers(network):
        patience_ms = manager.number(BOOT_TIME) or 0
        for node in network.nodes:
            is_needed = (manager.number(SLAVE_ASSIGNMENT, node.node_id) or 0) & (_SLAVE | _MANDATORY)
            if patience_ms and is_needed == _SLAVE | _MANDATORY and patience_ms <= node.heartbeat_ms:
                text = f"it waits {patience_ms} ms; node {node.node_id} sends a heartbeat every {node.heartbeat_ms} ms"
                yield held(manager, BOOT_TIME), text


@check("concise-dcf-form", ERROR, "the data of a manager for a node (0x1F22) is not a concise DCF", _DOWNLOAD)
def concise_dcf_form(network: CheckedNetwork) -> NetFound:
    """The manager configures the node not at all, or only partly."""
    for manager in _managers(network):
        for node_id, data in manager.downloads.items():
            try:
                read_concise_dcf(data)
            except ValueError as wrong:
                yield held(manager, CONCISE_DCF, node_id), f"for node {node_id}: {wrong}"


@check(
    "concise-dcf",
    ERROR,
    "the values that a manager downloads at boot-up (0x1F22) differ from the node's configuration",
    _DOWNLOAD,
)
def concise_dcf(network: CheckedNetwork) -> NetFound:
    """The manager overwrites the configuration, even a stored one, whenever it boots the node."""
    for manager in _managers(network):
        for node_id, data in manager.downloads.items():
            node = network.state.node(node_id)
            differs = [] if node is None else _differs(node, data)
            if differs:
                more = f" and {len(differs) - 3} more" if len(differs) > 3 else ""
                yield held(manager, CONCISE_DCF, node_id), f"node {node_id}: {join_some(differs[:3])}{more}"


def _differs(node: NodeState, data: bytes) -> list[str]:
    """Differences between a concise DCF and the intended state of *node*; empty if *data* is not a concise DCF."""
    try:
        left = read_concise_dcf(data)
    except ValueError:
        return []
    found = []
    for (index, sub_index), value in sorted(left.items()):
        wanted = node.holds(index, sub_index)
        if wanted is not None and wanted != int.from_bytes(value, "little"):
            width = 2 * len(value)
            new = int.from_bytes(value, "little")
            found.append(f"0x{index:04X}:{sub_index:02X} becomes 0x{new:0{width}X}, not 0x{wanted:0{width}X}")
    return found


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
