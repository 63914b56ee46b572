"""Putting a device back to what it held, and finding what is not as it should be.

Reads the device anew before each write, and again after the last one. Does not know what had gone wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Protocol

from dvtcli.device.observe import RebootMonitor, Undisturbed
from dvtcli.device.read_pdos import read_cob_id, read_pdo
from dvtcli.domain.abort import may_pass
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, PdoChange, Step, ValueChange, plan_pdo
from dvtcli.domain.ports import SdoReader, SdoTransport
from dvtcli.domain.several import value_text
from dvtcli.errors import DeviceRefused, NoAnswer, SdoAborted, SdoProtocolError

#: How long a roll-back keeps trying where the node is silent or refuses, and the pause between two tries, in seconds.
PATIENCE_S = 5.0
RETRY_S = 0.2
#: What a node that is rebooting answers, or does not: it is asked again for a while.
_PASSING = (NoAnswer, SdoProtocolError, SdoAborted, DeviceRefused)


class Clock(Protocol):
    """The bus's time, so that waiting reads the bus and simulated time can pass at its own pace."""

    def now_s(self) -> float:
        """Seconds on a clock that only goes forward."""

    def sleep(self, duration_s: float) -> None:
        """Let *duration_s* pass."""


def roll_back_patiently(
    sdo: SdoTransport,
    changes: Sequence[Change],
    clock: Clock,
    before_retry: Callable[[], None],
    witness: RebootMonitor | None = None,
) -> tuple[PdoChange, ...]:
    """Put every change's *before* back; a node that is silent or refuses may be rebooting, so it is asked again.

    Also what was not begun: a reboot takes that, too, back to what is stored. Each try reads the device anew, so
    nothing is taken for granted of what an earlier one wrote; what was put back stays put back. A try during which
    the *witness* saw the node restart, or an upload repeated, proves nothing: it is followed by another. *before_retry*
    makes the device writable again. After `PATIENCE_S` follows a last try, whose error is raised. Returns the changes
    of which the device refused *before* and took *back*; a refusal that may pass counts in the last try only.
    """
    witness = witness or Undisturbed()
    deadline = clock.now_s() + PATIENCE_S
    while True:
        is_last = clock.now_s() >= deadline
        try:
            upsets = witness.upsets()
            otherwise = roll_back_once(sdo, changes, settles=is_last)
            if witness.upsets() == upsets:
                return otherwise
            if is_last:
                raise DeviceRefused("the node restarted, or lost an answer, each time that it was put back")
        except _PASSING:
            if is_last:
                raise
            clock.sleep(RETRY_S)
            with suppress(*_PASSING):
                before_retry()  # where that fails too, the next try finds out


def roll_back_once(sdo: SdoTransport, changes: Sequence[Change], *, settles: bool) -> tuple[PdoChange, ...]:
    """Put every change's *before* back, last change first, then verify all; the first failure is raised at the end.

    The device is read anew first: after a time-out nobody knows whether the last write arrived. Verified is after the
    last write only, since putting one PDO back may alter another. Returns what was put back to its *back* instead;
    *settles* says whether that may follow a refusal that may pass.
    """
    failures: list[Exception] = []
    fillers = _fillers(changes)
    behind = {id(filler) for group in fillers.values() for filler in group}
    dependent = [change for change in changes if isinstance(change, ValueChange) and change.is_dependent]
    behind |= {id(change) for change in dependent[:-1]}  # they go with the last of them, in their own order
    for change in reversed(changes):
        if id(change) in behind:
            continue  # goes with its PDO, whose count is in its way
        try:
            if dependent and change is dependent[-1]:
                _put_dependent_back(sdo, dependent)
            else:
                _put_one_back(sdo, change, fillers, settles=settles)
        except NoAnswer:
            raise  # a silent node answers nothing about the others either
        except Exception as failed:  # noqa: BLE001 - the others are put back all the same
            failures.append(failed)
    if failures:
        raise failures[0]
    otherwise = []
    for change in changes:
        difference = first_difference(sdo, change, wanted_before=True)
        if difference and isinstance(change, PdoChange) and change.back is not None:
            difference = first_difference(sdo, replace(change, after=change.back))
            otherwise.append(change)
        if difference:
            raise DeviceRefused(f"{change.label} does not read back as it was", place=change.label, why=difference)
    return tuple(otherwise)


def _put_one_back(
    sdo: SdoTransport, change: Change, fillers: Mapping[Pdo, Sequence[ValueChange]], *, settles: bool
) -> None:
    """Put back what *change* replaced; where the device refuses that, and that was foreseen, what it takes."""
    try:
        for step in _steps_back(sdo, change, fillers):
            _bring(sdo, step)
    except SdoAborted as refused:
        if not isinstance(change, PdoChange) or not _otherwise_put_back(sdo, change, refused, settles=settles):
            raise


def _put_dependent_back(sdo: SdoTransport, changes: Sequence[ValueChange]) -> None:
    """Put back what *changes* of values that depend on each other replaced; the first refusal is raised at the end."""
    from dvtcli.domain.value_order import altering, in_order

    known = ((change.step, change.step.before) for change in changes if change.step.before is not None)
    back: list[Step] = []
    unseen: list[Step] = []  # what cannot be read now
    for written, before in known:
        step = replace(written, after=before, reason="put the old value back")
        try:
            back.append(replace(step, before=sdo.upload(step.index, step.sub_index)))
        except SdoAborted:
            unseen.append(step)
    refused: list[SdoAborted] = []
    for step in (*in_order(altering(back)), *unseen):
        try:
            _bring(sdo, step)
        except SdoAborted as aborted:
            refused.append(aborted)
    if refused:
        raise refused[0]


