"""Rules about incomplete PDOs: without COB-ID, without mapping, or with a count beyond their entries.

Such a PDO may be disabled, cleared and mapped anew, but not enabled unchanged.
"""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.plan import disables, mapping_differs, needs_disabling
from dvtcli.domain.rules.finding import ERROR, Finding, Proposal, Rule, error

_ANOTHER = Hint(Action.SHOW_PDOS, {"all": True}, "choose another PDO ({})")
RULES = (
    Rule("half-pdo", ERROR, "the PDO has no COB-ID or no mapping that could be written",
         "CiA 301, 7.5.2.35 to 7.5.2.38: a PDO has both; the device", (Abort.NO_OBJECT,)),
    Rule("inconsistent-pdo", ERROR, "a PDO would be enabled with fewer entries than its count",
         "CiA 301, 7.5.2.36 and 7.5.2.38", (Abort.PDO_LENGTH,)),
)  # fmt: skip


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
