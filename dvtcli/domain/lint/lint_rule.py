"""How a rule about a device's file is declared: once, where it is checked.

Knows no rule and no file. A rule of `map` is another thing (`rules.rule`): that one judges a change.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Generic, NamedTuple, TypeVar

from dvtcli.domain.profile import Severity

ERROR, WARNING, NOTE = Severity.ERROR, Severity.WARNING, Severity.NOTE


class LintRule(NamedTuple):
    """One rule: its *name*, how bad it is where it speaks, what it says then (*sense*), and who says so (*source*).

    An error: the file contradicts itself or the standard, and who believes it does the wrong thing. A warning: most
    likely not meant, or against the standard, and tools get along with it. A note: worth knowing.
    """

    name: str
    severity: Severity
    sense: str
    source: str


Subject = TypeVar("Subject")
Place = TypeVar("Place")
Look = Callable[[Subject], Iterable[tuple[Place, str]]]


@dataclass(frozen=True, slots=True)
class RuleCheck(Generic[Subject, Place]):
    """A rule with what checks it: *look* takes the subject and yields a place and a text for each thing found."""

    rule: LintRule
    look: Look[Subject, Place]


def check(
    name: str, severity: Severity, sense: str, source: str
) -> Callable[[Look[Subject, Place]], RuleCheck[Subject, Place]]:
    """Declare a rule above the function that checks it; the function becomes the `RuleCheck`."""
    return lambda look: RuleCheck(LintRule(name, severity, sense, source), look)


def checks_of(*modules: ModuleType) -> list[RuleCheck[Any, Any]]:
    """Every check that *modules* declare, in the order they stand there."""
    return [value for module in modules for value in vars(module).values() if isinstance(value, RuleCheck)]
