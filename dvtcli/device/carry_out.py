"""Carrying out a plan on a node: gate, lock, backup, journal, transaction, and the NMT state afterwards.

Decides nothing about what is legal, and shows nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.pending import CHANGE
from dvtcli.device.transaction import Transaction
from dvtcli.domain.nmt import NmtState
from dvtcli.errors import DvtcliError, LeftChanged

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.plan import Plan
    from dvtcli.domain.rules import Finding


def carry_out(node: Node, plan: Plan, findings: tuple[Finding, ...] = ()) -> None:
    """Take *node* to where *plan* ends, or leave it as it was; LeftChanged names the journal where neither works.

    *findings* are what the rules had said; they explain a refusal of something that was forced.
    """
    found = node.access.state()
    boot_ups = node.bus.boot_ups(node.node_id)
    if node.keeper is not None:
        node.keeper.begin(plan, node.identity(), found, node.pdos)
    try:
        node.gate.enter()
        run(node, plan)
    except LeftChanged as left:
        left_open(node, left)
        raise
    except BaseException as error:
        if isinstance(error, DvtcliError):
            _explain(node, error, findings)
        _settle_after(node, error, found, boot_ups)
        raise
    _return(node, found, boot_ups)
    _close(node)


def left_open(node: Node, left: LeftChanged) -> None:
    """A roll-back failed: nothing may be stored, and *left* says how to finish."""
    node.pending.suspicions[CHANGE] = left.text
    if node.keeper is not None:
        left.place = str(node.keeper.journals.path(node.node_id))
        left.hint = f"recover finishes it, from {left.place}"


def _close(node: Node) -> None:
    if node.keeper is not None:
        node.keeper.end()


def _settle_after(node: Node, error: BaseException, found: NmtState | None, boot_ups: int) -> None:
    """The device is as it was: forget the journal; what cannot be put right of its NMT state is added to *error*."""
    try:
        rebooted = _return(node, found, boot_ups)
    except DvtcliError as failed:
        _add(error, f"{failed.text}: {failed.why or failed.hint}")
    else:
        if rebooted and found is None:
            _add(error, f"node {node.node_id} restarted; its NMT state before is not known: look at it")
    _close(node)


def _add(error: BaseException, text: str) -> None:
    if isinstance(error, DvtcliError):
        error.details.append(("nmt", text))


def run(node: Node, plan: Plan) -> None:
    """Run *plan* as one transaction; what was read of the node before counts no longer."""
    transaction = Transaction(
        node.sdo,
        plan,
        node.cancellation,
        node.access.explain,
        before_retry=node.gate.renew,
        clock=node.bus,
    )
    try:
        transaction.run()
    finally:
        node.forget()


def _explain(node: Node, error: DvtcliError, findings: tuple[Finding, ...]) -> None:
    foreseen = (finding.text for finding in findings if finding.place == f"0x{error.place}")
    error.why = error.why or next(foreseen, None)
    error.hint = error.hint or _hint(node, error)
    if error.abort in node.profile.store.never_after:
        node.pending.suspicions[CHANGE] = f"the device answered 0x{error.abort:08X} to a change"


def _hint(node: Node, error: DvtcliError) -> str | None:
    """What the family's maker says of this refusal at this step."""
    if error.abort is None or error.place is None or ":" not in error.place:
        return None
    index, _, sub_index = error.place.partition(":")
    return node.profile.hint(int(index, 16), int(sub_index, 16), error.abort)


def _return(node: Node, found: NmtState | None, boot_ups: int) -> bool:
    """Undo what a reboot did to the NMT state, which inside an open gate is left to the gate's end; whether it did."""
    rebooted = node.bus.boot_ups(node.node_id) != boot_ups
    if rebooted and found is NmtState.OPERATIONAL and not node.gate.entered:
        node.access.insist(NmtState.OPERATIONAL)
    return rebooted
