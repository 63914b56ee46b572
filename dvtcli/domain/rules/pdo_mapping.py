"""Rules about a PDO's mapping: completeness, size, entries, dummies, changes (CiA 301, 7.5.2.36/38; CiA 306)."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import count

from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import DUMMY_BITS, MAX_ENTRIES, MAX_PDO_BITS, PdoConfig, PdoMappingEntry, split_dummy
from dvtcli.domain.plan import disables, mapping_differs, needs_disabling
from dvtcli.domain.profile import DeviceProfile, Severity
from dvtcli.domain.rules.finding import ERROR, NOTE, WARNING, Finding, Proposal, Rule, error, note, warning
from dvtcli.domain.rules.mapped_object import object_findings
from dvtcli.domain.text import join_some

_MAPPING = "CiA 301, 7.5.2.36 and 7.5.2.38"
RULES = (
    Rule("mpdo", (Severity.ERROR, Severity.WARNING),
         "a multiplexed PDO would get mapped objects or is not event-driven (error), or the device has "
         "GroupMessaging=0 (warning)",
         "CiA 301, 7.5.2.36: counts 0xFE and 0xFF", (Abort.PDO_LENGTH,)),
    Rule("empty-mapping", ERROR, "a PDO without mapped objects would be enabled",
         "ours: a count of 0 switches the mapping off (CiA 301, 7.5.2.36)", (Abort.VALUE_RANGE,)),
    Rule("no-dictionary", NOTE, "there is no EDS: the object cannot be checked beforehand", "ours"),
    Rule("static-mapping", ERROR, "the mapping is read-only", "the EDS, AccessType (CiA 306)", (Abort.READ_ONLY,)),
    Rule("pdo-length", ERROR, "the PDO would have more than 64 bits", _MAPPING, (Abort.PDO_LENGTH,)),
    Rule("entry-count", ERROR, "more entries than the device accepts", f"{_MAPPING}; the EDS; the family",
         (Abort.NO_SUB_INDEX, Abort.PDO_LENGTH)),
    Rule("dummy-direction", ERROR, "a TPDO would skip bits", f"{_MAPPING}: dummies are for RPDOs",
         (Abort.NOT_MAPPABLE,)),
    Rule("dummy-unknown", WARNING, "no file states which dummies the device has", "ours"),
    Rule("dummy-supported", ERROR, "the device has no such dummy", "the EDS, DummyUsage (CiA 306); the family",
         (Abort.NOT_MAPPABLE,)),
    Rule("dummy-length", ERROR, "the length of a dummy differs from its type's", _MAPPING, (Abort.NOT_MAPPABLE,)),
    Rule("double-target", (Severity.ERROR, Severity.WARNING),
         "an RPDO maps an object twice (error); two RPDOs write the same object (warning)", "ours"),
    Rule("mapped-twice", WARNING, "a TPDO maps an object twice", "ours"),
    Rule("entry-length", ERROR, "the length of an entry differs from its object's, is 0, or exceeds 64 bits",
         "CiA 301, 7.5.2.36 and 7.5.2.38; the EDS; the family", (Abort.NOT_MAPPABLE, Abort.VALUE_RANGE)),
    Rule("granularity", ERROR, "the length of an entry is not a multiple of the device's granularity",
         "the EDS, Granularity (CiA 306); the family", (Abort.NOT_MAPPABLE,)),
    Rule("half-pdo", ERROR, "the PDO has no COB-ID or no mapping that could be written",
         "CiA 301, 7.5.2.35 to 7.5.2.38: a PDO has both; the device", (Abort.NO_OBJECT,)),
    Rule("inconsistent-pdo", ERROR, "a PDO would be enabled with fewer entries than its count",
         "CiA 301, 7.5.2.36 and 7.5.2.38", (Abort.PDO_LENGTH,)),
)  # fmt: skip
#: Number of entries that a message shows one by one.
_SHOWN_ENTRIES = 12
#: The lowest event-driven transmission type.
_EVENT_DRIVEN = 254


def enables_nothing(now: PdoConfig, want: PdoConfig) -> bool:
    """Whether a PDO *now* becomes an enabled PDO without mapping in *want*; an existing one may stay."""
    return want.enabled and not want.count and (not now.enabled or disables(now, want) or bool(now.count))


def mapping_findings(proposal: Proposal) -> Iterator[Finding]:
    """Judge the requested mapping if it changes, and an empty mapping if the PDO becomes valid."""
    want = proposal.want
    yield from _mpdo_findings(proposal)
    if enables_nothing(proposal.now, want):
        yield error(
            "empty-mapping",
            proposal.communication_place(1),
            f"{proposal.pdo.label} has no mapped objects: an empty PDO cannot be enabled",
            Abort.VALUE_RANGE,
            Hint(Action.MAP, {"pdo": proposal.pdo}) + Hint(Action.LEAVE_OFF, why=", or {}"),
        )
    if not mapping_differs(proposal.now, want):
        return
    yield from _static_findings(proposal)
    yield from _size_findings(proposal)
    yield from _unknown_objects(proposal)
    for number, entry in enumerate(want.mapping, 1):
        place = proposal.mapping_place(number)
        yield from (_dummy if entry.is_dummy else object_findings)(proposal, place, entry)
        yield from length_findings(proposal, place, entry)
    yield from (_mapped_twice if proposal.pdo.is_tpdo else _double_targets)(proposal)


def _mpdo_findings(proposal: Proposal) -> Iterator[Finding]:
    """Refuse to map over an MPDO, and to make one of a TPDO that is not event-driven (CiA 301, 7.2.2.5)."""
    now, want, pdo = proposal.now, proposal.want, proposal.pdo
    if now.mpdo is not None and want.mapping:
        yield error(
            "mpdo",
            proposal.mapping_place(0),
            f"{pdo.label} is a multiplexed PDO (count 0x{now.mpdo:02X}), which maps no objects",
            hint=Hint(Action.CLEAR, {"pdo": pdo}, "{} makes it a plain PDO"),
        )
    if want.mpdo is None or want.mpdo == now.mpdo:
        return
    kind = want.communication.transmission_type
    if pdo.is_tpdo and kind is not None and kind < _EVENT_DRIVEN:
        yield error(
            "mpdo",
            proposal.communication_place(2),
            f"{pdo.label} has transmission type {kind}, but a multiplexed TPDO must be event-driven (254 or 255)",
            Abort.PDO_LENGTH,
            Hint(Action.GIVE, {"event": True}),
        )
    if proposal.dictionary is not None and proposal.dictionary.info.group_messaging is False:
        text = f"GroupMessaging=0 in {proposal.dictionary.source}: the device may not support multiplexed PDOs"
        yield warning("mpdo", proposal.mapping_place(0), text)


def _unknown_objects(proposal: Proposal) -> Iterator[Finding]:
    """One note for all objects without EDS."""
    objects = [entry.object for entry in proposal.want.mapping if not entry.is_dummy]
    if proposal.dictionary is None and objects:
        text = f"no EDS: {join_some(objects)} cannot be checked beforehand; give an EDS of the device"
        yield note("no-dictionary", proposal.mapping_place(0), text)


def _static_findings(proposal: Proposal) -> Iterator[Finding]:
    """A mapping with read-only sub-indices is static, regardless of Granularity."""
    dictionary, index = proposal.dictionary, proposal.pdo.mapping_index
    first = 0 if proposal.profile.filler is None else 1  # fillers stand for a count that is read-only
    for sub_index in range(first, len(proposal.want.mapping) + 1):
        entry = dictionary.entry(index, sub_index) if dictionary else None
        if dictionary and entry and not entry.access.writable:
            yield error(
                "static-mapping",
                proposal.mapping_place(sub_index),
                f"the mapping of {proposal.pdo.label} is static: {proposal.mapping_place(sub_index)} is "
                f"{entry.access} in {dictionary.place(entry)}",
                Abort.READ_ONLY,
                Hint(
                    Action.SHOW_PDOS,
                    {"all": True},
                    "this device has a fixed mapping for the PDO; choose another PDO ({})",
                )
                if sub_index or not _writable_entries(proposal)
                else Hint(Action.SHOW_PDOS, {"all": True}, "choose another PDO ({})")
                + "its entries can be written: a profile with `filler` (unused entries) maps it in spite of the count",
            )
            return


def _writable_entries(proposal: Proposal) -> bool:
    """Tell whether the file lets the first mapping entry be written."""
    entry = proposal.dictionary.entry(proposal.pdo.mapping_index, 1) if proposal.dictionary else None
    return entry is not None and entry.access.writable


def _size_findings(proposal: Proposal) -> Iterator[Finding]:
    want, place = proposal.want, proposal.mapping_place(0)
    yield from _count_findings(proposal)
    if want.bits > MAX_PDO_BITS:
        parts = " + ".join(f"{entry.object} {entry.bits}" for entry in want.mapping[:_SHOWN_ENTRIES])
        parts += " + …" if len(want.mapping) > _SHOWN_ENTRIES else ""
        over = want.bits - MAX_PDO_BITS
        yield error(
            "pdo-length",
            place,
            f"{proposal.pdo.label} would need {want.bits} bits, at most {MAX_PDO_BITS} fit: {parts} = {want.bits}",
            Abort.PDO_LENGTH,
            f"{over} bits too many: {_to_drop(want.mapping, over)} into another PDO",
        )


def _to_drop(mapping: Sequence[PdoMappingEntry], over: int) -> str:
    """Name the last objects of *mapping* that have *over* bits or more together: `drop …, or put it`."""
    if len(mapping) > _SHOWN_ENTRIES:
        return "put the rest"
    first = next(at for at in reversed(range(len(mapping))) if sum(entry.bits for entry in mapping[at:]) >= over)
    *others, last = (str(entry.object) for entry in mapping[first:])
    return f"drop {', '.join(others)} and {last}, or put them" if others else f"drop {last}, or put it"


def _count_findings(proposal: Proposal) -> Iterator[Finding]:
    """More entries than the mapping has sub-indices, or than the family or the standard allows."""
    wanted, label = len(proposal.want.mapping), proposal.pdo.label
    subs = _entry_sub_indices(proposal)
    limit = min(MAX_ENTRIES, proposal.profile.max_entries or MAX_ENTRIES)
    text = f"{wanted} entries were requested, {label} has at most {limit if subs is None else min(limit, subs)}"
    spread = "spread the objects over more PDOs"
    hint = spread if subs != 0 else Hint(Action.SHOW_PDOS, {"all": True}, "choose another PDO ({})")
    if subs is not None and wanted > subs:
        yield error("entry-count", proposal.mapping_place(subs + 1), text, Abort.NO_SUB_INDEX, hint)
    elif wanted > limit:
        yield error("entry-count", proposal.mapping_place(0), text, Abort.PDO_LENGTH, hint)


def _entry_sub_indices(proposal: Proposal) -> int | None:
    """Number of consecutive entries in the EDS's mapping parameter; None if not in the EDS."""
    dictionary, index = proposal.dictionary, proposal.pdo.mapping_index
    if dictionary is None or index not in dictionary:
        return None
    described = dictionary[index].entries
    return next(number for number in count() if number + 1 not in described)


