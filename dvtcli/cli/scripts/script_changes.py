"""Track a script's changes on all nodes, by line; with --atomic, roll back all."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.text import join_some
from dvtcli.errors import BusUnavailable, DeviceRefused, DvtcliError, LeftChanged, NoAnswer, Restarted, SdoProtocolError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dvtcli.device.change.own_journal import OwnJournal
    from dvtcli.device.node import Node
    from dvtcli.domain.plan import Change, Plan
    from dvtcli.domain.rules import Finding
    from dvtcli.operations.session.session import Session


@dataclass(slots=True)
class NodeRolledBack:
    """The roll-back of *made* on *node*, with *boot_ups* counted before, or its *failure*."""

    node: Node
    made: list[Plan]
    boot_ups: int = 0
    failure: LeftChanged | None = None
    #: PDOs not restored by the device, with their present state
    not_put_back: list[Finding] = field(default_factory=list)

    def settled(self, cause: str) -> LeftChanged | None:
        """After all nodes' turns: close the journal; returns the reason if changes remain."""
        if self.failure is not None:
            return self.failure
        try:
            if self.made and self.node.bus.boot_ups(self.node.node_id) != self.boot_ups:
                raise NoAnswer("it restarted during the check")  # what was rolled back before that may be lost again
            self._look_again()
            if self.node.guard is not None:
                self.node.guard.own_journal.end_group()
        except (DvtcliError, KeyboardInterrupt) as failed:
            return _left_of(self, cause, failed)
        from dvtcli.device.change.undo_plan import unknown_before

        unknown = unknown_before(self.made)
        if not unknown and not self.not_put_back:
            return None
        why = "; ".join(finding.text for finding in (*unknown, *self.not_put_back))
        from dvtcli.device.change.failed_change import not_rolled_back

        left = not_rolled_back(self.made, self.node.node_id, cause, why)
        if unknown:
            left.hint = "set it by hand: its old value is unknown"
        return left

    def _look_again(self) -> None:
        """Read the old values once more, because a restart may go unnoticed. Raises DeviceRefused on a difference."""
        if self.not_put_back or not self.made:
            return
        from dvtcli.device.change.changeable import still_there
        from dvtcli.device.change.undo_plan import beginnings
        from dvtcli.device.target_config import config_differences

        if lost := config_differences(self.node, still_there(self.node, beginnings(self.made))):
            raise DeviceRefused(f"it does not have its earlier values: {lost[0][0]} {lost[0][1]}")


def undo_patiently(node: Node, *, force: bool) -> tuple[Finding, ...]:
    """Undo a change; retries for a while if the node is silent, possibly rebooting.

    *force*: undo even if present values differ. Returns values not accepted by the device.
    """
    from dvtcli.device.change.roll_back import PATIENCE_S, RETRY_S

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


def _left_of(rolled_back: NodeRolledBack, cause: str, failed: BaseException) -> LeftChanged:
    """Return the error for the changes that remain, with `recover` as the hint if a journal exists."""
    from dvtcli.device.change.failed_change import BUS_BACK, name_journal, not_rolled_back

    node = rolled_back.node
    left = not_rolled_back(rolled_back.made, node.node_id, cause, str(failed) or "interrupted")
    left.__cause__ = failed
    path = node.guard.unfinished_journal() if node.guard is not None else None
    name_journal(left, path, BUS_BACK if isinstance(failed, BusUnavailable) else None)
    return left


#: The text for unknown lines, e.g. of a Tcl script.
ABOVE = "lines above it"


