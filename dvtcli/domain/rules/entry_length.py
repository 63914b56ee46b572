"""Rules about the length of one mapping entry (CiA 301, 7.5.2.36/38; CiA 306, Granularity)."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.abort import Abort
from dvtcli.domain.mapping import MAX_PDO_BITS, PdoMappingEntry
from dvtcli.domain.rules.finding import ERROR, Finding, Proposal, Rule, error

RULES = (
    Rule("entry-length", ERROR, "the length of an entry differs from its object's, is 0, or exceeds 64 bits",
         "CiA 301, 7.5.2.36 and 7.5.2.38; the EDS; the family", (Abort.NOT_MAPPABLE, Abort.VALUE_RANGE)),
    Rule("granularity", ERROR, "the length of an entry is not a multiple of the device's granularity",
         "the EDS, Granularity (CiA 306); the family", (Abort.NOT_MAPPABLE,)),
)  # fmt: skip


def length_findings(proposal: Proposal, place: str, entry: PdoMappingEntry) -> Iterator[Finding]:
    """Judge the length of *entry* at *place*: in itself, by the family, and by its object."""
    profile = proposal.profile
    if not 1 <= entry.bits <= MAX_PDO_BITS:
        abort = Abort.NOT_MAPPABLE if entry.bits or not entry.raw else Abort.VALUE_RANGE
        yield error("entry-length", place, f"{entry} has {entry.bits} bits; an entry has 1..64", abort)
        return
    granularity = _granularity(proposal)
    if entry.bits % granularity:
        yield error(
            "granularity",
            place,
            f"{entry} has {entry.bits} bits; this device maps multiples of {granularity}",
            Abort.NOT_MAPPABLE,
        )
    if entry.bits > profile.max_entry_bits:
        yield error(
            "entry-length",
            place,
            f"{entry} is longer than the {profile.max_entry_bits} bits that a {profile.title} takes per entry",
            Abort.NOT_MAPPABLE,
        )
    if not entry.is_dummy:
        yield from _against_object(proposal, place, entry)


def _against_object(proposal: Proposal, place: str, entry: PdoMappingEntry) -> Iterator[Finding]:
    known = _object_bits(proposal, entry)
    if known is None or entry.bits == known:
        return
    name = proposal.name(entry.index, entry.sub_index)
    if entry.bits > known:
        yield error(
            "entry-length",
            place,
            f"{name} has {known} bits, {entry.bits} were requested",
            Abort.NOT_MAPPABLE,
            f"write {entry.object} or {entry.object}/{known}",
        )
    elif not proposal.profile.partial_entries:
        yield error(
            "entry-length",
            place,
            f"{name} has {known} bits, only {entry.bits} were requested: CiA 301 does not define which bits a device "
            f"transmits then",
            None,
            f"write {entry.object} or {entry.object}/{known}",
        )


def _granularity(proposal: Proposal) -> int:
    """The profile's granularity, else the EDS's if 1 or 8 (real files also hold 0 and 64, without meaning)."""
    if proposal.profile.granularity is not None:
        return proposal.profile.granularity
    stated = proposal.dictionary.info.granularity if proposal.dictionary else None
    return 8 if stated == 8 else 1


def _object_bits(proposal: Proposal, entry: PdoMappingEntry) -> int | None:
    found = proposal.dictionary.entry(entry.index, entry.sub_index) if proposal.dictionary else None
    if found is not None and found.bits is not None:
        return found.bits
    return proposal.lengths.get((entry.index, entry.sub_index))
