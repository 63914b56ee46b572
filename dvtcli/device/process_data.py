"""Which objects of a node are process data, and no setting that a store keeps and a proof compares. Writes nothing.

Does not know what is configuration for a file: that is `Configuration`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.command_object import is_standard_command
from dvtcli.domain.named_process_data import is_named_as_process_data

if TYPE_CHECKING:
    from dvtcli.device.known_pdos import KnownPdos
    from dvtcli.device.wish import Place
    from dvtcli.domain.object_dictionary import OdEntry

_MAKERS = range(0x2000, 0x6000)


def is_no_setting(node: KnownPdos, place: Place) -> bool:
    """Whether the object at *place* is a command, a target or an output by a standard; a maker's own by its name, too.

    The latter only where a PDO can carry it, and so is what an enabled RPDO takes of the maker's.
    """
    dictionary = node.dictionary
    entry = dictionary.entry(*place) if dictionary else None
    if is_standard_command(place[0], entry):
        return True
    if dictionary is None or entry is None or place[0] not in _MAKERS or not _is_carried(entry):
        return False
    return is_named_as_process_data(f"{entry.name} {dictionary.display_name(*place)}") or _is_taken(node, place)


def is_process_data(node: KnownPdos, place: Place) -> bool:
    """Whether a machine may change the object at *place* at any time: no setting, or what an enabled RPDO takes."""
    entry = node.dictionary.entry(*place) if node.dictionary else None
    return is_no_setting(node, place) or (entry is not None and _is_carried(entry) and _is_taken(node, place))


def _is_carried(entry: OdEntry) -> bool:
    """Whether its file lets a PDO carry the object, and a master write it."""
    return bool(entry.pdo_mapping) and entry.access.writable


def _is_taken(node: KnownPdos, place: Place) -> bool:
    return any(
        (mapped.index, mapped.sub_index) == place
        for pdo, config in node.known_pdos().items()
        if config.enabled and not pdo.is_tpdo
        for mapped in config.mapping
    )
