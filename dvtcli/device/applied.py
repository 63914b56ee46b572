"""What became of a checked plan, and refusing one that the rules forbid. Knows no device."""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.domain.plan import Plan
from dvtcli.domain.rules import Finding, errors_in
from dvtcli.errors import RuleError


@dataclass(frozen=True, slots=True)
class Applied:
    """A plan that the device took, with what the rules said beforehand.

    *unreadable* are the objects of it that cannot be read back: they were acknowledged, and nothing more is known.
    *not_put_back* says of each PDO that was to be what it was before, and that the device did not take, what it is now.
    *unrestored* are the objects that were to be put back and keep what was written: nobody knows what they held.
    """

    plan: Plan
    findings: tuple[Finding, ...] = ()
    not_put_back: tuple[Finding, ...] = ()
    unreadable: tuple[str, ...] = ()
    unrestored: tuple[str, ...] = ()


def refuse(findings: tuple[Finding, ...], text: str, node_id: int, *, force: bool, can_force: bool = True) -> None:
    """Raise RuleError where *findings* hold an error, and *force* is not given or can change nothing of it."""
    stopping = errors_in(findings)
    if stopping and not (force and can_force):
        raise RuleError(f"{text}: {stopping[0].text}", stopping, node=node_id, can_force=can_force)
