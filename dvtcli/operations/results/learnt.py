"""The result of `learn`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import ClassVar

from dvtcli.domain.learning.probe import Conclusions, Learnt, Probe, ProbeAnswer, Value
from dvtcli.domain.text import plural
from dvtcli.errors import DvtcliError, ended_with
from dvtcli.operations.results.documents import Answer, Document, Short
from dvtcli.operations.results.documents import Answer as Answered


@dataclass(frozen=True, slots=True)
class Difference(Short):
    """A value of the profile *name* that differs from the device: *key*, profile's value, learnt value."""

    key: str
    said: Value | None
    learnt: Learnt

    def document(self) -> Document:
        """A difference in `dvtcli.learnt/1`."""
        return {
            "key": self.key, "profile": self.said, "learnt": self.learnt.value, "evidence": self.learnt.evidence
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class LearntDevice(Answered):
    """What a device accepts: *pdos* tested, *answers*; *writes* downloads, all rolled back and verified.

    *saves* is the number of signatures sent to 0x1010. *saved* are files, *compared* a profile's name and differences
    from it. *identified* is false for a device without vendor-ID, by which no node is recognised.
    """

    renderer: ClassVar = "learn_lines:learnt_lines"

    node: int
    title: str
    pdos: Sequence[str]
    answers: Sequence[ProbeAnswer]
    conclusions: Conclusions
    writes: int
    saves: int
    seconds: float
    saved: Sequence[str] = ()
    compared: tuple[str, Sequence[Difference]] | None = None
    identified: bool = True

    def __bool__(self) -> bool:
        """Tell whether the device equals the compared profile; true without a comparison."""
        return self.exit_code == 0

    @property
    def exit_code(self) -> int:
        """3 if the device differs from the compared profile."""
        return 3 if self.compared is not None and self.compared[1] else 0

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
        if self.compared is None or not self.exit_code:
            return None
        name, differences = self.compared
        verb = "differs" if len(differences) == 1 else "differ"
        return ended_with(3, f"{plural(len(differences), 'key')} of the profile {name} {verb}")

    @property
    def changed_nothing(self) -> bool:
        """Tell whether the device did not store: all writes were rolled back and verified."""
        return not self.saves

    @property
    def not_learnt(self) -> list[ProbeAnswer]:
        """The tests without an answer."""
        return [answer for answer in self.answers if answer.code is None]

    def document(self) -> Document:
        """`dvtcli.learnt/1`."""
        return {
            "schema": "dvtcli.learnt/1",
            "node": self.node,
            "dry_run": False,
            "pdos": list(self.pdos),
            "writes": self.writes,
            "likely_writes": self.writes,
            "saves": self.saves,
            "put_back": True,
            "seconds": round(self.seconds, 3),
            "profile": [_learnt(learnt) for learnt in self.conclusions.profile],
            "family": [_learnt(learnt) for learnt in self.conclusions.family],
            "probes": [_answer(answer) for answer in self.answers],
            "saved": list(self.saved),
            "compared": None if self.compared is None else self.compared[0],
            "differences": None
            if self.compared is None
            else [difference.document() for difference in self.compared[1]],
        }


@dataclass(frozen=True, slots=True)
class LearnForecast(Answered):
    """The forecast of `learn` from a dry run: *probes* of *pdos*, at most *writes* downloads; nothing was sent.

    *likely* is the number of writes on its twin, which answers like its family.
    """

    renderer: ClassVar = "learn_lines:forecast_lines"

    node: int
    pdos: Sequence[str]
    probes: Sequence[Probe]
    writes: int
    likely: int
    stores: str
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.learnt/1`."""
        return {
            "schema": "dvtcli.learnt/1",
            "node": self.node,
            "dry_run": True,
            "pdos": list(self.pdos),
            "writes": self.writes,
            "likely_writes": self.likely,
            "saves": sum(probe.pdo is None for probe in self.probes),
            "put_back": False,
            "seconds": 0.0,
            "profile": [],
            "family": [],
            "probes": [_probe(probe) for probe in self.probes],
            "saved": [],
            "compared": None,
            "differences": None,
        }


def _learnt(one: Learnt) -> Document:
    return {"key": one.key, "value": one.value, "evidence": one.evidence}


def _probe(probe: Probe) -> Document:
    rows: Mapping[str, object] = {
        "pdo": None if probe.pdo is None else str(probe.pdo),
        "name": probe.name,
        "asks": probe.sense,
        "stand": str(probe.stand),
        "needs": str(probe.where),
        "object": f"{probe.asked.index:04X}:{probe.asked.sub_index:02X}",
        "raw": probe.asked.data.hex(" ").upper(),
    }
    return {**rows, "abort": None, "accepted": None, "held": None, "why": ""}


def _answer(answer: ProbeAnswer) -> Document:
    code = answer.code
    return {
        **_probe(answer.probe),
        "abort": f"0x{code:08X}" if code else None,
        "accepted": None if code is None else answer.accepted,
        "held": None if answer.held is None else answer.held.hex(" ").upper(),
        "why": answer.why,
    }


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
