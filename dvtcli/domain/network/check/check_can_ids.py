"""Rules about CAN-IDs: one producer each, and no CAN-ID of another service."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

from dvtcli.domain.can_ids import EMCY_BASE, LSS_REQUEST_ID, LSS_RESPONSE_ID
from dvtcli.domain.cob_id import SYNC_BY_DEFAULT, taken_by_channels
from dvtcli.domain.lint import ERROR, WARNING, check
from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetFound, NetSpot, at, held
from dvtcli.domain.network.network_state import Identifier, NodeState, identifier_of, identifier_text
from dvtcli.domain.objects import COB_ID_EMCY, COB_ID_SYNC, COB_ID_TIME
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.rules.can_id import default_owner, restricted_use
from dvtcli.domain.standard_objects import source

_SET = "CiA 301, 7.3.5: the pre-defined connection set"
_RESTRICTED = "CiA 301, 7.3.5: restricted CAN-IDs"
_LSS = (LSS_RESPONSE_ID, LSS_REQUEST_ID)
_SDO = ("SDO answers", "SDO requests")


@check("one-producer", ERROR, "two TPDOs send the same CAN-ID: their frames collide on the wire", _SET)
def one_producer(network: CheckedNetwork) -> NetFound:
    """Two frames with the same CAN-ID and different data cause a bus error."""
    senders: defaultdict[Identifier, list[tuple[NodeState, Pdo]]] = defaultdict(list)
    for node, pdo, config in network.tpdos:
        senders[identifier_of(config)].append((node, pdo))
    for identifier, found in senders.items():
        first, *others = found
        for node, pdo in others:
            yield (
                at(node, pdo),
                f"{identifier_text(identifier)} is sent by {first[1].label} of node {first[0].node_id}, too",
            )


def _of_pdos(network: CheckedNetwork, wanted: str) -> NetFound:
    for node, pdo, config in network.enabled:
        can_id, extended = identifier_of(config)
        if not extended and _service(can_id) == wanted:
            yield (
                at(node, pdo),
                f"{config.communication.cob_id} is {restricted_use(can_id) if wanted != 'LSS' else 'LSS'}",
            )


def _service(can_id: int) -> str:
    """The CiA 301 service with *can_id*, empty if a PDO may use it."""
    return "LSS" if can_id in _LSS else restricted_use(can_id) or ""


@check("can-id-of-nmt", ERROR, "an enabled PDO has CAN-ID 0x000: its frames are NMT commands", _RESTRICTED)
def can_id_of_nmt(network: CheckedNetwork) -> NetFound:
    """The first byte is taken for a command to the node in the second."""
    yield from _of_pdos(network, "NMT")


@check("can-id-of-sdo", ERROR, "an enabled PDO has a CAN-ID of some node's SDO", _RESTRICTED)
def can_id_of_sdo(network: CheckedNetwork) -> NetFound:
    """The PDO is taken for an SDO request or answer of another node."""
    yield from _of_pdos(network, "SDO answers")
    yield from _of_pdos(network, "SDO requests")
    taken: dict[Identifier, str] = {}
    for node in network.nodes:
        taken |= taken_by_channels(node.node_id, node.sdo_channels)
    free = {can_id: what for can_id, what in taken.items() if can_id[1] or _service(can_id[0]) not in _SDO}
    yield from _enabled_among(network, free)


@check("can-id-of-heartbeat", ERROR, "an enabled PDO has the CAN-ID of some node's heartbeat", _RESTRICTED)
def can_id_of_heartbeat(network: CheckedNetwork) -> NetFound:
    """The PDO hides the loss of a node."""
    yield from _of_pdos(network, "heartbeats")


@check("can-id-of-lss", ERROR, "an enabled PDO has a CAN-ID of LSS", "CiA 305; CiA 301, 7.3.5")
def can_id_of_lss(network: CheckedNetwork) -> NetFound:
    """0x7E4 and 0x7E5 set node-IDs and bit rates."""
    yield from _of_pdos(network, "LSS")


@check("can-id-reserved", ERROR, "an enabled PDO has a CAN-ID that CiA 301 reserves", _RESTRICTED)
def can_id_reserved(network: CheckedNetwork) -> NetFound:
    """Devices may refuse the CAN-ID."""
    yield from _of_pdos(network, "reserved")


@check("can-id-of-sync", ERROR, "an enabled PDO has the CAN-ID of SYNC", source(0x1005))
def can_id_of_sync(network: CheckedNetwork) -> NetFound:
    """Each of the PDO's frames is a SYNC for every node."""
    syncs = {node.sync for node in network.nodes} or {SYNC_BY_DEFAULT}
    return _enabled_among(network, dict.fromkeys(syncs, "SYNC"))


