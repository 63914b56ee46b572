"""Read the facts about a learned device that no file gives: standard objects, and lengths of mapped objects."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import ABSENT
from dvtcli.domain.abort import Abort
from dvtcli.domain.learning.probe_table import OTHER_WAY
from dvtcli.domain.learning.read_dictionary import TO_READ, Absence, ReadDevice, listed
from dvtcli.domain.pdo import Direction, Pdo, PdoConfig
from dvtcli.errors import SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.learning.probe import ProbedPdo
    from dvtcli.domain.learning.probe_table import KnownAnswers


def absences(
    node: ReadableNode, subjects: Sequence[ProbedPdo], on_look: Callable[[int, int], None] = lambda _done, _total: None
) -> tuple[Absence, ...]:
    """The objects of its file that *node* lacks, among those examined; empty without a file.

    *on_look* is called with the number of examined objects and the total.
    """
    if node.dictionary is None:
        return ()
    places = listed(node.dictionary, subjects)
    found: list[Absence] = []
    for done, (index, sub_indices) in enumerate(places.items()):
        on_look(done, len(places))
        found += _of_object(node, index, sub_indices)
    return tuple(found)


def _of_object(node: ReadableNode, index: int, sub_indices: Sequence[int]) -> Iterator[Absence]:
    """The missing entries at *index*; sub-index 0 alone never, since it stands for the whole object."""
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


def _missing(node: ReadableNode, index: int, sub_index: int) -> int | None:
    """The abort code for a missing object; None if present or unreadable."""
    try:
        node.memory.upload(index, sub_index)
    except SdoAborted as aborted:
        return aborted.code if aborted.code in ABSENT else None
    return None


def read_device(node: ReadableNode, pdos: Mapping[Pdo, PdoConfig], known: Sequence[KnownAnswers]) -> ReadDevice:
    """The description of *node* with its initial *pdos* and the answers of the probes."""
    values = {}
    for place in TO_READ:
        with suppress(SdoAborted):  # unreadable objects are left out
            values[place] = node.memory.upload(*place)
    mapped = {way: [e for p, c in pdos.items() if p.direction is way for e in c.mapping] for way in Direction}
    for answers in known:
        mapped[answers.subject.pdo.direction] += answers.fits
        if answers.subject.other_way is not None and answers.accepted(OTHER_WAY):
            mapped[answers.subject.pdo.direction].append(answers.subject.other_way)
    mapped = {way: [entry for entry in entries if not entry.is_dummy] for way, entries in mapped.items()}
    places = {(entry.index, entry.sub_index) for entries in mapped.values() for entry in entries}
    lengths = {place: bits for place in places if (bits := node.length_of(*place)) is not None}
    own = {answers.subject.pdo: answers.subject.entries for answers in known}
    return ReadDevice(node.node_id, node.title, values, pdos, own, mapped, lengths, node.bus.bitrate)
