"""Recover from an interrupted change: restore the former values from its journal.

`recover_together` recovers several nodes in phases. Other writers may have changed the device meanwhile.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.change.expected_refusals import substitute_findings
from dvtcli.device.change.failed_change import Guarded, failure_sentence, name_left
from dvtcli.device.change.roll_back import roll_back_patiently, unreadable_now
from dvtcli.device.change.undo_plan import undo_plan_of
from dvtcli.device.change.untouched_pdos import altered_of, as_they_are, changes_a_pdo, others_left, untouched_pdos
from dvtcli.device.observe import MAX_READS, RestartCounter
from dvtcli.device.stamped import NO_STAMP, held_stamp, is_stamp, stamp_back
from dvtcli.device.store.pending import CHANGE
from dvtcli.device.target_config import differences
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.network.network_plan import phases
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.objects import VERIFY_CONFIGURATION
from dvtcli.domain.plan import PdoChange, Plan, Step, ValueChange, plan_pdo
from dvtcli.domain.rules.no_way_back import restarted_finding
from dvtcli.domain.script_line import value_line, whole_line
from dvtcli.domain.store import DATE, TIME
from dvtcli.domain.text import join_some, value_text
from dvtcli.errors import (
    BusUnavailable,
    DeviceRefused,
    DvtcliError,
    LeftChanged,
    NoAnswer,
    SafetyRefusal,
    SdoAborted,
    SdoProtocolError,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from dvtcli.device.change.changeable import Changeable
    from dvtcli.device.change.journal import Journal
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.known_pdos import KnownPdos
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.plan import Change
    from dvtcli.domain.rules.finding import Finding

#: What a node that cannot be reached comes to, and not one that refuses.
_SILENT = (NoAnswer, SdoProtocolError, BusUnavailable, KeyboardInterrupt)


@dataclass(slots=True)
class Recovery:
    """The recovery of *node* from an interrupted change, to the former values in *journal*.

    *plan* is the intended roll-back from the initial state, *with_substitutes* the same with values
    that the device accepts instead.
    """

    node: Changeable
    journal: Journal
    plan: Plan
    with_substitutes: Plan
    #: the changes to roll back, newest last, without our stamp, which is removed
    changes: tuple[Change, ...]
    #: the PDOs outside the journal before the roll-back, and the boot-ups at that time
    others: tuple[PdoChange, ...]
    boot_ups_read: int
    #: the changes restored to a substitute value, and the boot-ups before the roll-back
    _substituted: tuple[PdoChange, ...] = ()
    _boot_ups: int = 0
    #: single objects that can be read no more, once all else was rolled back, with the refusal
    unknown: dict[ValueChange, SdoAborted] = field(default_factory=dict)

    @classmethod
    def begin(cls, node: Changeable, journal: Journal) -> Recovery:
        """Lock and read the node. Raises SafetyRefusal if *journal* was made on another device."""
        refuse_other_device(node, journal)
        if node.guard is not None:
            node.guard.lock.take()
        node.read_anew()
        boot_ups = node.bus.boot_ups(node.node_id)
        plan = undo_plan_of(node, [journal.plan], patient=True)
        with_substitutes = undo_plan_of(node, [journal.plan], with_substitutes=True, patient=True)
        present = untouched_pdos(node, journal.plan) if changes_a_pdo(journal.plan) else []
        others = as_they_are(_readable(node, present))
        return cls(node, journal, plan, with_substitutes, _without_stamp(node, journal.plan, plan), others, boot_ups)

    def ahead(self) -> Iterator[Plan]:
        """The parts to write before `roll_back` if several nodes recover together, a part per phase except the last.

        If a refusal is expected, only PDOs are disabled: `roll_back` finds an accepted value.
        """
        changes = self.journal.plan.changes
        foreseen = any(isinstance(change, PdoChange) and change.substitute is not None for change in changes)
        for number, phase in enumerate(phases([self.plan])[:-1]):
            left_out = foreseen and number > 1
            yield next((part for part in phase if not left_out), Plan(self.node.node_id, ()))

    def go_ahead(self, part: Plan) -> None:
        """Bring the node to the end of *part*, leaving refused steps to `roll_back`.

        Raises LeftChanged if the node does not answer.
        """
        if not part.changes:
            return
        with suppress(SdoAborted, DeviceRefused):
            self._restore(tuple(change.reversed() for change in part.changes), given_up=_SILENT)

    def roll_back(self) -> None:
        """Roll back and verify everything. Raises LeftChanged, which keeps the journal.

        Other PDOs altered by the device as a side effect are rolled back as well, unless the node restarted since the
        read. Objects no longer readable keep no journal: *unknown* lists them.
        """
        node = self.node
        self._boot_ups, self.unknown = node.bus.boot_ups(node.node_id), {}
        self._substituted = self._restore_readable(self.changes)
        if altered := self._altered():
            self._substituted = self._restore_readable((*self.changes, *altered))
            if still := self._altered():
                raise others_left(self.plan, still)

    def _restore_readable(self, changes: Sequence[Change]) -> tuple[PdoChange, ...]:
        """As `_restore` for all readable objects; the others are written blind, if writable."""
        given_up = (DvtcliError, KeyboardInterrupt)
        try:
            return self._restore([change for change in changes if change not in self.unknown], given_up=given_up)
        except LeftChanged as left:
            if isinstance(left.__cause__, _SILENT):
                raise
            found = unreadable_now(self.node.sdo, (change for change in changes if change not in self.unknown))
            if not found:
                raise
            self.unknown |= found
            readable = [change for change in changes if change not in self.unknown]
            return self._restore(readable, given_up=given_up) if readable else ()

    def _altered(self) -> dict[PdoChange, str]:
        """Other PDOs that differ from before, each with the difference; empty if the node restarted since."""
        node = self.node
        try:
            altered = node.observed(lambda: altered_of(node.sdo, self.others))
        except (DvtcliError, KeyboardInterrupt) as fault:
            raise self._left(fault) from fault
        return altered if node.bus.boot_ups(node.node_id) == self.boot_ups_read else {}

    def restart_findings(self) -> tuple[Finding, ...]:
        """A warning if the node restarted since the read: values not restored here are lost."""
        node_id = self.node.node_id
        if self.node.bus.boot_ups(node_id) == self.boot_ups_read:
            return ()
        return (restarted_finding(node_id),)

    def left_unknown(self) -> LeftChanged | None:
        """The error for objects no longer readable after the recovery, or None."""
        if not self.unknown:
            return None
        node_id, labels = self.node.node_id, join_some(change.label for change in self.unknown)
        left = LeftChanged(
            f"the present value of {labels} of node {node_id} is unknown: it can no longer be read",
            node=node_id,
            why="; ".join(dict.fromkeys(str(refused) for refused in self.unknown.values())),
            hint=Hint(Action.RESET_NODE, {"node": node_id}, "restores its stored values")
            + "or set it by hand when the device accepts it; there is nothing left to recover",
            state="left_changed",
        )
        others = [change.label for change in self.changes if change not in self.unknown]
        back = f"; {join_some(others)} is as it was, read back equal" if others else ""
        left.state_text = f"the present value of {labels} of node {node_id} is unknown{back}"
        before = {change.label: change.step.before for change in self.unknown if change.step.before is not None}
        left.details += [("held before", f"{label} {value_text(data)}") for label, data in before.items()]
        return left

    def start(self) -> None:
        """Start a node found OPERATIONAL; roll back again if the node restarted since verification.

        A restart, even one caused by the start command, clears values held in RAM only.
        """
        node = self.node
        for look in range(MAX_READS):
            if look:
                self.roll_back()
            if self.journal.nmt_state == NmtState.OPERATIONAL and node.access.state() is NmtState.PRE_OPERATIONAL:
                node.access.insist(NmtState.OPERATIONAL)
            if node.bus.boot_ups(node.node_id) == self._boot_ups:
                node.pending.boot_ups = self._boot_ups
                return
        raise LeftChanged(
            f"node {node.node_id} restarted during each of {MAX_READS} roll-backs",
            node=node.node_id,
            place=str(self.journal.path),
            hint=Hint(
                Action.RECOVER,
                why=f"check its supply and its wiring; {{}} tries again with the journal {verbatim(self.journal.path)}",
            ),
            state="left_changed",
        )

    def end(self, *, stored: bool = False) -> tuple[Plan, tuple[Finding, ...]]:
        """Remove the journal; return the intended changes and warnings about values the device did not take back.

        *stored*: a store has saved the replaced values, or may have; the present values are not stored then.
        """
        if self.node.guard is not None:
            self.node.guard.delete_journal(self.journal, self._held_now() if stored else None)
        self.node.pending.suspicions.pop(CHANGE, None)
        return self.with_substitutes if self._substituted else self.plan, substitute_findings(self._substituted)

    def _held_now(self) -> Plan:
        """The plan from the values of the interrupted change to the accepted roll-back."""
        taken = {change.pdo: change.substitute for change in self._substituted}
        changes: list[Change] = []
        for change in self.changes:
            if isinstance(change, PdoChange):
                changes.append(plan_pdo(change.pdo, change.after, taken.get(change.pdo) or change.before))
            elif change.step.before is not None:
                changes.append(change.reversed())
        return Plan(self.node.node_id, tuple(changes))

    def _restore(
        self, changes: Sequence[Change], *, given_up: tuple[type[BaseException], ...]
    ) -> tuple[PdoChange, ...]:
        """Restore the former values of *changes*. Raises LeftChanged on an error listed in *given_up*."""
        node = self.node
        node.open_gate()
        try:
            with node.cancellation.deferred():
                node.gate.renew()  # an earlier try may have started the node
                reboot_monitor = RestartCounter(node.bus, node.node_id)
                return roll_back_patiently(node.sdo, changes, node.bus, node.gate.renew, reboot_monitor)
        except given_up as fault:
            raise self._left(fault) from fault
        finally:
            node.forget()

    def _left(self, fault: BaseException) -> LeftChanged:
        node, labels = self.node, join_some(self.journal.labels)
        left = LeftChanged(
            f"{labels} of node {node.node_id} could not be rolled back",
            node=node.node_id,
            place=str(self.journal.path),
            why=_reason(fault),
            hint=_next_step(node, fault, self.journal),
            state="left_changed",
        )
        guarded = Guarded(node.node_id, node.sdo, node.reboot_monitor, self.changes)
        name_left(left, [guarded], stopped=isinstance(fault, KeyboardInterrupt))
        left.text = failure_sentence(left, node.node_id, "rolled back") or left.text
        return left


def _readable(node: ReadableNode, pdos: Iterable[Pdo]) -> dict[Pdo, PdoConfig]:
    """The readable configurations among *pdos* of *node*; unreadable PDOs delay nothing else."""
    found: dict[Pdo, PdoConfig] = {}
    for pdo in pdos:
        with suppress(SdoAborted):
            found[pdo] = node.known_pdo(pdo)
    return found


def _without_stamp(node: KnownPdos, interrupted: Plan, back: Plan) -> tuple[Change, ...]:
    """The changes of *interrupted* covered by *back*, preceded by the removal of our stamp instead of the stamp.

    The removal is needed even without a stamp: a restart may bring back a stamp for stored values.
    """
    stamps = {step.sub_index: step for step in (change.step for change in filter(is_stamp, interrupted.changes))}
    before = {sub_index: step.before for sub_index, step in stamps.items() if step.before is not None}
    held = held_stamp(node)
    if held is None or (stamp_back(node, back.changes, before) is None and (stamps or held != NO_STAMP)):
        return interrupted.changes
    others = tuple(change for change in interrupted.changes if not is_stamp(change))
    if held.is_own and not any(map(is_stamp, back.changes)):
        return others  # nothing covered by the stamp changes
    ends = (
        Step(VERIFY_CONFIGURATION, sub_index, bytes(4), held.data(sub_index), "a stamp is not rolled back")
        for sub_index in (DATE, TIME)
    )
    return (*others, *map(ValueChange, ends))


def recover_together(recoveries: Sequence[Recovery]) -> dict[int, DvtcliError]:
    """Recover several nodes from interrupted changes, phase by phase; failures by node-ID.

    Producers are disabled first, consumers second; everything is written; consumers are enabled, producers last. So no
    RPDO receives frames with a wrong layout. A failed node is left alone, the others continue. Nodes are started after
    all are verified.
    """
    failed: dict[int, DvtcliError] = {}
    if len(recoveries) > 1:
        for phase in zip(*(recovery.ahead() for recovery in recoveries), strict=True):
            parts = {part.node_id: part for part in phase}
            _each(recoveries, failed, lambda recovery, parts=parts: recovery.go_ahead(parts[recovery.node.node_id]))  # type: ignore[misc]
    _each(recoveries, failed, Recovery.roll_back)
    _each(recoveries, failed, Recovery.start)
    return failed


def _each(recoveries: Iterable[Recovery], failed: dict[int, DvtcliError], work: Callable[[Recovery], None]) -> None:
    """Do *work* for each recovery not in *failed*; new failures are added."""
    for recovery in recoveries:
        if recovery.node.node_id not in failed:
            try:
                work(recovery)
            except DvtcliError as error:
                failed[recovery.node.node_id] = error


def _reason(fault: BaseException) -> str:
    """The cause, with the device's reason if known."""
    why = fault.why if isinstance(fault, DvtcliError) else None
    return ": ".join(text for text in (str(fault), why) if text) or "interrupted"


