"""Meaning of an object's raw value: a number with a unit, a word, or named bits.

Exact: factors are fractions, and values are rounded only for display. Pure.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from math import lcm
from typing import NamedTuple

from dvtcli.domain.datatypes import Value, parse_number

#: maximum decimal places
_MOST_DECIMALS = 12
_QUANTITY = (
    r"(?P<number>[+-]?(?:[0-9]{1,30}(?:\.[0-9]{0,30})?|\.[0-9]{1,30})(?:[eE][+-]?[0-9]{1,2})?)\s*(?P<unit>[^\s\d(,][^()]*?)?"
    r"(?:(?<!\s)\s*\((?P<raw>-?(?:[0-9]{1,40}|0[xX][0-9a-fA-F]{1,38}))\))?"
)
#: a word as `text` shows it, raw in parentheses
_WITH_RAW = r"(?s)(?P<word>.*)\((?P<raw>-?(?:[0-9]{1,40}|0[xX][0-9a-fA-F]{1,38}))\)"
#: blanks, punctuation, brackets, and the hyphen within a word
_LEFT_OUT = r"(?:[\s_,;:'\"()\[\]]|(?<=[^\W\d_])-(?=[^\W\d_]))+"


class State(NamedTuple):
    """A word for all raw values with *bits* under *mask*."""

    mask: int
    bits: int
    text: str


class _Counts(NamedTuple):
    """Factor and offset in whole numbers: physical = (raw x *times* + *more*) / *parts*, with *decimals* places."""

    times: int
    more: int
    parts: int
    decimals: int


@dataclass(frozen=True, slots=True)
class Scaling:
    """Meaning of a raw value: raw x *factor* + *offset* in *unit*; or a word (*values*, *states*); or named *bits*.

    *bits* are by bit number, 0 and up.
    """

    unit: str = ""
    factor: Fraction = Fraction(1)
    offset: Fraction = Fraction(0)
    values: Mapping[int, str] = field(default_factory=dict)
    states: tuple[State, ...] = ()
    bits: Mapping[int, str] = field(default_factory=dict)
    #: whether the physical number differs from the raw one
    is_scaled: bool = field(init=False, repr=False, compare=False)
    #: whether the values are numbers, not words or bits
    has_number: bool = field(init=False, repr=False, compare=False)
    _counts: _Counts | None = field(default=None, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.factor:
            raise ValueError("a factor of 0 makes all values the same")
        object.__setattr__(self, "is_scaled", self.factor != 1 or bool(self.offset))
        object.__setattr__(self, "has_number", bool(self.unit) or self.is_scaled)

    @property
    def says(self) -> bool:
        """Whether the scaling adds anything to the raw value."""
        return bool(self.unit or self.is_scaled or self.values or self.states or self.bits)

    @property
    def scale(self) -> str:
        """One count's value and unit: `1/256 V`."""
        return scale_text(self.factor, self.unit)

    def to_physical(self, raw: float) -> Fraction | float:
        """The physical number of *raw*: exact for a whole number."""
        if isinstance(raw, float):
            return raw * float(self.factor) + float(self.offset) if self.is_scaled else raw
        return raw * self.factor + self.offset

    def number(self, raw: float) -> int | float:
        """The physical number of *raw* for a document or a table: a whole number if always whole, else a float."""
        if isinstance(raw, float):
            return float(self.to_physical(raw))
        counts = self._in_counts()
        exact = raw * counts.times + counts.more
        return exact if counts.parts == 1 else exact / counts.parts

    def meaning(self, raw: int) -> str:
        """The word for *raw*; empty for none."""
        if raw in self.values:
            return self.values[raw]
        for state in self.states:
            if raw & state.mask == state.bits:
                return state.text
        return ""

    def set_bits(self, raw: int) -> tuple[str, ...]:
        """Names of the bits set in *raw* (0 and up), from bit 0; `bit 6` without a name."""
        if not self.bits:
            return ()
        return tuple(self.bits.get(bit, f"bit {bit}") for bit in range(raw.bit_length()) if raw >> bit & 1)

    def quantity(self, raw: float) -> str:
        """The physical number for *raw*, with unit: `48.0 V`."""
        return f"{self.number_text(raw)} {self.unit}".rstrip()

    def words(self, raw: Value) -> str:
        """Meaning of *raw*, without *raw* itself: `48.0 V`, `operation enabled`, `input 1, input 3`; empty for none."""
        if isinstance(raw, int):
            word = self.word(raw) if self.values or self.states or self.bits else ""
        elif isinstance(raw, float):
            word = ""
        else:
            return ""
        return word or (self.quantity(raw) if self.has_number else "")

    def word(self, raw: int) -> str:
        """The word for *raw*, or its bits' names; empty for neither."""
        word = self.meaning(raw)
        if not word and self.bits and not self.states and raw >= 0:
            return ", ".join(self.set_bits(raw)) or "none"
        return word

    def text(self, raw: Value, bits: int = 0) -> str:
        """*raw* for people, with *raw* in parentheses if different: `48.0 V (768)`; empty for no meaning.

        *bits*, if known, is the length of *raw*: `operation enabled (0x0637)` has all its hex digits.
        """
        if not isinstance(raw, int):
            return self.words(raw)
        word, quantity = self.word(raw), self.quantity(raw) if self.has_number else ""
        words = word or quantity
        if not words or (words == quantity and not self.is_scaled):  # raw is in it already
            return words
        return f"{words} ({self.raw_text(raw, bits)})"

    def raw_text(self, raw: int, bits: int = 0) -> str:
        """*raw* as text, of *bits* bits if known: hexadecimal if its bits have a meaning."""
        if not (self.states or self.bits) or raw < 0:
            return str(int(raw))
        return f"0x{raw:0{2 * ((max(raw.bit_length(), bits, 1) + 7) // 8)}X}"

    def number_text(self, raw: float) -> str:
        """The physical number of *raw*, with enough digits to distinguish raw values: `48.0`."""
        if isinstance(raw, float):
            return f"{self.to_physical(raw):.9g}"
        times, more, parts, decimals = self._in_counts()
        if parts == 1:
            return str(raw * times + more)
        digits, rest = divmod((raw * times + more) * 10**decimals, parts)
        digits += 2 * rest > parts or (2 * rest == parts and digits % 2)  # half to even
        whole, part = divmod(abs(digits), 10**decimals)
        sign = "-" if digits < 0 else ""
        if not decimals:
            return f"{sign}{whole}"
        return f"{sign}{whole}.{f'{part:0{decimals}}'.rstrip('0') or '0'}"

    def _in_counts(self) -> _Counts:
        """Factor and offset as whole numbers, for fast conversion of thousands of values per second."""
        if self._counts is None:
            parts = lcm(self.factor.denominator, self.offset.denominator)
            counts = _Counts(int(self.factor * parts), int(self.offset * parts), parts, self._decimals())
            object.__setattr__(self, "_counts", counts)
            return counts
        return self._counts

    def _decimals(self) -> int:
        """The fewest decimal places that distinguish two raw values."""
        for decimals in range(_MOST_DECIMALS):
            unit = Fraction(1, 10**decimals)
            exact = (self.factor / unit).denominator == (self.offset / unit).denominator == 1
            if exact or unit < abs(self.factor):
                return decimals
        return _MOST_DECIMALS

    def to_raw(self, text: str, *, whole: bool = True) -> float | None:
        """The raw value for *text*: a number with a unit (`48V`, `48 mV`), a word, or output of `text`.

        None for anything else, such as a number alone (already raw). A number is accurate to its last digit: `23.4 V`
        is the nearest raw value that rounds to 23.4 V. Without *whole* the result is a real number. Raises ValueError
        for another unit, for a number without a close raw value, for another raw value in parentheses, and for a word
        with several raw values.
        """
        found = None if _is_raw(text, whole=whole) else self._by_word(text.strip())
        if found is not None:
            return found
        match = None if _number(text) is not None else re.fullmatch(_QUANTITY, text.strip())
        if match is None or not self.has_number or not (match["unit"] or match["raw"]):
            return None
        number = self._in_own_unit(match)
        return self._whole(match, *number) if whole else float((number[0] - self.offset) / self.factor)

    def _by_word(self, text: str) -> int | None:
        """The raw value for the word *text*, exactly; or ignoring blanks and case, unless it is a number."""
        shown = re.fullmatch(_WITH_RAW, text)
        number = None if shown is None else _number(shown["raw"])
        if (
            shown
            and number is not None
            and _spelling(self.values.get(number, "")) == _spelling(shown["word"].rstrip()) != ""
        ):
            return number
        wanted = _spelling(text) if _number(text) is None else ""
        named = [raw for raw, word in self.values.items() if word == text and text] or [
            raw for raw, word in self.values.items() if wanted and _spelling(word) == wanted
        ]
        if len(named) > 1:
            may_be = " or ".join(f"{self.values[raw]!r} ({raw})" for raw in named)
            raise ValueError(f"it can be {may_be}: enter the number")
        return named[0] if named else None

    def _in_own_unit(self, match: re.Match[str]) -> tuple[Fraction, Fraction]:
        """The number in *match* in the object's own unit, and its last digit's weight."""
        unit = spelled((match["unit"] or "").strip())
        ratio = times(unit, self.unit) if unit else None if self.unit else Fraction(1)
        if ratio is None:
            known = f"it is in {with_prefixes(self.unit)}" if self.unit else "it has no unit"
            raise ValueError(f"{known}, not {f'in {unit}' if unit else 'a number alone'}")
        number, last_digit = _with_last_digit(match["number"])
        return number * ratio, last_digit * ratio

    def _whole(self, match: re.Match[str], number: Fraction, last_digit: Fraction) -> int:
        """The raw value for *number*, typed as *match*. Raises ValueError if none is close, or if raw differs."""
        raw = round((number - self.offset) / self.factor)
        off = abs(raw * self.factor + self.offset - number)
        if off and 2 * off >= last_digit and Fraction(self.number_text(raw)) != number:
            raise ValueError(f"one count is {self.scale}: the nearest values are {self._neighbours(number)}")
        if match["raw"] is not None and _number(match["raw"]) != raw:
            raise ValueError(f"{self.quantity(raw)} is {raw} raw, not {match['raw']}")
        return raw

    def _neighbours(self, number: Fraction) -> str:
        exact = (number - self.offset) / self.factor
        below = exact.numerator // exact.denominator
        return " and ".join(self.text(raw) or str(raw) for raw in (below, below + 1))


