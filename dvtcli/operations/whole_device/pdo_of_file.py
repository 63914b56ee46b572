"""A PDO as a file about one device wants it on a node: what the file says, else what the node holds.

What the node does not let write stays. Writes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dvtcli.device.described_node import ToldValues
from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.mapping import MAX_ENTRIES
from dvtcli.domain.network.network_plan import LeftOut
from dvtcli.domain.pdo import BY_SUB_INDEX, PdoConfig
from dvtcli.domain.rules.mappable import enables_nothing
from dvtcli.errors import SdoAborted
from dvtcli.operations.whole_device.object_kind import entry_of

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.configuration import Configuration
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.operations.whole_device.held_device import HeldDevice


def pdo_of_file(
    node: Node, held: HeldDevice, known: Configuration, pdo: Pdo, now: PdoConfig, left_out: dict[str, LeftOut]
) -> PdoConfig | None:
    """What *pdo* of *node*, which is *now*, is to be by *held*; None where the file says no whole PDO.

    What may not be written stays, and is told to *left_out* with why.
    """
    wanted = _wanted(node, held, known, pdo, now, left_out)
    if wanted is not None and enables_nothing(now, wanted):
        _leave_out(left_out, pdo.label, "is enabled and maps nothing in the file, as no plan makes it")
        return None
    return wanted


def _wanted(
    node: Node, held: HeldDevice, known: Configuration, pdo: Pdo, now: PdoConfig, left_out: dict[str, LeftOut]
) -> PdoConfig | None:
    """The same, whether it may be enabled or not."""
    said = _said(node, held, pdo)
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
    """Whether *held* says entries, but no count, and some beyond the node's own: told to *left_out*."""
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
    node: Node, known: Configuration, pdo: Pdo, now: PdoConfig, said: PdoConfig, left_out: dict[str, LeftOut]
) -> PdoCommunicationParameter:
    """The parameters that *said* says, where the node has them and lets them be written; else those of *now*."""
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
    """Tell of a part of a PDO that differs and stays."""
    left_out[place] = LeftOut(place, why, remains=True)


def _why_not(known: Configuration, dictionary: ObjectDictionary | None, place: ObjectAddress) -> str:
    why = known.why_not(entry_of(dictionary, place))
    return "" if why is None else str(why)


@dataclass(frozen=True, slots=True)
class _Values(ToldValues):
    """What *held* says of *node*, else what the node holds, behind the same seam as a node."""

    held: HeldDevice
    node: Node

    def told(self, index: int, sub_index: int) -> bytes:
        """What the file says, else what the node does; SdoAborted where that refuses it."""
        place = index, sub_index
        data = self.held.on_node(place, entry_of(self.node.dictionary, place), self.node.node_id)
        return self.node.memory.upload(index, sub_index) if data is None else data
