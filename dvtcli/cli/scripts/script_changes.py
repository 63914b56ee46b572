"""What the lines of a script have changed on every node, by line; and, with --atomic, taking all of it back.

Does not know how lines are parsed or run, and shows nothing.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.restarts import held_plans, refuse_after_restarts
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.several import join_some
from dvtcli.errors import BusUnavailable, DeviceRefused, DvtcliError, LeftChanged, NoAnswer, Restarted, SdoProtocolError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dvtcli.device.change.own_journal import OwnJournal
    from dvtcli.device.node import Node
    from dvtcli.domain.plan import Change, Plan
    from dvtcli.domain.rules import Finding
    from dvtcli.operations.session.session import Session


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


#: What stands for a line that is not known, as one of a Tcl script.
ABOVE = "lines above it"


class ScriptChanges:
    """The changes of one script, from its beginning; with *atomic* they are all kept, or all taken back."""

    def __init__(self, session: Session, name: str, *, atomic: bool, outer: ScriptChanges | None = None) -> None:
        self._session, self.atomic = session, atomic
        #: whether all of the script works on twins
        self.dry_run = session.dry_run
        #: those of the script that runs this one
        self._outer = outer
        self._before = {id(node): len(node.history) for node in session.met_nodes()}
        #: how many changes of earlier processes had been put back on each node, which no history holds
        self._unkept = {id(node): node.unkept for node in session.met_nodes()}
        self._stores = {id(node): node.pending.stores for node in session.met_nodes()}
        self._executed, self._selected = len(session.record.lines), session.selected
        #: each plan of the script's with its line; kept, so that no other plan gets its id
        self._plans: dict[int, tuple[Plan, str]] = {}
        #: lines that did what no history holds: stores, resets, NMT commands, logins
        self._others: list[str] = []
        #: the nodes whose gates found them OPERATIONAL before such a line was begun; None where none was
        self._operational: set[int] | None = None
        #: the first line that did what cannot be taken back
        self.final: str | None = None
        #: whether a node was seen to hold something else than what was set: it is put back all the same then
        self._lost = False
        #: whether it was tried to take everything back
        self.ended = False
        if atomic:
            session.whole.begin(name)

    def note(self, place: str, *, other: bool = False, final: bool = False) -> None:
        """The line at *place* was run; *other* says that it did what no history holds, *final* nor any undo reverts."""
        for node in self._session.met_nodes():
            before, made = self._before.get(id(node), 0), self._made(node)
            for plan in made:
                self._plans.setdefault(id(plan), (plan, place))
            if len(node.history) < before:  # it undid what was done before the script
                self._before[id(node)], other, final = len(node.history), True, True
            if node.unkept > self._unkept.get(id(node), 0):
                self._unkept[id(node)], other, final = node.unkept, True, True
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
        """Whether any node was changed, and would have to be taken back."""
        return any(map(self._made, self._session.met_nodes()))

    def staying(self) -> tuple[str, ...]:
        """`FILE:LINE` of each line whose changes the nodes hold, in order."""
        held = self._held()
        unknown = [ABOVE] if held - self._plans.keys() else []
        outer = self._outer._noted() if self._outer is not None else []  # noqa: SLF001 - one of ours
        return tuple(dict.fromkeys([*outer, *self._noted(), *unknown]))

    def differing(self) -> tuple[str, ...] | None:
        """How nodes differ from what this script's lines set and nobody took back, read now.

        None if nothing was set, or if nothing differs and not all of it can be read again. Raises as reading does.
        """
        from dvtcli.device.change.expected import moves, no_longer_held
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
        """The ids of the plans that this script made and whose changes the nodes hold."""
        made = {id(plan) for node in self._session.met_nodes() for plan in self._made(node)}
        return made & {id(plan) for node in self._session.met_nodes() for plan in held_plans(node)}

    def _noted(self) -> list[str]:
        held = self._held()
        return [*(place for number, (_, place) in self._plans.items() if number in held), *self._others]

    def begin_final(self, line: str) -> None:
        """*line* is run next, which no undo reverts: where this process ends in its middle, `recover` says so."""
        self._note_gates()
        for journal in self._journals():
            journal.final(line)

    def _note_gates(self) -> None:
        """Keep in mind which nodes go back to OPERATIONAL: an NMT line makes their gates forget that."""
        nodes = self._session.met_nodes()
        found = {id(node) for node in nodes if node.gate.found is NmtState.OPERATIONAL}
        self._operational = found | (self._operational or set())

    def look_again(self) -> None:
        """Once all lines have worked: do the nodes still hold what the earlier ones set? DeviceRefused where not.

        What the last line set was read back after all else; nothing is looked at behind one that cannot be taken back.
        """
        made = [(node, self._made(node)) for node in self._session.met_nodes()]  # a node, and its twin
        if self.final is not None or sum(len(plans) for _, plans in made) < 2:
            return
        from dvtcli.device.change.expected import no_longer_held

        for node, plans in made:
            changes = [change for plan in plans for change in plan.changes]
            if lost := no_longer_held(node, changes):
                self._lost = True
                raise DeviceRefused(
                    f"node {node.node_id} does not hold any more what the script set: {lost[0][0]} {lost[0][1]}",
                    node=node.node_id,
                    why=join_some(f"{label} {text}" for label, text in lost[1:]) or None,
                    hint="a later line altered it with what it wrote, or the node restarted and nobody heard it",
                )

    def return_nodes(self) -> None:
        """Bring the nodes to the NMT state they were found in; Restarted if one has lost by then what was set.

        Nothing is done behind a line that cannot be taken back.
        """
        if self.final is not None:
            return
        nodes = list(self._session.met_nodes())
        for node in nodes:
            node.gate.leave()
        try:
            refuse_after_restarts(nodes)
        except Restarted:
            self._lost = True
            raise

    def complete(self) -> None:
        """Everything stays: no `recover` takes it back any more. JournalKept where a journal cannot be removed."""
        if not self.atomic:
            return
        from dvtcli.device.change.own_journal import complete_wholes

        kept = complete_wholes(self._journals())
        self._session.whole.end()
        if kept is not None:
            raise kept

    def end(self, *, complete: bool) -> None:
        """The script has ended, *complete* or with an error; what of it could not be taken back waits for `recover`."""
        if complete:
            self.complete()
        elif self.atomic:
            for journal in self._journals():
                journal.abandon_whole()
            self._session.whole.end()

    def _journals(self) -> list[OwnJournal]:
        """Those of the nodes that were looked at so far, while the script stands or falls as a whole."""
        if not self.atomic or self._session.whole.id is None:
            return []
        return [node.keeper.own_journal for node in self._session.met_nodes() if node.keeper is not None]

    def take_back(self, cause: str, failed: LeftChanged | None = None) -> None:
        """Undo everything, on all nodes, newest first, each verified; LeftChanged if some of it stays.

        *cause* is why: what the line that failed said; *failed* is its error, if its own roll-back failed.
        """
        self.ended = True
        made = {node.node_id: (node, self._made(node)) for node in self._session.met_nodes()}
        if self.final is not None:
            left = self._committed(cause)
            self._name_left(left, made.values(), failed)
            raise left
        for journal in self._journals():
            journal.final("")
        with self._session.cancellation.way_back(), self._session.agreed():
            tried = [self._take_back(node, cause) for node in reversed(list(self._session.met_nodes()))]
            failures = [failure for attempt in tried if (failure := attempt.settled(cause)) is not None]
        if failures:
            from dvtcli.device.change.left_behind import could_not

            first, *others = failures
            self._name_left(first, [made[changed.node] for changed in failures if changed.node in made], failed)
            for failure in failures:
                failure.text = could_not(first, failure.node or 0, "taken back") or failure.text
            first.details += [("also", failure.text) for failure in others]
            raise first
        if failed is not None:
            self._name_left(failed, made.values(), failed)
        self._leave_stopped()
        self._others.clear()
        del self._session.record.lines[self._executed :]
        self._session.selected = self._selected

    def _leave_stopped(self) -> None:
        """Nodes that a line of the script had started stay PRE-OPERATIONAL, which is said: they were not found so."""
        if self._operational is None:
            return
        for node in self._session.met_nodes():
            if id(node) not in self._operational and (said := node.gate.abandon()):
                self._session.tell.warning(said)

    def _take_back(self, node: Node, cause: str) -> NodeTakenBack:
        """Undo what was done to *node*, or find out why that is not possible; its journal stays."""

        made = self._made(node)
        tried = NodeTakenBack(node, made)
        if not made and (node.keeper is None or node.keeper.open_journal() is None):
            return tried  # nothing was written to it, and it need not be there any more
        try:
            tried.boot_ups = node.bus.boot_ups(node.node_id)
            while self._made(node):
                tried.not_put_back += undo_patiently(node, force=self._lost)
        except (DvtcliError, KeyboardInterrupt) as failed:
            tried.failure = left_of(node, made, cause, failed)
        return tried

    def _name_left(
        self, left: LeftChanged, made: Iterable[tuple[Node, Sequence[Plan]]], failed: LeftChanged | None
    ) -> None:
        """Let *left* name what the nodes hold otherwise than before the script, and before the line that *failed*."""
        from dvtcli.device.change.course import combine_plans
        from dvtcli.device.change.left_behind import Guarded, name_left
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
            [Guarded(node.node_id, node.sdo, node.witness, some) for node, some in changes.values() if some],
            stopped=stopped,
        )

    def _committed(self, cause: str) -> LeftChanged:
        from dvtcli.domain.hint import Action, Hint

        return LeftChanged(
            f"{cause}; what the lines before {self.final} changed cannot be taken back after that line",
            hint=Hint(Action.SHOW_PDOS, why="look at each node with {}"),
            state="left_changed",
        )
