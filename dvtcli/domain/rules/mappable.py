"""Rules about what may be mapped where, and how much of it (CiA 301, 7.5.2.36/38; CiA 306)."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.abort import Abort
from dvtcli.domain.mapping import DUMMY_BITS, MAX_ENTRIES, MAX_PDO_BITS, PdoMappingEntry
from dvtcli.domain.object_dictionary import Access, ObjectDictionary, OdEntry
from dvtcli.domain.profile import Severity
from dvtcli.domain.rules.finding import Finding, Proposal, error, note, warning
from dvtcli.domain.rules.rule import ERROR, NOTE, WARNING, Rule
from dvtcli.domain.several import several

_MAPPING = "CiA 301, 7.5.2.36 and 7.5.2.38"
RULES = (
    Rule("mpdo", ERROR, "the PDO is a multiplexed one: dvtcli shows MPDOs and never writes them",
         "CiA 301, 7.5.2.36: counts 0xFE and 0xFF", (Abort.PDO_LENGTH,)),
    Rule("empty-mapping", ERROR, "a PDO that maps nothing is to be enabled",
         "ours: a count of 0 switches the mapping off (CiA 301, 7.5.2.36)", (Abort.VALUE_RANGE,)),
    Rule("no-dictionary", NOTE, "there is no EDS: the object is not known beforehand", "ours"),
    Rule("static-mapping", ERROR, "the mapping is read-only", "the EDS, AccessType (CiA 306)", (Abort.READ_ONLY,)),
    Rule("pdo-length", ERROR, "the PDO would have more than 64 bits", _MAPPING, (Abort.PDO_LENGTH,)),
    Rule("entry-count", ERROR, "more entries than the device takes", f"{_MAPPING}; the EDS; the family",
         (Abort.NO_SUB_INDEX, Abort.PDO_LENGTH)),
    Rule("dummy-direction", ERROR, "a TPDO is to skip bits", f"{_MAPPING}: dummies are for RPDOs",
         (Abort.NOT_MAPPABLE,)),
    Rule("dummy-unknown", WARNING, "no file says which dummies the device has", "ours"),
    Rule("dummy-supported", ERROR, "the device has no such dummy", "the EDS, DummyUsage (CiA 306); the family",
         (Abort.NOT_MAPPABLE,)),
    Rule("dummy-length", ERROR, "a dummy of another length than its type", _MAPPING, (Abort.NOT_MAPPABLE,)),
    Rule("object-exists", ERROR, "the object or its sub-index is not in the device's file", "the EDS",
         (Abort.NO_OBJECT, Abort.NO_SUB_INDEX)),
    Rule("direction", ERROR, "a TPDO would send what cannot be read, an RPDO set what cannot be written",
         "the EDS, AccessType (CiA 306, 4.6.3)", (Abort.NOT_MAPPABLE,)),
    Rule("mappable-unknown", WARNING, "the file says nothing about mapping", "the EDS, PDOMapping (CiA 306)"),
    Rule("mappable", ERROR, "the file says PDOMapping=0", "the EDS, PDOMapping (CiA 306)", (Abort.NOT_MAPPABLE,)),
    Rule("advised-against", WARNING, "the maker advises against this object in a TPDO", "the family"),
    Rule("read-write-object", (Severity.ERROR, Severity.WARNING),
         "a read/write object in a direction that the family refuses (error) or advises against (warning)",
         "the family", (Abort.NOT_MAPPABLE,)),
    Rule("entry-length", ERROR, "an entry is longer or shorter than its object, or of 0 or more than 64 bits",
         f"{_MAPPING}; the EDS; the family", (Abort.NOT_MAPPABLE, Abort.VALUE_RANGE)),
    Rule("granularity", ERROR, "an entry is no multiple of the device's granularity",
         "the EDS, Granularity (CiA 306); the family", (Abort.NOT_MAPPABLE,)),
    Rule("double-target", (Severity.ERROR, Severity.WARNING),
         "an RPDO maps an object twice (error); two RPDOs write one object (warning)", "ours"),
)  # fmt: skip


#: Access types whose objects may feed a TPDO, and be an RPDO's target (CiA 306, 4.6.3).
FEEDS_TPDO = frozenset({Access.RO, Access.RWR, Access.CONST, Access.RW})
TAKES_RPDO = frozenset({Access.WO, Access.RWW, Access.RW})


def mapping_findings(proposal: Proposal) -> Iterator[Finding]:
    """Judge the wanted mapping where it changes, and an empty one where the PDO becomes valid."""
    want = proposal.want
    if proposal.now.mpdo is not None and proposal.now != want:
        yield error(
            "mpdo",
            proposal.mapping_place(0),
            f"{proposal.pdo.label} is a multiplexed PDO (count 0x{proposal.now.mpdo:02X}); dvtcli shows MPDOs "
            "and never writes them",
        )
    if want.enabled and not want.count and (not proposal.now.enabled or proposal.now.count):
        yield error(
            "empty-mapping",
            proposal.communication_place(1),
            f"{proposal.pdo.label} maps nothing: an empty PDO cannot be enabled",
            Abort.VALUE_RANGE,
            f"map {proposal.pdo} OBJECT…, or --off",
        )
    if want.mapping == proposal.now.mapping:
        return
    yield from _static_findings(proposal)
    yield from _size_findings(proposal)
    yield from _unknown_objects(proposal)
    for number, entry in enumerate(want.mapping, 1):
        place = proposal.mapping_place(number)
        yield from (_dummy if entry.is_dummy else _object)(proposal, place, entry)
        yield from _length(proposal, place, entry)
    yield from _double_targets(proposal)


def _unknown_objects(proposal: Proposal) -> Iterator[Finding]:
    """One note for all objects of which no EDS tells anything."""
    objects = [entry.object for entry in proposal.want.mapping if not entry.is_dummy]
    if proposal.dictionary is None and objects:
        text = f"no EDS: nothing is known beforehand about {several(objects)}; --eds FILE gives one"
        yield note("no-dictionary", proposal.mapping_place(0), text)


def _static_findings(proposal: Proposal) -> Iterator[Finding]:
    """A mapping is static where its sub-indices are read-only; Granularity says nothing about it."""
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
                "this device fixes what the PDO carries; choose another PDO (pdo --all)"
                if sub_index
                else "choose another PDO (pdo --all); if only the count is fixed, a profile's `filler` helps",
            )
            return


def _size_findings(proposal: Proposal) -> Iterator[Finding]:
    want, place = proposal.want, proposal.mapping_place(0)
    yield from _count_findings(proposal)
    if want.bits > MAX_PDO_BITS:
        parts = " + ".join(f"{entry.object} {entry.bits}" for entry in want.mapping)
        over = want.bits - MAX_PDO_BITS
        yield error(
            "pdo-length",
            place,
            f"{proposal.pdo.label} would need {want.bits} bits, a PDO holds {MAX_PDO_BITS}: {parts} = {want.bits}",
            Abort.PDO_LENGTH,
            f"{over} bits too many: drop {want.mapping[-1].object}, or put it into another PDO",
        )


def _count_findings(proposal: Proposal) -> Iterator[Finding]:
    """More entries than the mapping has sub-indices, or than the family or the standard takes."""
    wanted, label = len(proposal.want.mapping), proposal.pdo.label
    subs = _entry_sub_indices(proposal)
    limit = min(MAX_ENTRIES, proposal.profile.max_entries or MAX_ENTRIES)
    text = f"{wanted} entries are wanted, {label} of this device takes {limit if subs is None else min(limit, subs)}"
    hint = "spread the objects over more PDOs"
    if subs is not None and wanted > subs:
        yield error("entry-count", proposal.mapping_place(subs + 1), text, Abort.NO_SUB_INDEX, hint)
    elif wanted > limit:
        yield error("entry-count", proposal.mapping_place(0), text, Abort.PDO_LENGTH, hint)


def _entry_sub_indices(proposal: Proposal) -> int | None:
    """How many entries the EDS's mapping parameter has room for; None where it does not say."""
    dictionary, index = proposal.dictionary, proposal.pdo.mapping_index
    if dictionary is None or index not in dictionary:
        return None
    return len(dictionary[index].entries.keys() - {0}) or None


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
        yield warning("dummy-unknown", place, f"no file says whether this device takes the dummy {entry}")
    elif entry.index not in usable:
        have = ", ".join(f"{index:04X}/{DUMMY_BITS[index]}" for index in sorted(usable)) or "none"
        yield error("dummy-supported", place, f"this device has no dummy {entry} (it has {have})", Abort.NOT_MAPPABLE)
    if entry.bits != DUMMY_BITS[entry.index]:
        yield error(
            "dummy-length",
            place,
            f"the dummy {entry.object} is {DUMMY_BITS[entry.index]} bits long, not {entry.bits}",
            Abort.NOT_MAPPABLE,
        )


