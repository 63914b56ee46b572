"""Rules about a PDO's parameters, by CiA 301 (7.5.2.35/37) and by the device's file (CiA 306, 4.6.3)."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
from dvtcli.domain.pdo import MAX_ENTRIES, PdoCommunicationParameter, is_mapping_index
from dvtcli.domain.plan import INHIBIT_TIME, Step, plan_pdo
from dvtcli.domain.profile import Severity, within
from dvtcli.domain.rules.finding import ERROR, NOTE, Finding, Proposal, Rule, error, note, warning

RULES = (
    Rule("parameter-exists", ERROR, "the PDO has no such parameter", "the device; the EDS", (Abort.NO_SUB_INDEX,)),
    Rule("parameter-range", ERROR, "outside the limits of the device's file, of the family or of the object's size",
         "CiA 301, 7.5.2.35; the EDS, LowLimit and HighLimit (CiA 306); the family",
         (Abort.VALUE_HIGH, Abort.VALUE_LOW)),
    Rule("transmission-type", (Severity.ERROR, Severity.WARNING),
         "a type that is reserved or not supported by the family (error), or has a special meaning on it (warning)",
         "CiA 301, 7.5.2.35 and 7.5.2.37; the family", (Abort.VALUE_RANGE,)),
    Rule("event-timer", (Severity.WARNING, Severity.NOTE),
         "the event timer has no effect with this type on this family (warning), or by CiA 301 (note)",
         "the family; CiA 301, 7.5.2.37"),
    Rule("timer-below-inhibit", NOTE, "the event timer of a TPDO is shorter than its inhibit time",
         "CiA 301, 7.5.2.37"),
    Rule("parameter-static", ERROR, "the parameter is read-only", "the EDS, AccessType (CiA 306)", (Abort.READ_ONLY,)),
    Rule("parameter-length", ERROR, "a parameter has another length in the device's file than in CiA 301",
         "CiA 301, 7.5.2.35 to 7.5.2.38; the EDS, DataType (CiA 306)", (Abort.TOO_LONG, Abort.TOO_SHORT)),
    Rule("parameter-unreadable", ERROR, "a parameter can be written, but not read: the change could not be verified",
         "ours; the EDS, AccessType (CiA 306)"),
)  # fmt: skip
_NAMES = {1: "COB-ID", 2: "transmission type", 3: "inhibit time", 5: "event timer", 6: "SYNC start value"}
#: The sub-index of the event timer, and the lowest event-driven transmission type.
EVENT_TIMER, _EVENT_DRIVEN = 5, 254
_LARGEST = {2: 0xFF, 3: 0xFFFF, 5: 0xFFFF, 6: 0xFF}


def communication_findings(proposal: Proposal) -> Iterator[Finding]:
    """Judge every changing communication parameter, and each write by the device's file."""
    fits = len(proposal.want.mapping) <= MAX_ENTRIES
    for sub_index, before, after in _changed(proposal):
        place = proposal.communication_place(sub_index)
        if after is not None and before is None:
            yield error(
                "parameter-exists",
                place,
                f"{proposal.pdo.label} has no {_NAMES[sub_index]} on this device",
                Abort.NO_SUB_INDEX,
                "a synchronous type (1..240) sends it periodically, by SYNC"
                if sub_index == EVENT_TIMER and proposal.pdo.is_tpdo
                else None,
            )
            fits = fits and _fits(sub_index, after)
            continue
        if after is not None:
            found = list(_size_findings(proposal, sub_index, after))
            fits = fits and not found
            yield from found
        if sub_index == 2 and after is not None:
            yield from _type_findings(proposal, place, after)
    if fits:
        yield from described_step_findings(proposal)
    yield from _combination_findings(proposal)


def _changed(proposal: Proposal) -> Iterator[tuple[int, int | None, int | None]]:
    now, want = proposal.now.communication, proposal.want.communication
    rows = (
        (1, now.cob_id.raw, want.cob_id.raw),
        (2, now.transmission_type, want.transmission_type),
        (3, now.inhibit_time, want.inhibit_time),
        (5, now.event_timer, want.event_timer),
        (6, now.sync_start_value, want.sync_start_value),
    )
    return ((sub_index, before, after) for sub_index, before, after in rows if before != after)


def _fits(sub_index: int, value: int) -> bool:
    return sub_index not in _LARGEST or value <= _LARGEST[sub_index]  # every word is a COB-ID


