"""Learned write requirements of device types (0x1018 without the serial number), shared with later processes.

One file per identity; the requirements of a node without identity last for the session. Writes to no device.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from dvtcli.device.change.plan_document import Identity
from dvtcli.device.change.private_file import write_private
from dvtcli.domain.pdo import Direction
from dvtcli.errors import SafetyRefusal

SCHEMA = "dvtcli.habits/2"
#: One refusal may pass; this many alike, each mended by switching the PDO off, are the device's way.
OFTEN_ENOUGH = 2
_MOST_BYTES = 10_000
_MOST_TIMES = 1_000_000

#: A parameter of the PDOs of one direction, by its sub-index.
Parameter = tuple[Direction, int]


class Habit(NamedTuple):
    """The device aborted a write to *parameter* of an enabled PDO with *abort*, and took it with the PDO disabled.

    Without a *parameter*: aborted any PDO write while OPERATIONAL, and took it in PRE-OPERATIONAL.
    """

    parameter: Parameter | None
    abort: int


@dataclass(slots=True, eq=False, repr=False)
class Habits:
    """Writes that device types accept only with the PDO disabled or in PRE-OPERATIONAL, in files of *folder*.

    *report* shows a failure.
    """

    folder: Path | None = None
    report: Callable[[str], None] = lambda _text: None
    _known: dict[str, Counter[Habit]] = field(default_factory=dict)

    @property
    def are_there(self) -> bool:
        """True if requirements of any device are known; otherwise no identity needs to be read."""
        return any(self._known.values()) or (self.folder is not None and any(self.folder.glob("*.json")))

    def off_first(self, identity: Identity) -> frozenset[Parameter]:
        """Parameters writable only while the PDO is disabled on devices of *identity*, as far as certain."""
        known = self._of(identity).items()
        return frozenset(
            habit.parameter for habit, times in known if times >= OFTEN_ENOUGH and habit.parameter is not None
        )

    def is_pre_operational_wanted(self, identity: Identity) -> bool:
        """True if devices of *identity* accept PDO writes only in PRE-OPERATIONAL, as far as certain."""
        return any(times >= OFTEN_ENOUGH and habit.parameter is None for habit, times in self._of(identity).items())

    def add(self, identity: Identity, refusal: Habit) -> int:
        """Record a *refusal* of the device of *identity* and return its count."""
        known = self._of(identity)
        known[refusal] += 1
        name = name_of(identity)
        if self.folder is not None and name:
            try:
                write_private(self.folder / f"{name}.json", json.dumps(_document(known)))
            except (OSError, SafetyRefusal) as failed:
                self.report(f"the habits of this device cannot be saved: {failed}")
        return known[refusal]

    def _of(self, identity: Identity) -> Counter[Habit]:
        """The counts so far; a node without identity has an empty name."""
        name = name_of(identity)
        if name not in self._known:
            self._known[name] = Counter() if self.folder is None or not name else self._read(self.folder, name)
        return self._known[name]

    def _read(self, folder: Path, name: str) -> Counter[Habit]:
        path = folder / f"{name}.json"
        try:
            return read_habits(path)
        except FileNotFoundError:
            return Counter()
        except (OSError, ValueError, RecursionError) as wrong:
            self.report(f"{path} is damaged ({wrong}): what dvtcli knew about this device is found out again")
            return Counter()


def name_of(identity: Identity) -> str:
    """The name for devices of *identity*: `0000001E-0705302D-00010000`; empty without a vendor or a product."""
    vendor, product, revision = (identity.get(word) for word in ("vendor", "product", "revision"))
    if not vendor or product is None:
        return ""
    return "-".join("none" if word is None else f"{word:08X}" for word in (vendor, product, revision))


def read_habits(path: Path) -> Counter[Habit]:
    """The count of each refusal in a file of `Habits`. Raises OSError, or ValueError if malformed."""
    with path.open("rb") as file:
        document = json.loads(file.read(_MOST_BYTES))
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise ValueError(f"it does not say {SCHEMA}")
    rows = [
        *map(_refusal, _list(document.get("refused"))),
        *map(_in_operational, _list(document.get("operational", []))),
    ]
    return Counter(dict(rows))


def _list(value: Any) -> Iterable[Any]:
    if not isinstance(value, list):
        raise ValueError("it names no refusals")
    return value


def _refusal(row: Any) -> tuple[Habit, int]:
    if not isinstance(row, dict):
        raise ValueError("a refusal is malformed")
    parameter = Direction(str(row.get("direction"))), _number(row.get("sub_index"), 2, 6)
    return Habit(parameter, _number(row.get("abort"), 0, 0xFFFF_FFFF)), _number(row.get("times"), 1, _MOST_TIMES)


def _in_operational(row: Any) -> tuple[Habit, int]:
    if not isinstance(row, dict):
        raise ValueError("a refusal is malformed")
    return Habit(None, _number(row.get("abort"), 0, 0xFFFF_FFFF)), _number(row.get("times"), 1, _MOST_TIMES)


def _number(value: Any, least: int, most: int) -> int:
    if type(value) is not int or not least <= value <= most:
        raise ValueError("a refusal is malformed")
    return value


def _document(known: Counter[Habit]) -> dict[str, Any]:
    rows = [
        {"direction": str(direction), "sub_index": sub, "abort": refusal.abort, "times": min(times, _MOST_TIMES)}
        for refusal, times in known.items()
        if refusal.parameter is not None
        for direction, sub in [refusal.parameter]
    ]
    running = [
        {"abort": refusal.abort, "times": min(times, _MOST_TIMES)}
        for refusal, times in known.items()
        if refusal.parameter is None
    ]
    return {"schema": SCHEMA, "refused": rows} | ({"operational": running} if running else {})
