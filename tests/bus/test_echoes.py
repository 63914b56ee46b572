"""Our own frames are told by what was sent, whatever a driver's mark says of who sent them.

SocketCAN marks every frame of the same host like an echo (`is_rx` false), a node beside us on vcan as well; other
drivers mark no echo at all. The bus here does what each of them does, with and without echoes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import can
import pytest

from dvtcli.bus.node_watch import SECOND_ANSWERS
from dvtcli.bus.python_can import LOST_AFTER_S, MOST_REMEMBERED, NONE_IN, CanBus, Echoes
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.errors import NoAnswer
from tests.bus.scripted import NODE, Lockstep, Server, message, well_behaved

REQUEST, HEARTBEAT = 0x600 + NODE, 0x700 + NODE
#: reads the device type, as our own client does
READ_DEVICE_TYPE = bytes.fromhex("40 00 10 00 00 00 00 00")
READ_IDENTITY = bytes.fromhex("40 18 10 01 00 00 00 00")


class MarkingBus(Lockstep):
    """python-can's virtual bus whose driver marks all frames alike: `is_rx` is *marks* for every one."""

    def __init__(self, channel: str, *, marks: bool, **options: Any) -> None:
        super().__init__(channel, **options)
        self._marks = marks

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        received, filtered = super()._recv_internal(timeout)
        if received is not None:
            received.is_rx = self._marks
        return received, filtered


class Ours:
    """A CanBus with or without echoes, a scripted node, and another program on the same channel."""

    def __init__(self, channel: str, *, echoes: bool, told: bool, marks: bool) -> None:
        driver = MarkingBus(channel, marks=marks, receive_own_messages=echoes)
        self.bus = CanBus(driver, f"virtual:{channel}", timeout_s=0.2, retries=0)
        if told and not echoes:
            self.bus.echoes.rule_out()
        self.server = driver.server = Server(channel, well_behaved)
        self.other = can.Bus(channel, interface="virtual", ignore_config=True)

    def close(self) -> None:
        self.bus.close()
        self.server.stop()
        self.other.shutdown()

    def others(self) -> int:
        """How many frames of another SDO client were counted."""
        self.bus.drain()
        return self.bus.sdo(NODE).dropped.other_client


Start = Callable[..., Ours]


@pytest.fixture
def start(channel: str) -> Iterator[Start]:
    started: list[Ours] = []

    def begin(**how: bool) -> Ours:
        started.append(Ours(channel, **how))
        return started[-1]

    yield begin
    for ours in started:
        ours.close()


@pytest.fixture(params=[True, False], ids=["echoes", "no echoes"])
def echoes(request: pytest.FixtureRequest) -> bool:
    return bool(request.param)


@pytest.fixture(params=[True, False], ids=["told", "found out"])
def told(request: pytest.FixtureRequest) -> bool:
    return bool(request.param)


@pytest.fixture(params=[True, False], ids=["all marked received", "all marked sent"])
def marks(request: pytest.FixtureRequest) -> bool:
    return bool(request.param)


@pytest.fixture
def ours(start: Start, echoes: bool, told: bool, marks: bool) -> Ours:
    return start(echoes=echoes, told=told, marks=marks)


def test_a_node_answers_whatever_the_driver_says_of_its_frames(ours: Ours) -> None:
    for sub_index in range(5):
        assert ours.bus.sdo(NODE).upload(0x2000, sub_index)[2] == sub_index
        ours.bus.sdo(NODE).download(0x2000, sub_index, b"\0")
    assert ours.others() == 0
    assert ours.bus.disturbances() == []


def test_another_client_s_request_is_another_client(ours: Ours) -> None:
    ours.bus.sdo(NODE).upload(0x1000, 0)
    ours.other.send(message(REQUEST, READ_IDENTITY))
    assert ours.others() == 1
    ours.other.send(message(REQUEST, READ_DEVICE_TYPE))  # the very request that we have just made
    assert ours.others() == 2
    assert ours.bus.disturbances() == [
        f"another SDO client communicates with node {NODE}: 2 frames on its SDO channel were not ours; it may be "
        f"another dvtcli, even if that only monitors"
    ]


