"""Reading a node's PDOs as they are.

Reads raw words and takes them apart. Does not judge them, and does not need an EDS.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from dvtcli.domain.abort import Abort
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.mapping import MAX_ENTRIES, PdoMappingEntry
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import MAX_PDO_NUMBER, Direction, Pdo, PdoCommunicationParameter, PdoConfig, is_mpdo
from dvtcli.domain.ports import SdoTransport
from dvtcli.errors import SdoAborted, SdoProtocolError

#: Answers that mean "this device has no such object": devices choose freely among them.
ABSENT = frozenset({Abort.NO_OBJECT, Abort.NO_SUB_INDEX})
IDENTITY = 0x1018
#: Without an EDS every PDO up to this number is asked for; beyond it the first gap ends the search.
ALWAYS_PROBED = 4


def read_number(sdo: SdoTransport, index: int, sub_index: int, size: int) -> int:
    """Read an unsigned number of *size* bytes; SdoProtocolError where the device sends none or more."""
    data = sdo.upload(index, sub_index)
    if not data or any(data[size:]):
        raise SdoProtocolError(
            f"0x{index:04X}:{sub_index:02X} answered {len(data)} bytes ({data[:8].hex(' ')}), expected {size}",
            place=f"{index:04X}:{sub_index:02X}",
        )
    return int.from_bytes(data[:size], "little")


def read_optional(sdo: SdoTransport, index: int, sub_index: int, size: int) -> int | None:
    """Read a number that a device need not have; None where it has none."""
    try:
        return read_number(sdo, index, sub_index, size)
    except SdoAborted as aborted:
        if aborted.code in ABSENT:
            return None
        raise


def read_identity(sdo: SdoTransport, sub_index: int) -> int | None:
    """Read a part of the identity (0x1018); None where the device refuses it, for whatever reason it gives."""
    try:
        return read_number(sdo, IDENTITY, sub_index, 4)
    except SdoAborted:
        return None


def learnt_lengths(
    entries: Iterable[PdoMappingEntry], length_of: Callable[[int, int], int | None]
) -> dict[tuple[int, int], int]:
    """Lengths in bits of mapped objects that no file describes, as *length_of* learns them; those that it can."""
    places = [(entry.index, entry.sub_index) for entry in entries if not entry.is_dummy]
    return {place: bits for place in places if (bits := length_of(*place)) is not None}


def service_can_ids(sdo: SdoTransport) -> tuple[int, int | None]:
    """CAN-IDs of SYNC and of the node's EMCY as 0x1005 and 0x1014 say, else the defaults."""
    sync, emcy = read_optional(sdo, 0x1005, 0, 4), read_optional(sdo, 0x1014, 0, 4)
    return 0x080 if sync is None else sync & 0x7FF, None if emcy is None else emcy & 0x7FF


def read_pdo(sdo: SdoTransport, pdo: Pdo) -> PdoConfig:
    """Read what *pdo* is set to: communication parameter and active mapping.

    Sub-index 4 is never touched; sub-indices 2, 3, 5 and 6 are each optional (CiA 301, 7.5.2.35/37). Entries
    are read up to the count only, since what lies behind is filler.
    """
    index = pdo.communication_index
    communication = PdoCommunicationParameter(
        cob_id=CobId.from_raw(read_number(sdo, index, 1, 4)),
        transmission_type=read_optional(sdo, index, 2, 1),
        inhibit_time=read_optional(sdo, index, 3, 2),
        event_timer=read_optional(sdo, index, 5, 2),
        sync_start_value=read_optional(sdo, index, 6, 1) if pdo.is_tpdo else None,
    )
    count = read_number(sdo, pdo.mapping_index, 0, 1)
    if is_mpdo(count):
        return PdoConfig(communication, (), mpdo=count)
    if count > MAX_ENTRIES:
        place = f"{pdo.mapping_index:04X}:00"
        raise SdoProtocolError(f"0x{place} says {count} mapped objects; a PDO has 0..{MAX_ENTRIES}", place=place)
    words = [read_number(sdo, pdo.mapping_index, number, 4) for number in range(1, count + 1)]
    return PdoConfig(communication, tuple(PdoMappingEntry.from_raw(word) for word in words))


def present_pdos(sdo: SdoTransport, dictionary: ObjectDictionary | None) -> list[Pdo]:
    """The PDOs the node has, TPDOs first: the EDS's, or what the node answers for where there is none."""
    if dictionary is None:
        return [pdo for direction in (Direction.TPDO, Direction.RPDO) for pdo in _probe(sdo, direction)]
    listed = {pdo for pdo in map(Pdo.at, dictionary) if pdo is not None}
    complete = [pdo for pdo in listed if {pdo.communication_index, pdo.mapping_index} <= dictionary.keys()]
    return sorted(complete, key=lambda pdo: (not pdo.is_tpdo, pdo.number))


def _probe(sdo: SdoTransport, direction: Direction) -> Iterator[Pdo]:
    for number in range(1, MAX_PDO_NUMBER + 1):
        pdo = Pdo(direction, number)
        if exists(sdo, pdo):
            yield pdo
        elif number > ALWAYS_PROBED:
            return


def exists(sdo: SdoTransport, pdo: Pdo) -> bool:
    """Whether the node has *pdo*, by asking for its COB-ID."""
    return read_optional(sdo, pdo.communication_index, 1, 4) is not None
