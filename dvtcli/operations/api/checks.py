"""Check the types of a program's arguments: a UsageError names the argument. Asks no device."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from reprlib import repr as short
from typing import Any

from dvtcli.errors import UsageError

#: Range of a time-out, in seconds.
LEAST_S, MOST_S = 0.001, 600.0


def wrong(name: str, value: object, takes: str) -> UsageError:
    """Make the error for *value* of the argument *name*, which *takes* something else."""
    return UsageError(f"{name}={short(value)}: {takes}")


def flag(name: str, value: object) -> bool:
    """Require True or False, and no truthy value: `"no"` would be true."""
    if not isinstance(value, bool):
        raise wrong(name, value, "True or False")
    return value


def flags(**given: object) -> None:
    """Require True or False for each of *given*."""
    for name, value in given.items():
        flag(name, value)


def whole(name: str, value: object, what: str, high: int, *, low: int = 0) -> int:
    """A whole number *low*…*high*; True and False are none."""
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        numbers = f"{low}…{high}" + (f" (0x{low:X}…0x{high:X})" if high > 255 else "")
        raise wrong(name, value, f"{what} is {numbers}")
    return value


def number(name: str, value: object, what: str, *, low: float = 0.0, high: float = math.inf) -> float:
    """A finite number *low*…*high*."""
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or not math.isfinite(value)
        or not low <= value <= high
    ):
        raise wrong(name, value, what)
    return value


def seconds(name: str, value: object) -> float:
    """A time-out in seconds."""
    return number(name, value, f"a number of seconds, {LEAST_S:g}…{MOST_S:g}", low=LEAST_S, high=MOST_S)


def word(name: str, value: object, takes: str) -> str:
    """Text."""
    if not isinstance(value, str):
        raise wrong(name, value, takes)
    return value


def words(name: str, value: object) -> tuple[str, ...]:
    """Require a list or tuple of words; a single text would count as its letters."""
    if not isinstance(value, list | tuple) or not all(isinstance(item, str) for item in value):
        raise wrong(name, value, "a list or tuple of words")
    return tuple(value)


def path(name: str, value: object) -> Path:
    """Require the path of a file or folder, which need not exist."""
    if not isinstance(value, str | Path) or "\0" in str(value):
        raise wrong(name, value, "a path: text or pathlib.Path")
    return Path(value)


def call_back(**given: Callable[..., Any] | None) -> None:
    """Require a callable or None for each of *given*."""
    for name, value in given.items():
        if value is not None and not callable(value):
            raise wrong(name, value, "a function, or None")
