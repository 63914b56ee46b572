"""Rules about a mapped object: existence, direction, advice of the family (CiA 306, 4.6.3)."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.abort import Abort, abort_text
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import Access, ObjectDictionary, OdEntry
from dvtcli.domain.objects import SAFETY
from dvtcli.domain.pdo import DUMMY_BITS, MAX_PDO_BITS, PdoMappingEntry
from dvtcli.domain.profile import DeviceProfile, Severity
from dvtcli.domain.rules.finding import ERROR, WARNING, Finding, Proposal, Rule, error, warning

RULES = (
    Rule("object-exists", ERROR,
         "the object or its sub-index is not in the device's file; without a file: not in the device",
         "the EDS, or the device's answer to an upload",
         (Abort.NO_OBJECT, Abort.NO_SUB_INDEX)),
    Rule("direction", ERROR, "a TPDO would send an unreadable object, an RPDO write a read-only object",
         "the EDS, AccessType (CiA 306, 4.6.3)", (Abort.NOT_MAPPABLE,)),
    Rule("safety-object", ERROR, "an object of the safety configuration (0x1300…0x13FF) would be mapped",
         "EN 50325-5: SRDOs and their configuration", (Abort.NOT_MAPPABLE,)),
    Rule("mappable-unknown", WARNING, "the file has no PDOMapping", "the EDS, PDOMapping (CiA 306)"),
    Rule("mappable", ERROR, "the file has PDOMapping=0", "the EDS, PDOMapping (CiA 306)", (Abort.NOT_MAPPABLE,)),
    Rule("advised-against", WARNING, "the maker advises against this object in a TPDO", "the family"),
    Rule("read-write-object", (Severity.ERROR, Severity.WARNING),
         "a read/write object in a direction that the family refuses (error) or advises against (warning)",
         "the family", (Abort.NOT_MAPPABLE,)),
)  # fmt: skip

#: Access types whose objects may feed a TPDO, and be an RPDO's target (CiA 306, 4.6.3).
FEEDS_TPDO = frozenset({Access.RO, Access.RWR, Access.CONST, Access.RW})
TAKES_RPDO = frozenset({Access.WO, Access.RWW, Access.RW})


def is_taken(profile: DeviceProfile, dictionary: ObjectDictionary, entry: OdEntry, *, tpdo: bool) -> bool:
    """Whether the rules below allow mapping *entry* into a TPDO, or an RPDO; warnings do not count."""
    refused = _of_read_write(profile, entry.access, tpdo=tpdo) is Severity.ERROR
    fits = entry.index not in SAFETY and (entry.data_type is None or 1 <= (entry.bits or 0) <= MAX_PDO_BITS)
    return fits and _has_access(entry.access, tpdo=tpdo) and not _is_said_unmappable(dictionary, entry) and not refused


def _has_access(access: Access, *, tpdo: bool) -> bool:
    """Whether a TPDO can read, or an RPDO write, an object with *access*; families differ on rww in a TPDO."""
    return access in (FEEDS_TPDO if tpdo else TAKES_RPDO) or (tpdo and access is Access.RWW)


def _is_said_unmappable(dictionary: ObjectDictionary, entry: OdEntry) -> bool:
    """Whether the file excludes *entry* from mapping; a file without any PDOMapping excludes nothing."""
    return not entry.pdo_mapping and (entry.pdo_mapping is not None or dictionary.tells_mappability)


def _of_read_write(profile: DeviceProfile, access: Access, *, tpdo: bool) -> Severity | None:
    """The family's severity for an object that the host may also write."""
    return {
        (True, Access.RW): profile.rw_in_tpdo,
        (True, Access.RWW): profile.rww_in_tpdo,
        (False, Access.RW): profile.rw_in_rpdo,
    }.get((tpdo, access))


def object_findings(proposal: Proposal, place: str, entry: PdoMappingEntry) -> Iterator[Finding]:
    """Judge the object of *entry* at *place*: by its file, else by the device's answer to an upload."""
    dictionary = proposal.dictionary
    if entry.index in SAFETY:
        text = f"{entry.object} belongs to the safety configuration of the device, which cannot be mapped"
        yield error("safety-object", place, text, Abort.NOT_MAPPABLE, _mappable(proposal))
        return
    if dictionary is None:
        if entry not in proposal.now.mapping and (abort := proposal.absent.get((entry.index, entry.sub_index))):
            yield _absent_object(proposal, place, entry, abort)
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


