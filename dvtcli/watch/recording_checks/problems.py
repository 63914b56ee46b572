"""A problem in a recording: the rule, who is concerned, when, and in which frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeVar

from dvtcli.domain.lint.lint_rule import LintRule

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