def _spelling(word: str) -> str:
    """*word* without optional characters; a sign stays, to distinguish `+10 V` from `-10 V`."""
    return re.sub(_LEFT_OUT, "_", word.lower()).strip("_")


def _is_raw(text: str, *, whole: bool) -> bool:
    """Whether *text* is a number alone, in the notation of the object's own type."""
    try:
        parse_number(text) if whole else float(text)
    except ValueError:
        return False
    return True


def _number(text: str) -> int | None:
    try:
        return int(text, 0)
    except ValueError:
        return None


def _with_last_digit(text: str) -> tuple[Fraction, Fraction]:
    """A decimal number, and its last digit's weight."""
    mantissa, _, exponent = text.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return Fraction(text), Fraction(10) ** (int(exponent or 0) - decimals)


#: other spellings of the same unit
_SPELLINGS = {
    "degC": "°C", "deg C": "°C", "degF": "°F", "deg F": "°F", "degree": "°", "degrees": "°", "deg": "°",
    "Ohm": "Ω", "ohm": "Ω", "\u2126": "Ω", "sec": "s", "msec": "ms", "usec": "µs", "r/min": "rpm", "1/min": "rpm",
    "RPM": "rpm", "percent": "%",
}  # fmt: skip
_PREFIXES = {
    "": 0, "p": -12, "n": -9, "µ": -6, "m": -3, "c": -2, "d": -1, "k": 3, "M": 6, "G": 9,
}  # fmt: skip
#: units that take a prefix
_BASES = frozenset({"V", "A", "W", "Ω", "Hz", "s", "m", "g", "N", "Nm", "Pa", "J", "K", "F", "H", "C", "Wh", "Ah", "VA",
                    "bar", "T", "rad", "inc", "bit"})  # fmt: skip
