"""A user's request for a PDO, and the resulting configuration on a given device.

A request is a value: made, shown and compared without a device.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from itertools import islice
from typing import Literal, NamedTuple

from dvtcli.domain.cob_id import HIGHEST_BASE_CAN_ID, CobId
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_syntax import MappedObject, Skipped
from dvtcli.domain.pdo import (
    DAM_MPDO,
    DUMMY_BITS,
    MAPPING,
    PARAMETERS,
    SAM_MPDO,
    Pdo,
    PdoCommunicationParameter,
    PdoConfig,
    PdoMappingEntry,
    split_dummy,
)
from dvtcli.domain.plan import disables
from dvtcli.domain.profile import BitPolicy, ObjectAddress, Severity
from dvtcli.domain.rules.can_id import automatic_can_id, can_id_findings, cob_id_findings
from dvtcli.domain.rules.finding import Finding, Proposal, note
from dvtcli.domain.rules.pdo_mapping import usable_dummies

#: The counts of multiplexed PDOs with source and with destination addressing (CiA 301, 7.5.2.36).
MPDO_COUNTS = {"sam": SAM_MPDO, "dam": DAM_MPDO}


@dataclass(frozen=True, slots=True)
class PdoRequest:
    """The options of `map` and `set`; None leaves a parameter unchanged.

    *cob_id* is a CAN-ID, `auto` or `keep`; *inhibit_time* counts 100 µs, *event_timer* 1 ms; *enabled* is the PDO's
    final state, None for unchanged. *objects* is the whole mapping in frame order, None for the present mapping.
    *mpdo* is the mapping's count of a multiplexed PDO (0xFE, 0xFF).
    """

    cob_id: int | Literal["auto", "keep"] | None = None
    transmission_type: int | None = None
    inhibit_time: int | None = None
    event_timer: int | None = None
    sync_start_value: int | None = None
    rtr_allowed: bool | None = None
    extended: bool = False
    enabled: bool | None = None
    objects: tuple[MappedObject | Skipped | PdoMappingEntry, ...] | None = None
    mpdo: int | None = None

    @property
    def untyped_lengths(self) -> tuple[ObjectAddress, ...]:
        """Index and sub-index of each object without a typed length."""
        words = (word for word in self.objects or () if isinstance(word, MappedObject) and word.bits is None)
        return tuple((word.index, word.sub_index) for word in words)


class Switched(NamedTuple):
    """Request of `enable` and `disable`: bit 31 of the COB-ID only."""

    enabled: bool


@dataclass(frozen=True, slots=True)
class Cleared:
    """Request of `clear`: empty mapping, and disabled."""


AnyPdoRequest = PdoConfig | PdoRequest | Switched | Cleared


def requested_parameters(want: AnyPdoRequest) -> frozenset[str]:
    """Those of `PARAMETERS` that *want* sets; all others stay unchanged."""
    if isinstance(want, Switched):
        return frozenset({"cob_id"})
    if isinstance(want, Cleared):
        return frozenset({"cob_id", MAPPING})
    if isinstance(want, PdoConfig):
        return frozenset(PARAMETERS)
    requested = {name for name in PARAMETERS[:-1] if getattr(want, name) not in (None, "keep")}
    if (want.enabled, want.rtr_allowed) != (None, None):
        requested.add("cob_id")
    return frozenset(requested | ({MAPPING} if (want.objects, want.mpdo) != (None, None) else set()))


def parameters_at(pdo: Pdo, index: int, sub_index: int) -> frozenset[str]:
    """Parameters that a single write to an object of *pdo* sets."""
    if index == pdo.mapping_index:
        return frozenset({MAPPING})
    names = {1: "cob_id", 2: "transmission_type", 3: "inhibit_time", 5: "event_timer", 6: "sync_start_value"}
    return frozenset({names[sub_index]} if sub_index in names else ())


def resolved(want: AnyPdoRequest, proposal: Proposal, lengths: Mapping[ObjectAddress, int | None]) -> PdoConfig:
    """Configuration for *want* on the PDO in *proposal*; *lengths* are the untyped lengths, in bits.

    Raises ValueError if a length stays unknown, the device's dummies cannot add up to the skipped bits, `auto` finds
    no free CAN-ID, or a CAN-ID needs --extended.
    """
    if isinstance(want, PdoRequest):
        return _requested(want, proposal, lengths)
    if isinstance(want, PdoConfig):
        return want
    now = proposal.now
    if isinstance(want, Cleared):
        return cleared(now)
    return now.with_parameters(cob_id=now.communication.cob_id.enabled()) if want.enabled else now.disabled()


def cleared(now: PdoConfig) -> PdoConfig:
    """*now* without mapping, and disabled; missing parameters stay missing."""
    return PdoConfig(now.disabled().communication, (), unread=now.lacking)


def _requested(request: PdoRequest, proposal: Proposal, lengths: Mapping[ObjectAddress, int | None]) -> PdoConfig:
    now = proposal.now
    held = now.communication
    communication = PdoCommunicationParameter(
        cob_id=held.cob_id,
        transmission_type=_pick(request.transmission_type, held.transmission_type),
        inhibit_time=_pick(request.inhibit_time, held.inhibit_time),
        event_timer=_pick(request.event_timer, held.event_timer),
        sync_start_value=_pick(request.sync_start_value, held.sync_start_value),
    )
    want = replace(now, communication=communication)
    if request.objects is not None:
        want = PdoConfig(communication, _entries(request.objects, proposal, lengths), unread=now.lacking)
    elif request.mpdo is not None and request.mpdo != now.count:
        want = PdoConfig(communication, (), request.mpdo, unread=now.lacking)
    return want.with_parameters(cob_id=_cob_id(request, proposal, want))


def instead_findings(want: AnyPdoRequest, proposal: Proposal) -> Iterator[Finding]:
    """A note if *want* leaves the CAN-ID open and *proposal* sets neither the present nor the default CAN-ID.

    A PDO without CAN-ID (0x000) gets its default silently.
    """
    held, got = proposal.now.communication.cob_id, proposal.want.communication.cob_id
    if not isinstance(want, PdoRequest) or want.cob_id not in (None, "auto") or not got.valid:
        return
    default = proposal.pdo.default_can_id(proposal.node_id)
    kept = held.can_id if want.cob_id is None else default
    if not kept or kept == got.can_id:
        return
    usual = replace(got, can_id=kept, extended=held.extended and want.cob_id is None)
    kept_proposal = replace(proposal, want=proposal.want.with_parameters(cob_id=usual))
    refusals = (finding for finding in can_id_findings(kept_proposal) if finding.severity is Severity.ERROR)
    for refused in islice(refusals, 1):
        same = Hint(Action.SELECT_CAN_ID, {"can_id": usual}) + Hint(Action.FORCE, why=" {} accepts it nevertheless")
        yield note("can-id-instead", proposal.communication_place(1), f"{refused.text}: {got} instead", same)


#: COB-ID options of a parameter request only, as arguments of `SET_PDO`
_SAID_BY_SET: dict[Action, Mapping[str, object]] = {
    Action.SELECT_CAN_ID: {"cob_id": "auto"},
    Action.FORBID_RTR: {"no_rtr": True},
    Action.ALLOW_RTR: {"rtr": True},
}


def hinting_at_set(findings: Iterable[Finding], pdo: Pdo, *, enables: bool) -> Iterator[Finding]:
    """*findings* about *pdo* for a command without PDO parameters: their hints set these with `SET_PDO`.

    With *enables* the command was to enable the PDO, so the hint adds this step. No hint is to leave the PDO off.
    """
    then = Hint(Action.ENABLE, {"pdo": pdo}, ", then {}")
    for finding in findings:
        hint: Hint | str | None = finding.hint
        if isinstance(hint, Hint):
            steps = [_by_set(step, pdo) for step in hint if step.action is not Action.LEAVE_OFF]
            if enables and any(step.action in _SAID_BY_SET for step in hint):
                steps.append(then)
            hint = reduce(Hint.__add__, (replace(step, then=None) for step in steps)) if steps else None
        yield replace(finding, hint=hint)


def _by_set(step: Hint, pdo: Pdo) -> Hint:
    if step.action is None or step.action not in _SAID_BY_SET:
        return step
    can_id = {"cob_id": step.arguments["can_id"]} if "can_id" in step.arguments else {}
    return replace(step, action=Action.SET_PDO, arguments={"pdo": pdo, **_SAID_BY_SET[step.action], **can_id})


def _pick(asked: int | None, held: int | None) -> int | None:
    return held if asked is None else asked


def _cob_id(request: PdoRequest, proposal: Proposal, want: PdoConfig) -> CobId:
    """The COB-ID for *request*, given *proposal* and all other values in *want*."""
    held = proposal.now.communication.cob_id
    enabled = proposal.now.enabled if request.enabled is None else request.enabled
    flags = replace(held, valid=enabled, rtr_allowed=_rtr(request, proposal))
    if isinstance(request.cob_id, int):
        if request.cob_id > HIGHEST_BASE_CAN_ID and not request.extended:
            raise ValueError(f"CAN-ID 0x{request.cob_id:X} has more than 11 bits: it is an extended CAN-ID (29 bits)")
        return replace(flags, can_id=request.cob_id, extended=request.extended)
    kept = replace(flags, extended=held.extended or request.extended)
    proposal = replace(proposal, want=want)
    if request.cob_id == "keep" or (request.cob_id is None and (not enabled or _legal(proposal, kept))):
        return kept
    automatic = automatic_can_id(proposal)
    if automatic is None:
        raise ValueError("every CAN-ID of 0x680..0x6DF is in use on this node; give a CAN-ID")
    return replace(flags, can_id=automatic, extended=False)


def _rtr(request: PdoRequest, proposal: Proposal) -> bool:
    if request.rtr_allowed is not None:
        return request.rtr_allowed
    policy = proposal.profile.rtr_bit[proposal.pdo.direction]
    if policy is BitPolicy.KEEP:
        return proposal.now.communication.cob_id.rtr_allowed
    return policy is BitPolicy.CLEAR


def _legal(proposal: Proposal, cob_id: CobId) -> bool:
    """Whether the PDO may be enabled with *cob_id*; an enabled PDO keeps its COB-ID even if shared."""
    wanted = replace(proposal, want=proposal.want.with_parameters(cob_id=cob_id))
    if cob_id != proposal.now.communication.cob_id:
        findings = can_id_findings(wanted)
    elif disables(proposal.now, wanted.want):
        findings = cob_id_findings(wanted)
    else:
        return True
    return not any(finding.severity is Severity.ERROR for finding in findings)


def _entries(
    words: Iterable[MappedObject | Skipped | PdoMappingEntry],
    proposal: Proposal,
    lengths: Mapping[ObjectAddress, int | None],
) -> tuple[PdoMappingEntry, ...]:
    """The mapping entries for *words*."""
    entries: list[PdoMappingEntry] = []
    for word in words:
        if isinstance(word, Skipped):
            entries += _dummies(word.bits, proposal)
        elif isinstance(word, PdoMappingEntry):
            entries.append(word)
        else:
            entries.append(_entry(word, lengths))
    return tuple(entries)


def entry_number(
    words: Iterable[MappedObject | Skipped | PdoMappingEntry], place: ObjectAddress, proposal: Proposal
) -> int:
    """Mapping entry number (1…) of the object at *place* in *words*; 1 if missing."""
    number = 1
    for word in words:
        if not isinstance(word, Skipped) and (word.index, word.sub_index) == place:
            return number
        number += len(_dummies(word.bits, proposal)) if isinstance(word, Skipped) else 1
    return 1


def _entry(word: MappedObject, lengths: Mapping[ObjectAddress, int | None]) -> PdoMappingEntry:
    bits = word.bits if word.bits is not None else lengths.get((word.index, word.sub_index))
    if bits is None:
        place = f"{word.index:04X}:{word.sub_index:02X}"
        raise ValueError(f"the length of {place} is not known; write {place}/BITS")
    return PdoMappingEntry(word.index, word.sub_index, min(bits, 0xFF))


def _dummies(bits: int, proposal: Proposal) -> tuple[PdoMappingEntry, ...]:
    usable = usable_dummies(proposal)
    if proposal.pdo.is_tpdo or not usable:
        usable = frozenset(DUMMY_BITS)  # the rules report the refusal in the user's terms
    return split_dummy(bits, usable)
