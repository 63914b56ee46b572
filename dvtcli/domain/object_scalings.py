"""Physical meaning of objects, by a profile's rules and a device's file, and the text of their values. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import NamedTuple

from dvtcli.domain.datatypes import DataType, Value
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry, normalised
from dvtcli.domain.objects import DEVICE_TYPE, PROFILE_AREA, in_first
from dvtcli.domain.scaling import Scaling, parse_factor, parse_offset, parse_scale

#: scaling of an object without description
NOTHING = Scaling()
#: the device profile of drives
_DRIVE = 402
#: objects up to here have the types in CiA 301, whatever a file says
_LAST_OF_CIA_301 = 0x1FFF


class ObjectRange(NamedTuple):
    """All objects from index *first* to *last* with a sub-index from *first_sub* to *last_sub*."""

    first: int
    last: int
    first_sub: int = 0
    last_sub: int = 0

    def holds(self, index: int, sub_index: int) -> bool:
        """Whether *index*:*sub_index* is in the range."""
        return self.first <= index <= self.last and self.first_sub <= sub_index <= self.last_sub

    @property
    def size(self) -> int:
        """How many they are."""
        return (self.last - self.first + 1) * (self.last_sub - self.first_sub + 1)


class ScalingRule(NamedTuple):
    """A physical meaning for some objects.

    With *numbered*, the bits of sub-index k are called `NAME n`, counted from sub-index 1 with *per* bits each.
    """

    physical: Scaling
    numbered: str = ""
    per: int = 8

    def at(self, sub_index: int) -> Scaling:
        """The meaning of the object at *sub_index*."""
        if not self.numbered:
            return self.physical
        first = (max(sub_index, 1) - 1) * self.per + 1
        return replace(self.physical, bits={bit: f"{self.numbered} {first + bit}" for bit in range(self.per)})


@dataclass(frozen=True, slots=True)
class ScaledValue:
    """Meaning of an object's bytes: data type and scaling."""

    data_type: DataType
    meaning: Scaling

    def value(self, data: bytes | None) -> Value | None:
        """The raw value in *data*; None without data, or if it does not fit the type."""
        try:
            return None if data is None else self.data_type.decode(data)
        except ValueError:
            return None


Rules = Mapping[ObjectRange, ScalingRule]


@dataclass(frozen=True, slots=True)
class Standard:
    """Definitions in the CiA device profile *number*; 301, not a profile, applies to every device.

    *names* are the standard's object names, small letters and `_`: if a device claims another profile or
    none, an object counts only if its file uses this name.
    """

    number: int
    rules: Rules
    names: Mapping[int, str] = field(default_factory=dict)

    def rule(self, index: int, sub_index: int, dictionary: ObjectDictionary | None) -> Scaling | None:
        """Scaling of *index*:*sub_index* in the device described by *dictionary*, None if undefined.

        Further axes of a drive have the objects of the first axis, each 0x800 higher (CiA 402-2, 7).
        """
        told = _profile_number(dictionary)
        base = in_first(index) if index in PROFILE_AREA else index
        if self.number == 301 or told in (None, self.number):
            return best(self.rules, base if self.number == _DRIVE else index, sub_index)
        known = dictionary is not None and index in dictionary and base in self.names
        if known and dictionary is not None and normalised(dictionary[index].name) == self.names[base]:
            return best(self.rules, base, sub_index)
        return None


def _profile_number(dictionary: ObjectDictionary | None) -> int | None:
    """The device profile in a device's file; None without a file, or if not given."""
    entry = dictionary.entry(DEVICE_TYPE, 0) if dictionary else None
    data = None if entry is None else entry.initial(0)
    return None if data is None else int.from_bytes(data, "little") & 0xFFFF


def best(rules: Rules, index: int, sub_index: int) -> Scaling | None:
    """The meaning from the narrowest range with *index*:*sub_index*, None if no range has it."""
    fitting = [(place.size, meaning) for place, meaning in rules.items() if place.holds(index, sub_index)]
    return min(fitting, key=lambda pair: pair[0])[1].at(sub_index) if fitting else None


