"""Running a plan so that the device ends as planned, or as it was.

The only place that writes a plan to a device. Does not decide what is legal and asks nobody anything.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Protocol

from dvtcli.device.cancellation import Cancellation
from dvtcli.device.read import read_pdo
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, ValueChange, plan_pdo
from dvtcli.domain.ports import SdoTransport
from dvtcli.domain.several import several
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, NoAnswer, SdoAborted, SdoProtocolError

#: How long a roll-back keeps trying where the node is silent or refuses, and the pause between two tries, in seconds.
PATIENCE_S = 5.0
RETRY_S = 0.2


class Clock(Protocol):
    """The bus's time, so that waiting reads the bus and simulated time can pass at its own pace."""

    def now_s(self) -> float:
        """Seconds on a clock that only goes forward."""

    def sleep(self, duration_s: float) -> None:
        """Let *duration_s* pass."""


class SystemClock:
    """The computer's own time."""

    def now_s(self) -> float:
        """Seconds on a clock that only goes forward."""
        return time.monotonic()

    def sleep(self, duration_s: float) -> None:
        """Let *duration_s* pass."""
        time.sleep(duration_s)


class Interrupted(DvtcliError):
    """The user stopped a command; what it had changed was put back."""

    exit_code = 130
    slug = "interrupted"


@dataclass(slots=True)
class Transaction:
    """One plan on its way to a device.

    *cancellation* is looked at between two SDO downloads; *explain* may add the device's own reason to an abort;
    *on_step* is told of every step that the device took; *before_retry* makes the device writable again when a
    roll-back has to be tried anew, since the fault may have been a reboot; *clock* is the bus's.
    """

    sdo: SdoTransport
    plan: Plan
    cancellation: Cancellation = field(default_factory=Cancellation)
    explain: Callable[[SdoAborted], None] = lambda _aborted: None
    on_step: Callable[[Step], None] = lambda _step: None
    before_retry: Callable[[], None] = lambda: None
    clock: Clock = field(default_factory=SystemClock)
    _started: list[Change] = field(default_factory=list)
    _touched: bool = False

    def run(self) -> None:
        """Write every step, read everything back; on any fault put the old configuration back and say so.

        Raises DeviceRefused, NoAnswer and their kin with state `rolled_back`; LeftChanged where the roll-back
        failed too; Interrupted after *cancellation*.
        """
        with self.cancellation.guard():
            self._run()

    def _run(self) -> None:
        total, done = len(self.plan), 0
        try:
            for change in self.plan.changes:
                self._started.append(change)
                for step in change.steps:
                    self._stop_if_cancelled(done, total)
                    done += 1
                    self._download(step, change, done, total)
            self._stop_if_cancelled(done, total)
            self._verify()
        except BaseException as fault:  # a bug of ours must not leave the device half configured either
            self._roll_back(fault)
            raise

    def _stop_if_cancelled(self, done: int, total: int) -> None:
        if self.cancellation.requested:
            stopped = Interrupted(f"stopped after step {done} of {total}", node=self.plan.node_id)
            stopped.exit_code = self.cancellation.exit_code
            raise stopped

    def _download(self, step: Step, change: Change, number: int, total: int) -> None:
        touched, self._touched = self._touched, True
        try:
            self.sdo.download(step.index, step.sub_index, step.after)
        except SdoAborted as aborted:
            self.explain(aborted)
            raise refused(aborted, step, self.plan.node_id, f"step {number} of {total} of {change.label}") from aborted
        except DvtcliError as fault:
            self._touched = touched or fault.state != "unchanged"
            fault.details.insert(0, ("step", step_text(step)))
            raise
        self.on_step(step)

    def _verify(self) -> None:
        """Read back what the plan set; what differs is a refusal that came without an abort."""
        for change in self.plan.changes:
            difference = first_difference(self.sdo, change)
            if difference:
                raise DeviceRefused(
                    f"node {self.plan.node_id} took {change.label} without an error, but reads back differently",
                    node=self.plan.node_id,
                    place=change.steps[-1].object,
                    why=difference,
                    hint="the device corrects or ignores the value: its manual says which values it takes",
                )

    def _roll_back(self, fault: BaseException) -> None:
        if not self._touched:
            return
        try:
            restore_patiently(self.sdo, self.plan.changes, self.clock, self.before_retry)
        except (Exception, KeyboardInterrupt) as second:  # noqa: BLE001 - whatever it is, the device is left changed
            raise left_changed(self.plan, fault, second) from fault
        if isinstance(fault, DvtcliError):
            unreadable = any(isinstance(one, ValueChange) and one.step.before is None for one in self._started)
            refusal = isinstance(fault, DeviceRefused)
            fault.state = "unknown" if unreadable and not refusal else "rolled_back"
            fault.node = self.plan.node_id


