"""The bus: what nodes say, frames in and out, and ends of all kinds."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from queue import SimpleQueue

import can
import pytest

from dvtcli.bus.python_can import CanBus
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import BootUp, Emergency, Frame, NodeEvent, StateChange
from dvtcli.errors import BusUnavailable, DvtcliError, UsageError
from tests.bus.scripted import NODE, Server, Steps, frame, message, well_behaved
from tests.harness.sample import heavy
from tests.process import PATIENCE_S

Serve = Callable[..., tuple[CanBus, Server]]


def in_thread(work: Callable[[], object]) -> tuple[threading.Thread, SimpleQueue[DvtcliError]]:
    """Run *work* beside the test; the queue gets the error it ends with."""
    errors: SimpleQueue[DvtcliError] = SimpleQueue()

    def run() -> None:
        try:
            work()
        except DvtcliError as error:
            errors.put(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread, errors


# What nodes say -------------------------------------------------------------------------------------------------


def test_nothing_is_known_of_a_node_that_says_nothing(serve: Serve) -> None:
    bus, _ = serve()
    assert bus.nmt_state(NODE) is None
    assert bus.boot_ups(NODE) == 0
    assert bus.emergency(NODE) is None
    assert bus.nodes_seen() == {}


def test_boot_up_means_pre_operational(serve: Serve) -> None:
    bus, server = serve()
    server.send(0x700 + NODE, b"\0")
    assert bus.wait_boot_up(NODE, 0, PATIENCE_S)
    assert bus.boot_ups(NODE) == 1
    assert bus.nmt_state(NODE) is NmtState.PRE_OPERATIONAL
    assert not bus.wait_boot_up(NODE, 1, 0.01)


def test_heartbeats_tell_the_state_with_or_without_a_toggle_bit(serve: Serve) -> None:
    bus, server = serve()
    for said, state in ((5, NmtState.OPERATIONAL), (0x84, NmtState.STOPPED), (0x7F, NmtState.PRE_OPERATIONAL)):
        server.send(0x700 + NODE, bytes([said]))
        assert bus.nmt_state(NODE) is state
    assert bus.nodes_seen() == {NODE: NmtState.PRE_OPERATIONAL}


@pytest.mark.parametrize(
    "said",
    [
        message(0x700 + NODE, b"\x05", extended=True),
        message(0x700 + NODE, b""),
        message(0x700 + NODE, b"\x05\x05"),
        message(0x700 + NODE, b"\x33"),
        message(0x700, b"\x05"),
        can.Message(arbitration_id=0x700 + NODE, is_remote_frame=True, is_extended_id=False, dlc=1),
        can.Message(is_error_frame=True),
    ],
)
def test_what_is_no_heartbeat(serve: Serve, said: can.Message) -> None:
    bus, server = serve()
    server.bus.send(said)
    assert bus.nodes_seen() == {}


def test_a_new_sign_of_life_is_waited_for(serve: Serve) -> None:
    bus, server = serve()
    server.send(0x700 + NODE, b"\x7f")
    assert bus.nmt_state(NODE) is NmtState.PRE_OPERATIONAL
    enough = threading.Event()

    def beat() -> None:
        while not enough.wait(0.03):  # again, where one came before it was waited for
            server.send(0x700 + NODE, b"\x05")

    heart = threading.Thread(target=beat)
    heart.start()
    try:
        assert bus.nmt_state(NODE, PATIENCE_S) is NmtState.OPERATIONAL
    finally:
        enough.set()
        heart.join()


def test_a_command_makes_what_was_heard_before_it_old(serve: Serve) -> None:
    bus, server = serve()
    server.send(0x700 + NODE, b"\x7f")
    server.send(0x700 + NODE + 1, b"\x7f")
    bus.send_nmt(NmtCommand.START, NODE)
    assert bus.nmt_state(NODE) is None
    assert bus.nmt_state(NODE + 1) is NmtState.PRE_OPERATIONAL
    bus.send_nmt(NmtCommand.START, 0)
    assert bus.nmt_state(NODE + 1) is None


def test_another_master_s_command_makes_what_was_heard_before_it_old(serve: Serve) -> None:
    bus, server = serve()
    for node_id in (NODE, NODE + 1):
        server.send(0x700 + node_id, b"\x05")
    server.send(0x000, bytes([NmtCommand.STOP, NODE]))
    assert bus.nmt_state(NODE) is None
    assert bus.nmt_state(NODE + 1) is NmtState.OPERATIONAL
    server.send(0x000, bytes([NmtCommand.STOP, 0]))
    assert bus.nodes_seen() == {}


def test_the_last_emergency_is_kept(serve: Serve) -> None:
    bus, server = serve()
    server.send(0x080 + NODE, frame("10 82 11 01 02 03 04 05"))
    server.send(0x080 + NODE, bytes.fromhex("30 81"))
    server.send(0x080, b"\x01\x02")  # SYNC with a counter is no emergency
    last = bus.emergency(NODE)
    assert last is not None
    assert (last.code, last.register, last.manufacturer) == (0x8130, 0, bytes(5))


def test_events_are_told_as_they_happen(serve: Serve) -> None:
    bus, server = serve()
    events: list[NodeEvent] = []
    stop = bus.on_event(events.append)
    server.send(0x700 + NODE, b"\0")
    server.send(0x700 + NODE, b"\x05")
    server.send(0x700 + NODE, b"\x05")
    server.send(0x080 + NODE, frame("10 82 11"))
    bus.nodes_seen()
    stop()
    server.send(0x700 + NODE, b"\x04")
    bus.nodes_seen()
    assert [type(event) for event in events] == [BootUp, StateChange, StateChange, Emergency]
    assert {event.node_id for event in events} == {NODE}


def test_nmt_command_frame(serve: Serve) -> None:
    bus, server = serve()
    bus.send_nmt(NmtCommand.RESET_NODE, NODE)
    bus.sdo(NODE).upload(0x1000, 0)
    assert (server.received[0].arbitration_id, bytes(server.received[0].data)) == (0, bytes([0x81, NODE]))


@pytest.mark.parametrize("node_id", [0, 128, -1])
def test_node_ids_have_a_range(serve: Serve, node_id: int) -> None:
    bus, _ = serve()
    with pytest.raises(UsageError):
        bus.sdo(node_id)
    if node_id:
        with pytest.raises(UsageError):
            bus.send_nmt(NmtCommand.START, node_id)


def test_the_same_channel_for_the_same_node(serve: Serve) -> None:
    bus, _ = serve()
    assert bus.sdo(NODE) is bus.sdo(NODE)


# Frames ---------------------------------------------------------------------------------------------------------


def test_frames_are_received_as_they_are(serve: Serve) -> None:
    bus, server = serve()
    frames = bus.receive(0.05)
    server.send(0x185, b"\x01\x02")
    server.send(0x18FF0001, b"\x03", extended=True)
    seen = list(frames)
    assert [(one.can_id, one.data, one.extended) for one in seen] == [
        (0x185, b"\x01\x02", False),
        (0x18FF0001, b"\x03", True),
    ]
    assert seen[0].timestamp_s > 0


def test_a_frame_is_yielded_when_it_comes_and_not_at_the_end(serve: Serve) -> None:
    bus, server = serve()
    frames = bus.receive(100 * PATIENCE_S)
    server.send(0x185, b"\x01")
    assert next(frames).can_id == 0x185


def test_what_came_before_is_not_received_unless_it_may_answer_our_frame(serve: Serve) -> None:
    bus, server = serve()
    server.send(0x185, b"old")
    assert list(bus.receive(0.01)) == []
    server.send(0x185, b"old")
    bus.send(Frame(0x080, b""))
    server.send(0x185, b"new")
    bus.sdo(NODE).upload(0x1000, 0)  # reads the bus; the answer must not get lost by it
    assert [one.data for one in bus.receive(0.01) if one.can_id == 0x185] == [b"new"]
    assert list(bus.receive(0.01)) == []


def test_frames_arrive_while_another_thread_reads_the_bus(serve: Serve) -> None:
    bus, server = serve(Steps(), timeout_s=0.3)
    thread, _ = in_thread(lambda: bus.sdo(NODE).upload(0x1000, 0))
    frames = bus.receive(PATIENCE_S)
    server.send(0x185, b"\x01")
    assert any(one.can_id == 0x185 for one in frames)
    thread.join()


def test_taps_see_both_directions_in_order(serve: Serve) -> None:
    bus, _ = serve()
    seen: list[tuple[int, bool]] = []
    stop = bus.tap(lambda one, sent: seen.append((one.can_id, sent)))
    bus.sdo(NODE).upload(0x1000, 0)
    stop()
    bus.sdo(NODE).upload(0x1000, 0)
    assert seen == [(0x600 + NODE, True), (0x580 + NODE, False)]


def test_sent_frames_keep_their_kind(serve: Serve) -> None:
    bus, server = serve()
    bus.send(Frame(0x18FF0001, b"\x01", extended=True))
    bus.send(Frame(0x185, b"", remote=True))
    bus.sdo(NODE).upload(0x1000, 0)
    first, second = server.received[:2]
    assert (first.arbitration_id, first.is_extended_id, bytes(first.data)) == (0x18FF0001, True, b"\x01")
    assert (second.arbitration_id, second.is_remote_frame) == (0x185, True)


# Ends -----------------------------------------------------------------------------------------------------------


def test_close_may_be_repeated(serve: Serve) -> None:
    bus, _ = serve()
    bus.sdo(NODE).upload(0x1000, 0)
    bus.close()
    bus.close()
    for use in (
        lambda: bus.sdo(NODE).upload(0x1000, 0),
        lambda: bus.send(Frame(0x80, b"")),
        lambda: bus.idle(1),
        lambda: list(bus.receive(1)),
        lambda: bus.wait_boot_up(NODE, 0, 1),
    ):
        with pytest.raises(BusUnavailable, match="closed"):
            use()


def test_closing_sends_everyone_away(serve: Serve) -> None:
    bus, _ = serve(Steps(), timeout_s=100 * PATIENCE_S)
    waiting = [in_thread(lambda n=n: bus.sdo(n).upload(0x1000, 0)) for n in (1, 2, 3)]
    waiting.append(in_thread(lambda: bus.wait_boot_up(NODE, 0, 100 * PATIENCE_S)))
    time.sleep(0.03)
    bus.close()
    for thread, errors in waiting:
        assert isinstance(errors.get(timeout=PATIENCE_S), BusUnavailable)
        thread.join(PATIENCE_S)


def test_a_bus_that_dies_under_a_write_leaves_the_state_unknown(channel: str) -> None:
    ours = can.Bus(channel, interface="virtual", ignore_config=True)
    bus = CanBus(ours, "virtual:dying", timeout_s=30, retries=0)

    def unplug(_: bytes) -> list[bytes]:
        ours.shutdown()
        return []

    server = Server(channel, unplug)
    thread, errors = in_thread(lambda: bus.sdo(1).download(0x1800, 1, bytes(4)))
    died = errors.get(timeout=PATIENCE_S)
    thread.join()
    assert isinstance(died, BusUnavailable)
    assert died.state == "unknown"
    assert "virtual:dying" in died.text
    assert died.why
    with pytest.raises(BusUnavailable) as caught:
        bus.sdo(1).download(0x1800, 1, bytes(4))
    assert caught.value.state == "unchanged"
    bus.close()
    server.stop()


def test_a_bus_that_dies_sends_every_waiting_thread_away(channel: str) -> None:
    ours = can.Bus(channel, interface="virtual", ignore_config=True)
    bus = CanBus(ours, "virtual:dying", timeout_s=30)
    waiting = [in_thread(lambda n=n: bus.sdo(n).upload(0x1000, 0)) for n in range(1, 5)]
    time.sleep(0.03)
    ours.shutdown()
    for thread, errors in waiting:
        assert isinstance(errors.get(timeout=PATIENCE_S), BusUnavailable)
        thread.join()
    bus.close()


def test_an_interrupted_wait_does_not_block_the_bus(serve: Serve) -> None:
    bus, _ = serve(Steps([], *([frame("4F 00 10 00 07")] for _ in range(2))), timeout_s=0.02)
    stop = bus.tap(_interrupt)
    with pytest.raises(KeyboardInterrupt):
        bus.sdo(NODE).upload(0x1000, 0)
    stop()
    bus.sdo(NODE).upload(0x1000, 0, timeout_s=PATIENCE_S, retries=1)


def test_a_wait_that_is_interrupted_by_a_frame_does_not_block_the_bus(serve: Serve) -> None:
    bus, _ = serve()

    def interrupt(_: Frame, sent: bool) -> None:
        if not sent:
            raise KeyboardInterrupt

    stop = bus.tap(interrupt)
    with pytest.raises(KeyboardInterrupt):
        bus.sdo(NODE).upload(0x1000, 0)
    stop()
    bus.sdo(NODE).upload(0x1001, 0)


def test_a_thread_that_was_interrupted_while_it_ceased_to_read_can_go_on(serve: Serve) -> None:
    bus, _ = serve()
    bus._receiver._leader, bus._receiver._leading_thread = object(), threading.get_ident()
    bus.sdo(NODE).upload(0x1000, 0)
    thread, errors = in_thread(lambda: bus.sdo(NODE).upload(0x1000, 0))
    thread.join()
    assert errors.empty()


def _interrupt(_: Frame, sent: bool) -> None:
    if sent:
        raise KeyboardInterrupt


# Background reading ---------------------------------------------------------------------------------------------


def test_a_background_thread_tells_events_while_nobody_waits(serve: Serve) -> None:
    bus, server = serve()
    events: SimpleQueue[NodeEvent] = SimpleQueue()
    bus.on_event(events.put)
    thread, errors = in_thread(lambda: [bus.idle(0.2) for _ in range(100)])
    server.send(0x700 + NODE, b"\0")
    assert isinstance(events.get(timeout=PATIENCE_S), BootUp)
    bus.close()
    thread.join(PATIENCE_S)
    assert not thread.is_alive()
    assert errors.empty() or isinstance(errors.get(), BusUnavailable)


def test_a_background_thread_gives_way_to_an_sdo_client(serve: Serve) -> None:
    bus, _ = serve(timeout_s=PATIENCE_S)
    thread, _ = in_thread(lambda: bus.idle(30))
    time.sleep(0.05)
    readers: list[threading.Thread] = []
    bus.tap(lambda _, sent: None if sent else readers.append(threading.current_thread()))
    for sub_index in range(200):
        assert bus.sdo(NODE).upload(0x2000, sub_index)[2] == sub_index
    assert readers.count(threading.current_thread()) > 20  # a late thread finds the other one reading
    bus.close()
    thread.join(PATIENCE_S)


def test_idle_ends_in_time(serve: Serve) -> None:
    bus, _ = serve()
    started = time.monotonic()
    bus.idle(0.05)
    assert time.monotonic() - started > 0.04


# Threads --------------------------------------------------------------------------------------------------------


@heavy
@pytest.mark.parametrize("nodes", [list(range(1, 9)), [NODE] * 4, [NODE] * 8, [1, 1, 2, 2, 3, 3, 4, 4]])
def test_many_threads_get_their_own_answers(serve: Serve, nodes: list[int]) -> None:
    def by_address(request: bytes) -> list[bytes]:
        return well_behaved(request)

    bus, _ = serve(by_address, timeout_s=PATIENCE_S)

    def work(node_id: int) -> None:
        for index in range(0x2000, 0x2064):
            assert bus.sdo(node_id).upload(index, node_id) == index.to_bytes(2, "little") + bytes([node_id, 0])
            bus.sdo(node_id).download(index, node_id, b"\0")

    threads = [in_thread(lambda node_id=node_id: work(node_id)) for node_id in nodes]
    for thread, errors in threads:
        thread.join(PATIENCE_S)
        assert not thread.is_alive()
        assert errors.empty()
    assert sum(bus.sdo(node_id).dropped.total for node_id in set(nodes)) == 0


def test_a_silent_node_does_not_hold_up_the_others(serve: Serve) -> None:
    bus, _ = serve(lambda request: well_behaved(request) if request[3] else [], timeout_s=100 * PATIENCE_S)
    thread, errors = in_thread(lambda: bus.sdo(1).upload(0x1000, 0))
    time.sleep(0.02)
    for _ in range(50):
        bus.sdo(2).upload(0x1000, 1)
    assert errors.empty(), "it waits on"
    bus.close()
    thread.join(PATIENCE_S)
    assert isinstance(errors.get(timeout=PATIENCE_S), BusUnavailable)


@pytest.mark.parametrize(("can_id", "extended"), [(0x800, False), (1 << 29, True), (-1, False)])
def test_no_can_id_is_sent_that_a_driver_would_cut(serve: Serve, can_id: int, extended: bool) -> None:
    bus, _ = serve()
    sent: list[Frame] = []
    bus.tap(lambda frame, ours: sent.append(frame) if ours else None)
    with pytest.raises(UsageError, match="bits: not sent"):
        bus.send(Frame(can_id, b"\1\0", extended=extended))
    assert not sent
