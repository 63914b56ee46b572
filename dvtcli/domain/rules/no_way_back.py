"""Check in advance whether a device accepts a PDO's present configuration again after a change."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME, SYNC_START, TRANSMISSION_TYPE
from dvtcli.domain.request import cleared
from dvtcli.domain.rules import check_pdo, errors_in
from dvtcli.domain.rules.finding import ERROR, WARNING, Finding, Proposal, Rule, error, warning

RULES = (
    Rule("way-back", WARNING,
         "a PDO has a configuration that the device may refuse: if it does, an undo leaves the PDO off, or off and "
         "empty",
         "CiA 301, 7.5.2.35 to 7.5.2.38; the EDS; the family"),
    Rule("no-way-back", ERROR, "after the change a PDO could neither be rolled back nor be switched off and emptied",
         "ours; the EDS; the family"),
    Rule("restarted-meanwhile", WARNING,
         "a node restarted during the roll-back: other unstored values are lost", "ours"),
)  # fmt: skip

_FIELDS = {
    TRANSMISSION_TYPE: "transmission_type", INHIBIT_TIME: "inhibit_time",
    EVENT_TIMER: "event_timer", SYNC_START: "sync_start_value",
}  # fmt: skip
_NAMES = {"transmission_type": "transmission type", "inhibit_time": "inhibit time", "event_timer": "event timer",
          "sync_start_value": "SYNC start value"}  # fmt: skip


def way_back(back: Proposal) -> tuple[PdoConfig, Finding] | None:
    """Configuration that the device accepts in place of *back*, with a finding; None if it accepts *back*.

    *back* is the roll-back from the new configuration to the present one. Refused parameters keep their new value;
    next the PDO is disabled, and finally emptied.
    """
    refusals = _refusals(back)
    if not refusals:
        return None
    pdo, before, reason = back.pdo, back.want, refusals[0]
    taken = next((config for config in _weaker(back) if not _refusals(replace(back, want=config))), None)
    if taken is None:
        text = f"{pdo.label} could neither be rolled back after this, nor be switched off and emptied: {reason.text}"
        return before, error(
            "no-way-back", reason.place, text, None, Hint(Action.SHOW_PDOS, {"all": True}, "choose another PDO ({})")
        )
    text = f"{pdo.label} is {_state(before, taken)} now, and a device may refuse that configuration ({reason.text})"
    return taken, warning("way-back", reason.place, f"{text}: if it does, an undo leaves it {left_as(before, taken)}")


def _refusals(back: Proposal) -> list[Finding]:
    """Findings that a device would abort; dvtcli's own rules do not count, as the configuration existed before."""
    return [finding for finding in errors_in(check_pdo(back)) if finding.abort is not None]


def _weaker(back: Proposal) -> Iterator[PdoConfig]:
    places = {finding.place for finding in _refusals(back)}
    refused = [name for sub, name in _FIELDS.items() if back.communication_place(sub) in places]
    kept = {name: getattr(back.now.communication, name) for name in refused}
    as_set = back.want.with_parameters(**kept)
    off = as_set.disabled()
    empty = cleared(off)
    yield from (as_set, off, empty)
    yield replace(empty, communication=back.now.disabled().communication)


def substitute_finding(pdo: Pdo, before: PdoConfig, back: PdoConfig) -> Finding:
    """The warning that the device refused to restore *before*: *pdo* is *back* now."""
    place = f"0x{pdo.communication_index:04X}:01"
    return warning("way-back", place, substitute_text(pdo, before, back))


def substitute_text(pdo: Pdo, before: PdoConfig, back: PdoConfig) -> str:
    """The same in words."""
    was, state = _state(before, back), left_as(before, back)
    return f"{pdo.label} was {was}, and the device refuses that configuration: it is {state} now"


def _state(before: PdoConfig, back: PdoConfig) -> str:
    """Description of a PDO's state *before*, as far as it differs from *back*."""
    if before.inconsistency:
        return "inconsistent"
    words = ["enabled" if before.enabled else "off", *([] if before.count else ["empty"])]
    return " and ".join([*words, *_parameters(before, back)])


def _parameters(of: PdoConfig, beside: PdoConfig) -> Iterator[str]:
    """Parameters *of* a PDO that differ from *beside*."""
    for field, name in _NAMES.items():
        value = getattr(of.communication, field)
        if value != getattr(beside.communication, field):
            yield f"at {name} {value}"


def left_as(before: PdoConfig, back: PdoConfig) -> str:
    """Description of a PDO's state *back* that was *before*."""
    off = [] if back.enabled else ["off", *([] if back.count else ["empty"])]
    return " and ".join([*off, *_parameters(back, before)])


def restarted_finding(node_id: int) -> Finding:
    """The warning for a node that restarted during its roll-back."""
    text = f"node {node_id} restarted: other unstored values are lost"
    return warning("restarted-meanwhile", f"node {node_id}", text)
