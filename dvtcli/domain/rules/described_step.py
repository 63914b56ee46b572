"""Rules about each write of a PDO's change according to the device's file (CiA 306, 4.6.3)."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
from dvtcli.domain.pdo import is_mapping_index
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME, SYNC_START, TRANSMISSION_TYPE, Step, plan_pdo
from dvtcli.domain.rules.finding import ERROR, Finding, Proposal, Rule, error

RULES = (
    Rule("parameter-static", ERROR, "the parameter is read-only", "the EDS, AccessType (CiA 306)", (Abort.READ_ONLY,)),
    Rule("parameter-length", ERROR, "a parameter has another length in the device's file than in CiA 301",
         "CiA 301, 7.5.2.35 to 7.5.2.38; the EDS, DataType (CiA 306)", (Abort.TOO_LONG, Abort.TOO_SHORT)),
    Rule("parameter-unreadable", ERROR, "a parameter can be written, but not read: the change could not be verified",
         "ours; the EDS, AccessType (CiA 306)"),
)  # fmt: skip

COB_ID = 1
_NAMES = {
    COB_ID: "COB-ID", TRANSMISSION_TYPE: "transmission type", INHIBIT_TIME: "inhibit time",
    EVENT_TIMER: "event timer", SYNC_START: "SYNC start value",
}  # fmt: skip


def described_step_findings(proposal: Proposal) -> Iterator[Finding]:
    """Judge every write of the change, including intermediate disabling writes; each object once."""
    dictionary = proposal.dictionary
    if dictionary is None:
        return
    told: set[tuple[int, int]] = set()
    for step in plan_pdo(proposal.pdo, proposal.now, proposal.want).steps:
        entry = dictionary.entry(step.index, step.sub_index)
        place = (step.index, step.sub_index)
        if entry is None or place in told or _stands_for_fillers(proposal, step):
            continue
        for finding in _step_findings(proposal, dictionary, entry, step):
            told.add(place)
            yield finding


def _stands_for_fillers(proposal: Proposal, step: Step) -> bool:
    return proposal.profile.filler is not None and step.sub_index == 0


def _step_findings(proposal: Proposal, dictionary: ObjectDictionary, entry: OdEntry, step: Step) -> Iterator[Finding]:
    size = None if entry.data_type is None else entry.data_type.size
    if entry.access.writable and entry.access.readable and size in (None, len(step.after)):
        yield from _limit_findings(proposal, entry, step, dictionary)
        return
    place, name, where = f"0x{step.object}", parameter_name(step), dictionary.place(entry)
    if not entry.access.writable:
        if not is_mapping_index(step.index):  # mappings have their own rules
            text = f"{name} of {proposal.pdo.label} is {entry.access} in {where}"
            yield error("parameter-static", place, text, Abort.READ_ONLY, _fixed_hint(step))
    elif not entry.access.readable:
        text = f"{name} of {proposal.pdo.label} is {entry.access} in {where}: what it holds then cannot be read back"
        yield error(
            "parameter-unreadable", place, text, None, Hint(Action.SHOW_PDOS, {"all": True}, "choose another PDO ({})")
        )
    elif size is not None:
        code = Abort.TOO_LONG if len(step.after) > size else Abort.TOO_SHORT
        text = f"{name} of {proposal.pdo.label} has {8 * size} bits in {where}, CiA 301 has {8 * len(step.after)}"
        yield error(
            "parameter-length",
            place,
            text,
            code,
            Hint(Action.GIVE_EDS, why="if the file is wrong, correct it or give another file: {}"),
        )


def _fixed_hint(step: Step) -> Hint | str:
    if step.sub_index == COB_ID:
        return Hint(None, why="this device fixes it: what needs the PDO off or on cannot be changed") + Hint(
            Action.LEAVE_OFF, why="leaves one off"
        )
    return "this device fixes it; leave the option out"


def _limit_findings(proposal: Proposal, entry: OdEntry, step: Step, dictionary: ObjectDictionary) -> Iterator[Finding]:
    low, high = entry.limits(proposal.node_id)
    if low is None and high is None:
        return
    value = entry.data_type.decode(step.after) if entry.data_type else None
    if not isinstance(value, int | float) or not leave_a_choice(entry, low, high):
        return
    place, name, where = f"0x{step.object}", parameter_name(step), dictionary.place(entry)
    if high is not None and value > high:
        text = f"{name} {shown(step, value)} is above the limit {shown(step, high)} in {where}"
        yield error("parameter-range", place, text, Abort.VALUE_HIGH)
    if low is not None and value < low:
        text = f"{name} {shown(step, value)} is below the limit {shown(step, low)} in {where}"
        yield error("parameter-range", place, text, Abort.VALUE_LOW)


def leave_a_choice(entry: OdEntry, low: float | None, high: float | None) -> bool:
    """Whether the limits of *entry* are usable: real files have 0..0, reversed limits, and limits beyond the type."""
    least, most = (entry.data_type and entry.data_type.limits) or (float("-inf"), float("inf"))
    lowest, highest = least if low is None else low, most if high is None else high
    return least <= lowest < highest <= most


def parameter_name(step: Step) -> str:
    """Name of the object of *step*."""
    if not is_mapping_index(step.index):
        return _NAMES.get(step.sub_index, step.object)
    return f"mapping entry {step.sub_index}" if step.sub_index else "number of mapped objects"


def shown(step: Step, value: float) -> str:
    """A value of the object of *step* in the usual notation."""
    if len(step.after) == 4:
        return f"0x{int(value) & 0xFFFF_FFFF:08X}"
    if not is_mapping_index(step.index) and step.sub_index == INHIBIT_TIME:
        return f"{value / 10:.1f} ms ({int(value)} x 100 us)"
    return f"{value:g}"
