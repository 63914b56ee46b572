"""Run a plan to its end, or roll the device back. No other module writes a plan to a device."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import KW_ONLY, dataclass, field

from dvtcli.device.cancellation import Cancellation
from dvtcli.device.change.failed_change import (
    Guarded,
    failure_sentence,
    left_changed,
    name_left,
    refused,
    step_line,
    unreadable_left,
)
from dvtcli.device.change.outcome_text import RolledBack, readback_error, report_rolled_back, restarted_meanwhile
from dvtcli.device.change.roll_back import (
    Clock,
    bytes_differ,
    cob_id_difference,
    differing_values,
    first_difference,
    roll_back_patiently,
)
from dvtcli.device.change.untouched_pdos import UntouchedPdos, altered_too
from dvtcli.device.observe import MAX_READS, RebootMonitor, observed, restarted_since_read
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, ValueChange, only_cob_id, writes_cob_id
from dvtcli.domain.ports import SdoTransport
from dvtcli.errors import (
    BusUnavailable,
    DeviceRefused,
    DvtcliError,
    LeftChanged,
    NoAnswer,
    SdoAborted,
    SdoProtocolError,
)

#: how many bytes make a download long: half a second of segments at 125 kbit/s
_LONG_BYTES = 1000


@dataclass(slots=True, eq=False, repr=False)
class AcknowledgedSteps:
    """The last acknowledged value of each readable object."""

    _values: dict[tuple[int, int], bytes] = field(default_factory=dict)
    #: unreadable objects
    _unreadable: set[tuple[int, int]] = field(default_factory=set)

    def took(self, step: Step, change: Change) -> None:
        """Record that the device acknowledged *step* of *change*."""
        place = step.index, step.sub_index
        if isinstance(change, PdoChange) or change.is_readable:
            self._values[place] = step.after
        else:
            self._unreadable.add(place)

    def was_taken(self, change: ValueChange) -> bool:
        """True if the device acknowledged *change* to an object without read access."""
        return (change.step.index, change.step.sub_index) in self._unreadable

    def still_held(self, sdo: SdoTransport) -> bool:
        """True if every value reads back equal; false without any value or answer."""
        try:
            return bool(self._values) and all(self._is_held(sdo, *place) for place in self._values)
        except DvtcliError:
            return False

    def _is_held(self, sdo: SdoTransport, index: int, sub_index: int) -> bool:
        try:
            return sdo.upload(index, sub_index) == self._values[index, sub_index]
        except SdoAborted:  # an entry behind the count: it tells nothing
            return True


@dataclass(slots=True, eq=False, repr=False)
class Transaction:
    """One run of *plan* on a device."""

    sdo: SdoTransport
    plan: Plan
    _: KW_ONLY
    #: checked between two SDO downloads
    cancellation: Cancellation
    #: waits between two tries of a roll-back
    clock: Clock
    #: counts restarts: values read before and after a restart prove nothing
    reboot_monitor: RebootMonitor
    #: adds the device's reason to an abort
    explain: Callable[[SdoAborted], None]
    #: called after every acknowledged step
    on_step: Callable[[Step], None]
    #: makes the device writable again for another roll-back, since the fault may have been a reboot
    before_retry: Callable[[], None]
    #: called with everything to roll back, before further altered PDOs are rolled back
    on_altered: Callable[[Sequence[Change]], None]
    #: untouched PDOs; a plan that alters the COB-ID of one has failed
    others: UntouchedPdos
    #: objects that may read back neither the written nor the former value: the device took the command
    control_words: Collection[tuple[int, int]]
    #: boot-ups at the read behind the plan; None: a restart does not stop the plan
    boot_ups_read: int | None
    #: control words read back differently, with their present value
    differing_control_words: dict[str, bytes] = field(default_factory=dict, init=False)
    #: boot-ups seen when the read-back that proved the plan began
    boot_ups_verified: int = field(default=0, init=False)
    #: changes begun, the last one possibly in part
    _started: list[Change] = field(default_factory=list, init=False)
    _acknowledged: AcknowledgedSteps = field(default_factory=AcknowledgedSteps, init=False)
    #: whether a download may have reached the device
    _touched: bool = field(default=False, init=False)
    #: altered untouched PDOs not rolled back, in words
    _left: dict[Pdo, str] = field(default_factory=dict, init=False)
    #: a refused object that is unreadable since
    _unsure: ValueChange | None = field(default=None, init=False)
    #: boot-ups seen when the plan began
    _boot_ups: int = field(default=0, init=False)
    #: boot-ups seen when the roll-back began; None: the other PDOs could not be read then
    _boot_ups_back: int | None = field(default=None, init=False)

    def run(self) -> None:
        """Write every step and read everything back; on any fault roll back and report.

        Raises DeviceRefused, NoAnswer and similar errors with state `rolled_back`; LeftChanged if the roll-back failed
        too; Interrupted after *cancellation*.
        """
        total, done = len(self.plan), 0
        with self.cancellation.deferred():
            self._boot_ups = self.reboot_monitor.boot_ups()
            try:
                for change, step in self.plan.steps_in_order():
                    self._started.append(change)
                    self._stop_if_cancelled(done, total)
                    self._stop_if_restarted()
                    done += 1
                    self._download(step, change, done, total)
                self._stop_if_cancelled(done, total)
                observed(self.reboot_monitor, self._verify)
                self._stop_if_cancelled(done, total)  # the last chance to stop: a complete change stays
            except BaseException as fault:  # a bug of ours must not leave the device half configured either
                self._roll_back(fault)
                if isinstance(fault, KeyboardInterrupt) and self._touched:
                    # the user insisted on an immediate stop; the roll-back ran all the same
                    text = f"stopped at once, in step {done} of {total}"
                    raise self.cancellation.interrupted(text, node=self.plan.node_id, state="rolled_back") from fault
                raise

    def _stop_if_restarted(self) -> None:
        """Stop between two downloads if the device restarted: the rest was planned from earlier values."""
        if self.boot_ups_read in (None, self.reboot_monitor.boot_ups()):
            return
        if not self._touched:
            raise restarted_since_read(self.plan.node_id)
        raise restarted_meanwhile(self.plan)

    def _stop_if_cancelled(self, done: int, total: int) -> None:
        if self.cancellation.requested:
            raise self.cancellation.interrupted(f"stopped after step {done} of {total}", node=self.plan.node_id)

    def _download(self, step: Step, change: Change, number: int, total: int) -> None:
        touched, self._touched = self._touched, True
        try:
            with self._stoppable(step):
                self.sdo.download(step.index, step.sub_index, step.after)
        except SdoAborted as aborted:
            self.explain(aborted)
            raise refused(aborted, step, self.plan.node_id, f"step {number} of {total} of {change.label}") from aborted
        except DvtcliError as fault:
            self._touched = touched or fault.state != "unchanged"
            fault.details.insert(0, ("step", step_line(step)))
            raise
        self._acknowledged.took(step, change)
        self.on_step(step)

    def _stoppable(self, step: Step) -> AbstractContextManager[None]:
        """Allow a stop inside a long download; a device ignores an incomplete transfer.

        If it did not, the roll-back restores the old value.
        """
        return self.cancellation.released() if len(step.after) >= _LONG_BYTES else nullcontext()

    def _verify(self) -> None:
        """Read back the plan's values; a difference is a refusal without an abort."""
        self.boot_ups_verified = self.reboot_monitor.boot_ups()
        self.differing_control_words.clear()
        for change in self.plan.changes:
            if isinstance(change, ValueChange):
                if values := differing_values(self.sdo, change):
                    place = change.step.index, change.step.sub_index
                    if place in self.control_words and values[0] != change.step.before and not self._restarted():
                        self.differing_control_words[change.label] = values[0]
                        continue
                    raise self._readback_error(change, bytes_differ(change, *values), values)
            elif difference := self._difference(change):
                raise self._readback_error(change, difference)
        if self._others_matter() and self._restarted():
            raise restarted_meanwhile(
                self.plan, why="its other PDOs may have changed since then by this change or by a restart"
            )
        altered = self._altered()
        if altered:
            raise altered_too(self.plan, altered)

    def _readback_error(
        self, change: Change, difference: str, read_back: tuple[bytes, bytes] | None = None
    ) -> DeviceRefused:
        return readback_error(self.plan.node_id, change, difference, read_back, restarted=self._restarted())

    def _difference(self, change: PdoChange) -> str | None:
        """The difference from *change*; reads only the COB-ID if nothing else was written and more steps follow."""
        if change.pdo in self.plan.looked_at and only_cob_id(change):
            return cob_id_difference(self.sdo, change)
        return first_difference(self.sdo, change)

    def _others_matter(self) -> bool:
        return bool(self.others.cob_ids) and writes_cob_id(self.plan)

    def _altered(self) -> dict[Pdo, str]:
        """Untouched PDOs with an altered COB-ID, in words; empty after a restart meanwhile."""
        return {} if not self._others_matter() or self._restarted() else self.others.altered(self.sdo)

    def _altered_by_roll_back(self) -> dict[Pdo, str]:
        """Untouched PDOs that differ after the roll-back, in words; empty after a restart meanwhile."""
        if self.reboot_monitor.boot_ups() != self._boot_ups_back:
            return self._altered()
        return {**self.others.altered_configs(self.sdo), **self._altered()}

    def _restarted(self) -> bool:
        return self.reboot_monitor.boot_ups() != self._boot_ups

    def _roll_back(self, fault: BaseException) -> None:
        if not self._touched:
            return
        try:
            substitutes = self._roll_back_changes()
        except (Exception, KeyboardInterrupt) as second:  # noqa: BLE001 - whatever it is, the device is left changed
            substitutes = self._roll_back_all_but_refused(fault, second)
        if isinstance(fault, DvtcliError):
            unreadable = Plan(self.plan.node_id, tuple(self._started)).unreadable
            self._raise_if_taken(unreadable, fault)
            unknown = unreadable if self._unsure is None else (*unreadable, self._unsure)
            report_rolled_back(
                fault,
                RolledBack(
                    self.plan, self._started, self.others, unknown,
                    is_unsure=self._unsure is not None, restarted=self._restarted(), left=self._left,
                    substitutes=substitutes,
                ),
            )  # fmt: skip

    def _roll_back_all_but_refused(self, fault: BaseException, second: BaseException) -> tuple[PdoChange, ...]:
        """After a roll-back failed with *second*, roll back all but an object that was refused and is unreadable.

        Example: a partly sent domain. Raises LeftChanged if the cause is another, or this fails as well.
        """
        last = self._started[-1] if self._started else None
        place = second.place if isinstance(second, SdoAborted) else None
        is_refusal = isinstance(fault, DeviceRefused) and fault.abort is not None
        if not (is_refusal and isinstance(last, ValueChange) and last.step.object == place):
            raise self._left_changed(fault, second) from fault
        self._unsure = last
        others = [change for change in self.plan.changes if change is not last]
        try:
            return self._restore(others)[0] if others else ()
        except (Exception, KeyboardInterrupt) as third:  # noqa: BLE001
            raise self._left_changed(fault, third) from fault

    def _left_changed(self, fault: BaseException, second: BaseException) -> LeftChanged:
        """The error of a roll-back that failed with *second*, with the objects that differ from before, as read now."""
        left = left_changed(self.plan, fault, second)
        untouched = tuple(self.others.unchanged())
        guarded = Guarded(self.plan.node_id, self.sdo, self.reboot_monitor, self.plan.changes, untouched)
        name_left(left, [guarded], stopped=isinstance(second, KeyboardInterrupt))
        left.text = failure_sentence(left, self.plan.node_id, "rolled back") or left.text
        return left

    def _raise_if_taken(self, unreadable: Sequence[ValueChange], fault: DvtcliError) -> None:
        """Raise LeftChanged if the device took *unreadable* objects, which cannot be rolled back."""
        if taken := [change for change in unreadable if self._acknowledged.was_taken(change)]:
            left = unreadable_left(self.plan, taken, fault)
            name_left(left, [Guarded(self.plan.node_id, self.sdo, self.reboot_monitor, self.plan.changes)])
            raise left from fault

    def _roll_back_changes(self) -> tuple[PdoChange, ...]:
        """Restore the plan's PDOs, and after them PDOs altered as a side effect.

        If the device has lost an acknowledged value, it may have restarted unnoticed, and the COB-ID from before does
        not match its stored PDO. A PDO not read whole is left alone then. Returns the changes restored to a substitute
        value.
        """
        sure = not self._others_matter() or self._restarted() or self._acknowledged.still_held(self.sdo)
        with suppress(NoAnswer, SdoAborted, SdoProtocolError, BusUnavailable):  # its first write says why
            observed(self.reboot_monitor, self._begin_roll_back)
        disturbance_count = self.reboot_monitor.disturbance_count()
        substitutes, differing = self._restore(self.plan.changes)
        sure = sure and self.reboot_monitor.disturbance_count() == disturbance_count
        self._left = {} if sure else {pdo: why for pdo, why in differing.items() if pdo not in self.others.configs}
        altered = self.others.changes(self.sdo, [pdo for pdo in differing if pdo not in self._left])
        if not altered:
            return substitutes
        self.on_altered((*self.plan.changes, *altered))
        _, differing = self._restore((*self.plan.changes, *altered))
        still = [why for pdo, why in differing.items() if pdo not in self._left]
        if still:
            raise DeviceRefused("the device alters other PDOs again", why="; ".join(still))
        return substitutes

    def _begin_roll_back(self) -> None:
        self._boot_ups_back = self.reboot_monitor.boot_ups()
        self.others.begin_roll_back(self.sdo, restarted=self._restarted())

    def _restore(self, changes: Sequence[Change]) -> tuple[tuple[PdoChange, ...], dict[Pdo, str]]:
        """Roll *changes* back, again after a restart during the check of untouched PDOs; also the differing PDOs."""
        for _ in range(MAX_READS):
            substitutes = roll_back_patiently(self.sdo, changes, self.clock, self.before_retry, self.reboot_monitor)
            disturbance_count = self.reboot_monitor.disturbance_count()
            try:
                differing = self._altered_by_roll_back()
            except SdoAborted:  # refused for a moment: it was read before
                continue
            if self.reboot_monitor.disturbance_count() == disturbance_count:
                return substitutes, differing
        raise DeviceRefused("the node restarted, or lost an answer, each time that its other PDOs were looked at")
