"""A problem in a recording: the rule, who is concerned, when, and in which frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from statistics import median
from typing import NamedTuple, TypeVar

from dvtcli.domain.lint import LintRule

K = TypeVar("K")
L = TypeVar("L")
#: how many frames of a problem are named
_MOST_FRAMES = 10
#: rules whose problems mostly follow from others: a node that restarts, or is off, answers nothing; its mapping stays
#: half done
_FOLLOWS = {"sdo-given-up": 1, "sdo-no-answer": 1, "mapping-half-done": 2, "mapping-empty": 2}
_FROM_BAD = ("error", "warning", "note")


class Moment(NamedTuple):
    """A frame's *number* in its recording, from 1, and its time (s)."""

    number: int
    time_s: float


@dataclass(slots=True)
class Moments:
    """When something happened: *first*, *last*, how often, and the numbers of the first frames."""

    first: Moment
    last: Moment
    times: int = 1
    numbers: list[int] = field(default_factory=list)

    @classmethod
    def at(cls, *moments: Moment) -> Moments:
        """Make them of *moments*, in order."""
        return cls(moments[0], moments[-1], len(moments), [moment.number for moment in moments[:_MOST_FRAMES]])

    def joined(self, other: Moments) -> Moments:
        """Make them of these and *other*, which may overlap in time."""
        numbers = sorted({*self.numbers, *other.numbers})[:_MOST_FRAMES]
        return Moments(min(self.first, other.first), max(self.last, other.last), self.times + other.times, numbers)

    def add(self, moment: Moment) -> None:
        """Add a later *moment*."""
        self.last = moment
        self.times += 1
        if len(self.numbers) < _MOST_FRAMES:
            self.numbers.append(moment.number)


@dataclass(frozen=True, slots=True)
class Problem:
    """A finding of *rule*: *text* says what happened, *parties* between whom, *look* what to look at first.

    *node* is a node-ID, *object* as in `1A02:01`, if it is about one.
    """

    rule: LintRule
    text: str
    parties: str
    look: str
    moments: Moments
    node: int | None = None
    object: str = ""

    @property
    def order(self) -> tuple[int, int, int]:
        """A sort key: the worst first, what follows from others behind them, then by time."""
        return _FROM_BAD.index(str(self.rule.severity)), _FOLLOWS.get(self.rule.name, 0), self.moments.first.number


def joined(problems: Iterable[Problem]) -> Iterator[Problem]:
    """Iterate over *problems*, those that differ only in their moments joined to a single one."""
    found: dict[tuple[str, str, str, str, int | None, str], Problem] = {}
    for problem in problems:
        key = problem.rule.name, problem.text, problem.parties, problem.look, problem.node, problem.object
        same = found.get(key)
        found[key] = problem if same is None else replace(same, moments=same.moments.joined(problem.moments))
    yield from found.values()


class TimesOf(dict[K, Moments]):
    """Moments by what happened then."""

    def note(self, moment: Moment, what: K) -> None:
        """Add that *what* happened at *moment*."""
        if what in self:
            self[what].add(moment)
        else:
            self[what] = Moments.at(moment)

    def by(self, name: Callable[[K], L]) -> TimesOf[L]:
        """Return the same moments by the *name* of what happened then."""
        named: TimesOf[L] = TimesOf()
        for what, moments in self.items():
            key = name(what)
            named[key] = named[key].joined(moments) if key in named else moments
        return named


#: gaps from which a period is known, gaps that are kept, and how many periods a gap may take
_ENOUGH, _MOST_GAPS, LATE_AFTER_PERIODS = 4, 1_000, 2.5
#: the share of the period by which a gap is uneven; how many uneven ones there are at least, and of how many
_UNEVEN, _FEW, _ONE_OF = 0.3, 3, 20
#: a gap is shorter than its neighbours by this factor; two gaps together differ by this share at most
_UNLIKE, _ALIKE = 0.7, 0.1
#: turns from which two senders are likely
_TURNS = 8


@dataclass(slots=True)
class AlternatingFrames:
    """Tells two senders with one period by gaps (s) that are short and long by turns; *times* are the turns.

    One sender's gaps are even, or uneven without such an order.
    """

    last_s: float = 0.0
    gap_s: float = 0.0
    before_s: float = 0.0
    streak: int = 0
    times: Moments | None = None

    def take(self, moment: Moment) -> None:
        """Look at the next frame, at *moment*."""
        gap_s, last_s = moment.time_s - self.last_s, self.gap_s
        is_turn = gap_s < _UNLIKE * last_s or last_s < _UNLIKE * gap_s
        if is_turn and abs(gap_s - self.before_s) < _ALIKE * (gap_s + last_s):
            self.streak += 1
            if self.times is not None:
                self.times.add(moment)
            elif self.streak >= _TURNS:
                self.times = Moments.at(moment)
        else:
            self.streak = 0
        self.last_s, self.before_s, self.gap_s = moment.time_s, last_s, gap_s


@dataclass(slots=True)
class PeriodicFrames:
    """The heartbeats of one node, or the SYNC messages, since the node's start or the last change of their period.

    *last* is the moment of the last one, *gaps_s* are the times between two (s) and *count* is their number. *long* are
    the gaps that may be late: their time (s), how long there was no frame at all before their end (s), and the moment
    of that end. *uneven* are gaps far from the period: time (s) and moment of the end. *turns* tells two senders apart.
    """

    last: Moment | None = None
    gaps_s: list[float] = field(default_factory=list)
    long: list[tuple[float, float, Moment]] = field(default_factory=list)
    uneven: list[tuple[float, Moment]] = field(default_factory=list)
    count: int = 0
    turns: AlternatingFrames = field(default_factory=AlternatingFrames)
    _early_s: float = 0.0

    def take(self, moment: Moment, silent_s: float) -> None:
        """Take the next beat; no other frame came in the *silent_s* seconds before it."""
        if self.last is not None:
            gap_s = moment.time_s - self.last.time_s
            self.count += 1
            if self.count <= _MOST_GAPS:
                self.gaps_s.append(gap_s)
                if self.count <= _ENOUGH:
                    self._early_s = median(self.gaps_s)
            if self.count <= _ENOUGH or gap_s > LATE_AFTER_PERIODS * self._early_s:
                self.long.append((gap_s, silent_s, moment))
            if self.count <= _ENOUGH or abs(gap_s - self._early_s) > _UNEVEN / 2 * self._early_s:
                self.uneven.append((gap_s, moment))
            self.turns.take(moment)
        self.last = moment

    @property
    def period_s(self) -> float:
        """The usual gap; 0 if it is not known."""
        return median(self.gaps_s) if len(self.gaps_s) >= _ENOUGH else 0.0

    def late(self) -> list[tuple[float, Moment]]:
        """Gaps of more than two and a half periods in which other frames came after the beat was due."""
        period_s = self.period_s
        return [
            (gap_s, moment)
            for gap_s, silent_s, moment in self.long
            if gap_s > LATE_AFTER_PERIODS * period_s > 0 and gap_s - silent_s > (LATE_AFTER_PERIODS - 1) * period_s
        ]

    def jitter(self) -> list[tuple[float, Moment]]:
        """Gaps that are uneven, though not late; none if they are few of all gaps."""
        period_s = self.period_s
        found = [
            (gap_s, moment)
            for gap_s, moment in self.uneven
            if gap_s <= LATE_AFTER_PERIODS * period_s and abs(gap_s - period_s) > _UNEVEN * period_s
        ]
        return found if len(found) >= max(_FEW, self.count / _ONE_OF) else []
