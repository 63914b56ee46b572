"""One thing that was learnt, and all of them. Data; does not know how it was found out."""

from __future__ import annotations

from dataclasses import dataclass

#: What a value of a profile or of a family may be.
Value = bool | int | str | list["Value"]


@dataclass(frozen=True, slots=True)
class Learnt:
    """One value, by its *key* with its tables (`rtr_bit.tpdo`), and the *evidence* for it."""

    key: str
    value: Value
    evidence: str


@dataclass(frozen=True, slots=True)
class Conclusions:
    """What was learnt: *profile* is what the tool must know, *family* how a simulated device answers the same."""

    profile: tuple[Learnt, ...]
    family: tuple[Learnt, ...]