@check("can-id-of-emcy", ERROR, "an enabled PDO has the CAN-ID of a node's EMCY", source(0x1014))
def can_id_of_emcy(network: CheckedNetwork) -> NetFound:
    """The PDO is taken for an emergency."""
    emcys = {node.emcy: f"EMCY of node {node.node_id}" for node in network.nodes if node.emcy is not None}
    return _enabled_among(network, emcys)


@check("can-id-of-time", ERROR, "an enabled PDO has the CAN-ID of the time stamp that a node sends", source(0x1012))
def can_id_of_time(network: CheckedNetwork) -> NetFound:
    """The PDO's data would be taken for a time."""
    times = {node.time for node in network.nodes if node.produces(COB_ID_TIME)}
    return _enabled_among(network, dict.fromkeys(times, "TIME"))


def _enabled_among(network: CheckedNetwork, names: Mapping[Identifier, str]) -> NetFound:
    """Enabled PDOs with a CAN-ID in *names*, each with the CAN-ID's use."""
    for node, pdo, config in network.enabled:
        if (name := names.get(identifier_of(config))) is not None:
            yield at(node, pdo), f"{config.communication.cob_id} is {name}"


@check("emcy-twice", ERROR, "two nodes send EMCY with the same CAN-ID", source(0x1014))
def emcy_twice(network: CheckedNetwork) -> NetFound:
    """The producer of an emergency is ambiguous, and the frames collide."""
    owners: dict[Identifier, int] = {}
    for node in network.nodes:
        if node.emcy is not None and (other := owners.setdefault(node.emcy, node.node_id)) != node.node_id:
            yield held(node, COB_ID_EMCY), f"{identifier_text(node.emcy)} is EMCY of node {other}, too"


@check(
    "emcy-can-id",
    ERROR,
    "EMCY has the CAN-ID of SYNC or a CAN-ID that CiA 301 restricts",
    f"{source(0x1014)} and 7.3.5",
)
def emcy_can_id(network: CheckedNetwork) -> NetFound:
    """The emergency is taken for another service."""
    for node in network.nodes:
        if node.emcy is None or node.emcy[1]:
            continue
        use = "SYNC" if node.emcy == node.sync else _service(node.emcy[0])
        if use:
            yield held(node, COB_ID_EMCY), f"{identifier_text(node.emcy)} is {use}"


@check("emcy-of-other", WARNING, "EMCY has the pre-defined CAN-ID of another node's EMCY", _SET)
def emcy_of_other(network: CheckedNetwork) -> NetFound:
    """Devices that rely on the pre-defined connection set take it for the other node's emergency."""
    for node in network.nodes:
        if node.emcy is not None and not node.emcy[1] and 0x081 <= node.emcy[0] <= 0x0FF:
            owner = node.emcy[0] - EMCY_BASE
            if owner != node.node_id:
                yield held(node, COB_ID_EMCY), f"{identifier_text(node.emcy)} is EMCY of node {owner} by default"


@check("sync-can-id", ERROR, "SYNC has a CAN-ID that CiA 301 restricts", f"{source(0x1005)} and 7.3.5")
def sync_can_id(network: CheckedNetwork) -> NetFound:
    """The SYNC is taken for another service."""
    for node in network.nodes:
        can_id, extended = node.sync
        if not extended and (use := _service(can_id)):
            yield held(node, COB_ID_SYNC), f"SYNC {identifier_text(node.sync)} is {use}"


