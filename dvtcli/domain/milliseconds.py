"""Times in milliseconds as the counts that communication parameters hold. Knows no parameter."""

from __future__ import annotations


def counts(time_ms: float, unit_us: int, most: int = 0xFFFF) -> int:
    """*time_ms* as a whole number of counts of *unit_us* µs; ValueError where it is none, or more than *most*."""
    number = time_ms * 1000 / unit_us
    top = most * unit_us / 1000
    if not 0 <= number <= most:
        raise ValueError(f"{time_ms:g} ms is not within 0…{top:g} ms")
    if abs(number - round(number)) > 1e-6:
        raise ValueError(f"{time_ms:g} ms is no multiple of {unit_us / 1000:g} ms ({unit_us} us counts)")
    return round(number)
