"""Check, before any write, whether the nodes of a network can store. Writes nothing."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from dvtcli.device.store.store_parameters import chosen
from dvtcli.domain.hint import Hint, as_hint
from dvtcli.domain.objects import STORE_PARAMETERS
from dvtcli.domain.rules.finding import ERROR, Finding, Rule, error
from dvtcli.errors import DeviceRefused, RuleError, SdoAborted

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.network.network_config import NetworkConfig
    from dvtcli.domain.store import ProveBy
    from dvtcli.files.network.file_log import FileLog

RULES = (
    Rule("store-impossible", ERROR, "`store` of a network file names a group that the device does not store on command",
         "CiA 301, 7.5.2.13: the sub-indices of 0x1010, bit 0 of each; the EDS, AccessType"),
)  # fmt: skip
#: Words of `store` as sub-indices of 0x1010; `all` is whatever the device means by a store.
_GROUPS = {"all": None, "communication": 2, "application": 3}


def store_group(word: str) -> int | None:
    """Parse a network file's store group (name or number) into a sub-index of 0x1010; None: the device's default."""
    return _GROUPS[word] if word in _GROUPS else int(word)


def refuse_impossible_stores(nodes: Mapping[int, ReadableNode], stores: Mapping[int, str]) -> None:
    """Raises RuleError with each of *nodes* that cannot make its store of *stores* (by node-ID); never forced."""
    found = {node_id: _finding(nodes[node_id], word) for node_id, word in stores.items() if word}
    findings = [finding for finding in found.values() if finding is not None]
    if findings:
        ids = [node_id for node_id, store_finding in found.items() if store_finding is not None]
        only = ids[0] if len(ids) == 1 else None
        text = f"nothing was written: {findings[0].text}"
        raise RuleError(text, findings, node=only, can_force=False)


def refuse_stores_of(nodes: Mapping[int, ReadableNode], config: NetworkConfig, log: FileLog) -> None:
    """Apply `refuse_impossible_stores` to the nodes of *config*, with places in the file of *log*."""
    refused: list[RuleError] = []
    for node in config.nodes:
        try:
            refuse_impossible_stores(nodes, {node.node_id: str(node.store or "")})
        except RuleError as one:
            if node.store_mark.line:
                one.complaints = (log.shown(node.store_mark, one.findings[0].text),)
                one.text = f"{one.complaints[0].place}: {one.findings[0].text}"
            refused.append(one)
    if len(refused) == 1:
        raise refused[0]
    if refused:
        every = RuleError(
            refused[0].text, [finding for rule_error in refused for finding in rule_error.findings], can_force=False
        )
        every.complaints = tuple(complaint for rule_error in refused for complaint in rule_error.complaints)
        raise every


def refuse_unprovable_stores(nodes: Mapping[int, ReadableNode], stores: Mapping[int, str], prove: ProveBy) -> None:
    """Raises DeviceRefused if a restart (`reset`, `power`) could not prove a store of *stores*."""
    from dvtcli.device.store.prove_store import refuse_unprovable

    for node_id, word in stores.items():
        refuse_unprovable(nodes[node_id], store_group(word), certain=prove == "power")


def _finding(node: ReadableNode, word: str) -> Finding | None:
    with suppress(SdoAborted):  # what it answers to the store itself is told then
        try:
            chosen(node.access, node.profile.store, STORE_PARAMETERS, store_group(word), node.dictionary)
        except DeviceRefused as refused:
            said = "true" if word == "all" else word
            text = f"store: {said} of node {node.node_id}: {refused.text}: {refused.why}"
            place = f"0x{refused.place}"
            return error("store-impossible", place, text, refused.abort, _hint(node, word, refused))
    return None


def _hint(node: NodeDescription, word: str, refused: DeviceRefused) -> Hint | str:
    """Suggest another word for the file, or the device's own way of storing, if known."""
    others = node.profile.store.sub_indices
    if word != "all" and others and store_group(word) not in others:
        group = f"0x{STORE_PARAMETERS:04X}:{others[0]:02X}"
        return f"store: true stores group {group} of the device, store: false stores nothing"
    return "store: false stores nothing" + as_hint(refused.hint or "")