def test_another_client_s_answers_are_no_second_node(ours: Ours) -> None:
    """It reads what we have just read, and its answers fit ours."""
    for _ in range(2 * SECOND_ANSWERS):
        ours.bus.sdo(NODE).upload(0x1000, 0)
        frames = ours.server.dealt_with
        ours.other.send(message(REQUEST, READ_DEVICE_TYPE))
        ours.server.deal_with(frames + 1)
        ours.bus.drain()
    (said,) = ours.bus.disturbances()
    assert said.startswith(f"another SDO client communicates with node {NODE}")
    assert ours.bus.disturbances() == []


def test_an_abort_of_ours_is_no_other_client(ours: Ours) -> None:
    ours.bus.sdo(NODE).upload(0x1000, 0)  # a node that never answered gets no abort
    ours.server.script = lambda _request: []
    with pytest.raises(NoAnswer):
        ours.bus.sdo(NODE).upload(0x1000, 0)
    assert ours.server.requests[-1][0] == 0x80
    assert ours.others() == 0


def test_our_own_heartbeat_is_no_sign_of_life_but_another_s_is(start: Start, echoes: bool, marks: bool) -> None:
    ours = start(echoes=echoes, told=True, marks=marks)
    ours.bus.send(Frame(HEARTBEAT, b"\x05"))
    assert ours.bus.nodes_seen() == {}
    ours.other.send(message(HEARTBEAT, b"\x05"))  # the same node-ID twice
    assert ours.bus.nodes_seen() == {NODE: NmtState.OPERATIONAL}


def test_what_we_sent_is_not_received_but_what_another_sent_is(start: Start, echoes: bool, marks: bool) -> None:
    ours = start(echoes=echoes, told=True, marks=marks)
    seen: list[tuple[int, bool]] = []
    ours.bus.tap(lambda frame, sent: seen.append((frame.can_id, sent)))
    ours.bus.send_nmt(NmtCommand.START, NODE)
    ours.other.send(message(0x000, bytes([NmtCommand.START, NODE])))
    ours.bus.send(Frame(0x080, b""))
    ours.other.send(message(0x080, b""))
    assert [frame.can_id for frame in ours.bus.receive(0.05)] == [0x080]
    assert seen == [(0x000, True), (0x000, False), (0x080, True), (0x080, False)]


def test_an_unknown_bus_without_echoes_is_found_out_by_the_first_answer(start: Start, marks: bool) -> None:
    """An echo comes before the answer: what was sent before an answered request, and did not echo, never will."""
    ours = start(echoes=False, told=False, marks=marks)
    ours.bus.send(Frame(HEARTBEAT, b"\x05"))
    ours.bus.sdo(NODE).upload(0x1000, 0)
    ours.other.send(message(HEARTBEAT, b"\x05"))
    assert ours.bus.nodes_seen() == {NODE: NmtState.OPERATIONAL}


def test_frames_differ_by_everything_that_is_on_the_wire(start: Start) -> None:
    ours = start(echoes=False, told=False, marks=True)
    frames = ours.bus.receive(0.05)
    ours.bus.send(Frame(0x185, b"\x01"))
    for one in (
        message(0x186, b"\x01"),
        message(0x185, b"\x02"),
        message(0x185, b"\x01", extended=True),
        can.Message(arbitration_id=0x185, is_remote_frame=True, is_extended_id=False, dlc=1),
    ):
        ours.other.send(one)
    assert len(list(frames)) == 4


# What is remembered ---------------------------------------------------------------------------------------------


def test_each_frame_echoes_once() -> None:
    echoes = Echoes()
    for _ in range(2):
        echoes.expect(message(REQUEST, READ_DEVICE_TYPE), 0.0)
    assert [echoes.is_echo(message(REQUEST, READ_DEVICE_TYPE)) for _ in range(3)] == [True, True, False]


def test_a_frame_that_was_not_sent_has_no_echo() -> None:
    echoes = Echoes()
    echoes.expect(message(0x185, b"\x01"), 0.0)
    echoes.expect(message(0x185, b"\x01"), 0.1)
    echoes.unsent()
    assert [echoes.is_echo(message(0x185, b"\x01")) for _ in range(2)] == [True, False]


