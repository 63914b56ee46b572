"""Roll a device back to its former values, and find differences.

Reads the device again before each write and after the last.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Protocol

from dvtcli.device.observe import RebootMonitor
from dvtcli.device.read_pdos import read_cob_id, read_pdo
from dvtcli.domain.abort import may_pass
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, PdoChange, Step, ValueChange, altering, order_of_dependent_values, plan_pdo
from dvtcli.domain.ports import SdoReader, SdoTransport
from dvtcli.domain.text import value_text
from dvtcli.errors import DeviceRefused, NoAnswer, SdoAborted, SdoProtocolError

#: How long a roll-back keeps trying where the node is silent or refuses, and the pause between two tries, in seconds.
PATIENCE_S = 5.0
RETRY_S = 0.2
#: What a node that is rebooting answers, or does not: it is asked again for a while.
_PASSING = (NoAnswer, SdoProtocolError, SdoAborted, DeviceRefused)


class Clock(Protocol):
    """The bus's time: waiting reads the bus, and simulated time can pass at its own pace."""

    def now_s(self) -> float:
        """Seconds on a monotonic clock."""

    def sleep(self, duration_s: float) -> None:
        """Let *duration_s* pass."""


def roll_back_patiently(
    sdo: SdoTransport,
    changes: Sequence[Change],
    clock: Clock,
    before_retry: Callable[[], None],
    reboot_monitor: RebootMonitor,
) -> tuple[PdoChange, ...]:
    """Restore *before* of every change, with retries: a silent or refusing node may be rebooting.

    Includes changes not begun, since a reboot returns them to the stored values. Each try reads the device again and
    writes differences only. A try proves nothing and is repeated if the *reboot_monitor* saw a restart or an upload was
    repeated meanwhile. *before_retry* makes the device writable again. After `PATIENCE_S` a last try raises its error.
    Returns the changes restored to their *substitute*; a temporary refusal counts in the last try only.
    """
    deadline = clock.now_s() + PATIENCE_S
    while True:
        is_last = clock.now_s() >= deadline
        try:
            disturbance_count = reboot_monitor.disturbance_count()
            substituted = roll_back_once(sdo, changes, is_last_try=is_last)
            if reboot_monitor.disturbance_count() == disturbance_count:
                return substituted
            if is_last:
                raise DeviceRefused("the node restarted, or lost an answer, each time that it was rolled back")
        except _PASSING:
            if is_last:
                raise
            clock.sleep(RETRY_S)
            with suppress(*_PASSING):
                before_retry()  # if this fails as well, the next try finds out


def roll_back_once(sdo: SdoTransport, changes: Sequence[Change], *, is_last_try: bool) -> tuple[PdoChange, ...]:
    """Restore *before* of every change, last change first, and verify; the first failure is raised at the end.

    Reads the device first, since after a time-out the last write may have arrived or not. Verifies after the last write
    only, since restoring one PDO may alter another. Returns the changes restored to *substitute* instead; *is_last_try*
    allows that after a temporary refusal.
    """
    failures: list[Exception] = []
    entries_behind = _entries_behind_counts(changes)
    behind = {id(entry) for group in entries_behind.values() for entry in group}
    dependent = [change for change in changes if isinstance(change, ValueChange) and change.is_dependent]
    behind |= {id(change) for change in dependent[:-1]}  # they go with the last of them, in their own order
    for change in reversed(changes):
        if id(change) in behind:
            continue  # restored with its PDO, whose count blocks it
        try:
            if dependent and change is dependent[-1]:
                _roll_back_dependent(sdo, dependent)
            else:
                _roll_back_one(sdo, change, entries_behind, is_last_try=is_last_try)
        except NoAnswer:
            raise  # a silent node answers nothing about the others either
        except Exception as failed:  # noqa: BLE001 - the others are rolled back all the same
            failures.append(failed)
    if failures:
        raise failures[0]
    substituted = []
    for change in changes:
        difference = first_difference(sdo, change, wanted_before=True)
        if difference and isinstance(change, PdoChange) and change.substitute is not None:
            difference = first_difference(sdo, change._replace(after=change.substitute))
            substituted.append(change)
        if difference:
            raise DeviceRefused(f"{change.label} does not read back as it was", place=change.label, why=difference)
    return tuple(substituted)


