"""A node as a network file says what its manager downloads to it (CiA 302-3, 0x1F22). Knows no manager, reads no node.

What the downloads say is in the file; what they do not say is absent. What a file cannot say is named.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from dvtcli.device.store_parameters import SIGNATURES
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.mapping import MAX_ENTRIES, MAX_PDO_BITS, PdoMappingEntry
from dvtcli.domain.network.concise_dcf import ConciseEntry
from dvtcli.domain.network.wanted_state import FileWord, HeartbeatWatch, NodeWish, ObjectWish, PdoWish, ValueWish
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import STAMP
from dvtcli.files.network.network_keys import OF, Where
from dvtcli.operations.exchange.exported_pdos import Exported, NamedNode, mapped_word, title_word
from dvtcli.operations.exchange.sdo_value import value_word

Place = tuple[int, int]
_BEHAVIOUR, _CONSUMER = 0x1029, 0x1016
#: what is downloaded before PDOs, in either way of making the downloads
_FIRST = (0x1017, _BEHAVIOUR)


@dataclass(slots=True)
class _Left:
    """What is downloaded to a node, in its order; each is taken out as it is said. *unsaid*: what never is, and why."""

    data: dict[Place, bytes]
    unsaid: dict[Place, str] = field(default_factory=dict)

    def number(self, index: int, sub_index: int, size: int) -> int | None:
        """A number of *size* bytes; None where it is not downloaded, or is of another size."""
        data = self.data.get((index, sub_index))
        if data is None or len(data) != size:
            return None
        del self.data[index, sub_index]
        return int.from_bytes(data, "little")


def node_from_frames(device: NamedNode, downloads: Sequence[ConciseEntry]) -> tuple[Exported, tuple[str, ...]]:
    """*device* as its *downloads* make it, in the order in which these are; and, in words, what a file cannot say.

    A stamp (0x1020) is `stamp: true`: that of a file stands for what the file says. A file has one value an object:
    of several downloads to one the last, and that there are more is among what it cannot say.
    """
    left = _Left({(download.index, download.sub_index): download.data for download in downloads})
    remarks: dict[str, str] = {}
    stamped = {left.data.pop((STAMP, sub_index), None) for sub_index in (1, 2)} != {None}
    pdos = sorted({pdo for index, _ in left.data if (pdo := Pdo.at(index)) is not None}, key=_order)
    wishes = tuple(_pdo(device, pdo, left, remarks) for pdo in pdos)
    watches = _watches(left)
    wish = NodeWish(
        title_word(device), device.node_id,
        pdos=tuple(pdo_wish for pdo_wish in wishes if pdo_wish != PdoWish(pdo_wish.pdo)),
        objects=tuple(_objects(left)), values=tuple(_values(device, left, remarks)), watches=watches,
        store=True if stamped else None, stamp=True if stamped else None,
    )  # fmt: skip
    left.unsaid |= dict.fromkeys(left.data, "no key of a PDO says it")
    left.unsaid = _repeated(downloads) | left.unsaid
    unsaid = tuple(f"{index:04X}:{sub_index:02X} ({why})" for (index, sub_index), why in sorted(left.unsaid.items()))
    own = {(device.node_id, word): text for word, text in remarks.items()}
    return Exported(wish, own, tuple(text.partition(" ")[0] for text in unsaid)), unsaid


def _repeated(downloads: Sequence[ConciseEntry]) -> dict[Place, str]:
    """What is downloaded more than once, as to unlock or to select: each may do something, and a file says the last.

    Not those of PDOs, which are off, and map nothing, while they are set; nor a stamp.
    """
    counts = Counter((download.index, download.sub_index) for download in downloads)
    return {
        place: f"downloaded {count} times, the file has the last"
        for place, count in counts.items()
        if count > 1 and place[0] != STAMP and Pdo.at(place[0]) is None
    }


def _order(pdo: Pdo) -> tuple[bool, int]:
    return (not pdo.is_tpdo, pdo.number)


def _pdo(device: NamedNode, pdo: Pdo, left: _Left, remarks: dict[str, str]) -> PdoWish:
    at = pdo.communication_index
    raw = left.number(at, 1, 4)
    cob_id = None if raw is None else CobId.from_raw(raw)
    if cob_id is not None and cob_id.valid and not cob_id.can_id:
        left.unsaid[at, 1] = f"0x{raw:08X}: a PDO that is on has no CAN-ID 0"
        cob_id = None
    named = cob_id is not None and bool(cob_id.can_id)  # a COB-ID of 0 that is off is no CAN-ID
    return PdoWish(
        pdo,
        enabled=None if cob_id is None else cob_id.valid,
        cob_id=cob_id.can_id if cob_id is not None and named else None,
        extended=cob_id is not None and named and cob_id.extended,
        rtr_allowed=None if cob_id is None else cob_id.rtr_allowed,
        transmission_type=left.number(at, 2, 1),
        inhibit_time=left.number(at, 3, 2) if pdo.is_tpdo else None,
        event_timer=left.number(at, 5, 2),
        sync_start_value=left.number(at, 6, 1) if pdo.is_tpdo else None,
        mapping=_mapping(device, pdo, left, remarks),
    )


def _mapping(device: NamedNode, pdo: Pdo, left: _Left, remarks: dict[str, str]) -> tuple[FileWord, ...] | None:
    """All that is mapped; None where the downloads do not say all of it, or as no file can."""
    at = pdo.mapping_index
    count = left.data.get((at, 0))
    if count is None or len(count) != 1 or count[0] > MAX_ENTRIES:
        return None
    raws = [left.data.get((at, sub_index), b"") for sub_index in range(1, count[0] + 1)]
    entries = [PdoMappingEntry.from_raw(int.from_bytes(raw, "little")) for raw in raws if len(raw) == 4]
    if len(entries) != count[0] or not all(1 <= entry.bits <= MAX_PDO_BITS for entry in entries):
        return None
    for sub_index in range(count[0] + 1):
        del left.data[at, sub_index]
    return tuple(mapped_word(device, entry, remarks) for entry in entries)


def _watches(left: _Left) -> tuple[HeartbeatWatch, ...]:
    """The entries of 0x1016, where they are the last downloads, and as `heartbeat_consumer` makes them in a new node.

    That is from sub-index 1 on, in order of the producers. Others stay what they are.
    """
    places = [place for place in left.data if place[0] == _CONSUMER]
    last = list(left.data)[len(left.data) - len(places) :]
    numbers = [int.from_bytes(left.data[place], "little") for place in places]
    producers = [number >> 16 for number in numbers]
    in_order = [sub_index for _, sub_index in places] == list(range(1, len(places) + 1)) and last == places
    if not in_order or producers != sorted({producer for producer in producers if 1 <= producer <= 127}):
        return ()
    if not all(number & 0xFFFF for number in numbers):
        return ()
    for place in places:
        del left.data[place]
    return tuple(HeartbeatWatch(number >> 16, number & 0xFFFF) for number in numbers)


def _objects(left: _Left) -> list[ObjectWish]:
    """What keys of a node say: of those behind the PDOs the first ones, as far as they are in the order of a file."""
    keys = {key.object[:2]: (key.name, key.object[2]) for key in OF[Where.NODE].values() if key.object is not None}
    found: list[ObjectWish] = []
    for place in [place for place in left.data if Pdo.at(place[0]) is None]:
        name, size = ("error_behavior", 1) if place[0] == _BEHAVIOUR and place[1] else keys.get(place, ("", 0))
        is_next = place[0] in _FIRST or all(wish.index < place[0] for wish in found if wish.index not in _FIRST)
        if len(left.data[place]) != size or not is_next:
            break
        found.append(ObjectWish(name, *place, left.data.pop(place)))
    return sorted(found, key=lambda entry: (entry.index, entry.sub_index))


def _values(device: NamedNode, left: _Left, remarks: dict[str, str]) -> list[ValueWish]:
    """What is left besides PDOs, as `sdo:` has it."""
    found: list[ValueWish] = []
    for place in [place for place in left.data if Pdo.at(place[0]) is None]:
        data, word = left.data.pop(place), f"{place[0]:04X}:{place[1]:02X}"
        if place[0] in SIGNATURES:
            left.unsaid[place] = "a command"
            continue
        text, why = value_word(device.dictionary, place, data)
        if text is None:
            left.unsaid[place] = why
            continue
        if device.dictionary is not None:
            remarks[word] = device.dictionary.display_name(*place)
        found.append(ValueWish(FileWord(word), FileWord(text)))
    return found
