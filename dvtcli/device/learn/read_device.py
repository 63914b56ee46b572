"""Read the facts about a learned device that no file gives: standard objects, and lengths of mapped objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from dvtcli.domain.learning.probe_table import OTHER_WAY
from dvtcli.domain.learning.read_dictionary import TO_READ, ReadDevice
from dvtcli.domain.pdo import Direction, Pdo, PdoConfig
from dvtcli.errors import SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.learning.probe_table import KnownAnswers


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