def _roll_back_one(
    sdo: SdoTransport, change: Change, entries_behind: Mapping[Pdo, Sequence[ValueChange]], *, is_last_try: bool
) -> None:
    """Restore *before* of *change*; after an expected refusal, the value accepted instead."""
    try:
        for step in _roll_back_steps(sdo, change, entries_behind):
            _download_unless_held(sdo, step)
    except SdoAborted as refused:
        if not isinstance(change, PdoChange) or not _roll_back_in_another_way(
            sdo, change, refused, is_last_try=is_last_try
        ):
            raise


def _roll_back_dependent(sdo: SdoTransport, changes: Sequence[ValueChange]) -> None:
    """Restore *before* of dependent values; the first refusal is raised at the end."""
    known = ((change.step, change.step.before) for change in changes if change.step.before is not None)
    back: list[Step] = []
    unseen: list[Step] = []  # what cannot be read now
    for written, before in known:
        step = replace(written, after=before, reason="old value")
        try:
            back.append(replace(step, before=sdo.upload(step.index, step.sub_index)))
        except SdoAborted:
            unseen.append(step)
    refused: list[SdoAborted] = []
    for step in (*order_of_dependent_values(altering(back)), *unseen):
        try:
            _download_unless_held(sdo, step)
        except SdoAborted as aborted:
            refused.append(aborted)
    if refused:
        raise refused[0]


def _roll_back_in_another_way(sdo: SdoTransport, change: PdoChange, refused: SdoAborted, *, is_last_try: bool) -> bool:
    """Restore with the PDO disabled if a parameter was refused while enabled, else its substitute; false if neither.

    As long as the refusal may be temporary, the substitute is not used unless *is_last_try*.
    """
    held = read_pdo(sdo, change.pdo)
    parameter = refused.index == change.pdo.communication_index and refused.sub_index != 1
    if held.enabled and parameter:
        steps = plan_pdo(change.pdo, held, change.before, disabled_first=True).steps
    elif change.substitute is not None and (is_last_try or not may_pass(refused.code)):
        steps = plan_pdo(change.pdo, held, change.substitute).steps
    else:
        return False
    for step in steps:
        _download_unless_held(sdo, step)
    return True


def _download_unless_held(sdo: SdoTransport, step: Step) -> None:
    """Write *step*; a refused write of the present value is accepted: a count may be writable, but not its entries."""
    try:
        sdo.download(step.index, step.sub_index, step.after)
    except SdoAborted:
        if not _holds(sdo, step):
            raise


def _holds(sdo: SdoTransport, step: Step) -> bool:
    try:
        return sdo.upload(step.index, step.sub_index) == step.after
    except SdoAborted:
        return False


def _entries_behind_counts(changes: Sequence[Change]) -> dict[Pdo, list[ValueChange]]:
    """The changes to entries behind the count of the restored PDOs, by PDO."""
    pdos = {change.pdo: change.before for change in changes if isinstance(change, PdoChange)}
    found: dict[Pdo, list[ValueChange]] = {}
    for change in changes:
        if not isinstance(change, ValueChange) or change.step.before is None:
            continue
        pdo = Pdo.at(change.step.index)
        behind = pdo in pdos and change.step.sub_index > pdos[pdo].count
        if pdo is not None and behind and change.step.index == pdo.mapping_index:
            found.setdefault(pdo, []).append(change)
    return found


def _roll_back_steps(
    sdo: SdoTransport, change: Change, entries_behind: Mapping[Pdo, Sequence[ValueChange]]
) -> Sequence[Step]:
    if isinstance(change, PdoChange):
        return _pdo_roll_back_steps(sdo, change, entries_behind.get(change.pdo, ()))
    step = change.step
    if step.before is None:
        return ()
    with suppress(SdoAborted):  # unreadable now: written blind
        if sdo.upload(step.index, step.sub_index) == step.before:
            return ()
    return change.reversed().steps


