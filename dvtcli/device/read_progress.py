"""The progress of a long read, for display."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ReadProgress:
    """*node* is asked for an object after *done* of *total* PDOs, if all PDOs are read (else 0 of 0)."""

    node: int
    index: int
    sub_index: int
    done: int
    total: int
