"""What is being read of a node, so that a long look can be followed. Reads nothing and shows nothing."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ReadProgress:
    """*node* is asked for an object; *done* of *total* PDOs were read before it, where all are read (else 0 of 0)."""

    node: int
    index: int
    sub_index: int
    done: int
    total: int
