"""Changes of somebody else between those of this session: going back behind them would take them back, too.

Knows plans, oldest first. Reads no device.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dvtcli.device.change.change_guard import who_else
from dvtcli.device.compare import differences
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, Plan
from dvtcli.domain.several import join_some, value_text
from dvtcli.errors import SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.device.change.changeable import Changeable


def refuse_gap(node: Changeable, plans: Sequence[Plan]) -> None:
    """Raise SafetyRefusal where one of *plans* began at what none of those before it found or left."""
    found = _gap(plans)
    if found is not None:
        raise _refusal(node, *found)


def unbroken(plans: Sequence[Plan]) -> Sequence[Plan]:
    """The newest of *plans* (oldest first) without a gap: what was there before it is somebody else's to take back."""
    return next((plans[first:] for first in range(len(plans)) if _gap(plans[first:]) is None), ())


def _gap(plans: Sequence[Plan]) -> tuple[str, str] | None:
    """What somebody else changed between two of *plans*, and how."""
    pdos: dict[Pdo, list[PdoConfig]] = {}
    values: dict[tuple[int, int], list[bytes]] = {}
    for change in (change for plan in plans for change in plan.changes):
        if isinstance(change, PdoChange):
            known = pdos.setdefault(change.pdo, [change.before])
            if change.before not in known:
                return change.label, join_some(differences(change.pdo, known[-1], change.before))
            known += [change.before, change.after]
        elif (pdo := Pdo.at(change.step.index)) is not None:
            pdos.pop(pdo, None)  # a part of it was written: the next plan finds another whole
        elif (before := change.step.before) is not None:
            held = values.setdefault((change.step.index, change.step.sub_index), [before])
            if before not in held:
                return change.label, f"was {value_text(held[-1])}, became {value_text(before)}"
            held += [before, change.step.after]
    return None


def _refusal(node: Changeable, label: str, why: str) -> SafetyRefusal:
    return SafetyRefusal(
        f"somebody else changed {label} of node {node.node_id} between this session's changes",
        node=node.node_id,
        why=why,
        hint=Hint(Action.UNDO, why=f"{verbatim(who_else(node.keeper))}: {{}} takes back what came after that")
        + Hint(Action.UNDO, {"all": True, "force": True}, ", {} everything"),
    )
