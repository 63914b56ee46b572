"""Nodes that are restarted, and the boot-up messages that say so: by NMT, or by somebody who switches one off and on.

Does not know what a node loses by it, nor whether it may be restarted.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

from dvtcli.device.nmt_gate import Access
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import CanopenBus
from dvtcli.errors import NoAnswer

#: How long a node may take from reset to its boot-up message, in seconds.
BOOT_TIMEOUT_S = 10.0
#: How often it is looked after whether waiting for a power cycle shall end, in seconds.
_LOOK_S = 0.1


@dataclass(frozen=True, slots=True)
class SentReset:
    """A reset that was sent to one node, at *began_s*, when *seen* of its boot-up messages had been heard."""

    access: Access
    seen: int
    began_s: float

    def is_over(self) -> bool:
        """Whether the boot-up message came, or comes too late; waits for nothing."""
        bus = self.access.bus
        return bus.boot_ups(self.access.node_id) > self.seen or bus.now_s() - self.began_s >= BOOT_TIMEOUT_S

    def wait(self) -> float:
        """Wait for the boot-up message; the seconds it took. NoAnswer where none comes."""
        bus, node_id = self.access.bus, self.access.node_id
        left_s = max(0.0, self.began_s + BOOT_TIMEOUT_S - bus.now_s())
        if not bus.wait_boot_up(node_id, self.seen, left_s):
            raise self._silent()
        return bus.now_s() - self.began_s

    def _silent(self) -> NoAnswer:
        node_id = self.access.node_id
        silent = NoAnswer(
            f"node {node_id} sent no boot-up message within {BOOT_TIMEOUT_S:.0f} s after its reset",
            node=node_id,
            hint="look at the node, then scan",
            state="unknown",
        )
        if (state := self.access.bus.nmt_state(node_id)) is not None:  # heard since the reset was sent
            silent.hint = "it restarts without that message, or ignores resets: `pdo` shows what it holds"
            silent.state_text = f"{state.label}, as its heartbeat says; whether it was reset is not known"
        return silent


def send_reset(access: Access, command: NmtCommand) -> SentReset:
    """Reset the node, and wait for nothing; it may take `BOOT_TIMEOUT_S` to its boot-up message."""
    bus, node_id = access.bus, access.node_id
    seen, began_s = bus.boot_ups(node_id), bus.now_s()
    bus.send_nmt(command, node_id)
    return SentReset(access, seen, began_s)


def reset_and_wait(access: Access, command: NmtCommand) -> float:
    """Reset the node and wait for its boot-up message; the seconds it took. NoAnswer where none comes."""
    return send_reset(access, command).wait()


def reset_all_and_wait(
    bus: CanopenBus, command: NmtCommand, known: Collection[int], timeout_s: float = BOOT_TIMEOUT_S
) -> None:
    """Reset all nodes and wait for the boot-ups of the *known* ones (node-IDs); NoAnswer names those that gave none."""
    seen, deadline_s = {node_id: bus.boot_ups(node_id) for node_id in known}, bus.now_s() + timeout_s
    bus.send_nmt(command, 0)
    silent = [
        str(node_id)
        for node_id, count in sorted(seen.items())
        if not bus.wait_boot_up(node_id, count, max(0.0, deadline_s - bus.now_s()))
    ]
    if silent:
        raise NoAnswer(
            f"no boot-up message within {timeout_s:.0f} s after the reset from node {', '.join(silent)}",
            hint="look at it, then scan",
            state="unknown",
        )


def await_power_cycle(
    access: Access, timeout_s: float, ask: Callable[[], None], stop: Callable[[], None] = lambda: None
) -> None:
    """Let *ask* ask somebody to switch the node off and on, and wait for its boot-up; NoAnswer where none comes.

    *stop* is called again and again meanwhile, and raises where nobody wants to wait any longer.
    """
    bus, node_id = access.bus, access.node_id
    seen, deadline_s = bus.boot_ups(node_id), bus.now_s() + timeout_s
    ask()
    while not bus.wait_boot_up(node_id, seen, min(_LOOK_S, max(0.0, deadline_s - bus.now_s()))):
        stop()
        if bus.now_s() >= deadline_s:
            raise NoAnswer(
                f"node {node_id} was not switched off and on: no boot-up message within {timeout_s:g} s",
                node=node_id,
                hint="store --prove power --within S gives more time",
            )


def return_to(access: Access, state: NmtState | None) -> None:
    """Bring a node that was OPERATIONAL before its reset back there."""
    if state is NmtState.OPERATIONAL:
        access.request(NmtState.OPERATIONAL)