@check("sync-ids-differ", ERROR, "a node waits for SYNC with another CAN-ID than the producer sends", source(0x1005))
def sync_ids_differ(network: CheckedNetwork) -> NetFound:
    """The node's synchronous PDOs wait forever."""
    producers = [node for node in network.nodes if node.produces_sync]
    waiting = {node.node_id for node, _, _ in network.synchronous}
    for node in network.nodes:
        if producers and node.node_id in waiting and all(node.sync != other.sync for other in producers):
            sent = identifier_text(producers[0].sync)
            text = f"it waits for {identifier_text(node.sync)}, node {producers[0].node_id} sends {sent}"
            yield held(node, COB_ID_SYNC), text


@check("time-ids-differ", WARNING, "a node waits for the time stamp with another CAN-ID than is sent", source(0x1012))
def time_ids_differ(network: CheckedNetwork) -> NetFound:
    """The node's clock is never set."""
    producers = [node for node in network.nodes if node.produces(COB_ID_TIME)]
    for node in network.nodes:
        waits = (node.number(COB_ID_TIME) or 0) >> 31
        if producers and waits and all(node.time != other.time for other in producers):
            sent = identifier_text(producers[0].time)
            yield held(node, COB_ID_TIME), f"it waits for {identifier_text(node.time)}, {sent} is sent"


@check("two-times", ERROR, "two nodes transmit TIME with the same CAN-ID", source(0x1012))
def two_times(network: CheckedNetwork) -> NetFound:
    """Clocks jump."""
    seen: dict[Identifier, int] = {}
    for node in network.nodes:
        if node.produces(COB_ID_TIME):
            other = seen.setdefault(node.time, node.node_id)
            if other != node.node_id:
                yield held(node, COB_ID_TIME), f"node {other} sends it, too"


@check("can-id-of-other", WARNING, "a TPDO has the pre-defined CAN-ID of another node's TPDO", _SET)
def can_id_of_other(network: CheckedNetwork) -> NetFound:
    """The CAN-IDs collide as soon as the other PDO is enabled with its default."""
    present = {node.node_id for node in network.nodes}
    for node, pdo, config in network.tpdos:
        can_id, extended = identifier_of(config)
        owner = None if extended else default_owner(can_id)
        if (
            owner is not None
            and owner[0].is_tpdo
            and owner[1] != node.node_id
            and owner[1] in present
            and pdo.number <= 4
        ):
            yield at(node, pdo), f"{config.communication.cob_id} is {owner[0].label} of node {owner[1]} by default"


@check("other-formula", WARNING, "PDO 5 to 16 is enabled on a pre-defined CAN-ID of another node-ID (node-ID + 32, 64 "
       "or 96)", "dvtcli's own: gateways that number PDOs 5 to 16 this way allow node-IDs 1 to 32 only")  # fmt: skip
def other_formula(network: CheckedNetwork) -> NetFound:
    """Safe while all node-IDs are at most 32, unless a node has the other ID."""
    present = {node.node_id for node in network.nodes}
    for node, pdo, config in network.enabled:
        can_id, extended = identifier_of(config)
        owner = None if extended or not 5 <= pdo.number <= 16 else default_owner(can_id)
        if owner is None or owner[1] - node.node_id not in (32, 64, 96):
            continue
        if node.node_id > 32 or owner[1] in present:
            yield at(node, pdo), f"{config.communication.cob_id} is {owner[0].label} of node {owner[1]} by default"


@check(
    "node-id-of-master",
    ERROR,
    "a node has the node-ID of the master",
    "CiA 301, 7.3.4: each device has its own node-ID",
)
def node_id_of_master(network: CheckedNetwork) -> NetFound:
    """Both answer SDO requests and send the same heartbeat."""
    master = network.state.master
    for node in network.nodes:
        if master is not None and master.node_id == node.node_id:
            yield NetSpot(node.node_id), f"{node.node_id} is the node-ID of the master"