_FACTOR = re.compile(r"[+-]?(?:\d{1,18}/0*[1-9]\d{0,17}|\d{1,18}(?:\.\d{0,18})?(?:[eE][+-]?\d{1,2})?|\.\d{1,18})")
#: a whole number, and a unit: behind a blank also `1/s`, without one none such as `e5`, of `1/3e5`
_EXACT_SCALE = re.compile(rf"((?>{_FACTOR.pattern}))(?:(?!\w\d)([^\d\s(.,/^*].*)| +([^\d\s(.,/^*].*|1/[^\W\d].*))?")
#: a unit that begins with a digit: `1/s`
_PER = re.compile(r"1/[^\W\d].*")
_SCALE = r"(\d{1,9})/([1-9]\d{0,8})(?: +(\S.*))?|(\d{0,9}\.\d{1,9}|10{1,6}) *([^\d\s(.,/].*)"


def spelled(unit: str) -> str:
    """*unit* as displayed: `degC` as `°C`, `us` as `µs`."""
    text = " ".join(unit.split()).replace("\u03bc", "µ")
    text = _SPELLINGS.get(text, text)
    return f"µ{text[1:]}" if text[:1] == "u" and text[1:] in _BASES else text


def times(unit: str, other: str) -> Fraction | None:
    """The number of *other* in a *unit*: 1000 for `V` and `mV`; None if not convertible."""
    unit, other = spelled(unit), spelled(other)
    if unit == other:
        return Fraction(1)
    (one, rest), (two, other_rest) = _split(unit), _split(other)
    if one is None or two is None or rest != other_rest or one[1] != two[1]:
        return None
    return Fraction(10) ** (one[0] - two[0])


