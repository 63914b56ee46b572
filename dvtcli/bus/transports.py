"""Buses from other packages, by entry points of the group `dvtcli.bus`.

Imports none of those packages: loading is tried in a separate process, so that
hangs, crashes and output do no harm. Opens nothing.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points

from dvtcli.domain.hint import Action, Hint
from dvtcli.interpreter import python_words

#: group of the entry points
GROUP = "dvtcli.bus"
#: Time to load a package, in seconds: long enough for a busy computer.
PATIENCE_S = 30.0
_LOAD = """
import sys
from importlib.metadata import EntryPoint
if not callable(EntryPoint("", sys.argv[1], "").load()):
    raise TypeError("it is no function")
"""


@dataclass(frozen=True, slots=True)
class Brought:
    """Another package's bus by *name*; *about* names its package and fault, *problem* the remedy."""

    name: str
    about: str
    problem: Hint | str | None = None


def transports() -> Mapping[str, EntryPoint]:
    """The entry point for each name; the last found if a name is used twice."""
    return {point.name: point for point in entry_points(group=GROUP)}


def brought() -> Iterator[Brought]:
    """Each bus of other packages; loading longer than `PATIENCE_S` is a problem."""
    from can import VALID_INTERFACES

    for name, one in sorted(transports().items()):
        about = f"of {_package(one)}: {one.value}"
        if name in VALID_INTERFACES:
            yield Brought(name, about, "never opened: python-can has an interface of this name")
            continue
        hint: Hint | str | None = None
        if (why := _problem(one)) is not None:
            about, hint = f"{about}; {why}", "`pip check` says what its package lacks"
        others = [f"that of {_package(other)}: {other.value}" for other in entry_points(group=GROUP, name=name)]
        others.remove(f"that of {_package(one)}: {one.value}")
        if others:
            about = f"{about}; never opened: {', '.join(others)}"
            which = f"{{}} opens that of {_package(one)}: uninstall the package that is not meant"
            hint = Hint(Action.GIVE_INTERFACE, {"interface": name}, which)
        yield Brought(name, about, hint)


def _package(one: EntryPoint) -> str:
    return "a package" if one.dist is None else f"{one.dist.name} {one.dist.version}"


def _problem(one: EntryPoint) -> str | None:
    """Why *one* cannot be loaded; None if it can."""
    command = [*python_words(), "-P", "-c", _LOAD, one.value]
    try:
        done = subprocess.run(  # noqa: S603 - our own words
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL,
            timeout=PATIENCE_S, encoding="utf-8", errors="replace", check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"it cannot be loaded within {PATIENCE_S:g} s"
    if done.returncode == 0:
        return None
    said = done.stderr.strip().splitlines()
    return f"it cannot be loaded: {said[-1] if said else f'its process ended with {done.returncode}'}"
