"""Habits of devices as a result."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import ClassVar

from dvtcli.operations.results.documents import Answer, Document, Short


@dataclass(frozen=True, slots=True)
class Wanted(Short):
    """A parameter, by sub-index, of PDOs in a *direction* (`tpdo`, `rpdo`).

    It was refused with *abort* *times* times while its PDO was enabled, and accepted once disabled; *counts*: often
    enough that PDOs are disabled beforehand.
    """

    direction: str
    sub_index: int
    abort: int
    times: int
    counts: bool

    def document(self) -> Document:
        """A refusal in `dvtcli.device-habits/1`."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class WantedState(Short):
    """PDO writes refused with *abort* *times* times in OPERATIONAL, and accepted in PRE-OPERATIONAL.

    *counts*: often enough that the node is brought there beforehand, after a question.
    """

    abort: int
    times: int
    counts: bool

    def document(self) -> Document:
        """A refusal in `dvtcli.device-habits/1`."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class HabitRow(Short):
    """The habits of devices with an identity: *name* is vendor, product, revision; *problem*: why unreadable."""

    name: str
    wanted: tuple[Wanted, ...]
    problem: str | None = None
    pre_operational: tuple[WantedState, ...] = ()

    def document(self) -> Document:
        """A device in `dvtcli.device-habits/1`."""
        return {
            "name": self.name,
            "off_first": [habit.document() for habit in self.wanted],
            "pre_operational": [state.document() for state in self.pre_operational],
            "problem": self.problem,
        }


@dataclass(frozen=True, slots=True)
class HabitListing(Answer):
    """The habits in *folder*, after those of the devices *forgotten* were removed."""

    renderer: ClassVar = "learn_lines:habit_lines"

    rows: tuple[HabitRow, ...]
    folder: str
    forgotten: tuple[str, ...] = ()
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.device-habits/1`."""
        return {
            "schema": "dvtcli.device-habits/1",
            "folder": self.folder,
            "devices": [row.document() for row in self.rows],
            "forgotten": list(self.forgotten),
        }
