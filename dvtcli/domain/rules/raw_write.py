"""Rules for a `write` to an object, with the guards of the command intended for this object."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from dvtcli.domain.abort import Abort
from dvtcli.domain.cob_id import HIGHEST_BASE_CAN_ID, CobId
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.objects import SAFETY
from dvtcli.domain.pdo import (
    SAM_MPDO,
    Pdo,
    PdoCommunicationParameter,
    PdoConfig,
    PdoMappingEntry,
    is_mapping_index,
)
from dvtcli.domain.process_data import answers_with_state
from dvtcli.domain.rules.can_id import can_id_findings
from dvtcli.domain.rules.communication import communication_findings
from dvtcli.domain.rules.finding import ERROR, WARNING, Finding, Proposal, Rule, error, warning
from dvtcli.domain.rules.mapped_object import decimal_hint
from dvtcli.domain.rules.pdo_mapping import mapping_findings
from dvtcli.domain.text import value_text

_FROZEN_WHILE_VALID = "CiA 301, 7.5.2.35 to 7.5.2.38"
RULES = (
    Rule("access", ERROR, "write to a read-only object", "the EDS, AccessType (CiA 306)", (Abort.READ_ONLY,)),
    Rule("length", ERROR, "write of another length than the object's",
         "the EDS, DataType (CiA 306); for a PDO's parameters CiA 301, 7.5.2.35 to 7.5.2.38",
         (Abort.TOO_LONG, Abort.TOO_SHORT)),
    Rule("limits", ERROR, "write outside the object's limits", "the EDS, LowLimit and HighLimit (CiA 306)",
         (Abort.VALUE_HIGH, Abort.VALUE_LOW)),
    Rule("cob-id-while-valid", ERROR, "write to bits 0–30 of a COB-ID while the PDO is enabled",
         _FROZEN_WHILE_VALID, (Abort.VALUE_RANGE,)),
    Rule("frozen-while-valid", ERROR, "write to inhibit time or SYNC start value while the PDO is enabled",
         _FROZEN_WHILE_VALID, (Abort.VALUE_RANGE,)),
    Rule("mapping-while-valid", ERROR, "write to a mapping while the PDO is enabled",
         _FROZEN_WHILE_VALID, (Abort.UNSUPPORTED_ACCESS,)),
    Rule("write-only", WARNING,
         "the written value cannot be read back: it cannot be verified or undone",
         "the EDS, AccessType (CiA 306); CiA 301, 7.5.2.13 and 7.5.2.14; CiA 302-2, CiA 302-3"),
    Rule("safety-configuration", WARNING, "write to an object of the safety configuration (0x1300…0x13FF)",
         "EN 50325-5"),
    Rule("entry-while-counted", ERROR, "write to an entry while the count is not 0",
         _FROZEN_WHILE_VALID, (Abort.UNSUPPORTED_ACCESS,)),
)  # fmt: skip


_FIELDS = {2: "transmission_type", 3: "inhibit_time", 5: "event_timer", 6: "sync_start_value"}
_SIZES = {0: 1, 1: 4, 2: 1, 3: 2, 4: 1, 5: 2, 6: 1}
_FROZEN = {3: "inhibit time", 6: "SYNC start value"}


@dataclass(frozen=True, slots=True)
class ParameterWrite:
    """A raw write to a PDO's communication or mapping parameter."""

    index: int
    sub_index: int
    value: int

    @property
    def place(self) -> str:
        """The object for a person: `0x1A00:01`."""
        return f"0x{self.index:04X}:{self.sub_index:02X}"


def with_raw(parameter: PdoCommunicationParameter, sub_index: int, value: int) -> PdoCommunicationParameter:
    """*parameter* with *value* at *sub_index*; unchanged for an unknown sub-index."""
    if sub_index == 1:
        return replace(parameter, cob_id=CobId.from_raw(value))
    if sub_index not in _FIELDS:
        return parameter
    return replace(parameter, **{_FIELDS[sub_index]: value})  # type: ignore[arg-type]


def write_findings(dictionary: ObjectDictionary | None, index: int, sub_index: int, data: bytes) -> tuple[Finding, ...]:
    """Findings of the EDS about writing *data* to *index*:*sub_index*: existence, access, length, limits."""
    return () if dictionary is None else tuple(_write_findings(dictionary, index, sub_index, data))