class ScriptChanges:
    """The changes of a script since its beginning; *atomic*: keep all, or roll back all."""

    def __init__(self, session: Session, name: str, *, atomic: bool, outer: ScriptChanges | None = None) -> None:
        self._session, self.atomic = session, atomic
        #: whether the whole script works on twins
        self.dry_run = session.dry_run
        #: the changes of the calling script
        self._outer = outer
        self._before = {id(node): len(node.history) for node in session.met_nodes()}
        #: number of undone changes of earlier processes on each node, absent in histories
        self._undone_earlier = {id(node): node.undone_earlier for node in session.met_nodes()}
        self._stores = {id(node): node.pending.stores for node in session.met_nodes()}
        self._executed, self._selected = len(session.record.lines), session.selected
        #: the script's plans with their lines; kept, so that no other plan gets their ids
        self._plans: dict[int, tuple[Plan, str]] = {}
        #: lines with effects outside histories: stores, resets, NMT commands, logins
        self._others: list[str] = []
        #: nodes OPERATIONAL before the first line without undo; None before such a line
        self._operational: set[int] | None = None
        #: the first line without undo
        self.final: str | None = None
        #: whether a node was seen with other values than set; the roll-back is forced then
        self._lost = False
        #: whether a roll-back was attempted
        self.ended = False
        if atomic:
            session.group.begin(name)

    def note(self, place: str, *, other: bool = False, final: bool = False) -> None:
        """Record the line at *place*; *other*: effects outside histories; *final*: effects without undo."""
        for node in self._session.met_nodes():
            before, made = self._before.get(id(node), 0), self._made(node)
            for plan in made:
                self._plans.setdefault(id(plan), (plan, place))
            if len(node.history) < before:  # it undid what was done before the script
                self._before[id(node)], other, final = len(node.history), True, True
            if node.undone_earlier > self._undone_earlier.get(id(node), 0):
                self._undone_earlier[id(node)], other, final = node.undone_earlier, True, True
            if node.pending.stores > self._stores.get(id(node), 0):
                self._stores[id(node)], other, final = node.pending.stores, True, True
        if other:
            self._others.append(place)
        if final:
            self.final = self.final or place
            self.complete()

    def _made(self, node: Node) -> list[Plan]:
        return node.history[self._before.get(id(node), 0) :]

    def changed_anything(self) -> bool:
        """Whether any node was changed and needs a roll-back."""
        return any(map(self._made, self._session.met_nodes()))

    def staying(self) -> tuple[str, ...]:
        """Return `FILE:LINE` of each line whose changes are still in the nodes, in order."""
        held = self._held()
        unknown = [ABOVE] if held - self._plans.keys() else []
        outer = self._outer._noted() if self._outer is not None else []  # noqa: SLF001 - one of ours
        return tuple(dict.fromkeys([*outer, *self._noted(), *unknown]))

    def differing(self) -> tuple[str, ...] | None:
        """Read back how nodes differ from this script's changes, except undone changes.

        Returns None without changes, or if no difference was found and some values cannot be read back. Raises errors
        of reading.
        """
        from dvtcli.device.change.changeable import moves, no_longer_held
        from dvtcli.domain.plan import PdoChange

        held, found, is_read = self._held(), [], []
        for node in self._session.met_nodes():
            changes = [change for plan in self._made(node) if id(plan) in held for change in plan.changes]
            found += [f"{label} of node {node.node_id} {text}" for label, text in no_longer_held(node, changes)]
            is_read += [
                isinstance(change, PdoChange)
                or (change.is_readable and not moves(node, change.step.index, change.step.sub_index))
                for change in changes
            ]
        return tuple(found) if found or (is_read and all(is_read)) else None

    def _held(self) -> set[int]:
        """Return ids of this script's plans whose changes are still in the nodes."""
        made = {id(plan) for node in self._session.met_nodes() for plan in self._made(node)}
        return made & {id(plan) for node in self._session.met_nodes() for plan in node.plans_in_effect()}

    def _noted(self) -> list[str]:
        held = self._held()
        return [*(place for number, (_, place) in self._plans.items() if number in held), *self._others]

    def begin_final(self, line: str) -> None:
        """Record in the journals that *line*, without undo, runs next, for `recover` after a crash."""
        self._note_gates()
        for journal in self._journals():
            journal.record_stores(line)

    def _note_gates(self) -> None:
        """Record the nodes to return to OPERATIONAL, because an NMT line resets their gates."""
        nodes = self._session.met_nodes()
        found = {id(node) for node in nodes if node.gate.found is NmtState.OPERATIONAL}
        self._operational = found | (self._operational or set())

    def look_again(self) -> None:
        """After the last line, check earlier lines' values. Raises DeviceRefused on a difference.

        The last line's own read-back is recent enough; nothing is checked after a line without undo.
        """
        made = [(node, self._made(node)) for node in self._session.met_nodes()]  # a node, and its twin
        if self.final is not None or sum(len(plans) for _, plans in made) < 2:
            return
        from dvtcli.device.change.changeable import no_longer_held

        for node, plans in made:
            changes = [change for plan in plans for change in plan.changes]
            if lost := no_longer_held(node, changes):
                self._lost = True
                raise DeviceRefused(
                    f"node {node.node_id} no longer has the values of the script: {lost[0][0]} {lost[0][1]}",
                    node=node.node_id,
                    why=join_some(f"{label} {text}" for label, text in lost[1:]) or None,
                    hint="a later line altered it, or the node restarted without a boot-up message",
                )

    def return_nodes(self) -> None:
        """Restore the nodes' NMT states. Raises Restarted if a node lost its values by a restart.

        Does nothing after a line without undo.
        """
        if self.final is not None:
            return
        nodes = list(self._session.met_nodes())
        for node in nodes:
            node.gate.leave()
        try:
            from dvtcli.device.node import refuse_after_restarts

            refuse_after_restarts(nodes)
        except Restarted:
            self._lost = True
            raise

    def complete(self) -> None:
        """Keep all changes: `recover` no longer reverts them. Raises JournalKept if a journal cannot be removed."""
        if not self.atomic:
            return
        from dvtcli.device.change.own_journal import complete_groups

        try:
            complete_groups(self._journals())
        finally:
            self._session.group.end()

    def end(self, *, complete: bool) -> None:
        """End the script, *complete* or failed; `recover` handles changes that could not be rolled back."""
        if complete:
            self.complete()
        elif self.atomic:
            for journal in self._journals():
                journal.abandon_group()
            self._session.group.end()

    def _journals(self) -> list[OwnJournal]:
        """Return journals of all nodes met so far, for an atomic script that is still open."""
        if not self.atomic or self._session.group.id is None:
            return []
        return [node.guard.own_journal for node in self._session.met_nodes() if node.guard is not None]

    def roll_back(self, cause: str, failed: LeftChanged | None = None) -> None:
        """Undo all changes on all nodes, newest first, each verified. Raises LeftChanged if any remain.

        *cause* is the failing line's message; *failed* is its error, if its own roll-back failed.
        """
        self.ended = True
        made = {node.node_id: (node, self._made(node)) for node in self._session.met_nodes()}
        if self.final is not None:
            left = self._committed(cause)
            self._name_left(left, made.values(), failed)
            raise left
        for journal in self._journals():
            journal.record_stores("")
        with self._session.cancellation.rolling_back(), self._session.agreed():
            tried = [self._roll_back_node(node, cause) for node in reversed(list(self._session.met_nodes()))]
            failures = [failure for attempt in tried if (failure := attempt.settled(cause)) is not None]
        if failures:
            from dvtcli.device.change.failed_change import failure_sentence

            first, *others = failures
            self._name_left(first, [made[changed.node] for changed in failures if changed.node in made], failed)
            for failure in failures:
                failure.text = failure_sentence(first, failure.node or 0, "rolled back") or failure.text
            first.details += [("also", failure.text) for failure in others]
            raise first
        if failed is not None:
            self._name_left(failed, made.values(), failed)
        self._leave_stopped()
        self._others.clear()
        del self._session.record.lines[self._executed :]
        self._session.selected = self._selected

    def _leave_stopped(self) -> None:
        """Leave nodes started by the script PRE-OPERATIONAL, with a warning: they were not OPERATIONAL before."""
        if self._operational is None:
            return
        for node in self._session.met_nodes():
            if id(node) not in self._operational and (said := node.gate.abandon()):
                self._session.reporter.warning(said)

    def _roll_back_node(self, node: Node, cause: str) -> NodeRolledBack:
        """Undo the changes of *node*, or record the reason for failure; its journal stays."""
        made = self._made(node)
        tried = NodeRolledBack(node, made)
        if not made and (node.guard is None or node.guard.unfinished_journal() is None):
            return tried  # nothing was written to it, and it need not be there any more
        try:
            tried.boot_ups = node.bus.boot_ups(node.node_id)
            while self._made(node):
                tried.not_put_back += undo_patiently(node, force=self._lost)
        except (DvtcliError, KeyboardInterrupt) as failed:
            tried.failure = _left_of(tried, cause, failed)
        return tried

    def _name_left(
        self, left: LeftChanged, made: Iterable[tuple[Node, Sequence[Plan]]], failed: LeftChanged | None
    ) -> None:
        """Add to *left* the nodes' differences from before the script, and before the line that *failed*."""
        from dvtcli.device.change.combined_plan import combine_plans
        from dvtcli.device.change.failed_change import Guarded, name_left
        from dvtcli.domain.plan import Plan

        changes: dict[int, tuple[Node, tuple[Change, ...]]] = {}
        for node, plans in made:
            changes[node.node_id] = node, combine_plans(node.node_id, plans).changes
        for node in self._session.met_nodes():
            if failed is not None and node.node_id in failed.guarded:
                _, own = changes.get(node.node_id, (node, ()))
                parts = (Plan(node.node_id, some) for some in (own, failed.guarded[node.node_id]))
                changes[node.node_id] = node, combine_plans(node.node_id, parts).changes
        stopped = isinstance(left.__cause__, KeyboardInterrupt)
        name_left(
            left,
            [Guarded(node.node_id, node.sdo, node.reboot_monitor, some) for node, some in changes.values() if some],
            stopped=stopped,
        )

    def _committed(self, cause: str) -> LeftChanged:

        return LeftChanged(
            f"{cause}; the changes of the lines before {self.final} cannot be rolled back after that line",
            hint=Hint(Action.SHOW_PDOS, why="check each node with {}"),
            state="left_changed",
        )
