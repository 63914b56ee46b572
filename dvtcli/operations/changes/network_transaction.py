"""The progress of a network plan, and its roll-back over all nodes, last phase first.

During the roll-back, too, no consumer receives a layout other than its own.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.change.combined_plan import combine_plans
from dvtcli.device.change.failed_change import (
    BUS_BACK,
    Guarded,
    also_lines,
    failure_sentence,
    merge_left,
    name_journal,
    name_left,
    not_rolled_back,
)
from dvtcli.device.change.roll_back import PATIENCE_S, RETRY_S, first_difference
from dvtcli.device.change.undo_plan import UndoRequest
from dvtcli.device.change.untouched_pdos import as_they_are, untouched_pdos
from dvtcli.device.observe import MAX_READS
from dvtcli.domain.hint import Action, Hint, as_hint
from dvtcli.domain.plan import Change, PdoChange, Plan, ValueChange
from dvtcli.domain.text import all_nodes, join_some, some_nodes
from dvtcli.errors import (
    BusUnavailable,
    DeviceRefused,
    DvtcliError,
    Interrupted,
    LeftChanged,
    NoAnswer,
    SdoAborted,
    SdoProtocolError,
)

if TYPE_CHECKING:
    from dvtcli.device.change.own_journal import OwnJournal
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.operations.session.session import Session


#: Possible answers of a node that is restarting, or is not.
_PASSING = (NoAnswer, SdoProtocolError, SdoAborted, DeviceRefused)


@dataclass(frozen=True, slots=True)
class NodeBefore:
    """A node's state in the session before the change: set values and unstored changes."""

    wanted: dict[Pdo, PdoConfig]
    values: dict[tuple[int, int], bytes]
    unstored: dict[str, int]
    boot_ups: int

    @classmethod
    def of(cls, node: Node, boot_ups: int) -> NodeBefore:
        """Take the state of *node* after *boot_ups* received boot-ups."""
        return cls(dict(node.wanted), dict(node.wanted_values), dict(node.pending.unstored), boot_ups)

    def restarted(self, boot_ups: int) -> bool:
        """Tell whether *boot_ups*, the count at the last read of the node, has grown."""
        return boot_ups != self.boot_ups

    def restore(self, node: Node, boot_ups: int) -> None:
        """Return the session to this state after *node* was rolled back; losses by a restart stay recorded."""
        node.wanted.clear()
        node.wanted.update(self.wanted)
        node.wanted_values.clear()
        node.wanted_values.update(self.values)
        if not self.restarted(boot_ups):
            node.pending.unstored.clear()
            node.pending.unstored.update(self.unstored)


def roll_back_part(node: Node, plan: Plan) -> None:
    """Roll back *plan* whatever the node holds; a node that is silent or refuses may be restarting."""
    deadline_s = node.bus.now_s() + PATIENCE_S
    while True:
        try:
            node.undo_plans(UndoRequest([plan], force=True, own=True, rolls_back=True, is_part_of_group=True))
        except _PASSING:
            if node.bus.now_s() >= deadline_s:
                raise
            node.bus.sleep(RETRY_S)
            with suppress(*_PASSING):
                node.gate.renew()  # where that fails too, the next try finds out
        else:
            return


def difference_from_before(node: ReadableNode, plan: Plan) -> str | None:
    """Return the first difference of *node* from the old values of *plan*, or their accepted substitutes."""

    def look() -> str | None:
        for change in plan.changes:
            found = first_difference(node.sdo, change, wanted_before=True)
            if found and not holds_substitute(node, change):
                return f"{change.label}: {found}"
        return None

    return node.observed(look)


def holds_substitute(node: ReadableNode, change: Change) -> bool:
    """Tell whether *node* holds the substitute that it takes instead of its old value."""
    if not isinstance(change, PdoChange) or change.substitute is None:
        return False
    if first_difference(node.sdo, change, wanted_before=True) is None:
        return False
    return first_difference(node.sdo, change._replace(after=change.substitute)) is None


def all_back(
    back: Sequence[int],
    unwritten: Sequence[int],
    restarted: Sequence[int],
    unknown: Sequence[int],
    look_at: int | None,
    unread: Sequence[str] = (),
) -> str:
    """Describe the nodes after a complete roll-back: those rolled *back* and verified, and those *unwritten*.

    The *restarted* nodes lost their other unstored values; for *unknown* nodes a restart could not be checked.
    *look_at* is a node of unknown NMT state. *unread* are sentences about values that cannot be read.
    """
    some = bool(unwritten or unread)
    who = all_nodes(back) if some else "every node"
    what = f"the changes are reverted on {who}" if restarted or some else "every node is unchanged"
    said = [f"{what}, read back equal"] if back or not some else []
    said += unread
    if unwritten:
        said.append(f"nothing was written to {all_nodes(unwritten)}")
    said.append("nothing was stored")
    if look_at is not None:
        said.append(f"check the NMT state of node {look_at}")
    if restarted:
        said.append(f"{some_nodes(restarted)} restarted: other unstored values are lost")
    if unknown:
        said.append(f"whether {all_nodes(unknown)} restarted is not known: the bus is gone")
    return "; ".join(said)


