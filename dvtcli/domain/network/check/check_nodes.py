"""Rules about the identity of nodes."""

from __future__ import annotations

from dvtcli.domain.lint.lint_rule import ERROR, WARNING, check
from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetFound, at, held
from dvtcli.domain.network.network_state import IDENTITY, IDENTITY_NAMES


@check("identity", ERROR, "a node has another identity (0x1018) than the file asks for", "CiA 301, 7.5.2.19")
def identity(network: CheckedNetwork) -> NetFound:
    """The node is another device, so its EDS does not fit."""
    for node in network.told:
        for sub_index, name in enumerate(IDENTITY_NAMES, 1):
            wanted, has = node.asked.get(name), node.number(IDENTITY, sub_index)
            if wanted is not None and has is not None and wanted != has:
                yield held(node, IDENTITY, sub_index), f"its {name} is 0x{has:08X}, the file says 0x{wanted:08X}"


@check("eds-identity", ERROR, "the EDS, DCF, XDD or XDC of a node is for another device than it says in 0x1018",
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
    """The DCF's values may contain the other node-ID."""
    for node in network.told:
        made_for = None if node.dictionary is None else node.dictionary.info.node_id
        if made_for and made_for != node.node_id:
            yield at(node), f"its DCF is for node-ID {made_for}"
