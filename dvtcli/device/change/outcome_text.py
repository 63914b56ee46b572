"""Why a transaction failed, and the state of the device after its roll-back, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from dvtcli.device.change.expected_refusals import substitute_findings
from dvtcli.device.change.failed_change import TRY_AGAIN
from dvtcli.device.change.untouched_pdos import UntouchedPdos, changes_a_pdo
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Change, PdoChange, Plan, ValueChange
from dvtcli.domain.text import join_some
from dvtcli.errors import DeviceRefused, DvtcliError, NoAnswer, SdoProtocolError

#: how many bytes one frame takes (expedited): a refusal of more may come when a part was taken
_AT_ONCE = 4


def restarted_meanwhile(plan: Plan, why: str | None = None) -> DeviceRefused:
    """The error: the node restarted during *plan*, after the first write."""
    labels, node_id = join_some(change.label for change in plan.changes), plan.node_id
    return DeviceRefused(f"node {node_id} restarted while {labels} was changed", node=node_id, why=why, hint=TRY_AGAIN)


def readback_error(
    node_id: int, change: Change, difference: str, read_back: tuple[bytes, bytes] | None, *, restarted: bool
) -> DeviceRefused:
    """The error: *change* was acknowledged, but reads back with a *difference*.

    *read_back* are the present and the expected value. *restarted*: the node restarted since the plan began.
    """
    text = f"node {node_id} took {change.label} without an error, but reads back differently"
    hint = "the device corrects or ignores the value: check its valid values in the manual"
    if restarted:
        text = f"node {node_id} restarted while {change.label} was changed, and reads back differently"
        hint = TRY_AGAIN
    # equal values had no steps: a restart meanwhile cleared them
    place = change.steps[-1].object if change.steps else change.label
    error = DeviceRefused(text, node=node_id, place=place, why=difference, hint=hint)
    error.read_back = read_back
    return error


class RolledBack(NamedTuple):
    """A rolled-back *plan*, of which the changes *begun* were written in part or whole.

    *unknown* are changes to objects that cannot be read; with *is_unsure* the last of them was refused and is
    unreadable since. *restarted*: the node restarted since the plan began. *left* are the altered untouched PDOs, in
    words, that were not rolled back. *substitutes* are the changes restored to a substitute value.
    """

    plan: Plan
    begun: Sequence[Change]
    others: UntouchedPdos
    unknown: Sequence[ValueChange]
    is_unsure: bool
    restarted: bool
    left: Mapping[Pdo, str]
    substitutes: Sequence[PdoChange]

    @property
    def labels(self) -> str:
        """The changes of the plan, for display."""
        return join_some(change.label for change in self.plan.changes)


def report_rolled_back(fault: DvtcliError, rolled_back: RolledBack) -> None:
    """Complete *fault*, the cause of a roll-back, with the state of the device as in *rolled_back*."""
    node_id = rolled_back.plan.node_id
    _report_unreadable(fault, rolled_back)
    fault.details += [("rolled back", finding.text) for finding in substitute_findings(rolled_back.substitutes)]
    if rolled_back.substitutes and fault.state == "rolled_back":
        fault.state_text = "rolled back as far as the device accepts, and verified; nothing was stored"
    fault.node = node_id
    fault.state_text = rolled_back.others.rolled_back_in_part(rolled_back.plan) or fault.state_text
    if rolled_back.left:
        _report_left(fault, rolled_back)
    elif rolled_back.restarted:
        _report_lost(fault, rolled_back)
    elif changes_a_pdo(rolled_back.plan):
        _report_unread(fault, rolled_back)
    if isinstance(fault, NoAnswer):
        _explain_silence(fault, restarted=rolled_back.restarted)
    elif isinstance(fault, SdoProtocolError):
        fault.hint = fault.hint or Hint(
            Action.SHOW_FRAMES,
            why="there may be two nodes with one node-ID, or another SDO client; {} shows the frames",
        )


def _report_unreadable(fault: DvtcliError, rolled_back: RolledBack) -> None:
    """Report readable objects as before; unreadable ones as unknown, unless the refusal proves them unchanged."""
    refusal, unknown = isinstance(fault, DeviceRefused), rolled_back.unknown
    of_plan = unknown[:-1] if rolled_back.is_unsure else unknown
    fault.state = "unknown" if of_plan and not refusal else "rolled_back"
    if not (unknown and refusal):
        return
    if rolled_back.is_unsure or any(len(change.step.after) > _AT_ONCE for change in unknown):
        fault.state = "unknown"
        fault.hint = fault.hint or Hint(
            Action.RESET_NODE,
            {"node": rolled_back.plan.node_id},
            "restores its stored values; or write the whole object again when the device accepts it",
        )
    fault.state_text = _refused_unreadable(rolled_back.begun, unknown, is_known=fault.state == "rolled_back")


def _refused_unreadable(begun: Sequence[Change], blind: Sequence[Change], *, is_known: bool) -> str:
    """The state after a refusal of unreadable objects *blind*, with the rest of *begun* rolled back.

    *is_known*: the device is known to have taken nothing of *blind*.
    """
    read = [change.label for change in begun if change not in blind]
    names = join_some(change.label for change in blind)
    back = f"{join_some(read)} is as it was, read back equal; " if read else ""
    if not is_known:
        return f"{names} was refused; unknown whether anything was taken: it cannot be read; {back}nothing was stored"
    return f"rolled back: {back}{names} was refused, but its value cannot be read; nothing was stored"


def _report_lost(fault: DvtcliError, rolled_back: RolledBack) -> None:
    """Report only the plan's objects as before: other losses by a restart are not restored."""
    if fault.state == "rolled_back":
        text = fault.state_text or f"rolled back: {rolled_back.labels} is as it was, read back equal"
        fault.state_text = f"{text}; node {rolled_back.plan.node_id} restarted: other unstored values are lost"