def other_nodes(back: Sequence[int], unwritten: Sequence[int]) -> list[tuple[str, str]]:
    """Make labelled lines about nodes not left changed: those rolled *back* and verified, and *unwritten* nodes."""
    rows = ((back, "as before, read back equal"), (unwritten, "nothing was written there"))
    return [("others", f"{all_nodes(numbers)}: {text}") for numbers, text in rows if numbers]


_Put = Callable[["Node"], None]
#: a node-ID and the change of an object that cannot be read
_WriteOnly = tuple[int, ValueChange]


@dataclass(slots=True)
class NetworkTransaction:
    """The plan *name* in progress: *done* parts on *nodes*, and their whole *plans*.

    After a fault the last part of *done* may not be on the node: its roll-back then writes nothing.
    """

    session: Session
    nodes: Mapping[int, Node]
    name: str
    #: boot-ups of each node before its first read
    boot_ups: Mapping[int, int]
    done: list[Plan] = field(default_factory=list)
    plans: dict[int, Plan] = field(default_factory=dict)
    #: unchanged values that each node must hold, each as a change to itself
    held: dict[int, Sequence[Change]] = field(default_factory=dict)
    #: the unwritten PDOs, as at the start of the roll-back or read before
    untouched: dict[int, Sequence[Change]] = field(default_factory=dict)
    #: whether it is a change by itself, and no line of an atomic script
    _alone: bool = field(init=False)
    _before: dict[int, NodeBefore] = field(init=False)
    #: write-only values that the nodes acknowledged: what they held is not known
    _acknowledged: list[_WriteOnly] = field(default_factory=list)
    #: write-only values that a node refused, and those for which an answer is missing
    _refused: list[_WriteOnly] = field(default_factory=list)
    _unsure: list[_WriteOnly] = field(default_factory=list)
    #: boot-ups of each rolled-back node at its last check; empty if unknown
    _looked: dict[int, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._alone = self.session.group.id is None
        if self._alone:
            self.session.group.begin(self.name)
        self._before = {node_id: NodeBefore.of(node, self.boot_ups[node_id]) for node_id, node in self.nodes.items()}

    def journals(self) -> list[OwnJournal]:
        """List the journals of the nodes that belong to this plan alone."""
        if not self._alone:
            return []
        return [node.guard.own_journal for node in self.nodes.values() if node.guard is not None]

    def claims_by_node(self) -> dict[int, tuple[Change, ...]]:
        """Map changed nodes to their claims: completed changes, and values held before that must stay."""
        parts = {node_id: [plan for plan in self.done if plan.node_id == node_id] for node_id in self.plans}
        return {
            node_id: (*combine_plans(node_id, some).changes, *self.held.get(node_id, ()))
            for node_id, some in parts.items()
        }

    def guarded(self, node_id: int) -> Plan:
        """Return what a fault rolls back on a node: its plan, and values that the plan may alter."""
        held = (*self.held.get(node_id, ()), *self.untouched.get(node_id, ()))
        return Plan(node_id, (*self.plans[node_id].changes, *held))

    def __enter__(self) -> NetworkTransaction:
        return self

    def __exit__(self, *_fault: object) -> None:
        """End the transaction: each change counts for itself again."""
        for node in self.nodes.values():
            if node.guard is not None:
                node.guard.own_journal.also_cover(None)
        if self._alone:
            self.session.group.end()

    @contextmanager
    def doing(self, part: Plan) -> Iterator[None]:
        """Carry out *part* inside; a failure before its first write leaves it out of *done*."""
        self.done.append(part)
        try:
            yield
        except BaseException as fault:
            if isinstance(fault, DvtcliError) and fault.state == "unchanged":
                self.done = [plan for plan in self.done if plan is not part]
            else:
                self._note_write_only(part, fault)
            raise
        self._acknowledged += _write_only(part)

    def _note_write_only(self, part: Plan, fault: BaseException) -> None:
        """Note what is known of the write-only values of *part* after *fault*; those not begun are not noted."""
        place = fault.place if isinstance(fault, DvtcliError) else None
        of_fault = [(node_id, change) for node_id, change in _write_only(part) if change.step.object == place]
        if isinstance(fault, LeftChanged):
            self._acknowledged += _write_only(part)
        elif isinstance(fault, DvtcliError) and fault.state == "rolled_back":
            self._refused += of_fault
        else:
            self._unsure += of_fault or _write_only(part)

    def roll_back(self, faults: Sequence[BaseException]) -> None:
        """Roll back all done parts and verify each.

        Raises the first of *faults* with the state of the nodes, or LeftChanged if a roll-back failed.
        """
        fault = faults[0]
        failures = {
            changed.node: changed for changed in faults if isinstance(changed, LeftChanged) and changed.node is not None
        }
        if isinstance(fault, DvtcliError):
            fault.details += also_lines(
                fault, (exception for exception in faults[1:] if not isinstance(exception, Interrupted | LeftChanged))
            )
        with self.session.cancellation.rolling_back(), self.session.agreed():
            for node_id in dict.fromkeys(part.node_id for part in self.done if part.node_id not in failures):
                with suppress(NoAnswer, SdoAborted, SdoProtocolError, BusUnavailable):  # its first write says why
                    self._read_untouched(node_id)
            for part in reversed(self.done):
                if part.node_id not in failures:
                    self._try(part.node_id, failures, fault, lambda node, part=part: roll_back_part(node, part))  # type: ignore[misc]
            self._settle_all(failures, fault)
        for journal in self.journals():
            journal.abandon_group()
        if failures:
            left = self._all_left(failures)
            if left is not fault:
                raise left from fault
        elif isinstance(fault, DvtcliError) and fault.state != "left_changed" and self.done:
            self._report_all_rolled_back(fault)

    def _read_untouched(self, node_id: int) -> None:
        """Read the unwritten PDOs before the roll-back's first write."""
        node, guarded = self.nodes[node_id], self.guarded(node_id)
        node.read_anew()
        present = untouched_pdos(node, guarded)
        others = {pdo: config for pdo, config in node.known_pdos().items() if pdo in present}
        self.untouched[node_id] = (*self.untouched.get(node_id, ()), *as_they_are(others))

    def _report_all_rolled_back(self, fault: DvtcliError) -> None:
        back, unwritten = self._others(())
        unread = [f"{names} was refused, but its value cannot be read" for names in _of_nodes(self._refused)]
        unread += self._unsure_texts()
        restarted = [
            looked_id for looked_id, boot_ups in self._looked.items() if self._before[looked_id].restarted(boot_ups)
        ]
        unknown = [node for node in self.nodes if node not in self._looked]
        look_at = fault.node if fault.state == "unknown" else None
        text = all_back(back, unwritten, restarted, unknown, look_at, unread)
        fault.state = "unknown" if self._unsure else "rolled_back"
        fault.state_text = f"{'unknown' if self._unsure else 'rolled back'}: {text}"

    def _unsure_texts(self) -> list[str]:
        return [f"{names} cannot be read: it may have been written" for names in _of_nodes(self._unsure)]

    def _others(self, failures: Collection[int]) -> tuple[list[int], list[int]]:
        """Return all nodes but the *failures*: those rolled back and verified, and those never written.

        A node of which only write-only values were written is in neither.
        """
        written = {part.node_id for part in self.done}
        read = {part.node_id for part in self.done if len(part.unreadable) < len(part.changes)}
        others = [node_id for node_id in self.nodes if node_id not in failures]
        return [other for other in others if other in read], [other for other in others if other not in written]

    def _all_left(self, failures: Mapping[int, LeftChanged]) -> LeftChanged:
        """Return the first of *failures* with the state of the other nodes."""
        first, *others = failures.values()
        for node_id, failure in failures.items():
            node = self.nodes[node_id]
            written = {change.label for of_id, change in self._acknowledged if of_id == node_id}
            changes = [
                change
                for change in combine_plans(node_id, [self.guarded(node_id)]).changes
                if isinstance(change, PdoChange) or change.is_readable or change.label in written
            ]
            name_left(failure, [Guarded(node_id, node.sdo, node.reboot_monitor, changes)])
            failure.text = failure_sentence(failure, node_id, "rolled back") or failure.text
        merge_left(first, others)
        first.details += [("also", text) for text in (*(failure.text for failure in others), *self._unsure_texts())]
        first.details += other_nodes(*self._others(failures))
        return first

    def _try(self, node_id: int, failures: dict[int, LeftChanged], fault: BaseException, put: _Put) -> None:
        node = self.nodes[node_id]
        try:
            put(node)
        except (DvtcliError, KeyboardInterrupt) as failed:
            failures[node_id] = self._left(node_id, fault, failed)

    def _settle_all(self, failures: dict[int, LeftChanged], fault: BaseException) -> None:
        """Verify all nodes until two passes in a row find them as before, then clear the roll-back.

        Two passes, as the first nodes may restart unnoticed while the last are rolled back.
        """
        taken = list(dict.fromkeys(part.node_id for part in self.done))
        unsettled, clean = list[int](), 0
        for _ in range(MAX_READS + 1):
            unsettled = self._look_at(taken, failures, fault)
            clean = 0 if unsettled else clean + 1
            if clean == 2:
                break
        for node_id in taken:
            if node_id in failures:
                continue
            if node_id in unsettled:
                restarts = DeviceRefused(f"it restarted during each of {MAX_READS} reads")
                failures[node_id] = self._left(node_id, fault, restarts)
            elif written := [one for one in self._acknowledged if one[0] == node_id]:
                failures[node_id] = self._left_written(node_id, fault, written)
            else:
                self._try(node_id, failures, fault, self._forget)
        for node_id in self.nodes.keys() - taken:
            if self._alone and node_id not in failures:
                self._try(node_id, failures, fault, _end_journal)  # nothing was written to it
            with suppress(BusUnavailable):  # who is not asked for is said to be unknown
                self._looked[node_id] = self.nodes[node_id].bus.boot_ups(node_id)

    def _look_at(self, taken: Sequence[int], failures: dict[int, LeftChanged], fault: BaseException) -> list[int]:
        """Verify each of *taken* but the *failures*, and roll back differences.

        Returns the nodes that were rolled back again or restarted.
        """
        rewritten: list[int] = []
        seen = self._boot_ups_of(taken, failures, fault)
        for node_id in taken:
            if node_id not in failures:
                self._try(node_id, failures, fault, lambda node: self._settle(node, rewritten))
        now = self._looked = self._boot_ups_of(taken, failures, fault)
        return [
            taken_id
            for taken_id in taken
            if taken_id not in failures and (now[taken_id] != seen[taken_id] or taken_id in rewritten)
        ]

    def _boot_ups_of(
        self, taken: Sequence[int], failures: dict[int, LeftChanged], fault: BaseException
    ) -> dict[int, int]:
        """Count received boot-ups of *taken* except the *failures*; a dead bus adds the rest to them."""
        found: dict[int, int] = {}

        def look(node: ReadableNode) -> None:
            found[node.node_id] = node.bus.boot_ups(node.node_id)

        for node_id in taken:
            if node_id not in failures:
                self._try(node_id, failures, fault, look)
        return found

    def _settle(self, node: Node, rewritten: list[int]) -> None:
        """Roll *node* back again if it differs from before; *rewritten* gets its node-ID.

        The whole plan is compared: a restart also returns parts not begun to their stored values.
        """
        plan = self.guarded(node.node_id)
        if difference_from_before(node, plan):
            rewritten.append(node.node_id)
            roll_back_part(node, plan)
            if difference := difference_from_before(node, plan):
                raise DeviceRefused("it does not read back with its old values", why=difference)
        untaken = [change.label for change in plan.changes if holds_substitute(node, change)]
        if untaken:
            raise DeviceRefused(f"the device refuses the old values of {join_some(untaken)}")

    def _forget(self, node: Node) -> None:
        """Drop the recovery data of *node* after all nodes are as before."""
        self._before[node.node_id].restore(node, self._looked[node.node_id])
        if self._alone:
            _end_journal(node)

    def _left(self, node_id: int, fault: BaseException, failed: BaseException) -> LeftChanged:
        """Describe what stays changed on the node; `recover` uses its journal, if any."""
        why = failed.why or failed.text if isinstance(failed, LeftChanged) else str(failed) or "interrupted"
        left = not_rolled_back([self.plans[node_id]], node_id, str(fault) or "interrupted", why)
        guard = self.nodes[node_id].guard
        path = guard.unfinished_journal() if guard is not None else None
        name_journal(left, path, BUS_BACK if isinstance(failed, BusUnavailable) else None)
        return left

    def _left_written(self, node_id: int, fault: BaseException, written: Sequence[_WriteOnly]) -> LeftChanged:
        """Describe acknowledged write-only values of the node; all else was rolled back and read back equal."""
        names = join_some(dict.fromkeys(change.label for _, change in written))
        left = self._left(node_id, fault, DeviceRefused(f"{names} was acknowledged, but its old value cannot be read"))
        by_hand = "set it by hand: its old value is unknown"
        ends = None if left.place is None else Hint(Action.RECOVER, why="{} ends the change then")
        left.hint = as_hint(by_hand) if ends is None else ends.after(as_hint(by_hand))
        return left


def _write_only(part: Plan) -> list[_WriteOnly]:
    return [(part.node_id, change) for change in part.unreadable]


def _of_nodes(values: Iterable[_WriteOnly]) -> Iterator[str]:
    """The labels of *values* by node, as `2050:00 of node 5`."""
    labels: dict[int, dict[str, None]] = {}
    for node_id, change in values:
        labels.setdefault(node_id, {})[change.label] = None
    return (f"{join_some(labels[node_id])} of node {node_id}" for node_id in sorted(labels))


def _end_journal(node: Node) -> None:
    if node.guard is not None:
        node.guard.own_journal.end_group()
