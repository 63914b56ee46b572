"""Rules about CAN-IDs and the flag bits of a COB-ID (CiA 301, 7.3.5 and table 'restricted CAN-IDs')."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache

from dvtcli.domain.abort import Abort
from dvtcli.domain.can_ids import EMCY_BASE, TIME_ID
from dvtcli.domain.cob_id import OFF, PRODUCES, SYNC_BY_DEFAULT, CobId, taken_by_services
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.objects import COB_ID_EMCY, COB_ID_SYNC, COB_ID_TIME, SRDO_COMMUNICATION
from dvtcli.domain.pdo import Direction, Pdo
from dvtcli.domain.plan import disables
from dvtcli.domain.profile import BitPolicy, Severity
from dvtcli.domain.rules.finding import ERROR, NOTE, WARNING, Finding, Producer, Proposal, Rule, error, note, warning

_ANOTHER = Hint(Action.SELECT_CAN_ID, why="take another CAN-ID, or {}")
_OR_FREE = Hint(Action.SELECT_CAN_ID, why=", or {}")
RULES = (
    Rule("can-id-length", ERROR, "the CAN-ID has more than 11 bits, but 29 bits were not requested",
         "CiA 301, 7.5.2.35: bit 29 (frame)", (Abort.VALUE_RANGE,)),
    Rule("can-id-restricted", ERROR, "the CAN-ID of a PDO, SYNC or EMCY is restricted by CiA 301",
         "CiA 301, 7.3.5",
         (Abort.VALUE_RANGE,)),
    Rule("extended-id", ERROR, "29 bits on a device that accepts 11", "the family", (Abort.VALUE_RANGE,)),
    Rule("rtr-bit", ERROR, "bit 30 is wrong for the family", "the family", (Abort.VALUE_RANGE,)),
    Rule("can-id-in-use", (Severity.ERROR, Severity.WARNING),
         "the CAN-ID is used by SYNC, EMCY, a time stamp or an SDO of a known node (error), or is another node's "
         "default for EMCY, or that of TIME (warning); a write gives such a service the CAN-ID of another service or "
         "of an enabled PDO (error)",
         "CiA 301, 7.3.5; 0x1005, 0x1012, 0x1014 and 0x1201…0x12FF of known nodes"),
    Rule("can-id-clash", ERROR,
         "another PDO of the node, or a TPDO of another node of the session, uses the CAN-ID, changed or not",
         "ours"),
    Rule("one-producer", ERROR, "a TPDO would get a CAN-ID that an unknown node uses on the bus",
         "CiA 301, 7.3.5: the pre-defined connection set"),
    Rule("base-cob-id", WARNING,
         "the CAN-ID is a base of the pre-defined connection set, without a node-ID, whether the PDO is on or off",
         "CiA 301, 7.3.5; CiA 306, 4.6.3: $NODEID"),
    Rule("can-id-instead", NOTE, "the present or default CAN-ID of a PDO is not allowed: it gets another", "ours"),
    Rule("can-id-default", (Severity.WARNING, Severity.NOTE),
         "the CAN-ID is the default of another PDO, or set at a PDO that is off, or another node's EMCY; a warning for "
         "the default of a TPDO of a received node that `map` does not read",
         "CiA 301, 7.3.5"),
)  # fmt: skip

#: The services whose COB-ID is one object, by its index.
COB_ID_OF = {COB_ID_SYNC: "SYNC", COB_ID_TIME: "TIME", COB_ID_EMCY: "EMCY"}
_RESERVED = "reserved"
#: First and last 11-bit CAN-ID of each range that CiA 301 restricts, with its use.
RESTRICTED = (
    (0x000, 0x000, "NMT"),
    (0x001, 0x07F, _RESERVED),
    (0x101, 0x180, _RESERVED),
    (0x581, 0x5FF, "SDO answers"),
    (0x601, 0x67F, "SDO requests"),
    (0x6E0, 0x6FF, _RESERVED),
    (0x701, 0x77F, "heartbeats"),
    (0x780, 0x7E3, _RESERVED),
    (0x7E4, 0x7E5, "LSS"),
    (0x7E6, 0x7FF, _RESERVED),
)
#: Base CAN-IDs in the pre-defined connection set, without node-ID.
BASES = frozenset(Pdo(direction, number).default_can_id(0) for direction in Direction for number in range(1, 5))
#: CAN-IDs for `auto` after the pre-defined connection set: no node's defaults are among them.
FREE_POOL = range(0x680, 0x6E0)


def restricted_use(can_id: int) -> str | None:
    """Restricted use of an 11-bit *can_id*, or None if a PDO may have it."""
    for first, last, use in RESTRICTED:
        if first <= can_id <= last:
            return use
    return None


def is_of_service(cob_id: CobId) -> bool:
    """Whether CiA 301 gives the CAN-ID of *cob_id* to NMT, SDO, heartbeats or LSS."""
    return not cob_id.extended and restricted_use(cob_id.can_id) not in (None, _RESERVED)


def service_findings(node_id: int, index: int, raw: int) -> Iterator[Finding]:
    """Judge *raw* as the COB-ID of SYNC (*index* 0x1005), the time stamp (0x1012) or EMCY (0x1014) of *node_id*.

    Source: CiA 301, 7.3.5 (restricted CAN-IDs, pre-defined connection set), 7.5.2.5, 7.5.2.15 and 7.5.2.17.
    """
    want, place = CobId.from_raw(raw), f"0x{index:04X}:00"
    is_emcy, owner = index == COB_ID_EMCY, want.can_id - EMCY_BASE
    if want.extended or not is_in_use(index, raw):
        return
    if use := restricted_use(want.can_id):
        yield error("can-id-restricted", place, f"{COB_ID_OF[index]} {want} is {use}", Abort.VALUE_RANGE)
    elif is_emcy and 1 <= owner <= 127 and owner != node_id:
        yield note("can-id-default", place, f"{want} is the default COB-ID of EMCY of node {owner}")


def is_in_use(index: int, raw: int) -> bool:
    """Whether a service with the COB-ID *raw* at *index* occupies its CAN-ID.

    Bit 31 disables EMCY and an SDO channel, and has no meaning for SYNC; the time stamp is sent with bit 30.
    """
    return index == COB_ID_SYNC or bool(raw & PRODUCES if index == COB_ID_TIME else not raw & OFF)


def service_taken_findings(
    index: int, sub_index: int, raw: int, taken: Mapping[tuple[int, bool], str]
) -> Iterator[Finding]:
    """An error if the new COB-ID *raw* of a service is among the CAN-IDs *taken* by others.

    Source: CiA 301, 7.3.5; 7.5.2.5 (SYNC), 7.5.2.17 (EMCY), 7.5.2.15 (time stamp), 7.5.2.33 (SDO server).
    """
    want = CobId.from_raw(raw)
    owner = taken.get((want.can_id, want.extended)) if is_in_use(index, raw) else None
    if owner is not None:
        service = COB_ID_OF.get(index, "an SRDO" if index in SRDO_COMMUNICATION else "an SDO channel")
        yield error("can-id-in-use", f"0x{index:04X}:{sub_index:02X}", f"CAN-ID {want} for {service} is {owner}")


def can_id_findings(proposal: Proposal) -> Iterator[Finding]:
    """Judge the requested COB-ID; for an unchanged COB-ID of an enabled PDO, report only errors about clashes."""
    now, want = proposal.now.communication.cob_id, proposal.want.communication.cob_id
    yield from cob_id_findings(proposal)
    place, stays = proposal.communication_place(1), now == want
    for clashes in (_service_clashes, _pdo_clashes, _producer_clashes) if want.valid else ():
        yield from (clash for clash in clashes(proposal, place) if not stays or clash.severity is Severity.ERROR)


def cob_id_findings(proposal: Proposal) -> Iterator[Finding]:
    """Judge the requested COB-ID, regardless of other users of its CAN-ID.

    If the COB-ID is unchanged and the PDO stays enabled, only another service's CAN-ID is an error: the device has
    accepted reserved CAN-IDs, and flags that the family does not want, before.
    """
    now, want = proposal.now.communication.cob_id, proposal.want.communication.cob_id
    place = proposal.communication_place(1)
    is_untouched = now == want and not disables(proposal.now, proposal.want)
    if not is_untouched:
        yield from _flag_findings(proposal, place)
        if not want.fits_frame:
            yield error(
                "can-id-length",
                place,
                f"CAN-ID 0x{want.can_id:X} does not fit 11 bits",
                Abort.VALUE_RANGE,
                Hint(Action.EXTEND, why="asks for a 29-bit CAN-ID"),
            )
    use = restricted_use(want.can_id) if want.valid and not want.extended else None
    if use is not None and not (is_untouched and use == _RESERVED):
        yield error(
            "can-id-restricted",
            place,
            f"CAN-ID {want} is restricted by CiA 301: {use}",
            Abort.VALUE_RANGE,
            Hint(Action.SELECT_CAN_ID, why="choose a CAN-ID within 0x181..0x57F or 0x680..0x6DF, or {}"),
        )
    elif not want.extended and want.can_id in BASES:
        default = proposal.pdo.default_can_id(proposal.node_id)
        own = "" if default is None else f"; this node's own default is 0x{default:03X}"
        text = f"CAN-ID {want} is a base of the pre-defined connection set, as an EDS without $NODEID gives every node"
        hint = Hint(Action.SELECT_CAN_ID, {} if default is None else {"can_id": f"0x{default:03X}"})
        yield warning("base-cob-id", place, f"{text}{own}", hint)


def _flag_findings(proposal: Proposal, place: str) -> Iterator[Finding]:
    want, profile = proposal.want.communication.cob_id, proposal.profile
    if want.extended and not profile.extended_ids:
        yield error("extended-id", place, f"a {profile.title} accepts 11-bit CAN-IDs only", Abort.VALUE_RANGE)
    policy = profile.rtr_bit[proposal.pdo.direction]
    if policy is BitPolicy.SET and want.rtr_allowed:
        yield error(
            "rtr-bit",
            place,
            f"a {profile.title} needs bit 30 (no RTR) set",
            Abort.VALUE_RANGE,
            Hint(Action.ALLOW_RTR, why="leave {} out"),
        )
    if policy is BitPolicy.CLEAR and not want.rtr_allowed:
        yield error(
            "rtr-bit",
            place,
            f"a {profile.title} needs bit 30 (no RTR) clear",
            Abort.VALUE_RANGE,
            Hint(Action.FORBID_RTR, why="leave {} out"),
        )


def _service_clashes(proposal: Proposal, place: str) -> Iterator[Finding]:
    """CAN-IDs that are not restricted but in use: SYNC, EMCY, TIME, further SDO channels."""
    want = proposal.want.communication.cob_id
    taken = {**_services(proposal), SYNC_BY_DEFAULT: "SYNC"}.get((want.can_id, want.extended))
    if taken is not None:
        yield error("can-id-in-use", place, f"CAN-ID {want} is {taken}", hint=_ANOTHER)
    elif want.extended:
        return
    elif 0x081 <= want.can_id <= 0x0FF:
        yield warning("can-id-in-use", place, f"CAN-ID {want} is the EMCY of node {want.can_id - 0x080} by default")
    elif want.can_id == TIME_ID:
        yield warning("can-id-in-use", place, f"CAN-ID {want} is TIME by default")


def _services(proposal: Proposal) -> Mapping[tuple[int, bool], str]:
    return proposal.services() or taken_by_services(proposal.node_id, None, None, {})


def _pdo_clashes(proposal: Proposal, place: str) -> Iterator[Finding]:
    want = proposal.want.communication.cob_id
    others, stays = proposal.other_cob_ids, proposal.now.communication.cob_id == want
    for other, held in others.items():
        if (held.can_id, held.extended) != (want.can_id, want.extended) or other == proposal.pdo:
            continue
        if stays and not (proposal.pdo.is_tpdo or other.is_tpdo):
            continue  # two RPDOs that receive one CAN-ID: nothing collides on the wire
        if held.valid:
            yield error(
                "can-id-clash",
                place,
                f"CAN-ID {want} is already used by {other.label} of this node",
                hint=Hint(Action.DISABLE, {"pdo": other}, "first, take another CAN-ID") + _OR_FREE,
            )
        else:
            yield note("can-id-default", place, f"{want} is also set at {other.label}, which is disabled: no clash now")
    owner = default_owner(want.can_id)
    is_reported = (
        owner is not None
        and owner[1] == proposal.node_id
        and owner[0] in others
        and others[owner[0]].can_id == want.can_id
    )
    if owner is not None and not is_reported:
        senders = _same_senders(proposal)  # no warning for frames of a known producer
        is_reported = any((sender.pdo, sender.node_id) == owner for sender in senders) or (
            bool(senders) and not proposal.pdo.is_tpdo
        )
    if owner and owner != (proposal.pdo, proposal.node_id) and not want.extended and not is_reported:
        pdo, node_id = owner
        text = f"{want} is the default COB-ID of {pdo.label} of node {node_id}"
        if proposal.pdo.is_tpdo and pdo.is_tpdo and want.valid and not stays and node_id in proposal.unread():
            text = f"{text}, which is on the bus and was not read: it may send the same CAN-ID"
            yield warning("can-id-default", place, text, Hint(Action.CHECK_LIVE, why="reads every node"))
        else:
            yield note("can-id-default", place, text)


def _producer_clashes(proposal: Proposal, place: str) -> Iterator[Finding]:
    """Another node that sends the same CAN-ID: both nodes' frames would collide on the wire (CiA 301, 7.3.5)."""
    for producer in _same_producers(proposal):
        yield error(
            "can-id-clash",
            place,
            f"CAN-ID {producer.cob_id} is already sent by {producer.pdo.label} of node {producer.node_id}",
            hint=Hint(Action.DISABLE, {"pdo": producer.pdo, "node": producer.node_id}, "first, take another CAN-ID")
            + _OR_FREE,
        )


