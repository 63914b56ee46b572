"""Which objects a device lacks though its file lists them. Reads; writes nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import ABSENT
from dvtcli.domain.abort import Abort
from dvtcli.domain.learning.absence import Absence, listed
from dvtcli.errors import SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.learning.probe import ProbedPdo


def absences(
    node: Node, subjects: Sequence[ProbedPdo], on_look: Callable[[int, int], None] = lambda _done, _total: None
) -> tuple[Absence, ...]:
    """What *node* lacks of what its file lists, as far as that is looked at; nothing where no file is known.

    *on_look* is told how many objects of how many were looked at.
    """
    if node.dictionary is None:
        return ()
    places = listed(node.dictionary, subjects)
    found: list[Absence] = []
    for done, (index, sub_indices) in enumerate(places.items()):
        on_look(done, len(places))
        found += _of_object(node, index, sub_indices)
    return tuple(found)


def _of_object(node: Node, index: int, sub_indices: Sequence[int]) -> Iterator[Absence]:
    """What is missing at *index*; sub-index 0 alone is never, since it stands for the whole object."""
    missing = []
    for sub_index in sub_indices:
        code = _missing(node, index, sub_index)
        if code is None:
            continue
        missing.append(Absence(index, sub_index, code))
        if sub_index == 0 and code == Abort.NO_OBJECT:
            yield missing[0]
            return
    if len(missing) == len(sub_indices):
        yield Absence(index, 0, missing[0].code)
    else:
        yield from (absence for absence in missing if absence.sub_index)


def _missing(node: Node, index: int, sub_index: int) -> int | None:
    """The abort code that says that there is no such object; None where it is there, or cannot be read."""
    try:
        node.memory.upload(index, sub_index)
    except SdoAborted as aborted:
        return aborted.code if aborted.code in ABSENT else None
    return None