def _dummy(proposal: Proposal, place: str, entry: PdoMappingEntry) -> Iterator[Finding]:
    if proposal.pdo.is_tpdo:
        yield error(
            "dummy-direction",
            place,
            "a TPDO cannot skip bits: dummies are for RPDOs",
            Abort.NOT_MAPPABLE,
            "map an object there, or reorder the entries",
        )
        return
    usable = usable_dummies(proposal)
    if usable is None:
        yield warning("dummy-unknown", place, f"no file states whether this device has the dummy {entry}")
    elif entry.index not in usable:
        have = ", ".join(f"{index:04X}/{DUMMY_BITS[index]}" for index in sorted(usable)) or "none"
        text = f"this device has no dummy {entry} (it has {have})"
        yield error("dummy-supported", place, text, Abort.NOT_MAPPABLE, _instead_of(entry, usable))
    if entry.bits != DUMMY_BITS[entry.index]:
        yield error(
            "dummy-length",
            place,
            f"the dummy {entry.object} is {DUMMY_BITS[entry.index]} bits long, not {entry.bits}",
            Abort.NOT_MAPPABLE,
        )


def _instead_of(dummy: PdoMappingEntry, usable: Collection[int]) -> str:
    """What to do without *dummy* on a device with the dummies *usable*."""
    try:
        words = " ".join(f"{entry.index:04X}" for entry in split_dummy(dummy.bits, usable))
    except ValueError:
        return "shorten or reorder the TPDO that this RPDO receives, so that it skips nothing"
    return f"skip these bits with {words}"


