"""Program download (CiA 302-3): objects, written values, and status."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

#: one sub-index per program, 1..254
PROGRAM_DATA, PROGRAM_CONTROL, SOFTWARE_IDENTIFICATION, FLASH_STATUS = 0x1F50, 0x1F51, 0x1F56, 0x1F57
#: commands to the program control; it reads back the last accepted command
STOP, START, CLEAR = 0, 1, 3
#: expected identification if a device's software identification is the CRC-32 of its program
CRC32 = "crc32"

_FLASH_ERRORS = {
    1: "no valid program",
    2: "data format unknown",
    3: "data format error or wrong CRC",
    4: "flash not cleared before the download",
    5: "flash write error",
    6: "address error",
    7: "flash secured",
}


class FlashStatus(NamedTuple):
    """The flash status object (u32): bit 0 at work, bits 1..7 the last error; other bits are manufacturer-specific."""

    raw: int

    @property
    def is_at_work(self) -> bool:
        """Whether the flash memory is being cleared or written."""
        return bool(self.raw & 1)

    @property
    def error(self) -> str:
        """Error text, empty for no error."""
        code = self.raw >> 1 & 0x7F
        return _FLASH_ERRORS.get(code, f"error {code}") + f" (0x{self.raw:08X})" if code else ""


class Stage(Enum):
    """Progress of a program download; the value describes the device's program if it ends there."""

    STOPPING = "the old firmware, which may be stopped"
    CLEARING = "the old firmware or none: the clear command was sent"
    LOADING = (
        "no firmware that is known to be complete: the old firmware is cleared, "
        "and the new firmware was being downloaded or written"
    )
    CHECKING = "a program that was loaded and not started"
    STARTING = "the new program; whether it runs is not known"