def _next_step(node: NodeDescription, fault: BaseException, journal: Journal) -> Hint:
    again = Hint(Action.RECOVER, why=f"tries again, with the journal {verbatim(journal.path)}")
    if isinstance(fault, SdoAborted | DeviceRefused):  # the same again would be refused, or corrected, again
        return (
            Hint(Action.RESET_NODE, {"node": node.node_id}, "restores its stored values")
            + Hint(Action.RECOVER, why=", then {} checks that")
            + Hint(Action.RECOVER, {"accept": True}, "or {} accepts the present values as the new state")
            + again
        )
    return again


def refuse_other_device(node: ReadableNode, journal: Journal) -> None:
    """Raise SafetyRefusal if *journal* was made on another device than *node*."""
    if journal.plan.node_id != node.node_id or journal.identity != node.identity():
        raise SafetyRefusal(
            f"the journal was made on another device than node {node.node_id}",
            node=node.node_id,
            place=str(journal.path),
            why=f"it names {_text(journal.identity)}; this one is {_text(node.identity())}",
            hint=Hint(
                Action.RECOVER,
                {"discard": True},
                "attach that device; if it is gone for good, {} sets the journal aside",
            ),
        )


@dataclass(frozen=True, slots=True)
class AcceptedState:
    """The present and the former values of an interrupted change as script lines, and the differences.

    Unreadable values are not *is_known* and count as equal.
    """

    label: str
    held: str
    before: str
    differences: tuple[str, ...]
    is_known: bool = True

    def document(self) -> dict[str, object]:
        """The state as JSON."""
        what = {"object": self.label} if ":" in self.label else {"pdo": self.label.lower()}
        return {
            **what,
            "held": self.held,
            "before": self.before,
            "differs_from_before": list(self.differences),
            "known": self.is_known,
        }


