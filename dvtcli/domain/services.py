"""CAN-IDs of a node's services besides its PDOs: SYNC, EMCY, TIME, SDO channels, SRDOs. Pure."""

from __future__ import annotations

from collections.abc import Mapping

#: The parameters of SDO servers after the default one, and of SDO clients (CiA 301, 7.4.1).
SDO_SERVERS, SDO_CLIENTS = range(0x1201, 0x1280), range(0x1280, 0x1300)
#: Places of the COB-IDs of further SDO servers and clients.
SDO_CHANNEL_INDICES = range(SDO_SERVERS.start, SDO_CLIENTS.stop)
#: Communication parameters of SRDOs (EN 50325-5), and in each the direction, 0 for none, and both COB-IDs.
SRDOS, SRDO_DIRECTION, SRDO_COB_IDS = range(0x1301, 0x1341), 1, (5, 6)
#: Default CAN-ID of SYNC, with 11 bits (CiA 301, 7.5.2.5).
SYNC_BY_DEFAULT = (0x080, False)
_FRAME = 1 << 29
#: Bit 30 of 0x1005 and 0x1012: the node produces it; bit 31 of 0x1014 and of SDO channels: disabled.
PRODUCES, OFF = 1 << 30, 1 << 31


def is_channel_place(index: int, sub_index: int) -> bool:
    """Whether a further SDO channel or an SRDO has its COB-ID, or its direction, at *index*:*sub_index*."""
    if index in SRDOS:
        return sub_index == SRDO_DIRECTION or sub_index in SRDO_COB_IDS
    return index in SDO_CHANNEL_INDICES and sub_index in (1, 2)


def taken_by_services(
    node_id: int,
    sync: int | None,
    emcy: int | None,
    channels: Mapping[tuple[int, int], int],
    time: int | None = None,
) -> dict[tuple[int, bool], str]:
    """CAN-IDs in use, and whether they have 29 bits, each with its use; all but *node_id* are raw COB-IDs.

    *sync* is None if the node has no 0x1005, *emcy* if it has no 0x1014: the standard's defaults count. *time* (0x1012)
    occupies a CAN-ID if the node sends the time stamp.
    """
    found = taken_by_channels(node_id, channels) | _taken_by_time(time)
    if emcy is None:
        found[0x080 + node_id, False] = "this node's EMCY by default"
    elif not emcy & OFF:
        found[_identifier(emcy)] = "this node's EMCY"
    found[SYNC_BY_DEFAULT if sync is None else _identifier(sync)] = "SYNC"
    return found


def taken_on_another(
    node_id: int,
    sync: int | None,
    emcy: int | None,
    channels: Mapping[tuple[int, int], int],
    time: int | None = None,
) -> dict[tuple[int, bool], str]:
    """CAN-IDs in use by another node; unreadable values occupy nothing."""
    found = taken_by_channels(node_id, channels) | _taken_by_time(time)
    if emcy is not None and not emcy & OFF:
        found[_identifier(emcy)] = f"EMCY of node {node_id}"
    if sync is not None:
        found[_identifier(sync)] = "SYNC"
    return found


def _taken_by_time(time: int | None) -> dict[tuple[int, bool], str]:
    return {} if time is None or not time & PRODUCES else {_identifier(time): "TIME"}


def taken_by_channels(node_id: int, channels: Mapping[tuple[int, int], int]) -> dict[tuple[int, bool], str]:
    """CAN-IDs of further SDO servers and clients, and of SRDOs, with COB-IDs *channels*; a disabled one has none."""
    found: dict[tuple[int, bool], str] = {}
    for (index, sub_index), raw in channels.items():
        if index in SRDOS:
            if sub_index in SRDO_COB_IDS and raw and channels.get((index, SRDO_DIRECTION), 1):
                number = index - SRDOS.start + 1
                found[_identifier(raw)] = f"SRDO{number} of node {node_id} ({index:04X}:{sub_index:02X})"
        elif not raw & OFF and not channels.get((index, 3 - sub_index), 0) & OFF:
            what = "server" if index in SDO_SERVERS else "client"
            found[_identifier(raw)] = f"an SDO {what} of node {node_id} ({index:04X}:{sub_index:02X})"
    return found


def _identifier(raw: int) -> tuple[int, bool]:
    extended = bool(raw & _FRAME)
    return raw & (0x1FFF_FFFF if extended else 0x7FF), extended
