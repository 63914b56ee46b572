"""The CAN-IDs of a node's SDO servers, further ones as well (CiA 301, 7.5.2.33)."""

from __future__ import annotations

from collections.abc import Mapping

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.watch.decoder import Address, Layout, no_values
from dvtcli.watch.service import Service

#: objects of the servers; sub-index 1 is the COB-ID to the server, 2 that from it
SDO_SERVERS = range(0x1200, 0x1280)
_WORDS = {1: "request", 2: "answer"}
#: index, sub-index
Place = tuple[int, int]


def server_layouts(node_id: int, numbers: Mapping[Place, int]) -> dict[Address, Layout]:
    """Return a layout for each CAN-ID of the SDO servers of *node_id*: `SDO2 request` and `SDO2 answer` of 0x1201.

    *numbers* are values of its objects; a disabled COB-ID has no layout.
    """
    found: dict[Address, Layout] = {}
    for (index, sub_index), raw in numbers.items():
        cob_id = CobId.from_raw(raw)
        if index in SDO_SERVERS and sub_index in _WORDS and cob_id.valid and cob_id.can_id:
            label = f"{server_name(index)} {_WORDS[sub_index]}"
            found[cob_id.can_id, cob_id.extended] = Layout(Service("sdo", label, node_id), (), no_values)
    return found


def server_name(index: int) -> str:
    """Name the SDO server at *index*: `SDO` is the default one, `SDO2` that of 0x1201."""
    number = index - SDO_SERVERS[0] + 1
    return "SDO" if number == 1 else f"SDO{number}"


def described_servers(
    node_id: int, dictionary: ObjectDictionary | None, written: Mapping[Place, int] | None = None
) -> dict[Address, Layout]:
    """Return `server_layouts` by the values in *dictionary*, and by those *written* instead."""
    numbers: dict[Place, int] = {}
    for index in SDO_SERVERS[1:] if dictionary is not None else ():
        for sub_index in _WORDS if dictionary is not None and index in dictionary else ():
            entry = None if dictionary is None else dictionary.entry(index, sub_index)
            data = None if entry is None else entry.initial(node_id)
            if data is not None:
                numbers[index, sub_index] = int.from_bytes(data, "little")
    return server_layouts(node_id, {**numbers, **(written or {})})
