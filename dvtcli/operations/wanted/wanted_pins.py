"""What `vpdo` of a network file means on a node: what each named pin holds, and how many are active.

Complains where it means nothing there. Judges no value, and writes nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.virtual_pdos import read_pins
from dvtcli.domain.several import join_some
from dvtcli.errors import UsageError
from dvtcli.operations.pdos.virtual_pdo_ties import object_index, tied_name

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.network.wanted_state import Mark, PinWish
    from dvtcli.domain.vpdo import Pins
    from dvtcli.files.network.file_log import FileLog


class WantedValue(NamedTuple):
    """Bytes that the object at *place* should hold, why in words, and where the file says so."""

    place: tuple[int, int]
    data: bytes
    reason: str
    mark: Mark


def wanted_pins(node: Node, wishes: Iterable[PinWish], log: FileLog) -> Iterator[WantedValue]:
    """The objects of virtual PDOs as *wishes* want them, pins before the number of active ones."""
    for name, group in groupby(wishes, key=lambda wish: wish.group):
        pins = list(group)
        if name in node.profile.vpdo:
            yield from _group(node, read_pins(node, name), pins, log)
        else:
            have = join_some(node.profile.vpdo) or "no virtual PDOs"
            log.complain(pins[0].mark, f"node {node.node_id} ({node.profile.title}) has no {name!r}, but {have}")


def _group(node: Node, held: Pins, wishes: list[PinWish], log: FileLog) -> Iterator[WantedValue]:
    ties: dict[int, int] = {}
    for wish in wishes:
        index = held.group.none if wish.object is None else _index(node, wish, log)
        if wish.pin > len(held.values):
            have = f"it has 1…{len(held.values)}" if held.values else "it has none"
            log.complain(wish.mark, f"node {node.node_id} has no {held.name} pin {wish.pin}: {have}")
        elif index is not None:
            ties[wish.pin] = index
    marks = {wish.pin: wish.mark for wish in wishes}
    for sub_index, value in held.with_ties(ties).items() if ties else ():
        data = value.to_bytes(2 if sub_index else 1, "little")
        reason = held.said(sub_index, value, tied_name(node, value))
        yield WantedValue((held.group.index, sub_index), data, reason, marks.get(sub_index, wishes[0].mark))


def _index(node: Node, wish: PinWish, log: FileLog) -> int | None:
    word = wish.object
    try:
        return None if word is None else object_index(node, word.text)
    except UsageError as wrong:
        log.complain(
            wish.mark if word is None else word.mark,
            f"{wrong.text}; {wrong.hint}" if isinstance(wrong.hint, str) else wrong.text,
        )
        return None