def accepted_states(node: ReadableNode, journal: Journal) -> list[AcceptedState]:
    """The present values of everything in the interrupted change, as far as *node* can be read."""
    states = []
    for change in journal.plan.changes:
        if isinstance(change, PdoChange):
            before = whole_line(change.pdo, change.before)
            try:
                held = node.pdo(change.pdo)
            except SdoAborted as refused:
                states.append(AcceptedState(change.label, _unknown(change.label, refused), before, (), is_known=False))
                continue
            now = whole_line(change.pdo, held)
            unlike_before = tuple(differences(change.pdo, change.before, held))
            states.append(AcceptedState(change.label, now, before, unlike_before))
        else:
            states.append(_accepted_value(node, change.step))
    return states


def _accepted_value(node: ReadableNode, step: Step) -> AcceptedState:
    if step.before is None:
        return AcceptedState(
            step.object, f"# {step.object} is write-only", f"# {step.object} was not known", (), is_known=False
        )
    before = value_line(step, step.before)
    try:
        held = node.upload(step.index, step.sub_index)
    except SdoAborted as refused:
        return AcceptedState(step.object, _unknown(step.object, refused), before, (), is_known=False)
    found = () if held == step.before else (f"is {value_text(held)}, was {value_text(step.before)}",)
    return AcceptedState(step.object, value_line(step, held), before, found)


def _unknown(label: str, refused: SdoAborted) -> str:
    """A script comment for a value that the device does not return."""
    return f"# {label} is unknown: it cannot be read now ({refused})"


def _text(identity: Identity) -> str:
    return " ".join(f"{name} 0x{value:X}" for name, value in identity.items() if value is not None) or "no identity"
