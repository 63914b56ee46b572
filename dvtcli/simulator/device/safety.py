"""SRDOs of a simulated device (EN 50325-5): safety-relevant data in two frames, the second with each bit inverted."""

from __future__ import annotations

from binascii import crc_hqx
from dataclasses import dataclass

from dvtcli.domain.abort import Abort
from dvtcli.domain.objects import SAFETY_SIGNATURES, SAFETY_VALID, SRDO_COMMUNICATION, SRDO_MAPPING
from dvtcli.domain.pdo import PdoMappingEntry
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.emergency import Emergencies
from dvtcli.simulator.device.memory import Memory, Refusal
from dvtcli.simulator.device.pdos_at_work import collect, spread

#: sub-indices of a communication parameter
_DIRECTION, _REFRESH_TIME, _VALIDATION_TIME, _TRANSMISSION_TYPE, _PLAIN, _INVERTED = range(1, 7)
_OFF, _SENT, _RECEIVED = range(3)
#: the value of 0x13FE that makes the configuration valid, and the only transmission type
_IS_VALID, _EVENT_DRIVEN = 0xA5, 254
_CAN_IDS, _MOST_ENTRIES = range(0x101, 0x181), 16
#: EMCY error code: data set
CONFIGURATION_ERROR = 0x6300
_NEVER = float("inf")


@dataclass(slots=True, eq=False, repr=False)
class _Srdo:
    """One SRDO in use: CAN-IDs of both frames, and the entries of the plain and of the inverted data."""

    can_ids: tuple[int, int]
    plain: tuple[PdoMappingEntry, ...]
    inverted: tuple[PdoMappingEntry, ...]
    #: refresh time of one that is sent, 0 for one that is received (s)
    refresh_s: float
    due_s: float = -_NEVER
    #: the first frame of a pair
    waiting: bytes | None = None


