"""Carrying out a plan on a node: gate, lock, backup, journal, transaction, and the NMT state afterwards.

Decides nothing about what is legal, and shows nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

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
    node.gate.enter()
    boot_ups = node.bus.boot_ups(node.node_id)
    if node.keeper is not None:
        node.keeper.begin(plan, node.identity(), node.gate.found or found, node.pdos)
    try:
        run(node, plan)
    except LeftChanged as left:
        node.suspect = left.text
        if node.keeper is not None:
            left.place = str(node.keeper.journals.path(node.node_id))
            left.hint = f"recover finishes it, from {left.place}"
        raise
    except BaseException as error:
        if isinstance(error, DvtcliError):
            _explain(node, error, findings)
        _settled(node, found, boot_ups)
        raise
    _settled(node, found, boot_ups)


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
    if error.abort in node.profile.store.never_after:
        node.suspect = f"the device answered 0x{error.abort:08X} to a change"


def _settled(node: Node, found: NmtState | None, boot_ups: int) -> None:
    """The device is as planned, or as it was: forget the journal, and undo what a reboot did to the NMT state."""
    if node.keeper is not None:
        node.keeper.end()
    rebooted = node.bus.boot_ups(node.node_id) != boot_ups
    if rebooted and found is NmtState.OPERATIONAL:
        node.access.request(NmtState.OPERATIONAL)
