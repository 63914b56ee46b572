"""Where a node says that it has SYNC, TIME, EMCY and its SDO channels, by default or elsewhere. Only reads."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_number
from dvtcli.domain.cob_id import CobId
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError
from dvtcli.operations.sync.sync_frame import sync_frame
from dvtcli.watch.service import Service

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.watch.decoder import Address

_EMCY, _TIME = 0x1014, 0x1012
#: bits of 0x1012: the node takes TIME, it sends TIME (CiA 301, 7.5.2.15); bit 31 is no "off" there
_TAKES, _SENDS = 1 << 31, 1 << 30
#: CiA 301, 7.5.2.33 and 7.5.2.34: sub-index 1 is where the server is asked, 2 where it answers; of a client's channel 3
#: is the server's node-ID
_SDO_SERVERS, _SDO_CLIENTS = range(0x1200, 0x1280), range(0x1280, 0x1300)
_SDO_WORDS = {1: "SDO request", 2: "SDO answer"}
_SERVER = 3


def node_services(node: Node) -> Iterator[tuple[Address, Service]]:
    """Each service whose CAN-ID *node* says: SYNC, TIME, EMCY, its SDO servers (0x1200…) and clients (0x1280…).

    What it does not answer is left out.
    """
    sync = sync_frame(node.sdo)
    yield (sync.can_id, sync.extended), Service("sync", "SYNC")
    time = _number(node, _TIME, 0)
    if time is not None and time & (_TAKES | _SENDS) and (address := _address(time & ~_TAKES)):
        yield address, Service("time", "TIME")
    if address := _address(_number(node, _EMCY, 0)):
        yield address, Service("emcy", "EMCY", node.node_id)
    for _, channel in _sdo_channels(node, _SDO_SERVERS):
        for word, address in channel.items():
            yield address, Service("sdo", word, node.node_id)
    for index, channel in _sdo_channels(node, _SDO_CLIENTS):
        server = (_number(node, index, _SERVER, 1) or None) if channel else None
        for word, address in channel.items():
            yield address, Service("sdo", word, server)


def _sdo_channels(node: Node, indices: range) -> Iterator[tuple[int, dict[str, Address]]]:
    """Each SDO channel among *indices* with its CAN-IDs: up to the first that is absent, and those that the EDS has."""
    exists = True
    for index in indices:
        if exists or (node.dictionary and node.dictionary.entry(index, 1)):
            said = {word: _number(node, index, sub_index) for sub_index, word in _SDO_WORDS.items()}
            exists = index == _SDO_SERVERS[0] or any(raw is not None for raw in said.values())
            yield index, {word: address for word, raw in said.items() if (address := _address(raw))}


def _number(node: Node, index: int, sub_index: int, size: int = 4) -> int | None:
    try:
        return read_number(node.sdo, index, sub_index, size)
    except (NoAnswer, SdoAborted, SdoProtocolError):
        return None


def _address(raw: int | None) -> Address | None:
    """The CAN-ID in a COB-ID, None where there is none, or where bit 31 says that the service is off."""
    if raw is None:
        return None
    cob_id = CobId.from_raw(raw)
    return (cob_id.can_id, cob_id.extended) if cob_id.valid and cob_id.can_id else None