class SafetyObjects:
    """The SRDOs of one device, at work in OPERATIONAL while 0x13FE is 0xA5.

    *due_s* is the time of the next pair that is sent, infinite for never; *changes* grows whenever the result of
    `listens` may change.
    """

    def __init__(self, memory: Memory, errors: Emergencies) -> None:
        self._memory = memory
        self._errors = errors
        self._operational = False
        self._srdos: list[_Srdo] = []
        self.changes = 0
        self.due_s = _NEVER

    def check(self, index: int, sub_index: int, data: bytes) -> None:
        """Refuse a configuration of SRDOs in OPERATIONAL, and values that no SRDO has."""
        if not self._configures(index):
            return
        if self._operational:
            raise Refusal(Abort.DEVICE_STATE)
        value = int.from_bytes(data, "little")
        if index in SRDO_COMMUNICATION and not _is_possible(sub_index, value):
            raise Refusal(Abort.VALUE_RANGE)
        if index in SRDO_MAPPING:
            self._check_mapping(index, sub_index, value)

    def _configures(self, index: int) -> bool:
        return index in SRDO_COMMUNICATION or index in SRDO_MAPPING or index in (SAFETY_VALID, SAFETY_SIGNATURES)

    def _check_mapping(self, index: int, sub_index: int, value: int) -> None:
        is_used = self._memory.number(index - SRDO_MAPPING.start + SRDO_COMMUNICATION.start, _DIRECTION) != _OFF
        if is_used or (sub_index and self._memory.number(index, 0)):
            raise Refusal(Abort.UNSUPPORTED_ACCESS)
        if not sub_index and (value > _MOST_ENTRIES or value % 2):
            raise Refusal(Abort.PDO_LENGTH)

    def written(self, index: int) -> None:
        """Invalidate the configuration after a write to a part of it."""
        if self._configures(index) and index != SAFETY_VALID:
            self._memory.write(SAFETY_VALID, 0, b"\0")

    def start(self, *, operational: bool) -> list[Frame]:
        """Begin in a new NMT state; the EMCY if the configuration is not the one that was signed."""
        self._operational = operational
        self.changes += 1
        self._srdos, self.due_s = [], _NEVER
        if not operational or self._memory.number(SAFETY_VALID, 0) != _IS_VALID:
            return []
        used = [index for index in SRDO_COMMUNICATION if self._memory.number(index, _DIRECTION) != _OFF]
        if any(self._signature(index) != self._memory.number(SAFETY_SIGNATURES, _number(index)) for index in used):
            self._memory.write(SAFETY_VALID, 0, b"\0")
            return self._errors.set(SAFETY_VALID, CONFIGURATION_ERROR)
        self._srdos = [self._srdo(index) for index in used]
        return self._errors.clear(SAFETY_VALID)

    def _signature(self, index: int) -> int:
        """The CRC of an SRDO's parameters, in the order of their sub-indices; each entry with its sub-index."""
        number, mapping = self._memory.number, SRDO_MAPPING.start + _number(index) - 1
        count = number(mapping, 0)
        data = bytes([number(index, _DIRECTION)]) + number(index, _REFRESH_TIME).to_bytes(2, "little")
        data += bytes([number(index, _VALIDATION_TIME)])
        data += b"".join(number(index, sub_index).to_bytes(4, "little") for sub_index in (_PLAIN, _INVERTED))
        data += bytes([count])
        for sub_index in range(1, count + 1):
            data += bytes([sub_index]) + number(mapping, sub_index).to_bytes(4, "little")
        return crc_hqx(data, 0)

    def _srdo(self, index: int) -> _Srdo:
        mapping = SRDO_MAPPING.start + _number(index) - 1
        count = self._memory.number(mapping, 0)
        entries = [PdoMappingEntry.from_raw(self._memory.number(mapping, sub)) for sub in range(1, count + 1)]
        is_sent = self._memory.number(index, _DIRECTION) == _SENT
        refresh_s = self._memory.number(index, _REFRESH_TIME) / 1000 if is_sent else 0.0
        can_ids = self._memory.number(index, _PLAIN), self._memory.number(index, _INVERTED)
        return _Srdo(can_ids, tuple(entries[::2]), tuple(entries[1::2]), refresh_s)

    def listens(self, frame: Frame) -> bool:
        """True if *frame* belongs to an SRDO that is received."""
        return not frame.extended and any(frame.can_id in srdo.can_ids for srdo in self._srdos if not srdo.refresh_s)

    def receive(self, frame: Frame) -> None:
        """Receive a frame of an SRDO; the second, with each bit of the first inverted, sets the objects."""
        for srdo in self._srdos:
            if srdo.refresh_s or frame.can_id not in srdo.can_ids:
                continue
            if frame.can_id == srdo.can_ids[0]:
                srdo.waiting = frame.data
                continue
            if srdo.waiting is not None and frame.data == _inverted(srdo.waiting):
                spread(self._memory, srdo.plain, srdo.waiting)
                spread(self._memory, srdo.inverted, frame.data)
            srdo.waiting = None

    def poll(self, now_s: float) -> list[Frame]:
        """Both frames of each SRDO whose refresh time is over at *now_s* (s)."""
        frames: list[Frame] = []
        self.due_s = _NEVER
        for srdo in self._srdos:
            if not srdo.refresh_s:
                continue
            if now_s >= srdo.due_s:
                on_time = now_s < srdo.due_s + srdo.refresh_s
                srdo.due_s = (srdo.due_s if on_time else now_s) + srdo.refresh_s
                frames += self._pair(srdo)
            self.due_s = min(self.due_s, srdo.due_s)
        return frames

    def _pair(self, srdo: _Srdo) -> list[Frame]:
        """Both frames; the inverted objects follow the plain ones, as the device's application keeps them."""
        data = collect(self._memory, srdo.plain)
        inverted = _inverted(data)
        if collect(self._memory, srdo.inverted) != inverted:
            spread(self._memory, srdo.inverted, inverted)
        return [Frame(srdo.can_ids[0], data), Frame(srdo.can_ids[1], inverted)]


def _number(communication_index: int) -> int:
    return communication_index - SRDO_COMMUNICATION.start + 1


def _inverted(data: bytes) -> bytes:
    return bytes(byte ^ 0xFF for byte in data)


def _is_possible(sub_index: int, value: int) -> bool:
    """Whether *value* may be at *sub_index* of a communication parameter."""
    if sub_index == _DIRECTION:
        return value <= _RECEIVED
    if sub_index in (_REFRESH_TIME, _VALIDATION_TIME):
        return value > 0
    if sub_index == _TRANSMISSION_TYPE:
        return value == _EVENT_DRIVEN
    return value in _CAN_IDS and value % 2 == (sub_index == _PLAIN)
