"""Compute the wishes of a device's file for a node: PDOs, values, objects not to be written.

A file is a DCF, an XDC or a backup. Reads the node, writes nothing, applies no rules.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.described_node import ToldValues
from dvtcli.device.read_pdos import read_pdo
from dvtcli.device.read_whole import PAUSE_S
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.configuration import Configuration, NotWritten
from dvtcli.domain.mapping import MAX_ENTRIES
from dvtcli.domain.network.network_plan import LeftOut
from dvtcli.domain.pdo import BY_SUB_INDEX, Direction, Pdo, PdoConfig
from dvtcli.domain.rules.mappable import enables_nothing
from dvtcli.errors import SdoAborted
from dvtcli.files.eds.written_values import same_value
from dvtcli.operations.wanted.resolve_names import NodeWants
from dvtcli.operations.whole_device.included import Included, entry_of, idle, is_setting
from dvtcli.operations.whole_device.read_whole_device import configuration, described

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.pdo import PdoCommunicationParameter
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.operations.whole_device.held_device import HeldDevice


def pdo_of_file(
    node: Node, held: HeldDevice, known: Configuration, pdo: Pdo, now: PdoConfig, left_out: dict[str, LeftOut]
) -> PdoConfig | None:
    """Compute the wanted *pdo* of *node* from *held* and its state *now*; None if incomplete in the file.

    Unwritable parameters stay, with the reason in *left_out*.
    """
    wanted = _wanted(node, held, known, pdo, now, left_out)
    if wanted is not None and enables_nothing(now, wanted):
        _leave_out(left_out, pdo.label, "is enabled and maps nothing in the file, as no plan makes it")
        return None
    return wanted


def _wanted(
    node: Node, held: HeldDevice, known: Configuration, pdo: Pdo, now: PdoConfig, left_out: dict[str, LeftOut]
) -> PdoConfig | None:
    """Compute the wanted PDO, whether enabling is allowed or not."""
    said = _said(node, held, pdo)
    if said is not None and said.mpdo is not None and (said.mpdo, said.multiplexed) == (now.mpdo, now.multiplexed):
        return replace(now, communication=_communication(node, known, pdo, now, said, left_out))
    if said is None or said.mpdo is not None or said.held_count is not None:
        if said != now:
            _leave_out(left_out, pdo.label, "is no whole PDO in the file, or multiplexed")
        return None
    is_part = _tell_beyond(held, pdo, said, left_out) or any(not entry.index for entry in said.mapping)
    if is_part and said.mapping != now.mapping:
        _leave_out(left_out, f"{pdo.mapping_index:04X}:00", "the file does not say all that it maps")
    if is_part:
        return replace(now, communication=_communication(node, known, pdo, now, said, left_out))
    wanted = replace(now, communication=_communication(node, known, pdo, now, said, left_out))
    if not said.has_mapping or (said.mapping == now.mapping and not _has_odd_mapping(now)):
        return wanted
    if why := _why_not(known, node.dictionary, (pdo.mapping_index, 0)):
        _leave_out(left_out, f"{pdo.mapping_index:04X}:00", why)
        return wanted
    return PdoConfig(wanted.communication, said.mapping, unread=now.lacking)


def _said(node: Node, held: HeldDevice, pdo: Pdo) -> PdoConfig | None:
    try:
        return read_pdo(_Values(held, node), pdo)
    except SdoAborted:
        return None


def _tell_beyond(held: HeldDevice, pdo: Pdo, said: PdoConfig, left_out: dict[str, LeftOut]) -> bool:
    """Tell whether *held* has entries without a count, some beyond the node's own: recorded in *left_out*."""
    index = pdo.mapping_index
    if not said.has_mapping or held.says((index, 0)):
        return False
    why = f"is beyond the node's count ({said.count}), and the file says none ({index:04X}:00): it is not mapped"
    beyond = [sub for sub in range(said.count + 1, MAX_ENTRIES + 1) if held.maps((index, sub))]
    for sub_index in beyond:
        _leave_out(left_out, f"{index:04X}:{sub_index:02X}", why)
    return bool(beyond)


def _has_odd_mapping(now: PdoConfig) -> bool:
    return now.mpdo is not None or now.held_count is not None


def _communication(
    node: NodeDescription, known: Configuration, pdo: Pdo, now: PdoConfig, said: PdoConfig, left_out: dict[str, LeftOut]
) -> PdoCommunicationParameter:
    """Take parameters of *said* that the node has and lets be written, else those of *now*."""
    wanted = now.communication
    for sub_index, name in BY_SUB_INDEX.items():
        value, place = getattr(said.communication, name), (pdo.communication_index, sub_index)
        if value in (None, getattr(wanted, name)) or (name == "cob_id" and not said.has_cob_id):
            continue
        if name == "cob_id" and not value.raw:
            value = CobId(0, valid=False)  # CAN-ID 0x000 is NMT: the file tells no COB-ID
        if why := _why_not(known, node.dictionary, place):
            _leave_out(left_out, f"{place[0]:04X}:{place[1]:02X}", why)
        else:
            wanted = replace(wanted, **{name: value})
    return wanted


