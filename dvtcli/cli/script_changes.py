"""What the lines of a script have changed on every node, by line; and, with --atomic, taking all of it back.

Does not know how lines are parsed or run, and shows nothing.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.change.put_back import PATIENCE_S, RETRY_S
from dvtcli.device.change.way_back import unknown_before
from dvtcli.device.restarts import held_plans
from dvtcli.domain.plan import Change, PdoChange, Plan, ValueChange
from dvtcli.domain.several import several
from dvtcli.errors import DvtcliError, LeftChanged, NoAnswer, SdoProtocolError

if TYPE_CHECKING:
    from dvtcli.device.change.journal import Identity
    from dvtcli.device.node import Node
    from dvtcli.operations.session import Session

#: What stands for a line that is not known, as one of a Tcl script.
ABOVE = "lines above it"


class ScriptChanges:
    """The changes of one script, from its beginning; with *atomic* they are all kept, or all taken back."""

    def __init__(self, session: Session, *, atomic: bool, outer: ScriptChanges | None = None) -> None:
        self._session, self.atomic = session, atomic
        #: whether all of the script works on twins
        self.dry_run = session.dry_run
        #: those of the script that runs this one
        self._outer = outer
        self._before = {id(node): len(node.history) for node in session.met_nodes()}
        #: how many changes of earlier processes had been put back on each node, which no history holds
        self._unkept = {id(node): node.unkept for node in session.met_nodes()}
        self._executed, self._selected = len(session.record.lines), session.selected
        #: each plan of the script's with its line; kept, so that no other plan gets its id
        self._plans: dict[int, tuple[Plan, str]] = {}
        #: lines that did what no history holds: stores, resets, NMT commands, logins
        self._others: list[str] = []
        #: the first line that did what cannot be taken back
        self.final: str | None = None
        self._identities: dict[int, Identity] = {}
        #: whether it was tried to take everything back
        self.ended = False

    def note(self, place: str, *, other: bool = False, final: bool = False) -> None:
        """The line at *place* was run; *other* says that it did what no history holds, *final* nor any undo reverts."""
        for node in self._session.met_nodes():
            before, made = self._before.get(id(node), 0), self._made(node)
            for plan in made:
                self._plans.setdefault(id(plan), (plan, place))
            if len(node.history) < before:  # it undid what was done before the script
                self._before[id(node)], final = len(node.history), True
            if node.unkept > self._unkept.get(id(node), 0):
                self._unkept[id(node)], final = node.unkept, True
            final = final or (bool(made) and node.pending.stored_at > before)
            if self.atomic and node.keeper is not None and made and node.node_id not in self._identities:
                self._identities[node.node_id] = node.identity()
        if other or final:
            self._others.append(place)
        if final:
            self.final = self.final or place

    def _made(self, node: Node) -> list[Plan]:
        return node.history[self._before.get(id(node), 0) :]

    def staying(self) -> tuple[str, ...]:
        """`FILE:LINE` of each line whose changes the nodes hold, in order."""
        held = self._held()
        unknown = [ABOVE] if held - self._plans.keys() else []
        outer = self._outer._noted() if self._outer is not None else []  # noqa: SLF001 - one of ours
        return tuple(dict.fromkeys([*outer, *self._noted(), *unknown]))

    def _held(self) -> set[int]:
        """The ids of the plans that this script made and whose changes the nodes hold."""
        made = {id(plan) for node in self._session.met_nodes() for plan in self._made(node)}
        return made & {id(plan) for node in self._session.met_nodes() for plan in held_plans(node)}

    def _noted(self) -> list[str]:
        held = self._held()
        return [*(place for number, (_, place) in self._plans.items() if number in held), *self._others]

    def take_back(self, cause: str) -> None:
        """Undo everything, on all nodes, newest first, each verified; LeftChanged where some of it stays.

        *cause* is why: what the line that failed said.
        """
        self.ended = True
        if self.final is not None:
            raise self._committed(cause)
        failures: list[LeftChanged] = []
        with self._session.cancellation.way_back():
            for node in reversed(list(self._session.met_nodes())):
                failure = self._take_back(node, cause)
                if failure is not None:
                    failures.append(failure)
        if failures:
            failures[0].details += [("also", failure.text) for failure in failures[1:]]
            raise failures[0]
        self._others.clear()
        del self._session.record.lines[self._executed :]
        self._session.selected = self._selected

    def _take_back(self, node: Node, cause: str) -> LeftChanged | None:
        """Undo what was done to *node*; why that is not possible, where it is not."""
        made = self._made(node)
        if not made:
            return None
        whole, unknown = _combined(node.node_id, [*made, *_in_hand(node)]), unknown_before(made)
        try:
            boot_ups = node.bus.boot_ups(node.node_id)
            while self._made(node):
                _undo_patiently(node)
            if node.bus.boot_ups(node.node_id) != boot_ups:  # what was put back before that may be lost again
                raise NoAnswer("it restarted meanwhile")
        except (DvtcliError, KeyboardInterrupt) as failed:
            return self._left(node, whole, cause, failed)
        if not unknown:
            return None
        left = _left_changed(node, made, cause, "; ".join(finding.text for finding in unknown))
        left.hint = "set it by hand: its value before is not known"
        return left

    def _left(self, node: Node, whole: Plan, cause: str, failed: BaseException) -> LeftChanged:
        """Some of it stays on *node*: *whole* is written down for `recover`, where that is possible."""
        left = _left_changed(node, [whole], cause, str(failed) or "interrupted")
        identity = self._identities.get(node.node_id)
        if node.keeper is not None and identity is not None:
            try:
                path = node.keeper.journals.write(whole, identity, None)
                node.keeper.lock.note(path)
            except OSError as full:
                left.details.append(("journal", f"cannot be kept: {full.strerror or full}"))
            else:
                left.place, left.hint = str(path), f"recover finishes it, from {path}"
        return left

    def _committed(self, cause: str) -> LeftChanged:
        return LeftChanged(
            f"{cause}; what the lines before {self.final} changed cannot be taken back after that line",
            hint="look at the nodes with `verify` and `pdo`",
            state="left_changed",
        )


def _in_hand(node: Node) -> list[Plan]:
    """The change that could be neither made nor undone, where the line that failed left one."""
    journal = node.keeper.journals.find(node.node_id) if node.keeper is not None else None
    return [] if journal is None else [journal.plan]


def _undo_patiently(node: Node) -> None:
    """Undo one change; a node that is silent may be rebooting, so it is asked again for a while."""
    deadline_s = node.bus.now_s() + PATIENCE_S
    while True:
        try:
            node.undo()
        except (NoAnswer, SdoProtocolError):
            if node.bus.now_s() >= deadline_s:
                raise
            node.bus.sleep(RETRY_S)
            with suppress(NoAnswer, SdoProtocolError):
                node.gate.renew()  # where that fails too, the next try finds out
        else:
            return


def _combined(node_id: int, plans: list[Plan]) -> Plan:
    """One plan from before the first of *plans* to after the last one, for a journal."""
    first: dict[object, Change] = {}
    last: dict[object, Change] = {}
    for change in (change for plan in plans for change in plan.changes):
        key = change.pdo if isinstance(change, PdoChange) else change.label
        first.setdefault(key, change)
        last[key] = change
    return Plan(node_id, tuple(_joined(change, last[key]) for key, change in first.items()))


def _joined(first: Change, last: Change) -> Change:
    if isinstance(first, PdoChange) and isinstance(last, PdoChange):
        return replace(last, before=first.before)
    assert isinstance(first, ValueChange)  # noqa: S101 - one key, one kind
    assert isinstance(last, ValueChange)  # noqa: S101
    return ValueChange(replace(last.step, before=first.step.before))


def _left_changed(node: Node, plans: list[Plan], cause: str, why: str) -> LeftChanged:
    labels = several(dict.fromkeys(change.label for plan in plans for change in plan.changes))
    return LeftChanged(
        f"{labels} of node {node.node_id} could not be taken back",
        node=node.node_id,
        why=f"{cause}; then, while taking it back: {why}",
        hint=f"look at it with `pdo`; `nmt reset-node {node.node_id}` brings the stored settings back",
        state="left_changed",
    )
