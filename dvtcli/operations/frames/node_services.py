"""Where a node says that it has SYNC, EMCY and its SDO servers, by default or elsewhere. Only reads."""

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

_EMCY = 0x1014
#: CiA 301, 7.5.2.33: sub-index 1 is where the server is asked, 2 where it answers
_SDO_SERVERS = range(0x1200, 0x1280)
_SDO_WORDS = {1: "SDO request", 2: "SDO answer"}


def node_services(node: Node) -> Iterator[tuple[Address, Service]]:
    """Each service whose CAN-ID *node* says (0x1005, 0x1014, 0x1200…0x127F); what it does not answer is left out."""
    sync = sync_frame(node.sdo)
    yield (sync.can_id, sync.extended), Service("sync", "SYNC")
    if address := _address(node, _EMCY, 0):
        yield address, Service("emcy", "EMCY", node.node_id)
    exists = True
    for index in _SDO_SERVERS:
        if exists or (node.dictionary and node.dictionary.entry(index, 1)):
            found = {sub_index: _address(node, index, sub_index) for sub_index in _SDO_WORDS}
            exists = index == _SDO_SERVERS[0] or any(found.values())
            for sub_index, address in found.items():
                if address:
                    yield address, Service("sdo", _SDO_WORDS[sub_index], node.node_id)


def _address(node: Node, index: int, sub_index: int) -> Address | None:
    """The CAN-ID in an object, None where there is none, or where bit 31 says that the service is off."""
    try:
        cob_id = CobId.from_raw(read_number(node.sdo, index, sub_index, 4))
    except (NoAnswer, SdoAborted, SdoProtocolError):
        return None
    return (cob_id.can_id, cob_id.extended) if cob_id.valid and cob_id.can_id else None