class ObjectScalings:
    """ObjectScalings of a device's objects: the first match in *own*, else its file and *standards*.

    With *only_described*, an object missing in *dictionary* has words and bits, but no unit, as its
    sign is unknown. The device's own file takes precedence over a standard for a unit.
    """

    def __init__(
        self,
        own: Sequence[Rules] = (),
        standards: Sequence[Standard] = (),
        dictionary: ObjectDictionary | None = None,
        *,
        only_described: bool = False,
    ) -> None:
        self._only_described = only_described
        self._own = own
        self._standards = standards
        self._dictionary = dictionary
        self._found: dict[tuple[int, int], Scaling] = {}

    def of(self, index: int, sub_index: int) -> Scaling:
        """The meaning of *index*:*sub_index*; `NOTHING` if unknown."""
        place = index, sub_index
        if place not in self._found:
            self._found[place] = self._look_up(index, sub_index)
        return self._found[place]

    def _look_up(self, index: int, sub_index: int) -> Scaling:
        entry = self._dictionary.entry(index, sub_index) if self._dictionary else None
        found = self._said(index, sub_index, entry)
        if self._only_described and entry is None and index > _LAST_OF_CIA_301 and found.has_number:
            # the sign is unknown: -1500 rpm would be shown as 4294965796 rpm
            return replace(found, unit="", factor=NOTHING.factor, offset=NOTHING.offset)
        return found

    def _said(self, index: int, sub_index: int, entry: OdEntry | None) -> Scaling:
        for rules in self._own:
            if (found := best(rules, index, sub_index)) is not None:
                return found
        told = NOTHING if entry is None else _of_file(entry)
        for standard in self._standards:
            if (found := standard.rule(index, sub_index, self._dictionary)) is not None:
                if told.has_number:
                    return replace(found, unit=told.unit, factor=told.factor, offset=told.offset)
                return found
        return told


def _of_file(entry: OdEntry) -> Scaling:
    """Scaling in a file: `Unit` and `Factor` of an EDS (not standard keys), or an XDD's unit and scale.

    A limit is never an offset.
    """
    factor, unit = parse_scale(entry.unit)
    with suppress(ValueError):  # missing, or invalid
        factor *= parse_factor(entry.factor)
    offset = parse_offset(entry.offset) if entry.offset else Fraction(0)
    return Scaling(unit, factor, offset * factor)


#: displayed bytes of a long value, and characters of a text beside another
MOST_SHOWN, _WIDEST = 128, 24


def value_text(value: Value | None, meaning: Scaling = NOTHING, bits: int = 0, *, hexed: bool = False) -> str:
    """*value*, of *bits* bits, for people: `48.0 V (768)`, `operation enabled (0x0637)`; `-` for None.

    With *hexed*, a number without a meaning is followed by its hex digits: its bits may have one.
    """
    if value is None:
        return "-"
    if isinstance(value, bytes):
        return cut_bytes(value)
    text = meaning.text(value, bits)
    if isinstance(value, float) and not text:
        return repr(value) if bits == 64 else f"{value:.9g}"
    if hexed and bits and isinstance(value, int) and not isinstance(value, bool) and not text.endswith(")"):
        return f"{text or value} (0x{value & ((1 << bits) - 1):0{(bits + 3) // 4}X})"
    return text or (str(value).lower() if isinstance(value, bool) else str(value))


def cut_text(text: str) -> str:
    """A text in quotes; of a long text the beginning and the length."""
    return repr(text) if len(text) <= _WIDEST else f"{text[:_WIDEST]!r}… {len(text):,} characters"


def cut_bytes(data: bytes) -> str:
    """The first bytes of *data*, and its length."""
    if len(data) <= MOST_SHOWN:
        return data.hex(" ").upper()
    return f"{data[:MOST_SHOWN].hex(' ').upper()} … {len(data):,} bytes"