def _report_left(fault: DvtcliError, rolled_back: RolledBack) -> None:
    """Report an unknown cause: an unnoticed restart loaded stored values, or the change altered them."""
    left = join_some(pdo.label for pdo in rolled_back.left)
    fault.state = "unknown"
    fault.state_text = (
        f"unknown: {rolled_back.labels} is as it was, read back equal; {left} is not, and was not changed: the node "
        "may have restarted without a boot-up message, and hold its stored values; check it"
    )
    fault.details.append(("left", join_some(rolled_back.left.values())))


def _report_unread(fault: DvtcliError, rolled_back: RolledBack) -> None:
    """Report untouched PDOs as before only if read before the plan, or equal to a backup or a remembered change.

    The plan may have altered the others before the roll-back read them first.
    """
    unread = rolled_back.others.unread()
    if not unread or fault.state != "rolled_back" or fault.state_text is not None:
        return
    try:
        unlike = rolled_back.others.unlike_backups(unread)
    except DvtcliError as failed:  # somebody else can write where the backups are: they prove nothing
        fault.details.append(("also", failed.text))
        unlike = tuple(unread)
    if not unlike:
        fault.state_text = (
            f"rolled back: {rolled_back.labels} is as it was, read back equal; the other PDOs, which were not read "
            "before it, are as a backup or an earlier change left them; nothing was stored"
        )
        return
    labels = join_some(pdo.label for pdo in unlike)
    fault.state = "unknown"
    fault.state_text = (
        f"unknown: {rolled_back.labels} is as it was, read back equal; {labels} was not read before it, and is as no "
        "backup and no earlier change left it: this change altered it with its own, or another tool set it; check it"
    )


def _explain_silence(silent: NoAnswer, *, restarted: bool) -> None:
    """Explain *silent*: the node has answered the roll-back since, so it is neither off nor STOPPED."""
    if restarted:
        silent.why, silent.hint = "it restarted during the check: its boot-up message was received", TRY_AGAIN
    else:
        silent.why = silent.why or "it answers again: a request or answer was lost or late, or it restarted unnoticed"
        silent.hint = Hint(
            Action.GIVE_TIMEOUT,
            why="try again; if it fails again, use a longer {}, or check the wiring and the bus load",
        )