def _absent_object(proposal: Proposal, place: str, entry: PdoMappingEntry, abort: int) -> Finding:
    """Finding for an object without a file whose upload the device refused; mapping may still work."""
    text = f"0x{entry.index:04X}:{entry.sub_index:02X} cannot be read from node {proposal.node_id}: {abort_text(abort)}"
    return error(
        "object-exists", place, f"{text} (0x{abort:08X})", abort, Hint(Action.GIVE_EDS, why="names its objects")
    )


def missing_object(dictionary: ObjectDictionary, place: str, index: int, sub_index: int) -> Finding:
    """Finding for an object missing in *dictionary*, with its existing sub-indices."""
    if index not in dictionary:
        text = f"0x{index:04X} is not in {dictionary.source}"
        search = Hint(Action.FIND_OBJECTS, why="searches the dictionary")
        if len(digits := str(index)) == 4 and int(digits, 16) in dictionary:
            search = f"0x{index:04X} is decimal {digits}: 0x{digits} is in the dictionary" + search
        return error("object-exists", place, text, Abort.NO_OBJECT, search)
    known = dictionary[index]
    subs = ", ".join(f"{sub:02X}" for sub in list(known.entries)[:12])
    text = f'0x{index:04X}:{sub_index:02X} is not in {dictionary.source}; {index:04X} "{known.name}" has {subs}'
    hint = decimal_hint(dictionary, index, sub_index)
    if hint is None and list(known.entries) == [0]:
        hint = f"{index:04X} has no sub-indices: name it {index:04X}"
    return error("object-exists", place, text, Abort.NO_SUB_INDEX, hint)


def decimal_hint(dictionary: ObjectDictionary, index: int, sub_index: int) -> str | None:
    """A hint if *sub_index*, read as decimal digits, would be an object of *dictionary*."""
    digits = f"{sub_index:X}"
    if digits.isdigit() and dictionary.entry(index, int(digits)) and int(digits) != sub_index:
        return f"sub-indices are hexadecimal: decimal {digits} is {index:04X}:{int(digits):02X}"
    return None


def _mappable(proposal: Proposal) -> Hint:
    return Hint(Action.SHOW_MAPPABLE, {"direction": proposal.pdo.direction}, "lists mappable objects")


def _direction(proposal: Proposal, dictionary: ObjectDictionary, place: str, found: OdEntry) -> Iterator[Finding]:
    name = proposal.name(found.index, found.sub_index)
    tpdo = proposal.pdo.is_tpdo
    if not _has_access(found.access, tpdo=tpdo):
        role = "feed a TPDO" if tpdo else "be an RPDO's target"
        yield error(
            "direction",
            place,
            f"{name} is {found.access} in {dictionary.place(found)}: it cannot {role}",
            Abort.NOT_MAPPABLE,
            _mappable(proposal),
        )
    elif found.pdo_mapping is None and not dictionary.tells_mappability:
        yield warning("mappable-unknown", place, f"{dictionary.source} does not state whether {name} can be mapped")
    elif _is_said_unmappable(dictionary, found):
        yield error(
            "mappable",
            place,
            f"{name} is not mappable: {dictionary.place(found)} has PDOMapping=0",
            Abort.NOT_MAPPABLE,
            _mappable(proposal),
        )


def _access_advice(proposal: Proposal, dictionary: ObjectDictionary, place: str, found: OdEntry) -> Iterator[Finding]:
    """Advice of a device family about objects that the host may also write (Sevcon 3.3, Trinamic 6.3)."""
    tpdo, profile = proposal.pdo.is_tpdo, proposal.profile
    name = proposal.name(found.index, found.sub_index)
    if tpdo and (advice := profile.why_not_in_tpdo(found.index)):
        yield warning("advised-against", place, f"{name}: {advice}")
        return
    severity = _of_read_write(profile, found.access, tpdo=tpdo)
    if severity is Severity.ERROR:
        where = "an RPDO" if tpdo else "a TPDO"
        text = f"{name} is {found.access} in {dictionary.place(found)}: a {profile.title} takes it in {where} only"
        hint = _mappable(proposal)
        yield error("read-write-object", place, text, Abort.NOT_MAPPABLE, hint)
    elif severity is not None:
        text = f"{name} is {found.access} ({dictionary.place(found)}): it may return the last written value"
        yield Finding("read-write-object", severity, place, text)
