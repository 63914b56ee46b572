"""Convert times in milliseconds to the counts in communication parameters."""

from __future__ import annotations

import re

_TIME = re.compile(r"([+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?) ?(ms|s|)")


def milliseconds(text: str) -> float:
    """The time *text*, `20`, `20ms` or `0.02 s`, in milliseconds. Raises ValueError if it is not a time."""
    found = _TIME.fullmatch(text.strip())
    if found is None:
        raise ValueError(f"{text!r} is not a time in milliseconds, such as 20, 20ms or 0.02s")
    return float(found[1]) * (1000 if found[2] == "s" else 1)


def counts(time_ms: float, unit_us: int, most: int = 0xFFFF) -> int:
    """*time_ms* as counts of *unit_us* µs. Raises ValueError if not a whole number, or above *most*."""
    number = time_ms * 1000 / unit_us
    top = most * unit_us / 1000
    if not 0 <= number <= most:
        raise ValueError(f"{time_ms:g} ms is not within 0…{top:g} ms")
    if abs(number - round(number)) > 1e-6:
        raise ValueError(f"{time_ms:g} ms is no multiple of {unit_us / 1000:g} ms ({unit_us} us counts)")
    return round(number)
