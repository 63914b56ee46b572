"""Probe how a device stores (0x1010, 0x1011), and let it store if agreed: at most two writes to 0x1010.

Call only while the device holds its initial values: a store is not rolled back.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.change.failed_change import TRY_AGAIN
from dvtcli.device.read_pdos import ABSENT, read_number
from dvtcli.domain.abort import Abort, abort_text
from dvtcli.domain.learning.probe import ACCEPTED, Learnt, Probe, ProbeAnswer, ProbeCondition, ProbeWrite, Stand
from dvtcli.domain.objects import RESTORE_PARAMETERS, STORE_PARAMETERS
from dvtcli.errors import DeviceRefused, NoAnswer, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode

#: The sub-indices of CiA 301: all, communication, application; the first of the maker's own.
_SUB_INDICES = (1, 2, 3, 4)


@dataclass(frozen=True, slots=True)
class SignatureAnswers:
    """The device's *answers* to each signature, and the duration of the right signature in *seconds*."""

    answers: tuple[ProbeAnswer, ...] = ()
    seconds: float = 0.0

    @property
    def writes(self) -> int:
        """The number of signatures sent."""
        return sum(answer.code is not None for answer in self.answers)

    @property
    def sub_index(self) -> int | None:
        """The sub-index of 0x1010 that took `save`, else None; an accepted wrong signature may have saved nothing."""
        took = (answer.probe for answer in self.answers if answer.probe.name == SAVE and answer.accepted)
        return next((probe.asked.sub_index for probe in took), None)


def read_storage(node: ReadableNode) -> Storage:
    """The content of 0x1010 and 0x1011 of *node*; writes nothing."""
    save, unreadable = _capabilities(node, STORE_PARAMETERS)
    load, _ = _capabilities(node, RESTORE_PARAMETERS)
    return Storage(save, load, unreadable)


def _capabilities(node: ReadableNode, index: int) -> tuple[dict[int, int], int]:
    """The values of the sub-indices of *index*, and the abort code of an existing, unreadable sub-index."""
    found, unreadable = {}, 0
    for sub_index in _SUB_INDICES:
        try:
            found[sub_index] = read_number(node.read_cache, index, sub_index, 4)
        except SdoAborted as aborted:
            if aborted.code == Abort.NO_OBJECT:
                break
            unreadable = unreadable or (0 if aborted.code in ABSENT else aborted.code)
    return found, unreadable


def ask_to_save(node: ReadableNode, probes: Sequence[Probe]) -> SignatureAnswers:
    """Send *probes* in order, expected refusals first, until the device takes a signature.

    Raises DeviceRefused if the node restarts, Interrupted after a request to stop, NoAnswer if the node falls silent;
    with the state `unknown` if the node may have saved.
    """
    answers: list[ProbeAnswer] = []
    seconds = 0.0
    for probe in probes:
        if any(answer.accepted for answer in answers):
            answers.append(
                ProbeAnswer(probe, None, why="a wrong signature was taken, so that it may have saved already")
            )
            continue
        started_s = node.bus.now_s()
        answers.append(_asked(node, probe))
        seconds = node.bus.now_s() - started_s
    return SignatureAnswers(tuple(answers), seconds)


def _asked(node: ReadableNode, probe: Probe) -> ProbeAnswer:
    if node.cancellation.requested:
        raise node.cancellation.interrupted("stopped before the save", node=node.node_id)
    write, boot_ups, code = probe.asked, node.bus.boot_ups(node.node_id), ACCEPTED
    try:
        node.sdo.download(write.index, write.sub_index, write.data, timeout_s=node.profile.store.timeout_s)
    except SdoAborted as aborted:
        code = aborted.code
    except NoAnswer as silent:
        silent.hint = "it may still be saving: leave it powered for a while; whether it stored is unknown"
        raise
    if node.bus.boot_ups(node.node_id) != boot_ups:
        raise DeviceRefused(
            f"node {node.node_id} restarted when {write} was written", node=node.node_id,
            place=f"{write.index:04X}:{write.sub_index:02X}", hint=TRY_AGAIN, state="unknown",
        )  # fmt: skip
    return ProbeAnswer(probe, code)


