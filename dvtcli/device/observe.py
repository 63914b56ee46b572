"""Looking at a node that may restart meanwhile: what was read in two of its lives is no observation.

Knows boot-ups and repeated uploads as numbers of the bus. Does not know what is looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol, TypeVar

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import CanopenBus
from dvtcli.domain.several import join_some
from dvtcli.errors import NoAnswer, SafetyRefusal

#: How often something is looked at anew before the node counts as one that cannot be looked at.
MOST_LOOKS = 5

T = TypeVar("T")


class RebootMonitor(Protocol):
    """Who noticed what happened to a node."""

    def boot_ups(self) -> int:
        """How many boot-ups were seen so far."""
        ...

    def upsets(self) -> int:
        """A number that grows with each boot-up, and with each upload that had to be asked again."""
        ...


@dataclass(frozen=True, slots=True)
class BusWitness:
    """What *bus* heard of *node_id*."""

    bus: CanopenBus
    node_id: int

    def boot_ups(self) -> int:
        """How many boot-ups were seen so far."""
        return self.bus.boot_ups(self.node_id)

    def upsets(self) -> int:
        """A number that grows with each boot-up, and with each upload that had to be asked again."""
        return self.bus.upsets(self.node_id)


@dataclass(frozen=True, slots=True)
class InitialState:
    """How a node was found before a change was planned: its NMT state, None where it told none, and what had happened.

    *boot_ups* and *upsets* are those of the bus by then. With *whatever_happened* the change is made also if the node
    restarts after that, as a way back is.
    """

    state: NmtState | None
    boot_ups: int
    upsets: int
    whatever_happened: bool = False


class Undisturbed:
    """Of a node to which nothing happens, as one that is called directly."""

    def boot_ups(self) -> int:
        """None."""
        return 0

    def upsets(self) -> int:
        """None."""
        return 0


def observed(witness: RebootMonitor, look: Callable[[], T], node_id: int | None = None) -> T:
    """What *look* answers, once nothing upset the node from its first to its last upload; *node_id* names it.

    NoAnswer where that does not come about within `MOST_LOOKS`.
    """
    for _ in range(MOST_LOOKS):
        upsets = witness.upsets()
        found = look()
        if witness.upsets() == upsets:
            return found
    name = "the node" if node_id is None else f"node {node_id}"
    raise NoAnswer(
        f"{name} restarted, or lost an answer, each of {MOST_LOOKS} times that it was read back",
        node=node_id,
        hint="look at its supply and its wiring, then try again",
    )


def restarted_since_read(node_id: int, lost: Iterable[str] = ()) -> SafetyRefusal:
    """The error of a change that was not begun, since *node_id* restarted after it was read; *lost* are labels."""
    gone = join_some(lost)
    return SafetyRefusal(
        f"node {node_id} restarted since it was read; run it again",
        node=node_id,
        why=f"its boot-up was received, and no reset was sent from here; {f'lost: {gone}' if gone else 'RAM is lost'}",
        hint=Hint(Action.SHOW_PDOS, why="look at its supply; {} shows what it holds now"),
    )
