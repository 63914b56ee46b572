"""Tell process data from settings, which a store keeps and a proof compares. Writes nothing.

`Configuration` tells the configuration for a file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.objects import MANUFACTURER_AREA
from dvtcli.domain.process_data import is_named_as_process_data, is_standard_command, may_be_commanded

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.profile import ObjectAddress


def is_no_setting(node: ReadableNode, place: ObjectAddress) -> bool:
    """True if the object at *place* is a command, a target or an output, by a standard or for a manufacturer's object.

    A manufacturer's object counts by its name, if a PDO can carry it, and always if an enabled RPDO maps it, whatever
    its file says.
    """
    dictionary = node.dictionary
    entry = dictionary.entry(*place) if dictionary else None
    if is_standard_command(place[0], entry):
        return True
    if place[0] not in MANUFACTURER_AREA:
        return False
    if dictionary is not None and entry is not None and may_be_commanded(entry):
        name = f"{entry.name} {dictionary.display_name(*place)}"
        return is_named_as_process_data(name) or _is_taken(node, place)
    return _is_taken(node, place)


def is_process_data(node: ReadableNode, place: ObjectAddress) -> bool:
    """True if a machine may change the object at *place* at any time: no setting, or mapped in an enabled RPDO."""
    return is_no_setting(node, place) or _is_taken(node, place)


def _is_taken(node: ReadableNode, place: ObjectAddress) -> bool:
    return any(
        (mapped.index, mapped.sub_index) == place
        for pdo, config in node.known_pdos().items()
        if config.enabled and not pdo.is_tpdo
        for mapped in config.mapping
    )