def _leave_out(left_out: dict[str, LeftOut], place: str, why: str) -> None:
    """Record a differing parameter that stays."""
    left_out[place] = LeftOut(place, why, remains=True)


def _why_not(known: Configuration, dictionary: ObjectDictionary | None, place: ObjectAddress) -> str:
    why = known.why_not(entry_of(dictionary, place))
    return "" if why is None else str(why)


@dataclass(frozen=True, slots=True)
class _Values(ToldValues):
    """The values of *held*, else of the node, readable like a node."""

    held: HeldDevice
    node: Node

    def told(self, index: int, sub_index: int) -> bytes:
        """Return the file's value, else the node's; raises SdoAborted if the node refuses."""
        place = index, sub_index
        data = self.held.on_node(place, entry_of(self.node.dictionary, place), self.node.node_id)
        return self.node.memory.upload(index, sub_index) if data is None else data


#: reasons not even to read an object: secrets, programs, unreadable or meaningless values
_NOT_READ = frozenset(
    {
        NotWritten.READ_ONLY, NotWritten.WRITE_ONLY, NotWritten.PASSCODE, NotWritten.PROGRAM, NotWritten.REQUEST,
        NotWritten.STORE, NotWritten.ERROR_HISTORY, NotWritten.SDO_CHANNEL,
    }
)  # fmt: skip


@dataclass(slots=True)
class WantedOfFile:
    """The wishes of a file for a node (*wants*), and values not written (*left_out*, by object, with reasons).

    Left out are differing values and unreadable ones.
    """

    wants: NodeWants = field(default_factory=NodeWants)
    left_out: dict[str, LeftOut] = field(default_factory=dict)
    #: settings of the file that the node holds already, and that need no write
    also_equal: dict[ObjectAddress, bytes] = field(default_factory=dict)
    #: messages about included objects without effect
    idle: tuple[Hint, ...] = ()

    def __bool__(self) -> bool:
        """Tell whether any value of the file was compared."""
        is_other = any(left_out.remains for left_out in self.left_out.values())
        return bool(self.wants.pdos or self.wants.values or self.also_equal or is_other)


def wanted_of_file(
    node: Node, held: HeldDevice, included: Collection[Included] = (), *, names_makers: bool = False
) -> WantedOfFile:
    """Compute the wishes of *held* for *node*: the file's own values, not defaults.

    *included* is configuration by the user's choice. *names_makers*: the file itself includes the maker's objects that
    no PDO can map. Raises UsageError if the node's objects are unknown.
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
    """Yield objects with a value in the file that no PDO receives or transmits."""
    for place in held.objects.keys() - held.assumed:
        entry = dictionary.entry(*place)
        if entry is not None and not entry.pdo_mapping:
            yield place


def _pdos(node: Node, held: HeldDevice, known: Configuration, found: WantedOfFile) -> dict[Pdo, PdoConfig]:
    """Compute the wanted PDOs of the file."""
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


def _taken(node: ReadableNode, wanted: dict[Pdo, PdoConfig]) -> frozenset[ObjectAddress]:
    """Return process data: objects that enabled RPDOs of the node receive, now or later."""
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


def _value(node: ReadableNode, held: HeldDevice, known: Configuration, entry: OdEntry, found: WantedOfFile) -> None:
    """Add the file's value of an object, or the reason for leaving it out."""
    place = entry.index, entry.sub_index
    why = known.why_not(entry)
    is_write_only = why is NotWritten.WRITE_ONLY and known.why_not_unread(entry) is None
    if why in _NOT_READ and not is_write_only:
        found.left_out[entry.object] = LeftOut(entry.object, str(why))
        return
    data = held.on_node(place, entry, node.node_id)
    if data is None:
        return
    if is_write_only:
        found.wants.values[place] = data
        found.wants.reasons[place] = _name(node, place)
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


def _look_again(node: ReadableNode, found: WantedOfFile) -> None:
    """Read differing unwritten objects again: they may change by themselves."""
    suspects = [left_out for left_out in found.left_out.values() if left_out.remains and left_out.held is not None]
    if suspects:
        node.bus.sleep(PAUSE_S)
    for suspect in suspects:
        index, _, sub_index = suspect.object.partition(":")
        now = node.observed(partial(node.upload, int(index, 16), int(sub_index, 16)))
        if now != suspect.held:
            found.left_out[suspect.object] = replace(suspect, why="changes by itself", remains=False, held=now)


def _name(node: NodeDescription, place: ObjectAddress) -> str:
    return (node.dictionary.display_name(*place) if node.dictionary else "") or "write"
