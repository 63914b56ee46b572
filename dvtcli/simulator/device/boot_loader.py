"""A boot loader: download, clear, start and stop one program in flash memory (CiA 302-3, 0x1F50 to 0x1F57).

A program is complete or absent, even after a power failure.
"""

from __future__ import annotations

from binascii import crc32

from dvtcli.domain.abort import Abort
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.objects import FLASH_STATUS, PROGRAM_CONTROL, PROGRAM_DATA, PROGRAM_IDENTIFICATION
from dvtcli.simulator.device.memory import Refusal

_STOPPED, _STARTED, _CLEARED = 0, 1, 3
_AT_WORK, _NO_PROGRAM, _NOT_CLEARED, _WRITE_ERROR = 1, 1 << 1, 4 << 1, 5 << 1
#: how often the status says "at work" after a program was cleared or written
_BUSY_READS = 2
FACTORY_PROGRAM = b"the program that a simulated device comes with"


class BootLoader:
    """The boot loader of one device, with faults: *fails*, writing a program fails; *alters*, one byte is corrupted.

    While its flash memory is at work, it refuses its objects with the abort code *busy*, 0: the status says so.
    """

    def __init__(self, busy: int = 0) -> None:
        self.busy = busy
        self.program: bytes | None = FACTORY_PROGRAM
        self.fails = self.alters = False
        self._control = _STARTED
        self._status = self._busy = 0
        self._is_clear = False

    def handles(self, index: int, sub_index: int) -> bool:
        """True if the object belongs to the boot loader."""
        return sub_index == 1 and index in (PROGRAM_DATA, PROGRAM_CONTROL, PROGRAM_IDENTIFICATION, FLASH_STATUS)

    def read(self, index: int) -> bytes:
        """The value of the control, identification or status object. Raises Refusal if it is refused while busy."""
        self._refuse_if_busy()
        if index == PROGRAM_CONTROL:
            return bytes([self._control])
        if index == PROGRAM_IDENTIFICATION:
            return (0 if self.program is None else crc32(self.program)).to_bytes(4, "little")
        if self._busy:
            self._busy -= 1
            return _AT_WORK.to_bytes(4, "little")
        return self._status.to_bytes(4, "little")

    def _refuse_if_busy(self) -> None:
        if self._busy and self.busy:
            self._busy -= 1
            raise Refusal(self.busy)

    def begin(self, index: int) -> None:
        """Begin a program download. Raises Refusal unless the flash memory is clear; afterwards it is not."""
        if index != PROGRAM_DATA:
            return
        if not self._is_clear:
            self._status = _NOT_CLEARED
            raise Refusal(Abort.DEVICE_STATE)
        self._is_clear = False

    def take(self, index: int, data: bytes, state: NmtState) -> bool:
        """Take a program or a command; true if the device resets. Raises Refusal in the wrong state."""
        if index == PROGRAM_DATA:
            self._write(data)
            return False
        self._refuse_if_busy()
        if state is not NmtState.PRE_OPERATIONAL:
            raise Refusal(Abort.DEVICE_STATE)
        match data[0]:
            case 0:
                self._control = _STOPPED
            case 1:
                return self._start()
            case 3 if self._control == _STARTED:
                raise Refusal(Abort.DEVICE_STATE)
            case 3:
                self.program, self._control, self._is_clear = None, _CLEARED, True
                self._status, self._busy = 0, _BUSY_READS
            case _:
                raise Refusal(Abort.VALUE_RANGE)
        return False

    def _start(self) -> bool:
        if self.program is None:
            self._status = _NO_PROGRAM
            raise Refusal(Abort.DEVICE_STATE)
        return True

    def _write(self, data: bytes) -> None:
        self._busy = _BUSY_READS
        if self.fails:
            self._status = _WRITE_ERROR
            return
        self.program = data if not self.alters else data[:-1] + bytes([data[-1] ^ 0x01])
        self._status, self._control = 0, _STOPPED

    def restart(self) -> None:
        """Run the program, if any, after a reset or at power-on."""
        self._busy, self._is_clear = 0, False
        self._control = _STOPPED if self.program is None else _STARTED
        self._status = _NO_PROGRAM if self.program is None else 0
