"""How to describe nodes whose objects have no names, since no file of theirs is known."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import ERASED
from dvtcli.domain.text import all_nodes

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.node_parts import ReadableNode


def add_eds(nodes: Iterable[ReadableNode], before: str, after: str) -> Hint:
    """How to add the EDS of *nodes* that have none, between the words *before* and *after*.

    The identity that each node tells (0x1018) goes with it: a file may lack it. No library file can be found for a
    node without a vendor number.
    """
    words: dict[str, list[int]] = {}
    for node in nodes:
        words.setdefault(_identity_word(node.identity()), []).append(node.node_id)
    nameless = words.pop("", [])
    if not words:
        return _nameless(nameless, before)
    first, *others = (Hint(Action.ADD_EDS, {"identity": word}, "{}") for word in words)
    chained = replace(first, why=f"{before}{{}}")
    for other in others:
        chained += replace(other, why=", {}")
    chained = chained + after if after else chained
    return chained + _nameless(nameless, "; ") if nameless else chained


def _nameless(node_ids: Sequence[int], before: str) -> Hint:
    """How to describe nodes without a vendor number."""
    words = f"no vendor number (0x1018:01), so no file of the library can be found for {all_nodes(node_ids)}"
    return Hint(Action.GIVE_EDS, why=f"{before}{words}: `dcf: FILE` at it in a network file, or {{}} and its node-ID")


def _identity_word(identity: Identity) -> str:
    vendor, product = identity["vendor"], identity["product"]
    if not vendor:
        return ""
    has_product = product not in (None, 0, ERASED)
    return f"vendor=0x{vendor:X},product=0x{product:X}" if has_product else f"vendor=0x{vendor:X}"
