"""Position of mapped objects in a PDO's data, and conversion between bytes and values.

CiA 301, 7.4.7: the first mapped object starts at bit 0 of byte 0, the next object follows without a gap, the least
significant bit first. Callers supply the data types.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from dvtcli.domain.datatypes import DataType, Kind, Value
from dvtcli.domain.pdo import PdoMappingEntry

#: Returns the data type of a mapped object, None if unknown.
TypeOf = Callable[[PdoMappingEntry], DataType | None]


class Field(NamedTuple):
    """Position of an entry in the frame: *start_bit* counts from the least significant bit of byte 0."""

    start_bit: int
    bits: int
    entry: PdoMappingEntry

    @property
    def end_bit(self) -> int:
        """The first bit behind the field."""
        return self.start_bit + self.bits

    @property
    def bytes(self) -> range:
        """Bytes of the frame that the field touches."""
        return range(self.start_bit // 8, byte_length(self.end_bit))


class Decoded(NamedTuple):
    """An object in a frame: its *raw* bits as an unsigned number and its *value*, None if the frame ends before."""

    entry: PdoMappingEntry
    raw: int | None
    value: Value | None


def byte_length(bits: int) -> int:
    """Bytes of a frame with *bits* bits."""
    return (bits + 7) // 8


def layout(entries: Iterable[PdoMappingEntry]) -> tuple[Field, ...]:
    """Positions of *entries*, dummies included, in frame order."""
    fields: list[Field] = []
    start = 0
    for entry in entries:
        fields.append(Field(start, entry.bits, entry))
        start += entry.bits
    return tuple(fields)


def unpack(entries: Iterable[PdoMappingEntry], data: bytes) -> list[tuple[PdoMappingEntry, int | None]]:
    """Raw bits per entry, without dummies; None for an entry that is not completely in *data*."""
    word, length = int.from_bytes(data, "little"), 8 * len(data)
    return [
        (field.entry, word >> field.start_bit & (1 << field.bits) - 1 if field.end_bit <= length else None)
        for field in layout(entries)
        if not field.entry.is_dummy
    ]


def pack(entries: Iterable[PdoMappingEntry], raw_of: Callable[[PdoMappingEntry], int]) -> bytes:
    """The frame with the lowest bits of each *raw_of* entry, and 0 for dummies."""
    fields = layout(entries)
    word = 0
    for field in fields:
        if not field.entry.is_dummy:
            word |= (raw_of(field.entry) & (1 << field.bits) - 1) << field.start_bit
    return word.to_bytes(byte_length(fields[-1].end_bit if fields else 0), "little")


def decode(entries: Iterable[PdoMappingEntry], data: bytes, type_of: TypeOf) -> list[Decoded]:
    """Values of every entry except dummies in a frame's *data*; unsigned numbers for unknown types.

    A frame may be shorter than the mapping: missing values are None. Bytes past the mapping are ignored.
    """
    entries = tuple(entries)
    values = values_reader(entries, type_of)(data)
    return [Decoded(entry, raw, value) for (entry, raw), value in zip(unpack(entries, data), values, strict=True)]


def values_reader(entries: Iterable[PdoMappingEntry], type_of: TypeOf) -> Callable[[bytes], list[Value | None]]:
    """Return a function that reads the values of `decode` from a frame's data; computes the layout only once."""
    fields = [field for field in layout(entries) if not field.entry.is_dummy]
    places = [
        (field.start_bit, field.end_bit, (1 << field.bits) - 1, *_reading(field.bits, type_of(field.entry)))
        for field in fields
    ]
    whole_numbers = [(start_bit, mask, sign) for start_bit, _, mask, sign, convert in places if convert is None]
    #: the length in bits from which on a frame has all values, and all of them are whole numbers
    least = max((field.end_bit for field in fields), default=0) if len(whole_numbers) == len(places) else None

    def read(data: bytes) -> list[Value | None]:
        word, length = int.from_bytes(data, "little"), 8 * len(data)
        if least is not None and length >= least:
            return [((word >> start_bit & mask) ^ sign) - sign for start_bit, mask, sign in whole_numbers]
        return [
            None
            if end_bit > length
            else ((word >> start_bit & mask) ^ sign) - sign
            if convert is None
            else convert(word >> start_bit & mask)
            for start_bit, end_bit, mask, sign, convert in places
        ]

    return read


def _reading(bits: int, data_type: DataType | None) -> tuple[int, Callable[[int], Value] | None]:
    """How *bits* raw bits become a value: the sign bit (0: unsigned) of a whole number, or what makes another value."""
    kind = data_type.kind if data_type else Kind.UNSIGNED
    if kind is Kind.BOOLEAN:
        return 0, bool
    if kind is Kind.INTEGER:
        return 1 << bits >> 1, None
    if data_type is None or kind is Kind.UNSIGNED or bits % 8 or data_type.bits not in (None, bits):
        return 0, None  # a part of a REAL or TIME means nothing by itself
    decode_bytes = data_type.decode
    return 0, lambda raw: decode_bytes(raw.to_bytes(bits // 8, "little"))


def encode(entries: Iterable[PdoMappingEntry], values: Mapping[tuple[int, int], Value], type_of: TypeOf) -> bytes:
    """The frame with *values*, by index and sub-index, and 0 for dummies.

    Raises ValueError if a mapped object has no value, or if a value does not fit its type or its bits.
    """

    def raw_of(entry: PdoMappingEntry) -> int:
        value = values.get((entry.index, entry.sub_index))
        if value is None:
            raise ValueError(f"there is no value for {entry.object}")
        return _raw(value, entry, type_of(entry))

    return pack(entries, raw_of)


def _raw(value: Value, entry: PdoMappingEntry, data_type: DataType | None) -> int:
    if data_type is None or data_type.limits is not None:
        return _raw_number(value, entry, data_type)
    data = data_type.encode(value)
    if 8 * len(data) > entry.bits or (data_type.bits is not None and 8 * len(data) != entry.bits):
        raise ValueError(f"{value!r} takes {8 * len(data)} bits, {entry} has {entry.bits}")
    return int.from_bytes(data, "little")


def _raw_number(value: Value, entry: PdoMappingEntry, data_type: DataType | None) -> int:
    """Check a number against its type and mapped bits. Raises ValueError if it does not fit."""
    if not isinstance(value, int):
        raise ValueError(f"{value!r} is not a number, as {entry.object} needs")
    if data_type is not None:
        data_type.encode(value)
    half = 1 << max(entry.bits - 1, 0)
    low, high = (-half, half - 1) if data_type and data_type.kind is Kind.INTEGER else (0, (1 << entry.bits) - 1)
    if not low <= value <= high:
        raise ValueError(f"{int(value)} does not fit the {entry.bits} bits of {entry.object} ({low}..{high})")
    return int(value)
