"""Store and restore: 0x1010 "save" and 0x1011 "load" (CiA 301, 7.5.2.13, 7.5.2.14)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dvtcli.device.cancellation import Cancellation
from dvtcli.device.nmt_gate import NodeAccess
from dvtcli.device.read_pdos import ABSENT
from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.objects import RESTORE_PARAMETERS, STORE_PARAMETERS
from dvtcli.domain.ports import SdoTransport
from dvtcli.domain.profile import StorePolicy
from dvtcli.errors import BusUnavailable, DeviceRefused, Interrupted, NoAnswer, SdoAborted

SIGNATURES = {STORE_PARAMETERS: b"save", RESTORE_PARAMETERS: b"load"}


@dataclass(frozen=True, slots=True)
class StoreAnswer:
    """An accepted signature: its object, duration in seconds, and the object's former value (None: unknown)."""

    index: int
    sub_index: int
    seconds: float
    capability: int | None = None

    @property
    def place(self) -> str:
        """The object as printed and typed."""
        return f"{self.index:04X}:{self.sub_index:02X}"


def write_signature(
    access: NodeAccess,
    policy: StorePolicy,
    index: int,
    sub_index: int | None,
    cancellation: Cancellation,
    dictionary: ObjectDictionary | None = None,
    before: Callable[[], None] = lambda: None,
) -> StoreAnswer:
    """Write the signature to *index*:*sub_index*; None takes the first existing sub-index of *policy*.

    *before* is called directly before the write and may raise to prevent it.

    Waits up to the policy's time-out, since EEPROMs are slow. Raises DeviceRefused if the device lacks the object or
    refuses, or if *dictionary* makes it read-only: nothing is sent then.
    """
    sdo = access.bus.sdo(access.node_id)
    where, capability = chosen(access, policy, index, sub_index, dictionary)
    started_s = access.bus.now_s()
    found, boot_ups = access.state(), access.bus.boot_ups(access.node_id)
    try:
        before()
        with cancellation.deferred():  # a Ctrl-C waits for the answer; a second one does not
            sdo.download(index, where, SIGNATURES[index], timeout_s=policy.timeout_s)
    except KeyboardInterrupt as stopped:
        raise _interrupted(access.node_id, index, cancellation) from stopped
    except SdoAborted as aborted:
        access.explain(aborted)
        raise _refused(aborted, access.node_id, index, where) from aborted
    except BusUnavailable as gone:
        if gone.state == "unchanged":
            raise
        raise _unanswered(gone, index) from gone
    except NoAnswer as silent:
        silent.hint = _again(index, "it may still be writing; wait, then {} again")
        if access.bus.boot_ups(access.node_id) != boot_ups:
            silent.hint = _again(index, "it restarted instead; {} again")
            if index == STORE_PARAMETERS:
                silent.hint = _again(
                    STORE_PARAMETERS, "it restarted instead: unstored values are lost; set them again, then {}"
                )
            from dvtcli.device.resets import return_to

            return_to(access, found)
        raise
    return StoreAnswer(index, where, access.bus.now_s() - started_s, capability)


def chosen(
    access: NodeAccess, policy: StorePolicy, index: int, sub_index: int | None, dictionary: ObjectDictionary | None
) -> tuple[int, int | None]:
    """The sub-index for the signature and its present value (None: unknown); writes nothing.

    Raises DeviceRefused if the device or its *dictionary* has no writable sub-index.
    """
    where, capability = _choose(access.bus.sdo(access.node_id), policy, index, sub_index, access.node_id)
    _refuse_fixed(dictionary, index, where, access.node_id)
    return where, capability


def _interrupted(node_id: int, index: int, cancellation: Cancellation) -> Interrupted:
    return cancellation.interrupted(
        f"node {node_id} was asked to {word_of(index)}; its answer was not waited for",
        node=node_id,
        state="unknown",
        hint=_again(index, "it may still be writing its memory: leave it powered, then {} again"),
    )


