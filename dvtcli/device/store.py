"""Store and restore: 0x1010 "save", 0x1011 "load".

Knows the signatures and capability bits of CiA 301 (7.5.2.13, 7.5.2.14). Does not know what was changed.
"""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.device.access import Access
from dvtcli.device.cancellation import Cancellation
from dvtcli.device.read import ABSENT
from dvtcli.device.transaction import Interrupted
from dvtcli.domain.abort import Abort
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import SdoTransport
from dvtcli.domain.profile import StorePolicy
from dvtcli.errors import DeviceRefused, NoAnswer, SdoAborted

STORE, RESTORE = 0x1010, 0x1011
SIGNATURES = {STORE: b"save", RESTORE: b"load"}
#: How long a node may take from reset to its boot-up message, in seconds.
BOOT_TIMEOUT_S = 10.0


@dataclass(frozen=True, slots=True)
class Signed:
    """A signature that the device took: where, and how long it needed (s)."""

    index: int
    sub_index: int
    seconds: float


def sign(access: Access, policy: StorePolicy, index: int, sub_index: int | None, cancellation: Cancellation) -> Signed:
    """Write the signature to *index*:*sub_index*; None takes the first sub-index of *policy* that exists.

    Waits up to the policy's own time-out, since EEPROMs are slow. Raises DeviceRefused where the device has no
    such object, or refuses.
    """
    sdo = access.bus.sdo(access.node_id)
    where = _choose(sdo, policy, index, sub_index, access.node_id)
    started_s = access.bus.now_s()
    found, boot_ups = access.state(), access.bus.boot_ups(access.node_id)
    try:
        with cancellation.guard():  # a Ctrl-C waits for the answer; a second one does not
            sdo.download(index, where, SIGNATURES[index], timeout_s=policy.timeout_s)
    except KeyboardInterrupt as stopped:
        raise _interrupted(access.node_id, index, cancellation) from stopped
    except SdoAborted as aborted:
        access.explain(aborted)
        raise _refused(aborted, access.node_id, index, where) from aborted
    except NoAnswer as silent:
        silent.state = "unknown"
        silent.hint = f"it may still be writing; wait, then `{_word(index)}` again"
        if access.bus.boot_ups(access.node_id) != boot_ups:
            silent.hint = f"it has rebooted instead; `{_word(index)}` again"
            return_to(access, found)
        raise
    return Signed(index, where, access.bus.now_s() - started_s)


def _interrupted(node_id: int, index: int, cancellation: Cancellation) -> Interrupted:
    error = Interrupted(
        f"node {node_id} was asked to {_word(index)}; its answer was not waited for",
        node=node_id,
        hint=f"it may still be writing its memory: leave it powered, then `{_word(index)}` again",
        state="unknown",
    )
    error.exit_code = cancellation.exit_code
    return error


def _word(index: int) -> str:
    return "store" if index == STORE else "restore"


def _choose(sdo: SdoTransport, policy: StorePolicy, index: int, sub_index: int | None, node_id: int) -> int:
    wanted = (sub_index,) if sub_index is not None else policy.sub_indices
    for candidate in wanted:
        try:
            capability = int.from_bytes(sdo.upload(index, candidate), "little")
        except SdoAborted as aborted:
            if aborted.code in ABSENT:
                continue
            if aborted.code == Abort.WRITE_ONLY:
                return candidate
            raise
        if index == STORE and not capability & 1:
            raise _cannot(node_id, index, candidate, capability)
        return candidate
    error = _cannot(node_id, index, wanted[0] if wanted else 1, None)
    if index == STORE and policy.instead:
        error.hint = policy.instead
    elif sub_index is not None and policy.sub_indices and sub_index not in policy.sub_indices:
        error.text = f"this device cannot {_word(index)} that group alone"
        error.hint = f"`{_word(index)}` alone takes what it has (0x{index:04X}:{policy.sub_indices[0]:02X})"
    raise error


def _cannot(node_id: int, index: int, sub_index: int, capability: int | None) -> DeviceRefused:
    verb = "store" if index == STORE else "restore its defaults"
    place = f"{index:04X}:{sub_index:02X}"
    if capability is None:
        keeps = "keeps settings" if index == STORE else "forgets settings"
        why, hint = f"it has no 0x{place}", f"its manual says how it {keeps}"
    elif capability & 2:
        why, hint = f"0x{place} is {capability}: it stores changes by itself", "nothing to do"
    else:
        why, hint = f"0x{place} is {capability}: it does not store on command", "its manual says how it keeps settings"
    error = DeviceRefused(f"this device cannot {verb}", node=node_id, place=place, why=why, hint=hint)
    error.abort = None if capability is not None else int(Abort.NO_OBJECT)
    return error


def _refused(aborted: SdoAborted, node_id: int, index: int, sub_index: int) -> DeviceRefused:
    hint = aborted.hint
    if aborted.code == Abort.DEVICE_STATE:
        hint = f"nmt preop {node_id}, then again"
    elif aborted.code == Abort.HARDWARE:
        hint = "the device could not write its memory; what it had stored before may be lost"
    error = DeviceRefused(
        f"node {node_id} refused to {_word(index)}",
        node=node_id,
        place=f"{index:04X}:{sub_index:02X}",
        abort=aborted.code,
        why=aborted.why,
        hint=hint,
    )
    if aborted.code == Abort.HARDWARE:
        error.state = "unknown"
    return error


def reset_and_wait(access: Access, command: NmtCommand, timeout_s: float = BOOT_TIMEOUT_S) -> float:
    """Reset the node and wait for its boot-up message; the seconds it took. NoAnswer where none comes."""
    bus, node_id = access.bus, access.node_id
    seen, started_s = bus.boot_ups(node_id), bus.now_s()
    bus.send_nmt(command, node_id)
    if not bus.wait_boot_up(node_id, seen, timeout_s):
        raise NoAnswer(
            f"node {node_id} sent no boot-up message within {timeout_s:.0f} s after its reset",
            node=node_id,
            hint="look at the node, then scan",
            state="unknown",
        )
    return bus.now_s() - started_s


def return_to(access: Access, state: NmtState | None) -> None:
    """Bring a node that was OPERATIONAL before its reset back there."""
    if state is NmtState.OPERATIONAL:
        access.request(NmtState.OPERATIONAL)
