"""Learnt values and their evidence."""

from __future__ import annotations

from dataclasses import dataclass

#: Value in a profile or a family.
Value = bool | int | str | list["Value"]


@dataclass(frozen=True, slots=True)
class Learnt:
    """A learnt value with its *key* and tables (`rtr_bit.tpdo`), and the *evidence*."""

    key: str
    value: Value
    evidence: str


@dataclass(frozen=True, slots=True)
class Conclusions:
    """All learnt values: *profile* for the tool, *family* for a simulated device that answers the same."""

    profile: tuple[Learnt, ...]
    family: tuple[Learnt, ...]
