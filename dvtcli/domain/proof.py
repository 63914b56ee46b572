"""Result of a restart that checks a store or a restore."""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.domain.hint import Hint

#: ways to restart a node: two NMT commands, and somebody's hand
RESET_NODE, RESET_COMM, POWER = "reset-node", "reset-comm", "power-cycle"
RESTART_NAMES = {RESET_NODE: "reset", RESET_COMM: "communication reset", POWER: "power cycle"}


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
    def differing(self) -> tuple[str, ...]:
        """The PDOs and objects among the differences, each once."""
        return tuple(dict.fromkeys(text.partition(" ")[0].removesuffix(":") for text in self.differences))