def usable_dummies(proposal: Proposal) -> frozenset[int] | None:
    """Dummy indices that the device accepts according to file and profile; None if unknown."""
    return known_dummies(proposal.dictionary, proposal.profile)


def known_dummies(dictionary: ObjectDictionary | None, profile: DeviceProfile) -> frozenset[int] | None:
    """Dummy indices of any device with *dictionary* and *profile*; None if unknown."""
    stated = dictionary.info.dummies if dictionary else None
    known = profile.dummies
    return stated & known if stated is not None and known is not None else known if stated is None else stated


def _mapped_twice(proposal: Proposal) -> Iterator[Finding]:
    """A TPDO sends an object once."""
    seen: dict[tuple[int, int], int] = {}
    for number, entry in enumerate(proposal.want.mapping, 1):
        key = entry.index, entry.sub_index
        if key in seen and seen[key] > 0:
            text = f"{proposal.name(*key)} is mapped twice (entry {seen[key]} and {number})"
            yield warning("mapped-twice", proposal.mapping_place(number), text)
        seen[key] = -1 if key in seen else number


def _double_targets(proposal: Proposal) -> Iterator[Finding]:
    """An RPDO target should have one writer."""
    seen: dict[tuple[int, int], int] = {}
    for number, entry in enumerate(proposal.want.mapping, 1):
        if entry.is_dummy:
            continue
        place, key = proposal.mapping_place(number), (entry.index, entry.sub_index)
        name = proposal.name(*key)
        if key in seen:
            yield error(
                "double-target",
                place,
                f"{name} is mapped twice (entry {seen[key]} and {number})",
                hint="an RPDO target has one place in the frame",
            )
        seen[key] = number
        for other, cob_id in proposal.other_cob_ids.items():
            if other.is_tpdo or other == proposal.pdo or not cob_id.valid:
                continue
            if key in {(held.index, held.sub_index) for held in proposal.others[other].mapping}:
                yield warning("double-target", place, f"{name} is also written by {other.label}")


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