def _write_findings(dictionary: ObjectDictionary, index: int, sub_index: int, data: bytes) -> Iterator[Finding]:
    place = f"0x{index:04X}:{sub_index:02X}"
    entry = dictionary.entry(index, sub_index)
    if entry is None:
        code = Abort.NO_SUB_INDEX if index in dictionary else Abort.NO_OBJECT
        hint = (
            decimal_hint(dictionary, index, sub_index)
            if index in dictionary
            else Hint(Action.FIND_OBJECTS, why="searches")
        )
        yield error("object-exists", place, f"{place} is not in {dictionary.source}", code, hint)
        return
    if not entry.access.writable:
        yield error("access", place, f"{place} is {entry.access} in {dictionary.place(entry)}", Abort.READ_ONLY)
    kind = entry.data_type
    if kind is None or kind.size is None:
        return
    if len(data) != kind.size:
        code = Abort.TOO_LONG if len(data) > kind.size else Abort.TOO_SHORT
        yield error("length", place, f"{place} is {kind.short}: {kind.size} bytes, not {len(data)}", code)
        return
    value, where = kind.decode(data), f"{place} in {dictionary.place(entry)}"
    if not isinstance(value, int | float) or (
        entry.low is not None and entry.high is not None and entry.low >= entry.high
    ):
        return
    if entry.high is not None and value > entry.high:
        yield error("limits", place, f"{value} is above the limit {entry.high:g} of {where}", Abort.VALUE_HIGH)
    if entry.low is not None and value < entry.low:
        yield error("limits", place, f"{value} is below the limit {entry.low:g} of {where}", Abort.VALUE_LOW)


#: what is due after a write to the objects that end the configuration of SRDOs (EN 50325-5)
_DUE_AFTER = {0x13FF: "0x13FE = 0xA5 is due again", 0x13FE: "0xA5 makes it valid, any other value invalid"}


def safety_findings(index: int, sub_index: int) -> tuple[Finding, ...]:
    """The warning about a write to *index*:*sub_index* if it configures SRDOs."""
    if index not in SAFETY:
        return ()
    place = f"0x{index:04X}:{sub_index:02X}"
    due = _DUE_AFTER.get(index, "its signature (0x13FF) and 0x13FE = 0xA5 must be written again")
    text = f"{place} belongs to the safety configuration: {due}"
    hint = "the device may not transmit SRDOs until then; inform whoever approves the machine"
    return (warning("safety-configuration", place, text, hint),)


def why_unreadable(index: int) -> str:
    """Why the object at *index* does not read back the written value, in words that follow its name."""
    return "reads back a state" if answers_with_state(index) else "is write-only"


def unreadable_finding(index: int, sub_index: int, held: bytes | None = None) -> Finding:
    """The warning that a value cannot be read back; *held* is the value that a control word reads back instead."""
    place = f"0x{index:04X}:{sub_index:02X}"
    why = why_unreadable(index) if held is None else f"is a control word and reads back {value_text(held)}"
    return warning("write-only", place, f"{place} {why}: the written value cannot be read back")


def parameter_findings(
    proposal_for: Callable[[PdoConfig], Proposal],
    now: PdoConfig,
    write: ParameterWrite,
    entries: Callable[[], tuple[PdoMappingEntry, ...]],
) -> tuple[Finding, ...]:
    """Findings of the PDO rules about a raw *write*; *entries* returns the entries activated by a written count."""
    if not is_mapping_index(write.index):
        return tuple(_communication(proposal_for, now, write))
    return tuple(_mapping(proposal_for, now, write, entries))


def length_findings(index: int, sub_index: int, data: bytes) -> tuple[Finding, ...]:
    """The standard's findings about the length of *data* for a PDO parameter; none for an unknown sub-index."""
    size = parameter_size(index, sub_index)
    if size is None or len(data) == size:
        return ()
    place, code = f"0x{index:04X}:{sub_index:02X}", Abort.TOO_LONG if len(data) > size else Abort.TOO_SHORT
    plural = "" if size == 1 else "s"
    return (error("length", place, f"{place} has {size} byte{plural}, not {len(data)}", code),)


