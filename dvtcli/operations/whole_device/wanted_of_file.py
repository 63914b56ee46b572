"""What a file about one device asks of a node: its PDOs, its values, and what may not be written for a file's sake.

A file is a DCF, an XDC or a backup. Reads the node; writes nothing, and does not judge by the rules.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.read_whole import PAUSE_S
from dvtcli.domain.configuration import Configuration, NotWritten
from dvtcli.domain.network.network_plan import LeftOut
from dvtcli.domain.pdo import Direction, Pdo
from dvtcli.errors import SdoAborted
from dvtcli.files.eds.written_values import same_value
from dvtcli.operations.wanted.resolve_names import NodeWants
from dvtcli.operations.whole_device.included import Included, idle
from dvtcli.operations.whole_device.object_kind import entry_of, is_setting
from dvtcli.operations.whole_device.pdo_of_file import pdo_of_file
from dvtcli.operations.whole_device.read_whole_device import configuration, described

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.pdo import PdoConfig
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.operations.whole_device.held_device import HeldDevice


#: what is not even read to see whether it differs: secrets, programs, what cannot be read or says nothing then
_NOT_READ = frozenset(
    {
        NotWritten.READ_ONLY, NotWritten.WRITE_ONLY, NotWritten.PASSCODE, NotWritten.PROGRAM, NotWritten.REQUEST,
        NotWritten.STORE, NotWritten.ERROR_HISTORY, NotWritten.SDO_CHANNEL,
    }
)  # fmt: skip


@dataclass(slots=True)
class WantedOfFile:
    """What a file wants of a node, *wants*, and what it says and is not written: *left_out*, by object, each with why.

    That is what differs, and what is not read.
    """

    wants: NodeWants = field(default_factory=NodeWants)
    left_out: dict[str, LeftOut] = field(default_factory=dict)
    #: settings that the node holds as the file says, and that nobody would write
    also_equal: dict[ObjectAddress, bytes] = field(default_factory=dict)
    #: what to say of what the user called configuration and by which nothing more is written
    idle: tuple[Hint, ...] = ()

    def __bool__(self) -> bool:
        """Whether anything that the file says was compared."""
        is_other = any(left_out.remains for left_out in self.left_out.values())
        return bool(self.wants.pdos or self.wants.values or self.also_equal or is_other)


def wanted_of_file(
    node: Node, held: HeldDevice, included: Collection[Included] = (), *, names_makers: bool = False
) -> WantedOfFile:
    """What *held* wants of *node*: what it says itself, not what a device comes up with anyway.

    *included* is what the user calls configuration. With *names_makers* the file itself names the maker's own
    objects as configuration that no PDO can map. UsageError where nobody knows which objects the node has.
    """
    if node.dictionary is None and held.dictionary is not None:
        node.describe(held.dictionary)
    dictionary = described(node)
    known = replace(
        configuration(node, dictionary, [inclusion.range for inclusion in included if inclusion.range is not None]),
        included_objects=frozenset(inclusion.object for inclusion in included if inclusion.object is not None),
    )
    named = frozenset(_of_maker(dictionary, held)) if names_makers else frozenset()
    found = WantedOfFile()
    pdos = _pdos(node, held, known, found)
    known = replace(known, named=named, taken=_taken(node, pdos))
    for place, kept in sorted(held.objects.items()):
        if kept.data is not None and place not in held.assumed and Pdo.at(place[0]) is None:
            _value(node, held, known, entry_of(dictionary, place), found)
    _look_again(node, found)
    found.idle = tuple(idle(held, known, included))
    return found


def _of_maker(dictionary: ObjectDictionary, held: HeldDevice) -> Iterator[ObjectAddress]:
    """Objects that the file has a value for and that no PDO takes or sends."""
    for place in held.objects.keys() - held.assumed:
        entry = dictionary.entry(*place)
        if entry is not None and not entry.pdo_mapping:
            yield place


def _pdos(node: Node, held: HeldDevice, known: Configuration, found: WantedOfFile) -> dict[Pdo, PdoConfig]:
    """What each PDO of which the file says anything itself is to be."""
    said = {pdo for place in held.objects.keys() - held.assumed if (pdo := Pdo.at(place[0])) is not None}
    wanted: dict[Pdo, PdoConfig] = {}
    present = set(node.present())
    for pdo in sorted(said, key=lambda wanted_pdo: (not wanted_pdo.is_tpdo, wanted_pdo.number)):
        if pdo not in present:
            found.left_out[pdo.label] = LeftOut(pdo.label, "the node does not have it", remains=True)
            continue
        now = node.observed(partial(node.known_pdo, pdo))
        config = pdo_of_file(node, held, known, pdo, now, found.left_out)
        if config is not None:
            wanted[pdo] = config
    found.wants.pdos.update(wanted)
    return wanted


def _taken(node: Node, wanted: dict[Pdo, PdoConfig]) -> frozenset[ObjectAddress]:
    """What the node's enabled RPDOs take, now or then: process data."""
    rpdos = [pdo for pdo in node.present() if pdo.direction is Direction.RPDO]
    now = node.observed(lambda: [node.known_pdo(pdo) for pdo in rpdos])
    then = (config for pdo, config in wanted.items() if not pdo.is_tpdo)
    return frozenset(
        (entry.index, entry.sub_index)
        for config in (*now, *then)
        if config.enabled
        for entry in config.mapping
        if not entry.is_dummy
    )


def _value(node: Node, held: HeldDevice, known: Configuration, entry: OdEntry, found: WantedOfFile) -> None:
    """Take in what the file says of one object, or why that is not written."""
    place = entry.index, entry.sub_index
    why = known.why_not(entry)
    if why in _NOT_READ:
        found.left_out[entry.object] = LeftOut(entry.object, str(why))
        return
    data = held.on_node(place, entry, node.node_id)
    if data is None:
        return
    try:
        now = node.observed(partial(node.known_value, *place))
    except SdoAborted as aborted:
        text = f"cannot be read: {aborted.text}"
        found.left_out[entry.object] = LeftOut(entry.object, text, is_setting(why), said=data)
        return
    is_same = same_value(entry.data_type, data, now)
    if why is None:
        found.wants.values[place] = now if is_same else data
        found.wants.reasons[place] = _name(node, place)
    elif is_same and is_setting(why):
        found.also_equal[place] = now
    elif not is_same:
        found.left_out[entry.object] = LeftOut(entry.object, str(why), is_setting(why), now, data)


def _look_again(node: Node, found: WantedOfFile) -> None:
    """What is otherwise and is not written may be what changes by itself: look once more."""
    suspects = [left_out for left_out in found.left_out.values() if left_out.remains and left_out.held is not None]
    if suspects:
        node.bus.sleep(PAUSE_S)
    for suspect in suspects:
        index, _, sub_index = suspect.object.partition(":")
        now = node.observed(partial(node.upload, int(index, 16), int(sub_index, 16)))
        if now != suspect.held:
            found.left_out[suspect.object] = replace(suspect, why="changes by itself", remains=False, held=now)


def _name(node: Node, place: ObjectAddress) -> str:
    return (node.dictionary.display_name(*place) if node.dictionary else "") or "write"
