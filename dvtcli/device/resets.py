"""Restart nodes by NMT or by a power cycle, and wait for their boot-up messages."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from dvtcli.device.nmt_gate import NodeAccess
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.objects import DEVICE_TYPE
from dvtcli.domain.ports import CanopenBus
from dvtcli.domain.text import all_nodes
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError

#: How long a node may take from reset to its boot-up message, in seconds.
BOOT_TIMEOUT_S = 10.0
#: How long a boot-up message alone is waited for, in seconds; a device that sends none is asked after that.
QUIET_S = 1.0
#: How often it is asked then, and how long it has to answer, in seconds.
_ASK_EVERY_S, _ANSWER_S = 0.5, 0.1
#: How often it is looked after whether waiting for a power cycle shall end, in seconds.
_LOOK_S = 0.1
#: How many questions in a row an unpowered node leaves without an answer, some two seconds: a lost frame is one only,
#: and a device that writes its flash is silent for less.
_OFF = 10


@dataclass(slots=True)
class SentReset:
    """A reset sent to *node_id* at *began_s*, after *seen* boot-up messages from it.

    Over after the boot-up message, or any answer after `QUIET_S`: some devices send no boot-up message.
    """

    bus: CanopenBus
    node_id: int
    seen: int
    began_s: float
    #: the time-out in seconds
    timeout_s: float = BOOT_TIMEOUT_S
    _ask_at_s: float = field(init=False)
    _answered: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        self._ask_at_s = self.began_s + QUIET_S

    @property
    def booted(self) -> bool:
        """True after the boot-up message; without it a restart is uncertain."""
        return self.bus.boot_ups(self.node_id) > self.seen

    def is_over(self) -> bool:
        """True after the boot-up message, another answer, or the time-out; asks the node from time to time."""
        now_s, until_s = self.bus.now_s(), self.began_s + self.timeout_s
        if not self.is_back and self._ask_at_s <= now_s <= until_s - _ANSWER_S:
            self._ask_at_s = now_s + _ASK_EVERY_S
            self._answered = _answers(self.bus, self.node_id)
        return self.is_back or now_s >= until_s

    def wait(self) -> float:
        """Wait for the boot-up message or another answer, and return the seconds. Raises NoAnswer if none comes."""
        if not self.comes_back():
            raise self._silent()
        return self.bus.now_s() - self.began_s

    def comes_back(self) -> bool:
        """Wait for the boot-up message or another answer; true if it came."""
        while not self.is_over():
            self.wait_a_moment()
        return self.is_back

    def wait_a_moment(self) -> None:
        """Wait for the boot-up message until the next request to the node is due, or the time-out."""
        left_s = self.began_s + self.timeout_s - self.bus.now_s()
        self.bus.wait_boot_up(self.node_id, self.seen, max(0.0, min(_ASK_EVERY_S, left_s)))

    @property
    def is_back(self) -> bool:
        """True if the boot-up message or another answer came."""
        return self._answered or self.booted

    def _silent(self) -> NoAnswer:
        silent = NoAnswer(
            f"node {self.node_id} sent neither a boot-up message nor an answer within {self.timeout_s:.0f} s after "
            f"its reset",
            node=self.node_id,
            hint=Hint(Action.FIND_NODES, why="check the node, then {}"),
            state="unknown",
        )
        if (state := self.bus.nmt_state(self.node_id)) is not None:  # heard since the reset was sent
            silent.hint = Hint(Action.FIND_NODES, why="it answers no SDO: check the node, then {}")
            silent.state_text = f"{state.label}, by its heartbeat; whether it was reset is unknown"
        return silent


def _answers(bus: CanopenBus, node_id: int) -> bool:
    try:
        bus.sdo(node_id).upload(DEVICE_TYPE, 0, timeout_s=_ANSWER_S, retries=0)
    except NoAnswer:
        return False
    except (SdoAborted, SdoProtocolError):
        pass  # the node is present
    return True


def send_reset(access: NodeAccess, command: NmtCommand) -> SentReset:
    """Reset the node without waiting; its boot-up message may take up to `BOOT_TIMEOUT_S`."""
    bus, node_id = access.bus, access.node_id
    sent = SentReset(bus, node_id, bus.boot_ups(node_id), bus.now_s())
    bus.send_nmt(command, node_id)
    return sent


def reset_and_wait(access: NodeAccess, command: NmtCommand) -> float:
    """Reset the node, wait for its boot-up message or another answer, and return the seconds. Raises NoAnswer."""
    return send_reset(access, command).wait()


def reset_all_and_wait(
    bus: CanopenBus, command: NmtCommand, known: Collection[int], timeout_s: float = BOOT_TIMEOUT_S
) -> list[int]:
    """Reset all nodes and wait for *known*; the node-IDs that answer but sent no boot-up message.

    Raises NoAnswer naming the nodes with neither.
    """
    began_s = bus.now_s()
    sent = [SentReset(bus, node_id, bus.boot_ups(node_id), began_s, timeout_s) for node_id in sorted(known)]
    bus.send_nmt(command, 0)
    while pending := [reset for reset in sent if not reset.is_over()]:
        pending[0].wait_a_moment()
    if silent := [str(reset.node_id) for reset in sent if not reset.is_back]:
        raise NoAnswer(
            f"no boot-up message within {timeout_s:.0f} s after the reset from {all_nodes(silent)}, nor any answer",
            hint=Hint(Action.FIND_NODES, why="check it, then {}"),
            state="unknown",
        )
    return [reset.node_id for reset in sent if not reset.booted]


def await_power_cycle(
    access: NodeAccess, timeout_s: float, ask: Callable[[], None], stop: Callable[[], None] = lambda: None
) -> None:
    """Let *ask* request a power cycle from the user and wait for the node. Raises NoAnswer if it does not return.

    The node is back after its boot-up message, or after an SDO answer following `_OFF` unanswered requests in a row.
    *stop* is called repeatedly meanwhile and raises to end the wait.
    """
    bus, node_id = access.bus, access.node_id
    seen, deadline_s = bus.boot_ups(node_id), bus.now_s() + timeout_s
    ask()
    silent = 0
    while not bus.wait_boot_up(node_id, seen, min(_LOOK_S, max(0.0, deadline_s - bus.now_s()))):
        stop()
        if bus.now_s() < deadline_s - _ANSWER_S:
            if not _answers(bus, node_id):
                silent += 1
            elif silent >= _OFF:
                return
            else:
                silent = 0
        if bus.now_s() >= deadline_s:
            away = ", and it answers no SDO" if silent >= _OFF else ""
            raise NoAnswer(
                f"node {node_id} was not switched off and on: no boot-up message within {timeout_s:g} s{away}",
                node=node_id,
                hint=Hint(Action.PROVE_POWER, {"within": "S"}, "gives more time"),
            )


def return_to(access: NodeAccess, state: NmtState | None) -> None:
    """Bring a node that was OPERATIONAL before its reset back to OPERATIONAL."""
    if state is NmtState.OPERATIONAL:
        access.request(NmtState.OPERATIONAL)