def _otherwise_put_back(sdo: SdoTransport, change: PdoChange, refused: SdoAborted, *, settles: bool) -> bool:
    """Put back with the PDO off, where a parameter was refused while it was on, else to what the device takes.

    Whether there was another way. Less than it was is none as long as the refusal may pass and nothing *settles* it.
    """
    held = read_pdo(sdo, change.pdo)
    parameter = refused.index == change.pdo.communication_index and refused.sub_index != 1
    if held.enabled and parameter:
        steps = plan_pdo(change.pdo, held, change.before, off=True).steps
    elif change.back is not None and (settles or not may_pass(refused.code)):
        steps = plan_pdo(change.pdo, held, change.back).steps
    else:
        return False
    for step in steps:
        _bring(sdo, step)
    return True


def _bring(sdo: SdoTransport, step: Step) -> None:
    """Write *step*; refusing what is held already is no refusal: a count may be writable, and its entries not."""
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


def _fillers(changes: Sequence[Change]) -> dict[Pdo, list[ValueChange]]:
    """The entries behind the count of PDOs that are put back, too, by PDO."""
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


def _steps_back(sdo: SdoTransport, change: Change, fillers: Mapping[Pdo, Sequence[ValueChange]]) -> Sequence[Step]:
    if isinstance(change, PdoChange):
        return _pdo_steps_back(sdo, change, fillers.get(change.pdo, ()))
    step = change.step
    if step.before is None:
        return ()
    with suppress(SdoAborted):  # it cannot be read now: it is written unseen
        if sdo.upload(step.index, step.sub_index) == step.before:
            return ()
    return change.reversed().steps


def unreadable_now(sdo: SdoTransport, changes: Iterable[Change]) -> dict[ValueChange, SdoAborted]:
    """Those of *changes* whose object the device let be read before, and does not now, with its refusal.

    Whether they can be put back or not: what they hold is not known.
    """
    found: dict[ValueChange, SdoAborted] = {}
    for change in changes:
        if isinstance(change, ValueChange) and change.step.before is not None:
            try:
                sdo.upload(change.step.index, change.step.sub_index)
            except SdoAborted as refused:
                found[change] = refused
    return found


def _pdo_steps_back(sdo: SdoTransport, change: PdoChange, fillers: Sequence[ValueChange]) -> Sequence[Step]:
    """The PDO's own steps; where an entry behind its count differs, that is written while the mapping is open."""
    now = read_pdo(sdo, change.pdo)
    held = {filler: sdo.upload(filler.step.index, filler.step.sub_index) for filler in fillers}
    differing = [filler for filler, data in held.items() if data != filler.step.before]
    if not differing:
        return plan_pdo(change.pdo, now, change.before).steps
    cob_id = now.communication.cob_id.disabled()
    opened = PdoConfig(replace(now.communication, cob_id=cob_id), ())
    return (
        *plan_pdo(change.pdo, now, opened).steps,
        *(step for filler in differing for step in filler.reversed().steps),
        *plan_pdo(change.pdo, opened, change.before).steps,
    )


def first_difference(sdo: SdoReader, change: Change, *, wanted_before: bool = False) -> str | None:
    """Read *change* back and name the first difference to what it wanted (or had *before*), or None."""
    if isinstance(change, ValueChange):
        otherwise = held_otherwise(sdo, change, wanted_before=wanted_before)
        return None if otherwise is None else bytes_differ(change, *otherwise)
    wanted_config = change.before if wanted_before else change.after
    differing = plan_pdo(change.pdo, read_pdo(sdo, change.pdo), wanted_config).steps
    if not differing:
        return None
    cob_id = (change.pdo.communication_index, 1)
    telling = (step for step in differing if (step.index, step.sub_index) != cob_id)
    step = next(telling, None) or replace(differing[0], after=differing[-1].after)  # the COB-ID alone
    return f"0x{step.object} is {_hex(step.before)}, expected {_hex(step.after)}"


def held_otherwise(sdo: SdoReader, change: ValueChange, *, wanted_before: bool = False) -> tuple[bytes, bytes] | None:
    """What the object of *change* holds, and what it should; None where these are equal, or it cannot be read."""
    before = change.step.before
    if before is None:
        return None  # write-only: nothing can be read back
    wanted = before if wanted_before else change.step.after
    held = sdo.upload(change.step.index, change.step.sub_index)
    return None if held == wanted else (held, wanted)


def bytes_differ(change: ValueChange, held: bytes, wanted: bytes) -> str:
    """That the object of *change* holds another value than it should."""
    return f"0x{change.step.object} is {value_text(held)}, expected {value_text(wanted)}"


def cob_id_difference(sdo: SdoReader, change: PdoChange) -> str | None:
    """How the COB-ID differs from what *change* wanted, None where it does not; nothing else is read."""
    held, wanted = read_cob_id(sdo, change.pdo), change.after.communication.cob_id
    if held == wanted:
        return None
    return f"0x{change.pdo.communication_index:04X}:01 is 0x{held.raw:08X}, expected 0x{wanted.raw:08X}"


def altered_cob_ids(sdo: SdoTransport, others: Mapping[Pdo, CobId]) -> dict[Pdo, CobId]:
    """Those of *others* whose COB-ID (sub-index 1) is not what it was, each with what it is now."""
    held = {pdo: read_cob_id(sdo, pdo) for pdo in others}
    return {pdo: cob_id for pdo, cob_id in held.items() if cob_id != others[pdo]}


def _hex(data: bytes | None) -> str:
    return "unset" if data is None else f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}"
