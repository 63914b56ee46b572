"""What each check of the PDO parameters is called, so that a family can say how it answers one.

A family's `[answers.tpdo]` and `[answers.rpdo]` name a check and the abort code it answers, 0 for accepted. What is not
named there is as the other keys of the family have it. Knows names only; `pdo_guard` and `entry_guard` make them.
"""

from __future__ import annotations

from dvtcli.domain.abort import Abort
from dvtcli.domain.pdo import Pdo

#: What may have limits in a file: the sub-indices of a communication parameter, and of a mapping its count and entries.
_PARAMETERS = {1: "cob-id", 2: "type", 3: "inhibit", 5: "event", 6: "sync-start"}
_COUNT, _ENTRY = "count", "entry"


def limit_check(index: int, sub_index: int, code: int) -> str:
    """What the check of a file's limit is called that answers *code* of itself; "" for what is no PDO parameter."""
    pdo = Pdo.at(index)
    if pdo is None:
        return ""
    communication = index == pdo.communication_index
    name = _PARAMETERS.get(sub_index, "") if communication else _ENTRY if sub_index else _COUNT
    side = "above" if code == Abort.VALUE_HIGH else "below"
    return f"{name}-{side}-limit" if name else ""


#: Check → what is written when it is made.
CHECKS = {
    "cob-id-again": "a COB-ID that is held already, while the PDO is valid",
    "cob-id-while-valid": "another CAN-ID, while the PDO is valid",
    "rtr-bit": "a COB-ID whose bit 30 is not as the family has it",
    "extended": "a COB-ID with bit 29",
    "beyond-frame": "a CAN-ID above 0x7FF without bit 29, to be valid",
    "restricted": "a CAN-ID that CiA 301 keeps for others, to be valid",
    "empty-enabled": "a COB-ID that makes a PDO valid whose count is 0",
    "type": "a transmission type that the family does not know",
    "type-without-rtr": "transmission type 252 or 253 while bit 30 forbids RTR",
    "type-while-valid": "a transmission type, while the PDO is valid",
    "inhibit-while-valid": "an inhibit time, while the PDO is valid",
    "event-while-valid": "an event timer, while the PDO is valid",
    "sync-start-while-valid": "a SYNC start value, while the PDO is valid",
    "inhibit-high": "an inhibit time above the family's highest",
    "event-high": "an event timer above the family's highest",
    "count-again": "the count that is held already, while the PDO is valid",
    "count-while-valid": "another count, while the PDO is valid",
    "count-beyond": "a count above the entries that there are",
    "count-over-zero": "a count over an entry of 0",
    "count-over-no-bits": "a count over an entry of 0 bits",
    "too-many-bits": "a count over more than 64 bits",
    "no-entry": "an entry behind the last one",
    "entry-again": "the entry that is held already, while the PDO is valid",
    "entry-while-valid": "another entry, while the PDO is valid",
    "entry-again-counted": "the entry that is held already, while the count is not 0",
    "entry-while-counted": "another entry, while the count is not 0",
    "entry-zero": "an entry of 0",
    "missing-object": "an entry that names an object that is not there",
    "missing-sub-index": "an entry that names a sub-index that is not there",
    "not-mappable": "an entry that names an object that is not mappable",
    "wrong-direction": "an entry that names an object whose access is for the other direction",
    "entry-too-long": "an entry that is longer than its object",
    "entry-too-short": "an entry that is shorter than its object",
    "entry-bits": "an entry above the family's longest",
    "granularity": "an entry whose length is no multiple of the granularity",
    "dummy": "an entry that names a dummy which the family does not have",
    "dummy-sub-index": "an entry that names sub-index 1 of a dummy",
    **{
        f"{name}-{side}-limit": f"{what} {side} the limit that the file states"
        for name, what in (
            ("cob-id", "a COB-ID"),
            ("type", "a transmission type"),
            ("inhibit", "an inhibit time"),
            ("event", "an event timer"),
            ("sync-start", "a SYNC start value"),
            (_COUNT, "a count"),
            (_ENTRY, "an entry"),
        )
        for side in ("below", "above")
    },
}