def _same_producers(proposal: Proposal) -> list[Producer]:
    """Producers that clash with a TPDO; an RPDO never clashes with a producer."""
    return _same_senders(proposal) if proposal.pdo.is_tpdo else []


def _same_senders(proposal: Proposal) -> list[Producer]:
    """TPDOs of other nodes with the requested CAN-ID."""
    want = proposal.want.communication.cob_id
    identifier = (want.can_id, want.extended)
    return [
        producer
        for producer in proposal.elsewhere()
        if (producer.cob_id.can_id, producer.cob_id.extended) == identifier
    ]


@lru_cache(maxsize=1024)
def default_owner(can_id: int) -> tuple[Pdo, int] | None:
    """The PDO and node-ID with *can_id* in the pre-defined connection set, or None."""
    for direction in Direction:
        for number in range(1, 5):
            pdo = Pdo(direction, number)
            base = pdo.default_can_id(0)
            if base is not None and base < can_id <= base + 127:
                return pdo, can_id - base
    return None


def automatic_can_id(proposal: Proposal) -> int | None:
    """The CAN-ID for `auto`: the pre-defined CAN-ID for PDO 1..4, else the lowest free CAN-ID, else None.

    A pre-defined CAN-ID is not free if used by another PDO of the node or, for a TPDO, sent by another node.
    """
    used: set[int | None] = {cob_id.can_id for cob_id in proposal.other_cob_ids.values() if cob_id.valid}
    used |= {producer.cob_id.can_id for producer in proposal.elsewhere()} if proposal.pdo.is_tpdo else set()
    used |= {can_id for can_id, extended in _services(proposal) if not extended}
    default = proposal.pdo.default_can_id(proposal.node_id)
    if default is not None and default not in used:
        return default
    return next((can_id for can_id in FREE_POOL if can_id not in used), None)
