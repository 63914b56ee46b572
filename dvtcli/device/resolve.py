"""Resolve a PDO request on a node: complete it, or refuse an impossible request.

Reads lengths of objects; the rules are applied elsewhere. Writes nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

from dvtcli.device.other_producers import producers
from dvtcli.device.proposal import proposal
from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.mapping import PdoMappingEntry
from dvtcli.domain.request import PdoRequest, entry_number, resolved
from dvtcli.domain.rules.mapped_object import missing_object
from dvtcli.errors import RuleError, UsageError

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.device.proposal import Elsewhere
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.domain.request import PdoWant
    from dvtcli.domain.rules import Proposal

Lengths = Mapping["ObjectAddress", int | None]


def untyped_lengths(node: ReadableNode, wants: Iterable[PdoWant]) -> Lengths:
    """Lengths in bits of the objects named without a length in *wants*, from the EDS or *node*; None if unknown."""
    places = [place for want in wants if isinstance(want, PdoRequest) for place in want.untyped_lengths]
    return {place: node.length_of(*place) for place in dict.fromkeys(places)}


def resolve(
    node: ReadableNode, pdo: Pdo, now: PdoConfig, want: PdoWant, lengths: Lengths, elsewhere: Elsewhere | None = None
) -> PdoConfig:
    """The configuration requested by *want* for *pdo* of *node*, now *now*; *lengths* come from `untyped_lengths`.

    *elsewhere* are the future PDOs of the other nodes, None for the present. Raises RuleError for an object missing in
    the EDS, UsageError for any other unresolvable request.
    """
    beside = elsewhere or cache(lambda: producers(node.neighbours()))
    held = proposal(node, pdo, now, now, elsewhere=beside)
    if isinstance(want, PdoRequest):
        if want.extended and not isinstance(want.cob_id, int):
            from dvtcli.domain.hint import Action, Hint

            raise UsageError(
                f"{pdo.label}: a CAN-ID of 29 bits is not chosen by itself",
                node=node.node_id,
                hint=Hint(Action.GIVE, {"cob_id": "CAN_ID"}, "{} says which"),
            )
        _refuse_missing(held, want, [place for place in want.untyped_lengths if lengths[place] is None])
    try:
        config = resolved(want, held, lengths)
    except ValueError as wrong:
        raise UsageError(f"{pdo.label}: {wrong}", node=node.node_id) from wrong
    if isinstance(want, PdoRequest) and want.mpdo is not None:
        first = read_optional(node.memory, pdo.mapping_index, 1, 4)
        config = replace(config, multiplexed=() if first is None else (PdoMappingEntry.from_raw(first),))
    return config


def _refuse_missing(held: Proposal, want: PdoRequest, unknown: Iterable[ObjectAddress]) -> None:
    """Raise RuleError for an object of *unknown* length that is missing in the EDS."""
    dictionary = held.dictionary
    for index, sub_index in unknown:
        if dictionary is not None and dictionary.entry(index, sub_index) is None:
            number = entry_number(want.objects or (), (index, sub_index), held)
            finding = missing_object(dictionary, held.mapping_place(number), index, sub_index)
            text = f"{held.pdo.label} not changed: {finding.text}"
            raise RuleError(text, [finding], node=held.node_id)
