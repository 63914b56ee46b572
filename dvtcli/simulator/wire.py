"""Time on a CAN wire: how many bits a frame takes, and whose frame goes first.

Pure arithmetic of classical CAN (ISO 11898-1): headers, CRC-15, stuff bits, arbitration. Does not know clocks, threads
or what a frame means; times are seconds on a clock of the caller's.
"""

from __future__ import annotations

from collections import deque

from dvtcli.domain.ports import Frame

_CRC_15 = 0x4599
#: CRC delimiter, acknowledge and its delimiter, seven bits that end the frame: never stuffed
_TRAILER = 10
#: bits that stay recessive between two frames
INTERFRAME = 3
#: bits in front of the start of frame that fill up a byte: they end in 1, as an idle bus, and need no stuffing
_FILL = 0b01010101


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        crc = byte << 7
        for _ in range(8):
            crc = (crc << 1) ^ (_CRC_15 if crc & 0x4000 else 0)
        table.append(crc & 0x7FFF)
    return tuple(table)


def _stuff_table() -> tuple[tuple[int, int], ...]:
    """For each state (the last bit, and how many equal ones there were) and byte: the state behind it, its stuff bits.

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


_CRC_TABLE, _STUFF_TABLE = _crc_table(), _stuff_table()
_IDLE = 0b100


def frame_bits(frame: Frame) -> int:
    """Bits that *frame* takes on the wire: its own, its stuff bits, and the 3 bits between two frames.

    A remote frame carries the length of its data and no data.
    """
    content, bits = _stuffed_part(frame)
    fill = -bits % 8
    state, total = _IDLE, bits + _TRAILER + INTERFRAME
    for byte in ((_FILL & (1 << fill) - 1) << bits | content).to_bytes((bits + fill) // 8, "big"):
        state, stuffed = _STUFF_TABLE[state << 8 | byte]
        total += stuffed
    return total


def unstuffed_bits(frame: Frame) -> int:
    """As `frame_bits` without the stuff bits: what a frame takes at least."""
    return _stuffed_part(frame)[1] + _TRAILER + INTERFRAME


def _stuffed_part(frame: Frame) -> tuple[int, int]:
    """The bits from the start of the frame to the end of its CRC as one number, and how many they are."""
    header, bits = _header(frame.can_id, len(frame.data), frame.extended, frame.remote)
    sent = b"" if frame.remote else frame.data
    content, bits = header << 8 * len(sent) | int.from_bytes(sent, "big"), bits + 8 * len(sent)
    # Zeros in front change no CRC that starts at 0, so whole bytes may be looked up.
    crc = 0
    for byte in content.to_bytes((bits + 7) // 8, "big"):
        crc = (crc << 8 & 0x7FFF) ^ _CRC_TABLE[crc >> 7 ^ byte]
    return content << 15 | crc, bits + 15


def _header(can_id: int, length: int, extended: bool, remote: bool) -> tuple[int, int]:
    """Start of frame (0), arbitration and control field as one number, and how many bits that is."""
    if extended:
        base, extension = can_id >> 18 & 0x7FF, can_id & 0x3FFFF
        return base << 27 | 0b11 << 25 | extension << 7 | remote << 6 | length, 39
    return (can_id & 0x7FF) << 7 | remote << 6 | length, 19


def arbitration(frame: Frame) -> int:
    """The bits that decide who goes first, as a number: the lower one wins, as 0 is dominant."""
    header, _ = _header(frame.can_id, 0, frame.extended, frame.remote)
    return header >> 6 if frame.extended else header >> 6 << 20


class Wire:
    """A bus of *bitrate* bit/s on which one frame travels at a time; without a bit rate they take no time.

    Each *source* sends its own frames in order; among the sources that wait when the wire becomes free the lowest
    CAN-ID wins. Without a bit rate frames travel in the order of `offer`.
    """

    def __init__(self, bitrate: int | None = None) -> None:
        self._bit_s = 0.0 if bitrate is None else 1 / bitrate
        self._waiting: dict[object, deque[tuple[float, Frame]]] = {}
        self._straight: deque[tuple[float, object, Frame]] = deque()
        self._free_s = 0.0
        self._travelling: tuple[float, object, Frame] | None = None

    def offer(self, source: object, frame: Frame, at_s: float) -> None:
        """Let *source* want to send *frame* from *at_s* on."""
        if not self._bit_s:
            self._straight.append((at_s, source, frame))
        elif source in self._waiting:
            self._waiting[source].append((at_s, frame))
        else:
            self._waiting[source] = deque([(at_s, frame)])

    def waiting(self, source: object) -> int:
        """How many frames of *source* have not begun to travel."""
        queue = self._waiting.get(source)
        return 0 if queue is None else len(queue)

    def take(self, now_s: float) -> tuple[float, object, Frame] | None:
        """The next frame that has arrived by *now_s*, with the time of its last bit and its source; None for none."""
        if self._straight:
            return self._straight.popleft()
        self._begin(now_s)
        if self._travelling is None or self._travelling[0] > now_s:
            return None
        arrived, self._travelling = self._travelling, None
        return arrived

    def next_s(self) -> float | None:
        """When `take` has something next; None while nothing is on its way or waits."""
        if self._straight:
            return 0.0
        if self._travelling is not None:
            return self._travelling[0]
        return self._start_s()

    def _start_s(self) -> float | None:
        """When the next frame begins to travel, None where none waits."""
        if not self._waiting:
            return None
        return max(self._free_s, min(queue[0][0] for queue in self._waiting.values()))

    def _begin(self, now_s: float) -> None:
        """Let the winner begin, if that is not later than *now_s*."""
        start_s = None if self._travelling is not None else self._start_s()
        if start_s is None or start_s > now_s:
            return
        ready = [source for source, queue in self._waiting.items() if queue[0][0] <= start_s]
        winner = min(ready, key=lambda source: arbitration(self._waiting[source][0][1]))
        _, frame = self._waiting[winner].popleft()
        if not self._waiting[winner]:
            del self._waiting[winner]
        self._free_s = start_s + frame_bits(frame) * self._bit_s
        self._travelling = (self._free_s, winner, frame)