def usable_dummies(proposal: Proposal) -> frozenset[int] | None:
    """The dummy indices the device takes: the profile's, else the EDS's; None where nothing says."""
    if proposal.profile.dummies is not None:
        return proposal.profile.dummies
    return proposal.dictionary.info.dummies if proposal.dictionary else None


def _object(proposal: Proposal, place: str, entry: PdoMappingEntry) -> Iterator[Finding]:
    dictionary = proposal.dictionary
    if dictionary is None:
        return
    found = dictionary.entry(entry.index, entry.sub_index)
    if found is None and entry.index in DUMMY_BITS:
        yield error("object-exists", place, f"the dummy 0x{entry.index:04X} has sub-index 00 only", Abort.NO_SUB_INDEX)
        return
    if found is None:
        yield missing_object(dictionary, place, entry.index, entry.sub_index)
        return
    yield from _direction(proposal, dictionary, place, found)
    yield from _access_advice(proposal, dictionary, place, found)


def missing_object(dictionary: ObjectDictionary, place: str, index: int, sub_index: int) -> Finding:
    """The finding for an object that *dictionary* does not have, with what it has instead."""
    if index not in dictionary:
        text = f"0x{index:04X} is not in {dictionary.source}"
        return error("object-exists", place, text, Abort.NO_OBJECT, "objects TEXT searches the dictionary")
    known = dictionary[index]
    subs = ", ".join(f"{sub:02X}" for sub in list(known.entries)[:12])
    text = f'0x{index:04X}:{sub_index:02X} is not in {dictionary.source}; {index:04X} "{known.name}" has {subs}'
    return error("object-exists", place, text, Abort.NO_SUB_INDEX, decimal_hint(dictionary, index, sub_index))


