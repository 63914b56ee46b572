"""Length of a CAN frame on the wire in bits: exact, minimum and maximum.

Pure arithmetic of classical CAN (ISO 11898-1): headers, CRC-15, stuff bits.
"""

from __future__ import annotations

from functools import cache, lru_cache

_CRC_15 = 0x4599
#: CRC delimiter, acknowledge and its delimiter, seven end-of-frame bits: never stuffed
TRAILER = 10
#: interframe space: recessive bits between two frames
INTERFRAME = 3
#: padding bits before the start of frame: they end in 1, like an idle bus, and need no stuffing
_FILL = 0b01010101
_CRC_BITS = 15


@cache
def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        crc = byte << 7
        for _ in range(8):
            crc = (crc << 1) ^ (_CRC_15 if crc & 0x4000 else 0)
        table.append(crc & 0x7FFF)
    return tuple(table)


@cache
def _stuff_table() -> tuple[tuple[int, int], ...]:
    """State after a byte and its stuff bits, for each state (last bit, number of equal bits) and byte.

    A state is `bit * 4 + equal - 1`; the table's index is `state * 256 + byte`.
    """
    table = []
    for state in range(8):
        for byte in range(256):
            last, equal, stuffed = state >> 2, (state & 3) + 1, 0
            for place in range(7, -1, -1):
                bit = byte >> place & 1
                last, equal = bit, equal + 1 if bit == last else 1
                if equal == 5:
                    last, equal, stuffed = 1 - bit, 1, stuffed + 1
            table.append((last << 2 | equal - 1, stuffed))
    return tuple(table)


_IDLE = 0b100


def frame_bits(can_id: int, data: bytes = b"", extended: bool = False, remote: bool = False) -> int:
    """Bits of a frame on the wire: its own, its stuff bits, and the 3 bits of interframe space.

    *can_id* has 11 bits, or 29 if *extended*; *data* has 0..8 bytes. A *remote* frame carries the length of
    *data* and no data.
    """
    sent = b"" if remote else data
    state, bits, crc = _head(can_id, len(data), extended, remote, len(sent))
    state, stuffed, crc_of_data = _body(state, sent)
    crc ^= crc_of_data
    table = _stuff_table()
    # A bit unlike the last one fills the CRC's second byte: no stuff bit follows it.
    state, stuffed_first = table[state << 8 | crc >> 7]
    return bits + stuffed + stuffed_first + table[state << 8 | (crc << 1 & 0xFE | ~crc & 1)][1]


@lru_cache(maxsize=4096)
def _head(can_id: int, length: int, extended: bool, remote: bool, sent: int) -> tuple[int, int, int]:
    """State after the control field, bits of a frame with *sent* bytes as far as known, CRC with data of 0.

    A bus repeats CAN-IDs and data: each is counted once, as the CRC is the XOR of the CRCs of its parts.
    """
    content, bits = header(can_id, length, extended, remote)
    fill, crc = -bits % 8, 0
    stuff_table, crc_table = _stuff_table(), _crc_table()
    state, total = _IDLE, bits + 8 * sent + _CRC_BITS + TRAILER + INTERFRAME
    for byte in ((_FILL & (1 << fill) - 1) << bits | content).to_bytes((bits + fill) // 8, "big"):
        state, stuffed = stuff_table[state << 8 | byte]
        total += stuffed
    for byte in content.to_bytes((bits + 7) // 8, "big") + bytes(sent):  # leading zeros do not change a CRC
        crc = (crc << 8 & 0x7FFF) ^ crc_table[crc >> 7 ^ byte]
    return state, total, crc


@lru_cache(maxsize=4096)
def _body(state: int, data: bytes) -> tuple[int, int, int]:
    """State after *data*, its stuff bits from *state* on, and its own CRC."""
    total = crc = 0
    stuff_table, crc_table = _stuff_table(), _crc_table()
    for byte in data:
        state, stuffed = stuff_table[state << 8 | byte]
        total += stuffed
        crc = (crc << 8 & 0x7FFF) ^ crc_table[crc >> 7 ^ byte]
    return state, total, crc


def most_frame_bits(data_bytes: int, *, extended: bool = False, remote: bool = False) -> int:
    """Maximum bits of a frame with *data_bytes* (0..8) on the wire, with worst-case stuffing.

    55 + 10·s, with a 29-bit CAN-ID 80 + 10·s (Davis, Burns, Bril, Lukkien 2007); a *remote* frame has no data.
    """
    return (80 if extended else 55) + 10 * (0 if remote else data_bytes)


def least_frame_bits(data_bytes: int, *, extended: bool = False, remote: bool = False) -> int:
    """Bits of a frame with *data_bytes* (0..8) without stuff bits; a *remote* frame has no data."""
    return (67 if extended else 47) + 8 * (0 if remote else data_bytes)


def arbitration(can_id: int, *, extended: bool, remote: bool) -> int:
    """The bits that decide arbitration, as a number: the lower number wins, as 0 is dominant."""
    bits, _ = header(can_id, 0, extended, remote)
    return bits >> 6 if extended else bits >> 6 << 20


def header(can_id: int, length: int, extended: bool, remote: bool) -> tuple[int, int]:
    """Start of frame (0), arbitration and control field as a number, and its bit count."""
    if extended:
        base, extension = can_id >> 18 & 0x7FF, can_id & 0x3FFFF
        return base << 27 | 0b11 << 25 | extension << 7 | remote << 6 | length, 39
    return (can_id & 0x7FF) << 7 | remote << 6 | length, 19
