"""Units as people and files write them: spellings and conversion.

SI prefixes (ISO 80000-1, 6.5.4) apply to units that take prefixes.
"""

from __future__ import annotations

import re
from fractions import Fraction

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
_SCALE = re.compile(r"(\d{1,9})/([1-9]\d{0,8})(?: +(\S.*))?|(\d{0,9}\.\d{1,9}|10{1,6}) *([^\d\s(.,/].*)")


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
        raise ValueError(f"{text[:40]!r} is no factor: write 1/256 or 0.25")
    factor = Fraction(text.strip())
    if not factor:
        raise ValueError("a factor of 0 makes all values the same")
    return factor


def parse_offset(text: str) -> Fraction:
    """An offset in a file: a number as for `parse_factor`, or 0. Raises ValueError for anything else."""
    if not _FACTOR.fullmatch(text.strip()):
        raise ValueError(f"{text[:40]!r} is no offset: write -40 or 0.5")
    return Fraction(text.strip())


def parse_scale(text: str) -> tuple[Fraction, str]:
    """One count's value, and its unit: `1/256 V`, `0.1 %`, `100 us`; without a number, the text is the unit."""
    text = " ".join(text.split())
    match = _SCALE.fullmatch(text)
    if match is None:
        return Fraction(1), spelled("" if text == "-" else text)
    factor = Fraction(int(match[1]), int(match[2])) if match[1] else Fraction(match[4])
    return (factor, spelled(match[3] or match[5] or "")) if factor else (Fraction(1), spelled(text))


def scale_text(factor: Fraction, unit: str) -> str:
    """One count's value with its unit, as input for `parse_scale`: `1/256 V`."""
    if factor == 1:
        return unit
    exact = factor.numerator == 1 and (factor * 1000).denominator > 1
    return f"{factor if exact else f'{float(factor):.9g}'} {unit}".rstrip()