def unreadable_now(sdo: SdoTransport, changes: Iterable[Change]) -> dict[ValueChange, SdoAborted]:
    """The changes to objects readable before and unreadable now, each with the refusal.

    Their present value is unknown, whether they can be restored or not.
    """
    found: dict[ValueChange, SdoAborted] = {}
    for change in changes:
        if isinstance(change, ValueChange) and change.step.before is not None:
            try:
                sdo.upload(change.step.index, change.step.sub_index)
            except SdoAborted as refused:
                found[change] = refused
    return found


def _pdo_roll_back_steps(sdo: SdoTransport, change: PdoChange, entries_behind: Sequence[ValueChange]) -> Sequence[Step]:
    """The steps to restore the PDO; a differing entry behind its count is written while the mapping is open."""
    now = read_pdo(sdo, change.pdo)
    held = {entry: sdo.upload(entry.step.index, entry.step.sub_index) for entry in entries_behind}
    differing = [entry for entry, data in held.items() if data != entry.step.before]
    if not differing:
        return plan_pdo(change.pdo, now, change.before).steps
    opened = PdoConfig(now.disabled().communication, ())
    return (
        *plan_pdo(change.pdo, now, opened).steps,
        *(step for entry in differing for step in entry.reversed().steps),
        *plan_pdo(change.pdo, opened, change.before).steps,
    )


def first_difference(sdo: SdoReader, change: Change, *, wanted_before: bool = False) -> str | None:
    """Read *change* back and describe the first difference from its result (or from *before*), or None."""
    if isinstance(change, ValueChange):
        values = differing_values(sdo, change, wanted_before=wanted_before)
        return None if values is None else bytes_differ(change, *values)
    wanted_config = change.before if wanted_before else change.after
    differing = plan_pdo(change.pdo, read_pdo(sdo, change.pdo), wanted_config).steps
    if not differing:
        return None
    cob_id = (change.pdo.communication_index, 1)
    telling = (step for step in differing if (step.index, step.sub_index) != cob_id)
    step = next(telling, None) or replace(differing[0], after=differing[-1].after)  # the COB-ID alone
    return f"0x{step.object} is {_hex(step.before)}, expected {_hex(step.after)}"


def differing_values(sdo: SdoReader, change: ValueChange, *, wanted_before: bool = False) -> tuple[bytes, bytes] | None:
    """The present and the expected value of the object of *change*; None if equal or unreadable."""
    before = change.step.before
    if before is None:
        return None  # write-only: nothing can be read back
    wanted = before if wanted_before else change.step.after
    held = sdo.upload(change.step.index, change.step.sub_index)
    return None if held == wanted else (held, wanted)


def bytes_differ(change: ValueChange, held: bytes, wanted: bytes) -> str:
    """The sentence that the object of *change* has an unexpected value."""
    return f"0x{change.step.object} is {value_text(held)}, expected {value_text(wanted)}"


def cob_id_difference(sdo: SdoReader, change: PdoChange) -> str | None:
    """The difference of the COB-ID from *change*, or None; reads nothing else."""
    held, wanted = read_cob_id(sdo, change.pdo), change.after.communication.cob_id
    if held == wanted:
        return None
    return f"0x{change.pdo.communication_index:04X}:01 is 0x{held.raw:08X}, expected 0x{wanted.raw:08X}"


def altered_cob_ids(sdo: SdoTransport, others: Mapping[Pdo, CobId]) -> dict[Pdo, CobId]:
    """The PDOs of *others* with a changed COB-ID (sub-index 1), each with the present COB-ID."""
    held = {pdo: read_cob_id(sdo, pdo) for pdo in others}
    return {pdo: cob_id for pdo, cob_id in held.items() if cob_id != others[pdo]}


def _hex(data: bytes | None) -> str:
    return "unset" if data is None else f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}"
