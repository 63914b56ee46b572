"""What a script did to one node on its way back, and why some of it stays. Does not know lines, and shows nothing."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.errors import BusUnavailable, DeviceRefused, DvtcliError, LeftChanged, NoAnswer, SdoProtocolError

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.plan import Plan
    from dvtcli.domain.rules import Finding


@dataclass(slots=True)
class NodeTakenBack:
    """What *made* of a script was undone on *node*, which had sent *boot_ups* before; or why not (*failure*)."""

    node: Node
    made: list[Plan]
    boot_ups: int = 0
    failure: LeftChanged | None = None
    #: of each PDO that the device did not take back what it is now
    not_put_back: list[Finding] = field(default_factory=list)

    def settled(self, cause: str) -> LeftChanged | None:
        """Once all nodes had their turn: forget the journal; why something of it stays, where it does."""
        if self.failure is not None:
            return self.failure
        try:
            if self.made and self.node.bus.boot_ups(self.node.node_id) != self.boot_ups:
                raise NoAnswer("it restarted meanwhile")  # what was put back before that may be lost again
            self._look_again()
            if self.node.keeper is not None:
                self.node.keeper.own_journal.end_whole()
        except (DvtcliError, KeyboardInterrupt) as failed:
            return left_of(self.node, self.made, cause, failed)
        from dvtcli.device.change.way_back import unknown_before

        unknown = unknown_before(self.made)
        if not unknown and not self.not_put_back:
            return None
        why = "; ".join(finding.text for finding in (*unknown, *self.not_put_back))
        from dvtcli.device.change.failed_change import not_taken_back

        left = not_taken_back(self.made, self.node.node_id, cause, why)
        if unknown:
            left.hint = "set it by hand: its value before is not known"
        return left

    def _look_again(self) -> None:
        """Read once more what was put back, a restart need not be heard; DeviceRefused where it is not as before."""
        if self.not_put_back or not self.made:
            return
        from dvtcli.device.change.expected import still_there
        from dvtcli.device.change.way_back import beginnings
        from dvtcli.device.wish import unlike

        if lost := unlike(self.node, still_there(self.node, beginnings(self.made))):
            raise DeviceRefused(f"it does not hold what it held before: {lost[0][0]} {lost[0][1]}")


def undo_patiently(node: Node, *, force: bool) -> tuple[Finding, ...]:
    """Undo one change; a node that is silent may be rebooting, so it is asked again for a while.

    With *force* whatever it holds by now. Returns what the device did not take back.
    """
    from dvtcli.device.change.put_back import PATIENCE_S, RETRY_S

    deadline_s = node.bus.now_s() + PATIENCE_S
    while True:
        try:
            return node.undo(force=force, rolls_back=True).not_put_back
        except (NoAnswer, SdoProtocolError):
            if node.bus.now_s() >= deadline_s:
                raise
            node.bus.sleep(RETRY_S)
            with suppress(NoAnswer, SdoProtocolError):
                node.gate.renew()  # where that fails too, the next try finds out


def left_of(node: Node, plans: list[Plan], cause: str, failed: BaseException) -> LeftChanged:
    """Some of *plans* stays on *node*, whose journal `recover` takes, where there is one."""
    from dvtcli.device.change.failed_change import BUS_BACK, not_taken_back

    left = not_taken_back(plans, node.node_id, cause, str(failed) or "interrupted")
    left.__cause__ = failed
    path = node.keeper.open_journal() if node.keeper is not None else None
    if path is not None:
        finish = Hint(Action.RECOVER, why=f"finishes it, from {verbatim(path)}")
        left.place = str(path)
        left.hint = finish.after(BUS_BACK if isinstance(failed, BusUnavailable) else None)
    return left
