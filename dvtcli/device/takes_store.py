"""Whether a node supports a store command. Sends none."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.errors import DeviceRefused, DvtcliError

if TYPE_CHECKING:
    from dvtcli.device.node import Node


def takes_store(node: Node) -> bool:
    """True if *node* supports a store command, or nobody knows; its 0x1010 is read once."""
    if node.takes_store is None:
        from dvtcli.device.store_parameters import STORE, chosen

        try:
            chosen(node.access, node.profile.store, STORE, None, node.dictionary)
            node.takes_store = True
        except DeviceRefused:
            node.takes_store = False
        except DvtcliError:
            return True
    return node.takes_store
