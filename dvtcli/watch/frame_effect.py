"""A frame's effect on its receivers, as the reason to ask before sending it.

Based on the services' CAN-IDs and the PDOs of nodes that were read. Sends nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.ports import Frame
from dvtcli.domain.text import join_some
from dvtcli.watch.decoder import Address
from dvtcli.watch.service import Service, service_of

_DEFAULTS = "by the pre-defined connection set"
_REQUEST, _DOWNLOADS = " request", (1, 6)
_WORDS = {
    "sync": "SYNC: nodes apply the last received RPDOs and transmit their TPDOs",
    "time": "TIME: nodes set their clocks",
    "emcy": "EMCY{of}: whoever watches takes it for a fault of the node",
    "heartbeat": "heartbeat{of}: whoever watches takes the node for alive, in the state that it names",
    "lss": "LSS: it changes node-IDs and bit rates",
    "sdo": "{label}{of}: whoever asks the node takes it for the node's own",
}
_NMT = {
    NmtCommand.START: "to OPERATIONAL, and a machine may move",
    NmtCommand.STOP: "to STOPPED, and a machine may stop",
    NmtCommand.ENTER_PRE_OPERATIONAL: "to PRE-OPERATIONAL: PDOs end, and a machine may stop",
    NmtCommand.RESET_NODE: "through a restart: unstored values are lost, and a motor may be released",
    NmtCommand.RESET_COMMUNICATION: "through a restart of its communication: unstored communication values are lost",
}


@dataclass(slots=True)
class Parties:
    """Frames' producers and consumers: known for *nodes*, presumed by the standard for all others.

    *consumers* and *producers* are PDOs in words, `RPDO1 of node 5`; *services* are the nodes' own settings for
    SYNC, TIME, EMCY, SDO servers, and the servers that they access as clients.
    """

    nodes: set[int] = field(default_factory=set)
    consumers: dict[Address, list[str]] = field(default_factory=dict)
    producers: dict[Address, list[str]] = field(default_factory=dict)
    services: dict[Address, dict[Service, None]] = field(default_factory=dict)

    def add(self, node_id: int, configs: Mapping[Pdo, PdoConfig]) -> None:
        """Add the enabled PDOs of a node."""
        self.nodes.add(node_id)
        for pdo, config in configs.items():
            cob_id = config.communication.cob_id
            if cob_id.valid:
                users = self.producers if pdo.is_tpdo else self.consumers
                users.setdefault((cob_id.can_id, cob_id.extended), []).append(f"{pdo.label} of node {node_id}")


def effects(frame: Frame, parties: Parties) -> str:
    """Possible effect of *frame* on a bus, in words; empty if no node is known to react.

    If a node was not read, its PDOs are presumed as in the pre-defined connection set.
    """
    address = frame.can_id, frame.extended
    service = service_of(frame.can_id, extended=frame.extended)
    services = {**({} if service.kind in ("pdo", "other") else {service: None}), **parties.services.get(address, {})}
    said = [_of_service(frame, possible_service) for possible_service in services]
    if not frame.remote:  # a remote frame has no data to receive, and the TPDO's own node answers it
        said += _of_pdos(address, service, parties)
    return "; ".join(said)


def _of_pdos(address: Address, service: Service, parties: Parties) -> Iterator[str]:
    consumers, producers = parties.consumers.get(address, []), parties.producers.get(address, [])
    if service.kind == "pdo" and service.node not in parties.nodes:
        presumed = f"{service.label.rstrip('?')} of node {service.node} {_DEFAULTS}"
        if presumed.startswith("TPDO"):
            producers = [*producers, presumed]
        else:
            consumers = [*consumers, presumed]
    if consumers:
        yield f"received by {join_some(consumers)}"
    if producers:
        yield f"sent by {join_some(producers)}: others may mistake this frame for it"


def _of_service(frame: Frame, service: Service) -> str:
    if service.kind == "nmt":
        return _command(frame.data)
    if service.kind == "sdo" and service.label.endswith(_REQUEST):
        writes = bool(frame.data) and frame.data[0] >> 5 in _DOWNLOADS
        to = "" if service.node is None else f" to node {service.node}"
        return f"{service.label}{to}: it {'writes' if writes else 'reads, or continues with a transfer'}"
    if service.kind == "heartbeat" and frame.remote:
        return f"node guarding of node {service.node}: it may start life guarding"
    of = "" if service.node is None else f" of node {service.node}"
    return _WORDS[service.kind].format(of=of, label=service.label)


def _command(data: bytes) -> str:
    """An NMT command in words, even if malformed."""
    command = NmtCommand(data[0]) if data and data[0] in set(NmtCommand) else None
    if command is None or len(data) < 2:
        return "NMT: not a command of CiA 301; its effect on nodes is unknown"
    who = f"node {data[1]}" if data[1] else "all nodes"
    return f"NMT {command.word}: {who} {'goes' if data[1] else 'go'} {_NMT[command]}"
