"""What a restart of a node showed of a store or a restore. Does not know how it was found out."""

from __future__ import annotations

from dataclasses import dataclass

#: ways to restart a node: two NMT commands, and somebody's hand
RESET_NODE, RESET_COMM, POWER = "reset-node", "reset-comm", "power-cycle"


@dataclass(frozen=True, slots=True)
class Proof:
    """What was read after a restart: *compared* PDOs with *against*, and what differs.

    *unproved* says why equality shows nothing, where it does not. *canary* is what was changed to find out; *lost* are
    unstored changes that the restart took.
    """

    by: str
    compared: int
    against: str
    differences: tuple[str, ...] = ()
    unproved: str = ""
    canary: str = ""
    lost: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether what was to be proved is so."""
        return not self.differences and not self.unproved
