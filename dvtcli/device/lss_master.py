"""LSS master: the services of CiA 305, one request at a time, over any bus.

Answers carry no request number: late or repeated answers are waited out, and other answers are dropped. For certainty,
verify by another service.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from types import TracebackType

from dvtcli.device.resets import SentReset
from dvtcli.domain import lss_services as lss
from dvtcli.domain.can_ids import LSS_REQUEST_ID, LSS_RESPONSE_ID
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.lss_services import LssAddress, LssRanges
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import CanopenBus, Frame
from dvtcli.errors import DeviceRefused, NoAnswer

#: How long a node may take to answer a configuration service, and a store, in seconds.
ANSWER_S, STORE_S = 0.2, 5.0
#: How long a question of the fast scan waits, in seconds; where answers do not fit together: twice as long, and again.
SCAN_S = 0.05
#: What comes within this share of a question's wait after the first answer is of other nodes, or a double.
_SETTLE = 0.1
#: the same where who else answers is to be counted
_ALL = 0.25
#: the share of all these times that is waited for nodes of this process, which answer while they are asked
_SIMULATED = 0.02
_TRIES = 3
_SCANS = 5
#: how often a node that was found may be found again before every branch is asked: it answers in any state
_AGAIN = 3
_HIGHEST_BIT = lss.BITS - 1
#: node-IDs that a bus has: more branches than that are answers to everything, and no nodes
_MOST_NODES = 127


class LssMaster:
    """Talks to the LSS slaves of *bus*; each request of a fast scan waits *scan_s* seconds for its answer.

    At the end of a `with` block every node returns to LSS waiting, unless `keep_selected` was called.
    """

    def __init__(self, bus: CanopenBus, scan_s: float = SCAN_S) -> None:
        self._bus = bus
        share = _SIMULATED if bus.simulated else 1.0
        self._scan_s, self._answer_s, self._store_s = share * scan_s, share * ANSWER_S, share * STORE_S
        self._received: deque[bytes] = deque(maxlen=4096)
        self._keeps = False
        #: every node without a node-ID, once the scan had to ask every branch
        self._everybody: list[LssAddress] | None = None
        #: how many frames were sent
        self.requests = 0

    def __enter__(self) -> LssMaster:
        self._untap = self._bus.tap(self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is not None or not self._keeps:
                self.let_wait()
        finally:
            self._untap()

    def keep_selected(self) -> None:
        """Leave the selected node in the configuration state."""
        self._keeps = True

    def let_wait(self) -> None:
        """Switch every node to the waiting state, without an answer. A node with its first node-ID boots up."""
        self._send(lss.SWITCH_GLOBAL, bytes([lss.WAITING]))

    def reset_communication(self, node_id: int) -> None:
        """Let the node with *node_id* activate its new node-ID; 255: all nodes without a node-ID."""
        self._bus.send_nmt(NmtCommand.RESET_COMMUNICATION, node_id)

    def reset_node(self, node_id: int) -> None:
        """Restart the node with *node_id* from its stored values."""
        self._bus.send_nmt(NmtCommand.RESET_NODE, node_id)

    def comes_up(self, node_id: int, seen: int, within_s: float) -> bool:
        """True if the node boots up or answers as *node_id*; *seen* is the earlier number of its boot-ups."""
        return SentReset(self._bus, node_id, seen, self._bus.now_s(), within_s).comes_back()

    def select(self, address: LssAddress) -> int:
        """Select only the node with *address* for configuration and return the number of answers.

        Repeats the request after a lost frame.
        """
        for _ in range(_TRIES):
            self.let_wait()
            answers = self._select(address)
            if answers:
                return answers
        return 0

    def _select(self, address: LssAddress) -> int:
        *first, last = (_number(part) for part in address.parts)
        for place, number in enumerate(first):
            self._send(lss.SELECT + place, number)
        return len(self._ask(lss.SELECT + len(first), last, lss.SELECTED, self._answer_s, settle=_ALL))

    def unconfigured(self) -> int:
        """The number of answers from nodes without a node-ID."""
        for _ in range(_TRIES):
            answers = self._ask(
                lss.IDENTIFY_UNCONFIGURED, b"", lss.IDENTIFIED_UNCONFIGURED, self._answer_s, settle=_ALL
            )
            if answers:
                return len(answers)
        return 0

    def is_within(self, ranges: LssRanges) -> bool:
        """True if any node within *ranges* answers, with or without a node-ID; LSS states do not change.

        Several answers look the same as one: they are identical frames.
        """
        *first, last = (_number(part) for part in ranges.numbers)
        for _ in range(_TRIES):
            for place, number in enumerate(first):
                self._send(lss.IDENTIFY + place, number)
            if self._ask(lss.IDENTIFY + len(first), last, lss.IDENTIFIED, self._answer_s):
                return True
        return False

    def inquire(self) -> tuple[LssAddress, int] | None:
        """Address and node-ID (255: none) of the selected node; None if no node is selected.

        Raises DeviceRefused if several are selected, or a node answers in part.
        """
        asked = [self._told(lss.INQUIRE_NODE_ID)]
        if not asked[0]:
            return None
        asked += [self._told(lss.INQUIRE + part) for part in range(lss.PARTS)]
        if any(len(answers) > 1 for answers in asked):
            raise DeviceRefused(
                "several nodes are being configured at once", why="an inquiry got more than one answer",
                hint=Hint(Action.LSS_SCAN, why="lets all wait again, and lists them")
                + Hint(Action.LSS_SELECT, why="selects a node"),
            )  # fmt: skip
        if not all(asked):
            raise NoAnswer("the node that is being configured has no readable LSS address", hint=Hint(Action.LSS_SCAN))
        node_id, *parts = (answers[0] for answers in asked)
        return LssAddress(*(int.from_bytes(part[1:5], "little") for part in parts)), node_id[1]

    def _told(self, service: int) -> list[bytes]:
        for _ in range(_TRIES):
            answers = self._ask(service, b"", service, self._answer_s, settle=_ALL)
            if answers:
                return answers
        return []

    def configure_node_id(self, node_id: int) -> None:
        """Give the selected node *node_id* (1..127, 255 for none), effective after boot-up or reset.

        Raises DeviceRefused with the node's reason, NoAnswer.
        """
        self._configure(lss.CONFIGURE_NODE_ID, bytes([node_id]), f"node-ID {node_id}", lss.NODE_ID_REFUSED)

    def configure_bit_rate(self, bit_rate: int) -> None:
        """Give the selected node *bit_rate* (bit/s, a standard rate), effective after activation.

        Raises DeviceRefused with the node's reason, NoAnswer.
        """
        timing = bytes([0, lss.BIT_TIMINGS[bit_rate]])
        self._configure(lss.CONFIGURE_BIT_TIMING, timing, f"bit rate {bit_rate}", lss.BIT_TIMING_REFUSED)

    def configure_own_bit_rate(self) -> None:
        """Give the selected node the bit rate of the bus; no effect if the rate is unknown.

        Raises DeviceRefused; NoAnswer, also if the node does not support bit rates.
        """
        if self._bus.runs_at in lss.BIT_TIMINGS:
            self.configure_bit_rate(self._bus.runs_at)

    def activate_bit_rate(self, delay_ms: int) -> None:
        """Let every node with a new bit rate switch within *delay_ms*, and stay silent for the same time again.

        There is no answer; all nodes are in the configuration state afterwards.
        """
        self._send(lss.SWITCH_GLOBAL, bytes([lss.CONFIGURATION]))
        self._send(lss.ACTIVATE_BIT_TIMING, delay_ms.to_bytes(2, "little"))

    def _configure(self, service: int, data: bytes, what: str, reasons: dict[int, str]) -> None:
        for _ in range(_TRIES):
            answers = self._ask(service, data, service, self._answer_s, settle=_ALL)
            if answers:
                _require_success(answers, what, reasons)
                return
        raise NoAnswer(
            f"no answer to LSS configure {what}", hint=Hint(Action.LSS_SCAN, why="lists the nodes on the bus")
        )

    def store(self) -> None:
        """Let the selected node store its node-ID. Raises DeviceRefused with the node's reason, NoAnswer."""
        settle = _ALL * self._answer_s / self._store_s  # a store takes long, and only one node answers
        answers = self._ask(lss.STORE_CONFIGURATION, b"", lss.STORE_CONFIGURATION, self._store_s, settle=settle)
        if not answers:
            hint = Hint(Action.LSS_STORE, why="the next power-on shows whether it is stored; repeating {} does no harm")
            raise NoAnswer(f"no answer to LSS store configuration within {STORE_S:g} s", hint=hint, state="unknown")
        _require_success(answers, "store configuration", lss.STORE_REFUSED)

    def scan(self, found: Sequence[LssAddress], on_bit: Callable[[int], None] = lambda _bit: None) -> LssAddress | None:
        """The lowest address of a node without a node-ID besides *found*; None if no other node answers.

        The node found stays in the configuration state like those before: this excludes them from the next scan. Some
        slaves answer every request in that state: if so, all return to waiting, and every branch is scanned instead.
        *on_bit* is called with the number of known bits of 128. Raises NoAnswer if the answers stay contradictory.
        """
        if self._everybody is not None:
            return next((slave for slave in self._everybody if slave not in found), None)
        wait_s, again = self._scan_s, 0
        for _ in range(_SCANS):
            if not self._anybody(max(wait_s, self._answer_s / 2)):
                return None
            if again == _AGAIN or (found and self._echoes(wait_s)):
                everybody = self._every_branch(wait_s, on_bit)
                if everybody is not None:
                    self._everybody = everybody
                    return next((slave for slave in everybody if slave not in found), None)
            else:
                address = self._scan_once(wait_s, on_bit)
                if address is not None and address not in found:
                    return address
                again += address is not None
            wait_s *= 2
            self.let_wait()
            for address in found:
                self._select(address)
        raise NoAnswer(
            "the answers to the fast scan do not fit together",
            why=f"tried {_SCANS} times, at last with {1000 * wait_s / 2:.0f} ms for each request: answers are lost, "
            "arrive too late, or belong to no request",
            hint=Hint(Action.LSS_SCAN, {"wait": 200}) + Hint(Action.LSS_SELECT, why="else {} each node by its address"),
        )

    def _echoes(self, wait_s: float) -> bool:
        """True if a slave gives an impossible answer: both halves of the last part at the start of a scan."""
        last = lss.PARTS - 1
        return all(self._scanned(number, _HIGHEST_BIT, last, last, wait_s) for number in (0, 1 << _HIGHEST_BIT))

    def _every_branch(self, wait_s: float, on_bit: Callable[[int], None]) -> list[LssAddress] | None:
        """Every waiting node without a node-ID, found by both values of each bit; None after a lost answer.

        Selects no node.
        """
        self.let_wait()
        known: list[tuple[int, ...]] = [()]
        for part in range(lss.PARTS):
            longer: list[tuple[int, ...]] = []
            for before in known:
                numbers = self._numbers_behind(before, wait_s)
                if not numbers:
                    return None
                longer += [(*before, number) for number in numbers]
            known = longer
            on_bit(lss.BITS * (part + 1))
        return [LssAddress(*parts) for parts in known]

    def _numbers_behind(self, before: tuple[int, ...], wait_s: float) -> list[int]:
        """The values of the next part among nodes whose first parts are *before*; empty if the answers fit no node."""
        part = len(before)
        if not self._anybody(wait_s):
            return []
        for place, number in enumerate(before):
            if not self._scanned(number, 0, place, place + 1, wait_s):
                return []
        prefixes = [0]
        for bit in reversed(range(lss.BITS)):
            longer: list[int] = []
            for prefix in prefixes:
                halves = (prefix, prefix | 1 << bit)
                answered = [number for number in halves if self._scanned(number, bit, part, part, wait_s)]
                if not answered:
                    return []
                longer += answered
            if len(longer) > _MOST_NODES:
                return []
            prefixes = longer
        return prefixes

    def _anybody(self, wait_s: float) -> bool:
        return any(self._scanned(0, lss.SCAN_RESET, 0, 0, wait_s) for _ in range(_TRIES))

    def _scan_once(self, wait_s: float, on_bit: Callable[[int], None]) -> LssAddress | None:
        """One fast scan; None if a part found bit by bit is not confirmed as a whole."""
        parts: list[int] = []
        for part in range(lss.PARTS):
            number = 0
            for bit in reversed(range(lss.BITS)):
                if not self._scanned(number, bit, part, part, wait_s):
                    number |= 1 << bit
                on_bit(lss.BITS * (part + 1) - bit)
            if not self._scanned(number, 0, part, (part + 1) % lss.PARTS, wait_s):
                return None
            parts.append(number)
        return LssAddress(*parts)

    def _scanned(self, number: int, bit: int, part: int, following: int, wait_s: float) -> bool:
        data = _number(number) + bytes([bit, part, following])
        return bool(self._ask(lss.FAST_SCAN, data, lss.IDENTIFIED, wait_s))

    def _ask(self, service: int, data: bytes, answer: int, wait_s: float, *, settle: float = _SETTLE) -> list[bytes]:
        """Send a request and return every *answer* within *wait_s*, or shortly after the first.

        *settle* is the share of *wait_s* to wait for further answers after the first.
        """
        for _ in self._bus.receive(0.0):
            pass  # what came before is an answer to nothing
        self._received.clear()
        self._send(service, data)
        if self._wait(wait_s, answer):
            for _ in self._bus.receive(settle * wait_s):
                pass
        return [frame for frame in self._received if frame[0] == answer]

    def _wait(self, wait_s: float, answer: int) -> bool:
        """True if an *answer* came within *wait_s*."""
        for _ in self._bus.receive(wait_s):
            if any(frame[0] == answer for frame in self._received):
                return True
        return any(frame[0] == answer for frame in self._received)

    def _send(self, service: int, data: bytes) -> None:
        self.requests += 1
        self._bus.send(Frame(LSS_REQUEST_ID, (bytes([service]) + data).ljust(8, b"\0")))

    def _note(self, frame: Frame, sent: bool) -> None:
        is_data = not (sent or frame.extended or frame.remote)
        if is_data and frame.can_id == LSS_RESPONSE_ID and len(frame.data) == 8:
            self._received.append(frame.data)


def _number(part: int) -> bytes:
    return part.to_bytes(4, "little")


def _require_success(answers: list[bytes], what: str, reasons: dict[int, str]) -> None:
    """Raise DeviceRefused if an answer is no success, or several nodes answer a request for one."""
    refused = next((frame for frame in answers if frame[1]), None)
    if refused is not None:
        raise DeviceRefused(f"the node refused LSS {what}", why=lss.refusal(reasons, refused[1], refused[2]))