_ANOTHER = Hint(Action.SHOW_PDOS, {"all": True}, "choose another PDO ({})")


def whole_findings(proposal: Proposal) -> Iterator[Finding]:
    """Judge a change that needs missing parts of a PDO, or enables an inconsistent PDO."""
    now, want, label = proposal.now, proposal.want, proposal.pdo.label
    maps = mapping_differs(now, want)
    if not now.has_cob_id and now.communication.cob_id != want.communication.cob_id:
        place, hint = proposal.communication_place(1), _ANOTHER + Hint(Action.LEAVE_OFF, why="maps without enabling")
        yield error("half-pdo", place, f"{label} of this device has no COB-ID: {place} cannot be read",
                    Abort.NO_OBJECT, hint)  # fmt: skip
    if not now.has_mapping and maps:
        place, hint = (
            proposal.mapping_place(0),
            _ANOTHER + Hint(Action.DISABLE, {"pdo": proposal.pdo}, "switches this one off"),
        )
        yield error("half-pdo", place, f"{label} of this device has no mapping: {place} cannot be read",
                    Abort.NO_OBJECT, hint)  # fmt: skip
    if not now.has_cob_id and (now == want or (_is_described(proposal) and needs_disabling(now, want))):
        place = proposal.communication_place(1)
        yield error("half-pdo", place, f"it is not known whether {label} is off: {place} cannot be read",
                    None, _ANOTHER)  # fmt: skip
    enables = want.enabled and (not now.enabled or disables(now, want))
    if want.held_count is not None and (maps or enables):
        place, hint = (
            proposal.mapping_place(0),
            _repaired(proposal),
        )
        yield error("inconsistent-pdo", place, f"{label} cannot be enabled: {want.inconsistency}",
                    Abort.PDO_LENGTH, hint)  # fmt: skip


def _is_described(proposal: Proposal) -> bool:
    """Whether the device's file has the COB-ID, so that enabling may work."""
    return (
        proposal.dictionary is not None and proposal.dictionary.entry(proposal.pdo.communication_index, 1) is not None
    )


def _repaired(proposal: Proposal) -> Hint:
    pdo = {"pdo": proposal.pdo}
    return Hint(Action.MAP, pdo) + Hint(Action.CLEAR, pdo, " or {} repairs it")
