"""What a restart of a node showed of a store or a restore. Does not know how it was found out."""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.domain.hint import Hint

#: ways to restart a node: two NMT commands, and somebody's hand
RESET_NODE, RESET_COMM, POWER = "reset-node", "reset-comm", "power-cycle"
RESTART_NAMES = {RESET_NODE: "reset", RESET_COMM: "communication reset", POWER: "power cycle"}


@dataclass(frozen=True, slots=True)
class Proof:
    """What was read after a restart: *compared* PDOs, and *objects* besides, with *against*, and what differs.

    *unproved* says why equality shows nothing, where it does not, and *hint* what would. *canary* is what was changed
    to find out, *put_back* where that had to be put back afterwards; *lost* are unstored changes that the restart took.
    *already*: of nothing that is stored it is known that it was otherwise before, so that equality shows what the node
    comes up with, and not what was asked of it. *notes* say what was left out.
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
        """Whether what was to be proved is so."""
        return not self.differences and not self.unproved

    @property
    def differing(self) -> tuple[str, ...]:
        """The PDOs and objects among the differences, each once."""
        return tuple(dict.fromkeys(text.partition(" ")[0].removesuffix(":") for text in self.differences))
