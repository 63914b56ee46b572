"""Reasons why an object of a device is not written."""

from __future__ import annotations

from enum import StrEnum


class NotWritten(StrEnum):
    """Reason why a file or a clone does not write an object, in words that follow the object's name."""

    READ_ONLY = "is read-only"
    WRITE_ONLY = "is write-only: it cannot be read back"
    FLAGGED = "is not for a download (ObjFlags, bit 0)"
    ERROR_HISTORY = "is the error history"
    STORE = "stores or restores parameters: neither is done by writing values"
    STAMP = "is the stamp of a configuration"
    PROGRAM = "belongs to program download, which has its own command"
    SDO_CHANNEL = "is the SDO channel that is written over"
    SAFETY = "belongs to safety (EN 50325-5)"
    REQUEST = "is a command that acts at once and is not stored"
    COMMAND = "is a command or a target"
    TAKEN = "is written by an enabled RPDO: process data"
    OUTPUT = "is an output"
    PRESET = "sets a measured value"
    PASSCODE = "is part of a login"
    NODE_ID = "is a node-ID or a bit rate: LSS changes these"
    BEHAVIOUR = "is asked or written by dvtcli for another purpose (the device's profile)"
    RPDO_MAPPABLE = "can be mapped to an RPDO: process data, or a setting"
    MAKERS_RPDO = "is manufacturer-specific, and can be mapped to an RPDO: no profile defines it as configuration"
    NAMED_PROCESS_DATA = "is manufacturer-specific, and by its name a command, a target or a process value (a guess)"
    NAMED_COMMAND = "is manufacturer-specific, and by its name a command"
    MAKERS = "is manufacturer-specific, and no profile defines it as configuration"

    @property
    def is_lifted_by_include(self) -> bool:
        """Whether the user can include the object by naming it; a command only by its own address."""
        return self in (
            NotWritten.MAKERS, NotWritten.MAKERS_RPDO, NotWritten.NAMED_COMMAND, NotWritten.NAMED_PROCESS_DATA,
            NotWritten.RPDO_MAPPABLE,
        )  # fmt: skip

    @property
    def may_be_setting(self) -> bool:
        """Whether the object may be configuration after all: comparisons count it and a node's DCF contains it."""
        return self.is_lifted_by_include and self is not NotWritten.NAMED_PROCESS_DATA
