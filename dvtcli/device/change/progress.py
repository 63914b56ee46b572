"""How far the work on a node has come. Knows no plan and shows nothing."""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.domain.plan import Step


@dataclass(frozen=True, slots=True)
class Progress:
    """*node* took *step*, the *done*-th of *total*; until the last one was read back, all may yet be put back."""

    node: int
    done: int
    total: int
    step: Step