def test_controllers_may_swap_frames_but_not_over_a_long_time() -> None:
    echoes = Echoes()
    for can_id, sent_s in ((0x181, 0.0), (0x182, 1.9), (0x183, 2.0), (0x184, 2.5)):
        echoes.expect(message(can_id, b""), sent_s)
    assert [echoes.is_echo(message(can_id, b"")) for can_id in (0x183, 0x182, 0x181, 0x184)] == [
        True,
        True,
        False,  # lost: its echo would have come within a second
        True,
    ]


def test_an_answer_to_a_late_request_does_not_end_an_echoing_bus() -> None:
    """The answer to a request that timed out may pass the next request's echo."""
    echoes = Echoes()
    echoes.expect(message(REQUEST, READ_DEVICE_TYPE), 0.0)
    assert echoes.is_echo(message(REQUEST, READ_DEVICE_TYPE))
    echoes.expect(message(REQUEST, READ_IDENTITY), 1.0)
    echoes.answered(REQUEST)
    assert echoes.is_echo(message(REQUEST, READ_IDENTITY))


def exchanged_without_echoes(echoes: Echoes, count: int) -> None:
    for number in range(count):
        echoes.expect(message(REQUEST, READ_DEVICE_TYPE), float(number))
        echoes.answered(REQUEST)


def test_a_bus_without_an_echo_in_many_exchanges_has_none_and_each_request_is_another_s() -> None:
    echoes = Echoes()
    exchanged_without_echoes(echoes, NONE_IN)
    echoes.expect(message(REQUEST, READ_DEVICE_TYPE), 0.0)
    assert not echoes.is_echo(message(REQUEST, READ_DEVICE_TYPE))


@pytest.mark.parametrize("before", [0, NONE_IN - 1])
def test_one_echo_among_many_exchanges_is_enough(before: int) -> None:
    echoes = Echoes()
    exchanged_without_echoes(echoes, before)
    echoes.expect(message(REQUEST, READ_DEVICE_TYPE), 0.0)
    assert echoes.is_echo(message(REQUEST, READ_DEVICE_TYPE))
    exchanged_without_echoes(echoes, NONE_IN)
    echoes.expect(message(REQUEST, READ_IDENTITY), 0.0)
    assert echoes.is_echo(message(REQUEST, READ_IDENTITY))


def test_an_answer_to_nobody_says_nothing_of_echoes() -> None:
    echoes = Echoes()
    echoes.expect(message(0x185, b"\x01"), 0.0)
    echoes.answered(REQUEST)
    assert echoes.is_echo(message(0x185, b"\x01"))


def test_what_did_not_come_back_in_time_never_will_once_everything_was_read() -> None:
    echoes = Echoes()
    for sent_s in (0.0, 0.5):
        echoes.expect(message(0x080, b""), sent_s)
    echoes.caught_up(1.0)  # at the latest now the first one would have been there
    echoes.caught_up(1.2)
    assert [echoes.is_echo(message(0x080, b"")) for _ in range(2)] == [True, False]


def test_a_bus_that_told_nothing_of_echoes_does_not_keep_what_was_sent_long_ago(start: Start) -> None:
    ours = start(echoes=False, told=False, marks=True)
    ours.bus.send(Frame(0x080, b""))
    ours.bus.sleep(LOST_AFTER_S + 0.05)
    frames = ours.bus.receive(0.05)
    ours.other.send(message(0x080, b""))  # another SYNC producer, no echo of ours
    assert [frame.can_id for frame in frames] == [0x080]


def test_a_bus_that_echoes_may_do_so_late() -> None:
    """Nobody acknowledged what was sent until another node was plugged in."""
    echoes = Echoes()
    for sent_s in (0.0, 0.1):
        echoes.expect(message(0x080, b""), sent_s)
    assert echoes.is_echo(message(0x080, b""))
    echoes.caught_up(60.0)
    assert echoes.is_echo(message(0x080, b""))


def test_memory_is_bounded() -> None:
    echoes = Echoes()
    for number in range(MOST_REMEMBERED + 1):
        echoes.expect(message(0x185, number.to_bytes(4, "little")), 0.0)
    assert not echoes.is_echo(message(0x185, bytes(4)))
    assert echoes.is_echo(message(0x185, b"\x01\0\0\0"))
