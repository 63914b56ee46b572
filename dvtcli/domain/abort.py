"""SDO abort codes and their meaning (CiA 301, table 22); manufacturer-specific meanings are not included."""

from __future__ import annotations

import re
from enum import IntEnum


class Abort(IntEnum):
    """Abort codes that dvtcli reacts to."""

    TOGGLE_BIT = 0x0503_0000
    TIME_OUT = 0x0504_0000
    COMMAND_SPECIFIER = 0x0504_0001
    BLOCK_SIZE = 0x0504_0002
    SEQUENCE = 0x0504_0003
    CRC = 0x0504_0004
    OUT_OF_MEMORY = 0x0504_0005
    UNSUPPORTED_ACCESS = 0x0601_0000
    WRITE_ONLY = 0x0601_0001
    READ_ONLY = 0x0601_0002
    NO_OBJECT = 0x0602_0000
    NOT_MAPPABLE = 0x0604_0041
    PDO_LENGTH = 0x0604_0042
    INCOMPATIBLE = 0x0604_0043
    HARDWARE = 0x0606_0000
    LENGTH = 0x0607_0010
    TOO_LONG = 0x0607_0012
    TOO_SHORT = 0x0607_0013
    NO_SUB_INDEX = 0x0609_0011
    VALUE_RANGE = 0x0609_0030
    VALUE_HIGH = 0x0609_0031
    VALUE_LOW = 0x0609_0032
    NO_DATA = 0x060A_0023
    GENERAL = 0x0800_0000
    CANNOT_STORE = 0x0800_0020
    LOCAL_CONTROL = 0x0800_0021
    DEVICE_STATE = 0x0800_0022


_WRITTEN = re.compile(r"(?:0[xX])?([0-9A-Fa-f]{8})")
#: first byte of codes about an object, its access or its value
_ABOUT_THE_REQUEST = 0x06

_TEXTS = {
    0x0503_0000: "toggle bit not alternated",
    0x0504_0000: "SDO protocol timed out",
    0x0504_0001: "command specifier not valid or unknown",
    0x0504_0002: "invalid block size",
    0x0504_0003: "invalid sequence number",
    0x0504_0004: "CRC error",
    0x0504_0005: "out of memory",
    0x0601_0000: "unsupported access to an object",
    0x0601_0001: "attempt to read a write-only object",
    0x0601_0002: "attempt to write a read-only object",
    0x0602_0000: "object does not exist in the object dictionary",
    0x0604_0041: "object cannot be mapped to the PDO",
    0x0604_0042: "number and length of the mapped objects would exceed the PDO's length",
    0x0604_0043: "general parameter incompatibility",
    0x0604_0047: "general internal incompatibility in the device",
    0x0606_0000: "access failed due to a hardware error",
    0x0607_0010: "data type or length does not match",
    0x0607_0012: "data type does not match, parameter too long",
    0x0607_0013: "data type does not match, parameter too short",
    0x0609_0011: "sub-index does not exist",
    0x0609_0030: "invalid value for the parameter",
    0x0609_0031: "value written is too high",
    0x0609_0032: "value written is too low",
    0x0609_0036: "maximum value is less than the minimum value",
    0x060A_0023: "resource not available: SDO connection",
    0x0800_0000: "general error",
    0x0800_0020: "data cannot be transferred or stored to the application",
    0x0800_0021: "data cannot be transferred or stored because of local control",
    0x0800_0022: "data cannot be transferred or stored because of the present device state",
    0x0800_0023: "no object dictionary is present",
    0x0800_0024: "no data available",
}


def abort_text(code: int) -> str:
    """The meaning of abort *code* in words; "unknown abort code" for codes outside the standard."""
    return _TEXTS.get(code, "unknown abort code")


def code_of(text: str) -> int | None:
    """Return the abort code written as eight hex digits, with or without 0x; None if CiA 301 has no such code."""
    written = _WRITTEN.fullmatch(text)
    code = int(written[1], 16) if written else None
    return code if code in _TEXTS else None


def may_pass(code: int) -> bool:
    """Whether a retry may succeed after *code*: its cause is the protocol, memory or the device's state.

    All other codes refer to the request (CiA 301, table 22): a retry gets the same refusal.
    """
    return code >> 24 != _ABOUT_THE_REQUEST or code == Abort.HARDWARE