def _unanswered(gone: BusUnavailable, index: int) -> BusUnavailable:
    """The error: the bus was *gone* before the answer."""
    hint = (gone.hint or "bring the bus back") + _again(index, "then {} again: whether it did is not known")
    return BusUnavailable(gone.text, node=gone.node, place=gone.place, why=gone.why, hint=hint, state=gone.state)


def _again(index: int, why: str) -> Hint:
    return Hint(Action.STORE if index == STORE_PARAMETERS else Action.RESTORE, why=why)


def word_of(index: int) -> str:
    """The command that signs the object at *index*: store or restore."""
    return "store" if index == STORE_PARAMETERS else "restore"


def _choose(
    sdo: SdoTransport, policy: StorePolicy, index: int, sub_index: int | None, node_id: int
) -> tuple[int, int | None]:
    """The sub-index for the signature and its present value; None if unreadable."""
    wanted = (sub_index,) if sub_index is not None else policy.sub_indices
    for candidate in wanted:
        try:
            capability = int.from_bytes(sdo.upload(index, candidate), "little")
        except SdoAborted as aborted:
            if aborted.code in ABSENT:
                continue
            if aborted.code == Abort.WRITE_ONLY:
                return candidate, None
            raise
        if index == STORE_PARAMETERS and not capability & 1:
            raise _cannot(node_id, index, candidate, capability)
        return candidate, capability
    error = _cannot(node_id, index, wanted[0] if wanted else 1, None)
    if index == STORE_PARAMETERS and policy.instead:
        error.hint = policy.instead
    elif sub_index is not None and policy.sub_indices and sub_index not in policy.sub_indices:
        error.text = f"this device cannot {word_of(index)} that group alone"
        error.hint = _again(index, f"{{}} alone takes what it has (0x{index:04X}:{policy.sub_indices[0]:02X})")
    raise error


def _refuse_fixed(dictionary: ObjectDictionary | None, index: int, sub_index: int, node_id: int) -> None:
    entry = dictionary.entry(index, sub_index) if dictionary else None
    if dictionary is None or entry is None or entry.access.writable:
        return
    place = f"{index:04X}:{sub_index:02X}"
    raise DeviceRefused(
        f"this device cannot {'store' if index == STORE_PARAMETERS else 'restore its defaults'}",
        node=node_id,
        place=place,
        why=f"0x{place} is {entry.access} in {dictionary.place(entry)}: it accepts no signature",
        hint=Hint(
            Action.GIVE_EDS,
            why="see its manual for storing settings; if the file is wrong, correct it or give another file: {}",
        ),
    )


def _cannot(node_id: int, index: int, sub_index: int, capability: int | None) -> DeviceRefused:
    verb = "store" if index == STORE_PARAMETERS else "restore its defaults"
    place = f"{index:04X}:{sub_index:02X}"
    if capability is None:
        keeps = "storing settings" if index == STORE_PARAMETERS else "restoring defaults"
        why, hint = f"it has no 0x{place}", f"see its manual for {keeps}"
    elif capability & 2:
        why, hint = f"0x{place} is {capability}: it stores changes by itself", "nothing to do"
    else:
        why, hint = f"0x{place} is {capability}: it does not store on command", "see its manual for storing settings"
    error = DeviceRefused(f"this device cannot {verb}", node=node_id, place=place, why=why, hint=hint)
    error.abort = None if capability is not None else int(Abort.NO_OBJECT)
    return error


def _refused(aborted: SdoAborted, node_id: int, index: int, sub_index: int) -> DeviceRefused:
    hint: Hint | str | None = aborted.hint
    if aborted.code == Abort.DEVICE_STATE:
        hint = Hint(Action.ENTER_PRE_OPERATIONAL, {"node": node_id}, "{}, then again")
    elif aborted.code == Abort.HARDWARE:
        hint = "the device could not write its memory; its earlier stored values may be lost"
    error = DeviceRefused(
        f"node {node_id} refused to {word_of(index)}",
        node=node_id,
        place=f"{index:04X}:{sub_index:02X}",
        abort=aborted.code,
        why=aborted.why,
        hint=hint,
    )
    if aborted.code == Abort.HARDWARE:
        error.state = "unknown"
    return error