def restore_patiently(
    sdo: SdoTransport, changes: Sequence[Change], clock: Clock, before_retry: Callable[[], None]
) -> None:
    """Put every change's *before* back; a node that is silent or refuses may be rebooting, so it is asked again.

    Also what was not begun: a reboot takes that, too, back to what is stored. Each try reads the device anew, so
    nothing is taken for granted of what an earlier one wrote; what was put back stays put back. *before_retry*
    makes the device writable again. Raises the last try's error after `PATIENCE_S`.
    """
    deadline = clock.now_s() + PATIENCE_S
    while True:
        try:
            restore(sdo, changes)
        except (NoAnswer, SdoProtocolError, SdoAborted, DeviceRefused):
            if clock.now_s() >= deadline:
                raise
            clock.sleep(RETRY_S)
            with suppress(NoAnswer, SdoProtocolError, SdoAborted, DeviceRefused):
                before_retry()  # where that fails too, the next try finds out
        else:
            return


def step_text(step: Step) -> str:
    """A step for a person: `0x1A00:03 <- 0x27030120  map 2703:01/32`."""
    value = (
        f"0x{int.from_bytes(step.after, 'little'):0{2 * len(step.after)}X}"
        if len(step.after) <= 4
        else step.after.hex(" ")
    )
    return f"0x{step.object} <- {value}    {step.reason}"


def refused(aborted: SdoAborted, step: Step, node_id: int, what: str) -> DeviceRefused:
    """The device's refusal of one *step*, with everything the abort said."""
    error = DeviceRefused(
        f"node {node_id} refused {what}",
        node=node_id,
        place=step.object,
        abort=aborted.code,
        why=aborted.why,
        hint=aborted.hint,
    )
    error.details.append(("step", step_text(step)))
    return error


def restore(sdo: SdoTransport, changes: Sequence[Change]) -> None:
    """Put every change's *before* back, last change first, and verify it; the first failure is raised at the end.

    The device is read anew first: after a time-out nobody knows whether the last write arrived.
    """
    failures: list[Exception] = []
    for change in reversed(changes):
        try:
            _restore(sdo, change)
        except NoAnswer:
            raise  # a silent node answers nothing about the others either
        except Exception as failed:  # noqa: BLE001 - the others are put back all the same
            failures.append(failed)
    if failures:
        raise failures[0]


def _restore(sdo: SdoTransport, change: Change) -> None:
    for step in _steps_back(sdo, change):
        sdo.download(step.index, step.sub_index, step.after)
    difference = first_difference(sdo, change, wanted_before=True)
    if difference:
        raise DeviceRefused(f"{change.label} does not read back as it was", place=change.label, why=difference)


def _steps_back(sdo: SdoTransport, change: Change) -> Sequence[Step]:
    if isinstance(change, PdoChange):
        return plan_pdo(change.pdo, read_pdo(sdo, change.pdo), change.before).steps
    step = change.step
    if step.before is None or sdo.upload(step.index, step.sub_index) == step.before:
        return ()
    return change.reversed().steps


def first_difference(sdo: SdoTransport, change: Change, *, wanted_before: bool = False) -> str | None:
    """Read *change* back and name the first difference to what it wanted (or had *before*), or None."""
    if isinstance(change, ValueChange):
        before = change.step.before
        if before is None:
            return None  # write-only: nothing can be read back
        wanted = before if wanted_before else change.step.after
        held = sdo.upload(change.step.index, change.step.sub_index)
        if held == wanted:
            return None
        return f"0x{change.step.object} is {held.hex(' ')}, expected {wanted.hex(' ')}"
    wanted_config = change.before if wanted_before else change.after
    differing = plan_pdo(change.pdo, read_pdo(sdo, change.pdo), wanted_config).steps
    if not differing:
        return None
    cob_id = (change.pdo.communication_index, 1)
    telling = (step for step in differing if (step.index, step.sub_index) != cob_id)
    step = next(telling, None) or replace(differing[0], after=differing[-1].after)  # the COB-ID alone
    return f"0x{step.object} is {_hex(step.before)}, expected {_hex(step.after)}"


def _hex(data: bytes | None) -> str:
    return "unset" if data is None else f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}"


def left_changed(plan: Plan, fault: BaseException, second: BaseException) -> LeftChanged:
    """The worst case: say what failed twice and what the device may be left with."""
    labels = several(change.label for change in plan.changes)
    return LeftChanged(
        f"{labels} of node {plan.node_id} could not be put back",
        node=plan.node_id,
        why=f"{fault}; then, while rolling back: {second}",
        hint=f"look at it with `pdo {plan.changes[0].label.lower()}`; nothing was stored, a power cycle brings "
        "the stored settings back",
        state="left_changed",
    )
