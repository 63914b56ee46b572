"""Probe how a device stores, and let it store if agreed: at most two writes to 0x1010.

Call only while the device holds its initial values: a store is not rolled back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.device.change.failed_change import TRY_AGAIN
from dvtcli.device.read_pdos import ABSENT, read_number
from dvtcli.domain.abort import Abort
from dvtcli.domain.learning.probe import ACCEPTED, Probe, ProbeAnswer
from dvtcli.domain.learning.storage import RESTORE, SAVE, STORE, Storage
from dvtcli.errors import DeviceRefused, Interrupted, NoAnswer, SdoAborted

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
    save, unreadable = _capabilities(node, STORE)
    load, _ = _capabilities(node, RESTORE)
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
        stopped = Interrupted("stopped before the save", node=node.node_id)
        stopped.exit_code = node.cancellation.exit_code
        raise stopped
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
