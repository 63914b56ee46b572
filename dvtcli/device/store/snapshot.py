"""The stored part of a node's values: PDOs and single objects written by dvtcli. Writes nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.process_data import is_no_setting
from dvtcli.device.read_pdos import UNREADABLE
from dvtcli.device.store.pending import GROUPS
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Plan, ValueChange
from dvtcli.domain.profile import ObjectAddress
from dvtcli.domain.rules.raw_write import why_unreadable
from dvtcli.domain.text import join_some
from dvtcli.errors import InputFileError, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node import Node


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A node's PDOs, and the single objects written by this session or an earlier session.

    *unread* are objects temporarily unreadable, each with the reason; *notes* describe other omissions.
    """

    pdos: Mapping[Pdo, PdoConfig]
    values: Mapping[ObjectAddress, bytes]
    notes: tuple[str, ...] = ()
    unread: Mapping[ObjectAddress, str] = field(default_factory=dict)

    @classmethod
    def now(cls, node: Node) -> Snapshot:
        """Read the node, without write-only objects and objects that move the machine."""
        written, notes = _written(node)
        values: dict[ObjectAddress, bytes] = {}
        unread: dict[ObjectAddress, str] = {}
        commands = [place for place in written if is_no_setting(node, place)]
        for place in (place for place in written if place not in commands):
            try:
                values[place] = node.sdo.upload(*place)
            except SdoAborted as aborted:
                if aborted.code in UNREADABLE:
                    notes += (f"not compared: {aborted.text}",)
                else:
                    unread[place] = aborted.text
        if commands:
            names = join_some(f"0x{index:04X}:{sub:02X}" for index, sub in commands)
            notes += (f"not compared: {names}, since a command or a target is not a setting",)
        blind = [f"0x{index:04X}:{sub:02X} {why_unreadable(index)}" for index, sub in node.unreadable_values]
        notes += (f"not compared: {join_some(blind)}",) if blind else ()
        return cls(node.pdos(), values, notes, unread)

    def of_group(self, sub_index: int) -> dict[ObjectAddress, bytes]:
        """The objects covered by group *sub_index* of 0x1010 or 0x1011; empty for a manufacturer group."""
        return {place: value for place, value in self.values.items() if _is_in(place, sub_index)}

    def unread_of_group(self, sub_index: int) -> str:
        """The unreadable objects of the group with their reasons; empty if all were read."""
        return join_some(text for place, text in self.unread.items() if _is_in(place, sub_index))


def _is_in(place: ObjectAddress, sub_index: int) -> bool:
    low, high = GROUPS.get(sub_index, (1, 0))
    return low <= place[0] <= high


def _written(node: Node) -> tuple[list[ObjectAddress], tuple[str, ...]]:
    """The single objects written by any process, and messages if the list may be incomplete."""
    places, notes = dict.fromkeys(node.wanted_values), ()
    if node.guard is None:
        return list(places), notes
    try:
        history = node.guard.history.all_of(node.node_id, node.identity())
    except InputFileError as damaged:
        return list(places), (f"objects that an earlier command wrote are not compared: {damaged.text}",)
    for entry in history:
        places |= dict.fromkeys(_values_of(entry.plan, node.saves))
    return list(places), notes


def _values_of(plan: Plan, saves: Callable[[ObjectAddress], bool]) -> Iterator[ObjectAddress]:
    for change in plan.changes:
        if isinstance(change, ValueChange) and change.step.before is not None:
            place = (change.step.index, change.step.sub_index)
            if Pdo.at(place[0]) is None and not saves(place):
                yield place
