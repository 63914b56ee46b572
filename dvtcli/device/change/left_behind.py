"""The values in a device that differ from before a change after its roll-back failed.

Reads only; a missing answer is reported as unknown.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.change.roll_back import held_otherwise
from dvtcli.device.observe import MAX_READS, RebootMonitor
from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Change, PdoChange, Step, ValueChange, plan_pdo
from dvtcli.domain.text import join_some, value_text
from dvtcli.errors import DvtcliError, LeftChanged, LeftObject, SdoAborted

if TYPE_CHECKING:
    from dvtcli.domain.ports import SdoReader

_RESTARTS = f"the node restarted, or lost an answer, each of {MAX_READS} times that it was read"


class Guarded(NamedTuple):
    """The values of *node_id* that must be as before *changes*, read through *sdo*.

    *untouched*, possibly incomplete, is reported only if different.
    """

    node_id: int
    sdo: SdoReader
    reboot_monitor: RebootMonitor
    changes: Sequence[Change]
    untouched: Sequence[Change] = ()

    @property
    def all(self) -> tuple[Change, ...]:
        """All changes to compare."""
        return (*self.changes, *self.untouched)


def name_left(left: LeftChanged, guarded: Iterable[Guarded], *, stopped: bool = False) -> None:
    """Add to *left* the changed objects, and the PDOs and objects as before, as read now.

    With *stopped* (nobody waits) nothing is read, and everything is reported as unknown.
    """
    objects: list[LeftObject] = []
    as_before: dict[int, list[str]] = {}
    for node in guarded:
        left.guarded[node.node_id] = node.all
        found = list(_unread(node, node.changes, "stopped before it was read")) if stopped else _look(node)
        objects += found
        others = {_label(change) for change in node.changes} - {row.label for row in found}
        as_before[node.node_id] = [label for label in dict.fromkeys(map(_label, node.changes)) if label in others]
    left.left = tuple(objects)
    left.as_before = {node_id: tuple(labels) for node_id, labels in as_before.items() if labels}
    left.state_text = _state_text(left)


def merge_left(left: LeftChanged, others: Iterable[LeftChanged]) -> None:
    """Add the entries of *others*, about other nodes, to *left*."""
    for other in others:
        left.left += other.left
        left.as_before |= other.as_before
        left.guarded |= other.guarded
    left.state_text = _state_text(left)


def failure_sentence(left: LeftChanged, node_id: int, done: str) -> str | None:
    """The sentence that the entries of *left* for a node could not be *done* ("put back"); None without entries."""
    labels = _labels(left, node_id)
    return f"{labels} of node {node_id} could not be {done}" if labels else None


def _labels(left: LeftChanged, node_id: int) -> str:
    return join_some(dict.fromkeys(row.label for row in left.left if row.node_id == node_id))


def _state_text(left: LeftChanged) -> str | None:
    """The state in words; None if nothing was to be as before."""
    nodes = dict.fromkeys([*(row.node_id for row in left.left), *left.as_before])
    texts = []
    for node_id in nodes:
        rows = [row for row in left.left if row.node_id == node_id]
        if changed := join_some(dict.fromkeys(row.label for row in rows if row.is_known)):
            texts.append(f"{changed} of node {node_id}")
        if unknown := join_some(dict.fromkeys(row.label for row in rows if not row.is_known)):
            texts.append(f"the present value of {unknown} of node {node_id} is unknown")
    same = [f"{join_some(labels)} of node {node_id} is as it was" for node_id, labels in left.as_before.items()]
    if not texts:
        if not same:
            return None
        return f"{'; '.join(same)}, read last; but the roll-back did not end: check it again"
    return "; ".join([f"LEFT CHANGED: {'; '.join(texts)}", *(f"{text}, read back equal" for text in same)])


def _look(guarded: Guarded) -> list[LeftObject]:
    """The rows of a node, all read without a restart between."""
    for _ in range(MAX_READS):
        try:
            disturbance_count = guarded.reboot_monitor.disturbance_count()
            rows = list(_rows(guarded))
            if guarded.reboot_monitor.disturbance_count() == disturbance_count:
                return rows
        except DvtcliError as dead:
            return list(_unread(guarded, guarded.changes, dead.text))
    return list(_unread(guarded, guarded.changes, _RESTARTS))


def _rows(guarded: Guarded) -> Iterator[LeftObject]:
    for number, change in enumerate(guarded.all):
        try:
            differing = list(_differing(guarded.sdo, change))
        except SdoAborted as refused:
            if change in guarded.changes:
                yield from _unread(guarded, (change,), refused.text)
        except DvtcliError as silent:  # it answers nothing about the others either
            yield from _unread(guarded, guarded.changes[number:], silent.text)
            return
        except KeyboardInterrupt:
            yield from _unread(guarded, guarded.changes[number:], "stopped before it was read")
            return
        else:
            for place, held, before, text in differing:
                yield LeftObject(guarded.node_id, _label(change), place, held, before, text)


def _differing(sdo: SdoReader, change: Change) -> Iterator[tuple[str, bytes | None, bytes | None, str]]:
    """Each changed object of *change* with present and former value, and the difference in words."""
    if isinstance(change, ValueChange):
        step = change.step
        if step.before is None:
            text = f"0x{step.object} was written, but cannot be read: its old value is unknown"
            yield step.object, None, None, text
        elif (found := held_otherwise(sdo, change, wanted_before=True)) is not None:
            yield step.object, *found, _words(step.object, *found)
        return
    held = read_pdo(sdo, change.pdo)
    steps: dict[str, list[Step]] = {}
    for step in plan_pdo(change.pdo, held, change.before).steps:
        steps.setdefault(step.object, []).append(step)
    for place, written in steps.items():
        is_held, was = written[0].before, written[-1].after
        if is_held != was and (is_held is not None or len(steps) == 1):  # beyond the count an entry means nothing
            yield place, is_held, was, _words(place, is_held, was)


def _words(place: str, held: bytes | None, before: bytes) -> str:
    return f"0x{place} is {'unset' if held is None else value_text(held)}, was {value_text(before)}"


def _unread(guarded: Guarded, changes: Iterable[Change], why: str) -> Iterator[LeftObject]:
    for change in changes:
        place = None if isinstance(change, PdoChange) else change.step.object
        text = f"its value is unknown: {why}"
        yield LeftObject(guarded.node_id, _label(change), place, None, None, text, is_known=False)


def _label(change: Change) -> str:
    """The PDO of *change*, even for a single object of the PDO."""
    if isinstance(change, PdoChange):
        return change.label
    pdo = Pdo.at(change.step.index)
    return change.label if pdo is None else pdo.label