def parameter_size(index: int, sub_index: int) -> int | None:
    """Bytes of a sub-index of a PDO's parameters (CiA 301, 7.5.2.35 to 38); None if unknown."""
    if index & 0x200 == 0:
        return _SIZES.get(sub_index)
    return 4 if sub_index else 1


def _communication(
    proposal_for: Callable[[PdoConfig], Proposal], now: PdoConfig, write: ParameterWrite
) -> Iterator[Finding]:
    parameter = now.communication
    if write.sub_index == 1:
        wanted = CobId.from_raw(write.value)
        if parameter.cob_id.valid and wanted.valid and parameter.cob_id != wanted:
            legal = wanted.extended or wanted.can_id <= HIGHEST_BASE_CAN_ID
            yield error("cob-id-while-valid", write.place, "bits 0…30 of a COB-ID are frozen while the PDO is enabled",
                        Abort.VALUE_RANGE, _in_order(write, "cob_id", wanted) if legal else None)  # fmt: skip
            return
        proposal = proposal_for(now.with_parameters(cob_id=wanted))
        yield from can_id_findings(proposal)
        yield from mapping_findings(proposal)
        return
    if write.sub_index not in _FIELDS:
        return
    if now.enabled and write.sub_index in _FROZEN:
        yield error("frozen-while-valid", write.place, f"the {_FROZEN[write.sub_index]} cannot change while the PDO is "
                    "enabled", Abort.VALUE_RANGE,
                    _in_order(write, "inhibit", write.value / 10) if write.sub_index == 3
                    else _in_order(write, "sync_start", write.value))  # fmt: skip
    proposal = proposal_for(replace(now, communication=with_raw(parameter, write.sub_index, write.value)))
    yield from communication_findings(proposal)
    yield from can_id_findings(proposal)


def _in_order(write: ParameterWrite, parameter: str, value: object) -> Hint:
    extended = isinstance(value, CobId) and value.extended
    return Hint(
        Action.SET_PDO, {"pdo": Pdo.at(write.index), parameter: value, "extended": extended}, "does it in order"
    )


def _mapping(
    proposal_for: Callable[[PdoConfig], Proposal],
    now: PdoConfig,
    write: ParameterWrite,
    entries: Callable[[], tuple[PdoMappingEntry, ...]],
) -> Iterator[Finding]:
    pdo = Pdo.at(write.index)
    if now.enabled:
        yield error("mapping-while-valid", write.place, "a mapping cannot change while the PDO is enabled",
                    Abort.UNSUPPORTED_ACCESS, Hint(Action.MAP, {"pdo": pdo}, "does it in order"))  # fmt: skip
        return
    if write.sub_index == 0:
        if write.value in (0xFE, 0xFF):
            kind = "sam" if write.value == SAM_MPDO else "dam"
            hint = Hint(Action.SET_PDO, {"pdo": pdo, "mpdo": kind}, "{} makes a multiplexed PDO, in order")
            yield error("mpdo", write.place, "a count above 64 makes a multiplexed PDO", Abort.PDO_LENGTH, hint)
        elif write.value > len(active := entries()):
            place = f"0x{write.index:04X}:{len(active) + 1:02X}"
            yield error("entry-count", write.place, f"the count would be {write.value}, but {place} cannot be read",
                        Abort.PDO_LENGTH, Hint(Action.MAP, {"pdo": pdo}, "sets the entries and the count"))  # fmt: skip
        elif write.value:
            yield from mapping_findings(proposal_for(_with_mapping(now, active)))
        return
    if now.count:
        yield error("entry-while-counted", write.place, f"an entry cannot change while the count is {now.count}",
                    Abort.UNSUPPORTED_ACCESS, Hint(Action.MAP, {"pdo": pdo}, "does it in order"))  # fmt: skip
        return
    single = PdoMappingEntry.from_raw(write.value)
    for finding in mapping_findings(proposal_for(_with_mapping(now, (single,)))):
        yield replace(finding, place=write.place)


def _with_mapping(now: PdoConfig, entries: tuple[PdoMappingEntry, ...]) -> PdoConfig:
    return replace(now, mapping=entries, held_count=None, unread=now.lacking)
