"""Errors of a simulated device: EMCY frames, error register and history (CiA 301, 7.2.7, 7.5.2.2 and 7.5.2.4).

`strict_device` suppresses EMCY frames by NMT state.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable

from dvtcli.domain.abort import Abort
from dvtcli.domain.objects import COB_ID_EMCY, ERROR_FIELD, ERROR_REGISTER, INHIBIT_TIME_EMCY
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.family import ErrorList
from dvtcli.simulator.device.memory import Memory, Refusal

NO_ERROR = 0x0000
_GENERIC = 0x01
#: the class of an error code, its highest hex digit -> its bit of 0x1001 (CiA 301, tables 26 and 48)
_BITS = {0x2: 0x02, 0x3: 0x04, 0x4: 0x08, 0x8: 0x10, 0xF: 0x80}
_INVALID, _EXTENDED = 1 << 31, 1 << 29
_WAITING_MOST = 32


class Emergencies:
    """The errors of one device. A *source* raises an error, which stays until the same source clears it.

    *own* is the device's error list beside CiA 301. *due_s* is the time of the next frame held back by the inhibit time
    (0x1015), infinite for none.
    """

    def __init__(self, memory: Memory, own: ErrorList | None = None) -> None:
        self._memory = memory
        self._own = own
        self._active: dict[Hashable, int] = {}
        self._own_bits = 0
        self._waiting: deque[Frame] = deque(maxlen=_WAITING_MOST)
        self._quiet_until_s = 0.0

    @property
    def due_s(self) -> float:
        """The time of the next frame from `poll` (s)."""
        return self._quiet_until_s if self._waiting else float("inf")

    def reset(self) -> None:
        """Clear every error, as a reset does; the memory resets the standard's objects."""
        if self._active:
            self._active.clear()
            self.list_active()
        self._waiting.clear()
        self._own_bits = 0

    def check(self, index: int, _sub_index: int, data: bytes) -> None:
        """Refuse a download to the history other than 0, which clears the history (CiA 301, 7.5.2.4)."""
        if index == ERROR_FIELD and any(data):
            raise Refusal(Abort.VALUE_RANGE)

    def set(self, source: Hashable, code: int) -> list[Frame]:
        """Raise error *code* (0x0001..0xFFFF) of *source*; the frames to send, none for a known error."""
        if self._active.get(source) == code:
            return []
        self._active[source] = code
        self._remember(code)
        return self._send(code)

    def clear(self, source: Hashable) -> list[Frame]:
        """Clear the error of *source*; the error-reset frame if there was an error."""
        if self._active.pop(source, None) is None:
            return []
        return self._send(NO_ERROR)

    def clear_all(self) -> list[Frame]:
        """Clear every error; the error-reset frame."""
        self._active.clear()
        return self._send(NO_ERROR)

    def list_active(self) -> None:
        """Update the device's own error list, if any: the code at the selected position."""
        if self._own is None:
            return
        codes = sorted(self._active.values(), reverse=True)
        position = self._memory.number(*self._own.position)
        self._put(self._own.count, len(codes))
        self._put(self._own.code, codes[position] if position < len(codes) else 0)

    def _put(self, place: tuple[int, int], value: int) -> None:
        if self._memory.exists(*place):
            self._memory.write(*place, value.to_bytes(2, "little"))

    def forget_history(self) -> None:
        """Clear 0x1003, as writing 0 to its sub-index 0 does."""
        for sub_index in range(1, (self._memory.highest_sub_index(ERROR_FIELD) or 0) + 1):
            if self._memory.exists(ERROR_FIELD, sub_index):
                self._memory.write(ERROR_FIELD, sub_index, bytes(4))

    def poll(self, now_s: float) -> list[Frame]:
        """The frame released by the inhibit time at *now_s* (s)."""
        if now_s < self.due_s:
            return []
        self._quiet_until_s = now_s + self._memory.number(INHIBIT_TIME_EMCY, 0) / 10_000
        return [self._waiting.popleft()]

    def _send(self, code: int) -> list[Frame]:
        self.list_active()
        frame = self._frame(code, self._update_register())
        if frame is None:
            return []
        if not self._memory.number(INHIBIT_TIME_EMCY, 0):
            return [frame]
        self._waiting.append(frame)
        self._memory.touch()
        return []

    def _frame(self, code: int, register: int) -> Frame | None:
        """The EMCY frame, None if 0x1014 disables EMCY."""
        raw = self._memory.number(COB_ID_EMCY, 0, missing=0x80 + self._memory.node_id)
        if raw & _INVALID:
            return None
        data = code.to_bytes(2, "little") + bytes([register]) + bytes(5)
        return Frame(raw & 0x1FFF_FFFF, data, extended=bool(raw & _EXTENDED))

    def _update_register(self) -> int:
        """Update 0x1001; bits set by the device's own application stay."""
        own = 0
        for code in self._active.values():
            own |= _GENERIC | _BITS.get(code >> 12, 0)
        held = self._memory.number(ERROR_REGISTER, 0)
        register = (held & ~self._own_bits | own) & 0xFF
        self._own_bits = own
        if register != held and self._memory.exists(ERROR_REGISTER, 0):
            self._memory.write(ERROR_REGISTER, 0, bytes([register]))
        return register

    def _remember(self, code: int) -> None:
        """Add *code* at the top of the history, if the device has a history."""
        last = self._memory.highest_sub_index(ERROR_FIELD)
        if not last:
            return
        count = self._memory.number(ERROR_FIELD, 0)
        for sub_index in range(min(count + 1, last), 1, -1):
            self._memory.write(ERROR_FIELD, sub_index, self._memory.read(ERROR_FIELD, sub_index - 1))
        self._memory.write(ERROR_FIELD, 1, code.to_bytes(4, "little"))
        self._memory.write(ERROR_FIELD, 0, bytes([min(count + 1, last)]))
