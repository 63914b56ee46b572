"""A node's stored configuration: its proof by a restart, its stamp in 0x1020, and which nodes stored."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta
from typing import Literal, NamedTuple

from dvtcli.domain.hint import Hint
from dvtcli.domain.text import all_nodes

#: ways to restart a node: two NMT commands, and somebody's hand
RESET_NODE, RESET_COMM, POWER = "reset-node", "reset-comm", "power-cycle"
#: how a user lets a store be proved: by a reset, or by a power cycle that somebody makes
ProveBy = Literal["reset", "power"]
_RESTART_NAMES = {RESET_NODE: "reset", RESET_COMM: "communication reset", POWER: "power cycle"}


@dataclass(frozen=True, slots=True)
class Proof:
    """Comparison after a restart: number of *compared* PDOs and *objects*, *against* what, and differences.

    *unproved* is the reason if a match proves nothing, and *hint* the remedy. *canary* is a value changed for the
    test, *put_back* set if it had to be restored afterwards; *lost* are unstored changes lost by the restart.
    *already*: the stored values may have been the same before, so a match after the reset does not prove this store.
    *notes* list omissions.
    """

    by: str
    compared: int
    against: str
    differences: tuple[str, ...] = ()
    unproved: str = ""
    canary: str = ""
    lost: tuple[str, ...] = ()
    objects: int = 0
    hint: Hint | str = ""
    put_back: str = ""
    already: bool = False
    notes: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether the store or restore is proved."""
        return not self.differences and not self.unproved

    @property
    def restart(self) -> str:
        """The kind of restart for people: `power cycle`."""
        return _RESTART_NAMES[self.by]

    @property
    def differing(self) -> tuple[str, ...]:
        """The PDOs and objects among the differences, each once."""
        return tuple(dict.fromkeys(text.partition(" ")[0].removesuffix(":") for text in self.differences))


class WhoStored(NamedTuple):
    """Node-IDs that *stored*, that did not, and with *unknown* result.

    *not_held*: nodes that acknowledged their store, but then did not hold the planned values.
    """

    stored: tuple[int, ...] = ()
    not_stored: tuple[int, ...] = ()
    unknown: tuple[int, ...] = ()
    not_held: tuple[int, ...] = ()

    def rows(self) -> list[tuple[str, str]]:
        """Labelled lines for a screen."""
        rows = (("stored", self.stored), ("not stored", self.not_stored), ("unknown", self.unknown))
        outcomes = [(label, all_nodes(numbers)) for label, numbers in rows if numbers]
        if self.not_held:
            nodes = all_nodes(self.not_held)
            outcomes.append(("not held", f"{nodes}: the store was acknowledged, but values differ from the plan"))
        return outcomes

    def document(self) -> dict[str, list[int]]:
        """Fields for a JSON document."""
        found = {"stored": [*self.stored], "not_stored": [*self.not_stored], "unknown": [*self.unknown]}
        return found | ({"not_held": [*self.not_held]} if self.not_held else {})


#: Sub-indices of 0x1020: the date, days since 1 January 1984, and the time, ms after midnight (CiA 301).
DATE, TIME = 1, 2
_EPOCH = date(1984, 1, 1)
#: Own dates: valid dates that no clock shows before the year 2163.
_FIRST_DAY, _LAST_DAY = 65_536, 2_900_000
#: Own times have a remainder given by date and quotient; 8,663 fit into a day.
_PRIME, _QUOTIENTS = 9_973, 8_663


@dataclass(frozen=True, slots=True)
class Stamp:
    """Value of 0x1020: *days* since 1 January 1984, *ms* after midnight; both 0 for no stamp."""

    days: int
    ms: int

    @classmethod
    def of(cls, words: str) -> Stamp:
        """The own stamp for the configuration *words*; another configuration has the same once in 2 to the 34."""
        from hashlib import sha256  # loads OpenSSL

        number = int.from_bytes(sha256(words.encode()).digest(), "big")
        number, day = divmod(number, _LAST_DAY - _FIRST_DAY + 1)
        quotient = number % _QUOTIENTS
        days = _FIRST_DAY + day
        return cls(days, quotient * _PRIME + _rest(days, quotient))

    @property
    def is_own(self) -> bool:
        """Whether dvtcli made the stamp; 1 in 9,973 foreign stamps in its date range is mistaken for own."""
        if not is_own_date(self.days):
            return False
        quotient, rest = divmod(self.ms, _PRIME)
        return quotient < _QUOTIENTS and rest == _rest(self.days, quotient)

    @property
    def is_foreign(self) -> bool:
        """Whether another tool wrote the stamp: neither 0 nor dvtcli's."""
        return bool(self.days or self.ms) and not self.is_own

    def data(self, sub_index: int) -> bytes:
        """Value of *sub_index* (1 or 2) of 0x1020."""
        return (self.days if sub_index == DATE else self.ms).to_bytes(4, "little")

    def __str__(self) -> str:
        seconds, ms = divmod(self.ms, 1000)
        time = f"{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}.{ms:03}"
        try:
            return f"{_EPOCH + timedelta(self.days)} {time}"
        except OverflowError:
            return f"day {self.days} {time}"


def is_own_date(days: int) -> bool:
    """Whether an own stamp may have this date."""
    return _FIRST_DAY <= days <= _LAST_DAY


def _rest(days: int, quotient: int) -> int:
    return (days * 7_919 + quotient * 5_171 + 1_020) % _PRIME
