"""The progress of work on a node, the outcome of an applied plan, and the refusal of a plan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from dvtcli.domain.plan import Plan, Step
from dvtcli.domain.rules import errors_in
from dvtcli.domain.rules.finding import Finding
from dvtcli.errors import RuleError


class Applied(NamedTuple):
    """A plan that the device took, with the findings of the rules.

    *unreadable* are objects of the plan without read access: acknowledged, but not verified. *not_put_back* describes
    each untouched PDO whose old value the device refused, with its present value. *unrestored* are objects that keep
    the written value because their old value is unknown.
    """

    plan: Plan
    findings: tuple[Finding, ...] = ()
    not_put_back: tuple[Finding, ...] = ()
    unreadable: tuple[str, ...] = ()
    unrestored: tuple[str, ...] = ()


def refuse(findings: tuple[Finding, ...], text: str, node_id: int, *, force: bool, can_force: bool = True) -> None:
    """Raise RuleError if *findings* hold an error, unless *force* is given and *can_force* allows it."""
    stopping = errors_in(findings)
    if stopping and not (force and can_force):
        raise RuleError(f"{text}: {stopping[0].text}", stopping, node=node_id, can_force=can_force)


@dataclass(frozen=True, slots=True)
class Progress:
    """*node* took *step*, number *done* of *total*; until the last is read back, all may be rolled back."""

    node: int
    done: int
    total: int
    step: Step
