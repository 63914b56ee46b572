"""What devices were found to want, as an answer. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import ClassVar

from dvtcli.operations.results.documents import Answer, Document, Short


@dataclass(frozen=True, slots=True)
class Wanted(Short):
    """A parameter, by its sub-index, of the PDOs of one *direction* (`tpdo`, `rpdo`).

    It was refused with *abort* so many *times* while its PDO was on, and taken once it was off; *counts* says whether
    that was often enough for a PDO to be disabled right away.
    """

    direction: str
    sub_index: int
    abort: int
    times: int
    counts: bool

    def document(self) -> Document:
        """One refusal of `dvtcli.device-habits/1`."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class WantedState(Short):
    """PDO writes were refused with *abort* so many *times* in OPERATIONAL, and taken in PRE-OPERATIONAL.

    *counts* says whether that was often enough for the node to be brought there right away, after a question.
    """

    abort: int
    times: int
    counts: bool

    def document(self) -> Document:
        """One refusal of `dvtcli.device-habits/1`."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class HabitRow(Short):
    """What devices of one identity want; *name* is vendor, product and revision, *problem* why that is not known."""

    name: str
    wanted: tuple[Wanted, ...]
    problem: str | None = None
    pre_operational: tuple[WantedState, ...] = ()

    def document(self) -> Document:
        """One device of `dvtcli.device-habits/1`."""
        return {
            "name": self.name,
            "off_first": [habit.document() for habit in self.wanted],
            "pre_operational": [state.document() for state in self.pre_operational],
            "problem": self.problem,
        }


@dataclass(frozen=True, slots=True)
class HabitListing(Answer):
    """What is remembered in *folder*, after that of the devices *forgotten* was removed."""

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
