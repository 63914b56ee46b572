"""CiA 301 data types: bytes on the wire ↔ values, little-endian."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from datetime import date, timedelta
from enum import Enum, auto
from typing import NamedTuple


class Kind(Enum):
    """How a type's bytes are understood."""

    BOOLEAN = auto()
    INTEGER = auto()
    UNSIGNED = auto()
    REAL = auto()
    VISIBLE_STRING = auto()
    UNICODE_STRING = auto()
    OCTETS = auto()
    TIME = auto()


class CanopenTime(NamedTuple):
    """TIME_OF_DAY or TIME_DIFFERENCE: *milliseconds* (28 bits, after midnight) and *days* (16 bits, since 1984)."""

    milliseconds: int
    days: int

    def __str__(self) -> str:
        """`3 d 01:02:03.004`."""
        return f"{self.days} d {_clock(self.milliseconds)}"


class TimeOfDay(CanopenTime):
    """A TIME_OF_DAY."""

    __slots__ = ()

    def __str__(self) -> str:
        """`2026-11-29 12:00:00.000`; milliseconds beyond the day as hours above 23."""
        return f"{_EPOCH + timedelta(self.days)} {_clock(self.milliseconds)}"


_TIME_OF_DAY = 0x0C
#: Day 0 of a TIME_OF_DAY (CiA 301, 7.1.6.6).
_EPOCH = date(1984, 1, 1)
_DATE = r"(\d{4}-\d\d-\d\d)[ T](\d\d?):(\d\d):(\d\d)(?:\.(\d{3}))?"
_SPAN = r"(\d{1,5}) ?d (\d\d?):(\d\d):(\d\d)(?:\.(\d{3}))?"


def _clock(milliseconds: int) -> str:
    seconds, rest = divmod(milliseconds, 1000)
    minutes, seconds = divmod(seconds, 60)
    return f"{minutes // 60:02}:{minutes % 60:02}:{seconds:02}.{rest:03}"


def _days_to(text: str) -> int:
    """Days from 1984 to the date *text*. Raises ValueError if there is no such date."""
    try:
        return (date.fromisoformat(text) - _EPOCH).days
    except ValueError:
        raise ValueError(f"{text} is not a date") from None


def _read_time(text: str) -> CanopenTime:
    """Read `2026-11-29 12:00:00`, `3 d 01:02:03.004` or `DAYS:MILLISECONDS`. Raises ValueError otherwise."""
    found = re.fullmatch(_DATE, text) or re.fullmatch(_SPAN, text)
    if found is None:
        days, colon, milliseconds = text.partition(":")
        if not colon:
            raise ValueError("it takes 2026-11-29 12:00:00, 3 d 01:02:03.004, or DAYS:MILLISECONDS")
        return CanopenTime(parse_number(milliseconds), parse_number(days))
    count = _days_to(found[1]) if "-" in found[1] else int(found[1])
    hours, minutes, seconds, rest = (int(part or 0) for part in found.groups()[1:])
    return CanopenTime(((hours * 60 + minutes) * 60 + seconds) * 1000 + rest, count)


Value = bool | int | float | str | bytes | CanopenTime


@dataclass(frozen=True, slots=True)
class DataType:
    """A data type; *bits* is its length, None if variable."""

    code: int
    name: str
    short: str
    kind: Kind
    bits: int | None

    @property
    def size(self) -> int | None:
        """Length of an SDO transfer in bytes, None if variable."""
        return None if self.bits is None else (self.bits + 7) // 8

    @property
    def limits(self) -> tuple[int, int] | None:
        """Lowest and highest value of an integer type, else None."""
        if self.bits is None or self.kind not in (Kind.INTEGER, Kind.UNSIGNED, Kind.BOOLEAN):
            return None
        if self.kind is Kind.INTEGER:
            return -(1 << self.bits - 1), (1 << self.bits - 1) - 1
        return 0, (1 << self.bits) - 1

    def decode(self, data: bytes) -> Value:
        """Decode uploaded *data*. Raises ValueError if its length does not fit the type."""
        if self.size is not None and len(data) != self.size:
            raise ValueError(f"{self.name} takes {self.size} bytes, not {len(data)}")
        match self.kind:
            case Kind.BOOLEAN:
                return bool(data[0])
            case Kind.INTEGER | Kind.UNSIGNED:
                return int.from_bytes(data, "little", signed=self.kind is Kind.INTEGER)
            case Kind.REAL:
                return float(struct.unpack("<f" if self.bits == 32 else "<d", data)[0])
            case Kind.VISIBLE_STRING:
                return data.rstrip(b"\0").decode("latin-1")
            case Kind.UNICODE_STRING:
                return data.decode("utf-16-le", errors="replace").rstrip("\0")
            case Kind.TIME:
                milliseconds, days = struct.unpack("<LH", data)
                kind = TimeOfDay if self.code == _TIME_OF_DAY else CanopenTime
                return kind(milliseconds & 0x0FFF_FFFF, days)
            case Kind.OCTETS:
                return data

    def encode(self, value: Value) -> bytes:
        """Encode *value* for a download. Raises ValueError if it does not fit the type."""
        match value:
            case bool() | int() if self.limits is not None and self.size is not None:
                low, high = self.limits
                if not low <= value <= high:
                    raise ValueError(f"{int(value)} does not fit {self.name} ({low}..{high})")
                return int(value).to_bytes(self.size, "little", signed=self.kind is Kind.INTEGER)
            case int() | float() if self.kind is Kind.REAL:
                return self._encode_real(value)
            case CanopenTime() if self.kind is Kind.TIME:
                if not (0 <= value.milliseconds < 1 << 28 and 0 <= value.days <= 0xFFFF):
                    raise ValueError(f"{value} does not fit {self.name}")
                return struct.pack("<LH", value.milliseconds, value.days)
            case str() if self.kind is Kind.VISIBLE_STRING:
                return _encode_latin(value)
            case str() if self.kind is Kind.UNICODE_STRING:
                return value.encode("utf-16-le")
            case bytes() if self.kind is Kind.OCTETS:
                return value
        within = "" if self.limits is None else f" ({self.limits[0]}..{self.limits[1]})"
        raise ValueError(f"{value!r} is no value of {self.name}{within}")

    def _encode_real(self, value: float) -> bytes:
        try:
            return struct.pack("<f" if self.bits == 32 else "<d", value)
        except OverflowError:
            raise ValueError(f"{value} does not fit {self.name}") from None

    def parse(self, text: str) -> bytes:
        """Read *text* as a user types it (decimal, `0x…`, `true`, text, hex bytes) into the bytes to download."""
        match self.kind:
            case Kind.BOOLEAN if text.lower() in ("true", "false"):
                return self.encode(text.lower() == "true")
            case Kind.BOOLEAN | Kind.INTEGER | Kind.UNSIGNED:
                return self.encode(parse_number(text))
            case Kind.REAL:
                return self.encode(_read_real(text))
            case Kind.VISIBLE_STRING | Kind.UNICODE_STRING:
                return self.encode(text)
            case Kind.OCTETS:
                return _read_octets(text)
            case Kind.TIME:
                return self.encode(_read_time(text))


