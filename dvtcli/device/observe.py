"""Consistent reads: repeat a read if the node rebooted while it was running."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol, TypeVar

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import CanopenBus
from dvtcli.domain.text import join_some
from dvtcli.errors import NoAnswer, SafetyRefusal

#: How often something is looked at anew before the node counts as one that cannot be looked at.
MAX_READS = 5

T = TypeVar("T")


class RebootMonitor(Protocol):
    """Counts the boot-ups and disturbances of a node."""

    def boot_ups(self) -> int:
        """The number of boot-ups so far."""
        ...

    def disturbance_count(self) -> int:
        """A number that grows with each boot-up and each repeated upload."""
        ...


class RestartCounter(NamedTuple):
    """The boot-ups and disturbances of *node_id* as seen by *bus*."""

    bus: CanopenBus
    node_id: int

    def boot_ups(self) -> int:
        """The number of boot-ups so far."""
        return self.bus.boot_ups(self.node_id)

    def disturbance_count(self) -> int:
        """A number that grows with each boot-up and each repeated upload."""
        return self.bus.disturbance_count(self.node_id)


class InitialState(NamedTuple):
    """A node before the planning of a change: its NMT state (None if unknown), and the bus's counters.

    *boot_ups* and *disturbance_count* are the bus's counts. With *ignores_restarts* the change proceeds even if the
    node restarts meanwhile, as a roll-back does.
    """

    state: NmtState | None
    boot_ups: int
    disturbance_count: int
    ignores_restarts: bool = False


def observed(reboot_monitor: RebootMonitor, look: Callable[[], T], node_id: int | None = None) -> T:
    """The result of *look*, repeated until no disturbance occurred during its uploads; *node_id* for the error.

    Raises NoAnswer after `MAX_READS` tries.
    """
    for _ in range(MAX_READS):
        disturbance_count = reboot_monitor.disturbance_count()
        found = look()
        if reboot_monitor.disturbance_count() == disturbance_count:
            return found
    name = "the node" if node_id is None else f"node {node_id}"
    raise NoAnswer(
        f"{name} restarted, or lost an answer, during each of {MAX_READS} readings",
        node=node_id,
        hint="check its supply and its wiring, then try again",
    )


def restarted_since_read(node_id: int, lost: Iterable[str] = ()) -> SafetyRefusal:
    """The error: the change was not begun because *node_id* restarted after the read; *lost* are labels."""
    gone = join_some(lost)
    return SafetyRefusal(
        f"node {node_id} restarted since it was read; run it again",
        node=node_id,
        why=f"its boot-up was received, and no reset was sent from here; {f'lost: {gone}' if gone else 'RAM is lost'}",
        hint=Hint(Action.SHOW_PDOS, why="check its supply; {} shows its present values"),
    )