def with_prefixes(unit: str) -> str:
    """Examples of spellings of *unit*, for a hint: `V, mV or kV`."""
    first, _ = _split(spelled(unit))
    if first is None:
        return unit
    tail = spelled(unit)[len(_word(spelled(unit))) :]
    others = [f"{prefix}{first[1]}{tail}" for prefix in ("", "m", "k")]
    return ", ".join(dict.fromkeys([spelled(unit), *others]))


def _word(unit: str) -> str:
    """The part that may have a prefix: the first part of `km/h` and `N m`."""
    return re.split(r"[/*· ]", unit, maxsplit=1)[0]


def _split(unit: str) -> tuple[tuple[int, str] | None, str]:
    """Power of ten and base of a unit's first part, None without prefix; and its other parts."""
    word = _word(unit)
    rest = unit[len(word) :]
    if word in _BASES:
        return (0, word), rest
    if word[:1] in _PREFIXES and word[1:] in _BASES:
        return (_PREFIXES[word[0]], word[1:]), rest
    return None, rest


def parse_factor(text: str) -> Fraction:
    """A factor such as `1/256`, `0.25`, `1e-3`. Raises ValueError for anything else, and for 0."""
    if not _FACTOR.fullmatch(text.strip()):
        raise ValueError(f"{text[:40]!r} is not a factor: write 1/256 or 0.25")
    factor = Fraction(text.strip())
    if not factor:
        raise ValueError("a factor of 0 makes all values the same")
    return factor


def parse_offset(text: str) -> Fraction:
    """An offset in a file: a number as for `parse_factor`, or 0. Raises ValueError for anything else."""
    if not _FACTOR.fullmatch(text.strip()):
        raise ValueError(f"{text[:40]!r} is not an offset: write -40 or 0.5")
    return Fraction(text.strip())


def parse_scale(text: str) -> tuple[Fraction, str]:
    """One count's value, and its unit: `1/256 V`, `0.1 %`, `100 us`; without a number, the text is the unit."""
    text = " ".join(text.split())
    match = re.fullmatch(_SCALE, text)
    if match is None:
        return Fraction(1), spelled("" if text == "-" else text)
    factor = Fraction(int(match[1]), int(match[2])) if match[1] else Fraction(match[4])
    return (factor, spelled(match[3] or match[5] or "")) if factor else (Fraction(1), spelled(text))


def parse_exact_scale(text: str) -> tuple[Fraction, str]:
    """One count's value, and its unit, in a file of dvtcli's own: as `scale_text` writes them, or `2 V`, `3e-5 rad`.

    A number in front is always the factor, other than in an EDS, where `2 decimals` is a unit. Raises ValueError for a
    factor of 0, and for another text that begins with a digit.
    """
    text = " ".join(text.split())
    match = _EXACT_SCALE.fullmatch(text)
    if match is not None:
        return parse_factor(match[1]), spelled(match[2] or match[3] or "")
    factor, unit = parse_scale(text)
    if unit[:1].isdecimal() and not _PER.fullmatch(unit):
        raise ValueError(f"{text[:40]!r} is not one count's value: write 1/256 V, 0.5 V or V")
    return factor, unit


def scale_text(factor: Fraction, unit: str) -> str:
    """One count's value with its unit, with at most nine digits: `1/256 V`, `2 V`."""
    if factor == 1:
        return unit
    exact = factor.numerator == 1 and (factor * 1000).denominator > 1
    return f"{factor if exact else f'{float(factor):.9g}'} {unit}".rstrip()
