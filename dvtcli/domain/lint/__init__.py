"""Rules of `eds check` over an object dictionary, and how a rule of a file is declared: at its check function.

Rules of `map` (`rules.finding`) judge a change instead. Imports no rule: the reader needs the declaration only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Generic, NamedTuple, TypeVar

from dvtcli.domain.profile import Severity

ERROR, WARNING, NOTE = Severity.ERROR, Severity.WARNING, Severity.NOTE


class LintRule(NamedTuple):
    """A rule: *name*, *severity*, finding text (*sense*), *source*, and what to change in the file (*hint*).

    Error: the file contradicts itself or the standard, and readers that trust it do the wrong thing. Warning: probably
    unintended, or against the standard, but tools cope. Note: worth knowing.
    """

    name: str
    severity: Severity
    sense: str
    source: str
    hint: str = ""


Subject = TypeVar("Subject")
Place = TypeVar("Place")
Look = Callable[[Subject], Iterable[tuple[Place, str]]]


@dataclass(frozen=True, slots=True)
class RuleCheck(Generic[Subject, Place]):
    """A rule with its check: *look* takes the subject and yields a place and a text for each finding."""

    rule: LintRule
    look: Look[Subject, Place]


def check(
    name: str, severity: Severity, sense: str, source: str, hint: str = ""
) -> Callable[[Look[Subject, Place]], RuleCheck[Subject, Place]]:
    """Declare a rule at its check function, which becomes the `RuleCheck`."""
    return lambda look: RuleCheck(LintRule(name, severity, sense, source, hint), look)


def checks_of(*modules: ModuleType) -> list[RuleCheck[Any, Any]]:
    """Every check declared in *modules*, in source order."""
    return [value for module in modules for value in vars(module).values() if isinstance(value, RuleCheck)]