#: Bits of 0x1010:s: saves on command, saves by itself.
_ON_COMMAND, _BY_ITSELF = 1, 2
_SIGNATURE, _WRONG_SIGNATURE = b"save", bytes(4)
#: Names of the probes: the signature to be refused comes first.
WRONG_SIGNATURE, SAVE = "wrong signature", "save"


@dataclass(frozen=True, slots=True)
class Storage:
    """Values of 0x1010 and 0x1011 by sub-index: *save* and *load*; empty if the device lacks the object.

    *unreadable* is the abort code of 0x1010:01 if it exists but cannot be read.
    """

    save: Mapping[int, int] = field(default_factory=dict)
    load: Mapping[int, int] = field(default_factory=dict)
    unreadable: int = 0

    @property
    def wears(self) -> str:
        """Risk of wear at every write, in words; empty if the device saves on command only."""
        if self.unreadable:
            return f"0x1010:01 cannot be read ({abort_text(self.unreadable)}), so it may store each write on its own"
        if not self.save:
            return "it has no 0x1010, so it may store each write on its own"
        by_itself = [sub for sub, said in self.save.items() if said & _BY_ITSELF]
        if not by_itself:
            return ""
        place = f"0x1010:{by_itself[0]:02X}"
        return f"{place} is {self.save[by_itself[0]]}: it stores on its own, so each write wears its memory"

    def chosen(self, preferred: Iterable[int]) -> int | None:
        """Sub-index of 0x1010 that accepts the signature, if possible from *preferred*; else None."""
        able = [sub for sub, said in self.save.items() if said & _ON_COMMAND]
        return next((sub for sub in (*preferred, *able) if sub in able), None)

    def probes(self, preferred: Iterable[int]) -> list[Probe]:
        """The probes, each sent once: a wrong signature, then the right one. Empty if no sub-index saves on command."""
        sub = self.chosen(preferred)
        if sub is None:
            return []
        return [
            Probe(None, name, sense, Stand.BACK, (ProbeWrite(STORE_PARAMETERS, sub, data),), where=ProbeCondition.STORE)
            for name, sense, data in (
                (WRONG_SIGNATURE, "a wrong signature is accepted", _WRONG_SIGNATURE),
                (SAVE, 'it stores on request ("save")', _SIGNATURE),
            )
        ]


def not_asked(storage: Storage, why: str) -> list[ProbeAnswer]:
    """The same probes, skipped, each with the reason *why*."""
    return [ProbeAnswer(probe, None, why=why) for probe in storage.probes(())]


def storage_for_profile(
    storage: Storage, answers: Sequence[ProbeAnswer], preferred: Iterable[int], seconds: float
) -> Iterator[Learnt]:
    """Sub-indices of 0x1010 that save, in *preferred* order; the store took *seconds*."""
    if not storage.save and not storage.unreadable:
        yield Learnt("store.sub_indices", [], "0x1010:01 does not exist")
        return
    saved = next((answer for answer in answers if answer.probe.name == SAVE and answer.accepted), None)
    if saved is not None:
        own = saved.probe.asked.sub_index
        others = [sub for sub in preferred if sub != own and storage.save.get(sub, 0) & _ON_COMMAND]
        yield Learnt("store.sub_indices", [own, *others], f"{saved.text}, in {seconds:.2f} s")


def storage_for_family(storage: Storage, answers: Sequence[ProbeAnswer]) -> Iterator[Learnt]:
    """A simulated device's capability values, and its answers to signatures."""
    for key, index, said in (
        ("store_capability", STORE_PARAMETERS, storage.save),
        ("restore_capability", RESTORE_PARAMETERS, storage.load),
    ):
        if said:
            evidence = ", ".join(f"0x{index:04X}:{sub:02X} is {value}" for sub, value in said.items())
            yield Learnt(key, next(iter(said.values())), evidence)
    for answer in answers:
        key = {WRONG_SIGNATURE: "wrong_signature", SAVE: "save_answer"}[answer.probe.name]
        if answer.code is not None:
            yield Learnt(key, answer.code, answer.text)
