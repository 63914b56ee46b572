"""The progress of work on a node."""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.domain.plan import Step


@dataclass(frozen=True, slots=True)
class Progress:
    """*node* took *step*, number *done* of *total*; until the last is read back, all may be rolled back."""

    node: int
    done: int
    total: int
    step: Step