def _size_findings(proposal: Proposal, sub_index: int, value: int) -> Iterator[Finding]:
    """Judge a parameter by its object's size and the family."""
    place, name = proposal.communication_place(sub_index), _NAMES[sub_index]
    if not _fits(sub_index, value):
        yield error(
            "parameter-range",
            place,
            f"{name} {value} does not fit its object (0..{_LARGEST[sub_index]} counts)",
            Abort.VALUE_HIGH,
        )
        return
    if sub_index in (3, 5) and value > proposal.profile.max_time_count:
        most = _shown(sub_index, proposal.profile.max_time_count)
        text = f"{name} {_shown(sub_index, value)} is above {most}, the most that a {proposal.profile.title} takes"
        yield error("parameter-range", place, text, Abort.VALUE_HIGH)


def _shown(sub_index: int, value: int) -> str:
    return f"{value / 10:.1f} ms ({value} x 100 us)" if sub_index == 3 else str(value)


def _type_findings(proposal: Proposal, place: str, value: int) -> Iterator[Finding]:
    tpdo, profile = proposal.pdo.is_tpdo, proposal.profile
    if 241 <= value <= 251 or (not tpdo and value in (252, 253)):
        yield error(
            "transmission-type",
            place,
            f"transmission type {value} is reserved for {'a TPDO' if tpdo else 'an RPDO'}",
            Abort.VALUE_RANGE,
            "0..240 synchronous, 254 or 255 on event",
        )
    elif not profile.allows_type(value):
        allowed = ", ".join(f"{a}..{b}" if a != b else str(a) for a, b in profile.transmission_types)
        yield error(
            "transmission-type", place, f"a {profile.title} takes types {allowed}, not {value}", Abort.VALUE_RANGE
        )
    if value in profile.type_texts:
        yield warning("transmission-type", place, f"type {value} on a {profile.title}: {profile.type_texts[value]}")


def _combination_findings(proposal: Proposal) -> Iterator[Finding]:
    now, want = proposal.now.communication, proposal.want.communication
    touched = (now.transmission_type, now.cob_id) != (want.transmission_type, want.cob_id)
    if proposal.pdo.is_tpdo and want.transmission_type in (252, 253) and not want.cob_id.rtr_allowed and touched:
        yield error(
            "transmission-type",
            proposal.communication_place(2),
            f"type {want.transmission_type} answers RTR, but bit 30 of the COB-ID forbids RTR",
            Abort.VALUE_RANGE,
            Hint(Action.ALLOW_RTR, why="{}, or another type"),
        )
    timed = want.event_timer and (want.event_timer, want.transmission_type) != (now.event_timer, now.transmission_type)
    kind = want.transmission_type
    if timed and proposal.pdo.is_tpdo and kind is not None and not within(kind, proposal.profile.event_timer_types):
        yield warning(
            "event-timer",
            proposal.communication_place(5),
            f"the event timer of a {proposal.profile.title} works for event-driven types only, this is type {kind}",
        )
    elif timed and proposal.pdo.is_tpdo and kind is not None and kind < _EVENT_DRIVEN:
        text = f"CiA 301 uses the event timer with types 254 and 255 only, this is type {kind}"
        yield note("event-timer", proposal.communication_place(5), text)


def timer_findings(proposal: Proposal) -> Iterator[Finding]:
    """Note the times of a changed TPDO if they contradict; the checks of files and networks judge all TPDOs."""
    now, want = proposal.now.communication, proposal.want.communication
    changed = (now.event_timer, now.inhibit_time) != (want.event_timer, want.inhibit_time)
    if proposal.pdo.is_tpdo and changed and (text := timer_below_inhibit(want)):
        place = proposal.communication_place(EVENT_TIMER)
        yield note("timer-below-inhibit", place, f"{text}, which wins")


def timer_below_inhibit(held: PdoCommunicationParameter) -> str:
    """The two times of a TPDO whose event timer is shorter than its inhibit time, which wins; else empty."""
    timer_ms, inhibit = held.event_timer, held.inhibit_time
    if not timer_ms or not inhibit or timer_ms * 10 >= inhibit:
        return ""
    return f"the event timer is {timer_ms} ms, the inhibit time {inhibit / 10:g} ms"


COB_ID = 1


def described_step_findings(proposal: Proposal) -> Iterator[Finding]:
    """Judge every write of the change, including intermediate disabling writes; each object once."""
    dictionary = proposal.dictionary
    if dictionary is None:
        return
    reported: set[tuple[int, int]] = set()
    for step in plan_pdo(proposal.pdo, proposal.now, proposal.want).steps:
        entry = dictionary.entry(step.index, step.sub_index)
        place = (step.index, step.sub_index)
        if entry is None or place in reported or _stands_for_fillers(proposal, step):
            continue
        for finding in _step_findings(proposal, dictionary, entry, step):
            reported.add(place)
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