def decimal_hint(dictionary: ObjectDictionary, index: int, sub_index: int) -> str | None:
    """A hint where *sub_index*, read as decimal digits, would be an object of *dictionary*."""
    digits = f"{sub_index:X}"
    if digits.isdigit() and dictionary.entry(index, int(digits)) and int(digits) != sub_index:
        return f"sub-indices are hexadecimal: decimal {digits} is {index:04X}:{int(digits):02X}"
    return None


def _direction(proposal: Proposal, dictionary: ObjectDictionary, place: str, found: OdEntry) -> Iterator[Finding]:
    name = proposal.name(found.index, found.sub_index)
    tpdo = proposal.pdo.is_tpdo
    if found.access not in (FEEDS_TPDO if tpdo else TAKES_RPDO) and not (tpdo and found.access is Access.RWW):
        role = "feed a TPDO" if tpdo else "be an RPDO's target"
        yield error(
            "direction",
            place,
            f"{name} is {found.access} in {dictionary.place(found)}: it cannot {role}",
            Abort.NOT_MAPPABLE,
            f"objects --mappable {proposal.pdo.direction}",
        )
    elif found.pdo_mapping is None and not dictionary.tells_mappability:
        yield warning("mappable-unknown", place, f"{dictionary.source} does not say whether {name} can be mapped")
    elif not found.pdo_mapping:
        yield error(
            "mappable",
            place,
            f"{name} is not mappable: {dictionary.place(found)} has PDOMapping=0",
            Abort.NOT_MAPPABLE,
            f"objects --mappable {proposal.pdo.direction}",
        )


def _access_advice(proposal: Proposal, dictionary: ObjectDictionary, place: str, found: OdEntry) -> Iterator[Finding]:
    """What a device family makes of objects that the host may write too (Sevcon 3.3, Trinamic 6.3)."""
    tpdo, profile = proposal.pdo.is_tpdo, proposal.profile
    name = proposal.name(found.index, found.sub_index)
    if tpdo and (advice := profile.why_not_in_tpdo(found.index)):
        yield warning("advised-against", place, f"{name}: {advice}")
        return
    severity = {
        (True, Access.RW): profile.rw_in_tpdo,
        (True, Access.RWW): profile.rww_in_tpdo,
        (False, Access.RW): profile.rw_in_rpdo,
    }.get((tpdo, found.access))
    if severity is Severity.ERROR:
        where = "an RPDO" if tpdo else "a TPDO"
        text = f"{name} is {found.access} in {dictionary.place(found)}: a {profile.title} takes it in {where} only"
        hint = f"objects --mappable {proposal.pdo.direction}"
        yield error("read-write-object", place, text, Abort.NOT_MAPPABLE, hint)
    elif severity is not None:
        text = f"{name} is {found.access} ({dictionary.place(found)}): it may hold what the host wrote, not what is"
        yield Finding("read-write-object", severity, place, text)


def _length(proposal: Proposal, place: str, entry: PdoMappingEntry) -> Iterator[Finding]:
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
    known = _object_bits(proposal, entry)
    if known is None or entry.is_dummy or entry.bits == known:
        return
    name = proposal.name(entry.index, entry.sub_index)
    if entry.bits > known:
        yield error(
            "entry-length",
            place,
            f"{name} has {known} bits, {entry.bits} are wanted",
            Abort.NOT_MAPPABLE,
            f"write {entry.object} or {entry.object}/{known}",
        )
    elif not profile.partial_entries:
        yield error(
            "entry-length",
            place,
            f"{name} has {known} bits, only {entry.bits} are wanted: what a device sends then is not defined",
            None,
            f"write {entry.object} or {entry.object}/{known}",
        )


def _granularity(proposal: Proposal) -> int:
    """The profile's, else the EDS's where it is 1 or 8 (real files also hold 0 and 64, which mean nothing)."""
    if proposal.profile.granularity is not None:
        return proposal.profile.granularity
    stated = proposal.dictionary.info.granularity if proposal.dictionary else None
    return 8 if stated == 8 else 1


def _object_bits(proposal: Proposal, entry: PdoMappingEntry) -> int | None:
    found = proposal.dictionary.entry(entry.index, entry.sub_index) if proposal.dictionary else None
    if found is not None and found.bits is not None:
        return found.bits
    return proposal.lengths.get((entry.index, entry.sub_index))


def _double_targets(proposal: Proposal) -> Iterator[Finding]:
    """An RPDO target should have one writer."""
    if proposal.pdo.is_tpdo:
        return
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
        for other, config in proposal.others.items():
            mapped = {(held.index, held.sub_index) for held in config.mapping}
            if not other.is_tpdo and other != proposal.pdo and config.enabled and key in mapped:
                yield warning("double-target", place, f"{name} is also written by {other.label}")