def _read_real(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{text!r} is not a number") from None


def _read_octets(text: str) -> bytes:
    try:
        return bytes.fromhex(text.removeprefix("0x"))
    except ValueError:
        raise ValueError("it takes bytes in hexadecimal, two digits each: 01 02 0A") from None


def _encode_latin(text: str) -> bytes:
    try:
        return text.encode("latin-1")
    except UnicodeEncodeError as wrong:
        raise ValueError(f"{text[wrong.start]!r} is not one of the characters of a VISIBLE_STRING") from None


_NUMBER = re.compile(r"(?P<sign>-?)(?:(?P<decimal>[0-9]{1,40})|0[xX](?P<hex>[0-9a-fA-F]{1,38}))")


def parse_number(text: str) -> int:
    """Read `1500`, `-1500`, `0x5DC` or `-0x5DC`. Raises ValueError otherwise (no octal, no underscores)."""
    match = _NUMBER.fullmatch(text)
    if not match:
        raise ValueError(f"{text!r} is not a number; write it decimal or 0x… in hexadecimal")
    number = int(match["decimal"]) if match["decimal"] else int(match["hex"], 16)
    return -number if match["sign"] else number


def _integers(codes: dict[int, int], kind: Kind) -> list[DataType]:
    letter = "i" if kind is Kind.INTEGER else "u"
    return [DataType(code, f"{kind.name}{bits}", f"{letter}{bits}", kind, bits) for code, bits in codes.items()]


_ALL = [
    DataType(0x01, "BOOLEAN", "bool", Kind.BOOLEAN, 1),
    *_integers({2: 8, 3: 16, 0x10: 24, 4: 32, 0x12: 40, 0x13: 48, 0x14: 56, 0x15: 64}, Kind.INTEGER),
    *_integers({5: 8, 6: 16, 0x16: 24, 7: 32, 0x18: 40, 0x19: 48, 0x1A: 56, 0x1B: 64}, Kind.UNSIGNED),
    DataType(0x08, "REAL32", "r32", Kind.REAL, 32),
    DataType(0x11, "REAL64", "r64", Kind.REAL, 64),
    DataType(0x09, "VISIBLE_STRING", "vs", Kind.VISIBLE_STRING, None),
    DataType(0x0A, "OCTET_STRING", "os", Kind.OCTETS, None),
    DataType(0x0B, "UNICODE_STRING", "us", Kind.UNICODE_STRING, None),
    DataType(0x0C, "TIME_OF_DAY", "t", Kind.TIME, 48),
    DataType(0x0D, "TIME_DIFFERENCE", "td", Kind.TIME, 48),
    DataType(0x0F, "DOMAIN", "domain", Kind.OCTETS, None),
]

#: Index of a type in the data-type area -> the type (CiA 301, table 44).
DATA_TYPES = {data_type.code: data_type for data_type in _ALL}
BY_SHORT_NAME = {data_type.short: data_type for data_type in _ALL}

BOOLEAN, U8, U16, U32 = DATA_TYPES[1], DATA_TYPES[5], DATA_TYPES[6], DATA_TYPES[7]
VISIBLE_STRING, DOMAIN = DATA_TYPES[9], DATA_TYPES[0x0F]
