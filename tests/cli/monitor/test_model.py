"""The pure part: rates, least and most, events, layouts, drawings; and golden pictures of whole screens."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.bus.carrier import Carrier
from dvtcli.bus.python_can import CanBus
from dvtcli.cli.monitor.actions import NmtDialog
from dvtcli.cli.monitor.graph import graph, slots
from dvtcli.cli.monitor.monitor_keys import dialog_lines
from dvtcli.cli.monitor.screen import picture, signal_at
from dvtcli.cli.monitor.signal_lines import GRAPH, PICTURE, RAW, Moment, View, age
from dvtcli.cli.monitor.transmit_list import TransmitEntry, TransmitList
from dvtcli.cli.screen.widgets import Choices, Dialog, FieldDialog, Question
from dvtcli.cli.view.lines import Cell
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.object_scalings import ObjectRange, ObjectScalings
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling
from dvtcli.domain.sdo_frame import SdoValues
from dvtcli.domain.times import utc
from dvtcli.errors import BusUnavailable
from dvtcli.files.profiles import standards
from dvtcli.operations.frames.transmit_rows import transmit_row
from dvtcli.operations.session.steady_listener import FOREIGN_CLOCK_S, Listener
from dvtcli.watch.decoder import Decoder, Layout, Signal, pdo_layouts, unique
from dvtcli.watch.frame_reader import FrameReader, Reading
from dvtcli.watch.known_node import KnownNode
from dvtcli.watch.seen import ROWS, FrameStore
from dvtcli.watch.service import service_of
from dvtcli.watch.statistics import FrameIntervals, Point, ValueHistory, spark
from dvtcli.watch.table import Track, all_columns, find_tracks
from tests.laws.bench import dictionary
from tests.simulator.serve.served import wait_for

BEGIN_S = 1_700_000_000.0
SCREENS = Path(__file__).parent / "screens"


def config(cob_id: int, *entries: PdoMappingEntry) -> PdoConfig:
    return PdoConfig(PdoCommunicationParameter(CobId(cob_id)), entries)


def taking(store: FrameStore, family: str = "") -> Callable[[Frame], bool]:
    """Take frames of a device of *family* into *store*, with their words, as the monitor does."""
    node = KnownNode(dictionary(family) if family else None, ObjectScalings())
    reader = FrameReader(store.decoder, lambda _node: node)
    return lambda frame: store.take(frame, reader.read(frame))


def received(*sent: tuple[int, str], family: str = "") -> tuple[FrameStore, list[bool]]:
    """A store of the frames *sent* by a device of *family*, with their words, and which of them were news."""
    store = FrameStore(Decoder())
    take = taking(store, family)
    frames = [Frame(can_id, bytes.fromhex(data), timestamp_s=BEGIN_S + n) for n, (can_id, data) in enumerate(sent)]
    return store, [take(frame) for frame in frames]


def decoder() -> Decoder:
    tpdo = config(0x201, PdoMappingEntry(0x6C01, 1, 16), PdoMappingEntry(0x606C, 0, 32), PdoMappingEntry(0x6041, 0, 16))
    return Decoder(pdo_layouts(1, {Pdo.parse("tpdo1"): tpdo}, None, ObjectScalings()))


@pytest.mark.parametrize(
    ("can_id", "extended", "kind", "label", "node"),
    [
        (0x000, False, "nmt", "NMT", None), (0x080, False, "sync", "SYNC", None), (0x085, False, "emcy", "EMCY", 5),
        (0x100, False, "time", "TIME", None), (0x181, False, "pdo", "TPDO1?", 1), (0x205, False, "pdo", "RPDO1?", 5),
        (0x4FF, False, "pdo", "TPDO4?", 127), (0x57F, False, "pdo", "RPDO4?", 127),
        (0x180, False, "other", "frame", None),
        (0x581, False, "sdo", "SDO answer", 1), (0x601, False, "sdo", "SDO request", 1),
        (0x77F, False, "heartbeat", "heartbeat", 127), (0x7E5, False, "lss", "LSS", None),
        (0x181, True, "other", "29-bit frame", None),
    ],
)  # fmt: skip
def test_services_of_the_pre_defined_connection_set(
    can_id: int, extended: bool, kind: str, label: str, node: int | None
) -> None:
    assert service_of(can_id, extended=extended) == (kind, label, node)


@given(st.floats(0.001, 10), st.integers(3, 100))
def test_a_steady_frame_has_its_rate_and_no_jitter(period_s: float, count: int) -> None:
    rhythm = FrameIntervals()
    for n in range(count):
        rhythm.beat(n * period_s)
    last_s = (count - 1) * period_s
    assert rhythm.rate_hz(last_s) == pytest.approx(1 / period_s, rel=1e-6)
    assert rhythm.jitter_s() == pytest.approx(0, abs=1e-6)
    assert rhythm.rate_hz(last_s + 5 * period_s + 1) == 0


def test_jitter_is_the_deviation_of_the_gaps() -> None:
    rhythm = FrameIntervals()
    for time_s in (0.0, 0.010, 0.030, 0.040, 0.060):
        rhythm.beat(time_s)
    assert rhythm.jitter_s() == pytest.approx(0.005)
    assert rhythm.rate_hz(0.06) == pytest.approx(4 / 0.06)


def test_one_frame_has_no_rate() -> None:
    rhythm = FrameIntervals()
    assert rhythm.rate_hz(0) is None
    rhythm.beat(0)
    assert rhythm.rate_hz(0) is None
    assert rhythm.jitter_s() is None


@given(st.lists(st.tuples(st.integers(0, 300), st.integers(-(2**31), 2**31)), min_size=1, max_size=80))
def test_least_and_most_and_points_hold_every_value(samples: list[tuple[int, int]]) -> None:
    history, time_s, values = ValueHistory(), 0.0, []
    for gap_ms, value in samples:
        time_s += gap_ms / 1000
        values.append(value)
        history.take(value, time_s)
    assert (history.low, history.high, history.last) == (min(values), max(values), values[-1])
    assert min(point.low for point in history.points) == min(values)
    assert max(point.high for point in history.points) == max(values)
    assert history.points[-1].last == values[-1]
    times = [point.time_s for point in history.points]
    assert times == sorted(set(times))


def test_what_is_no_number_is_not_counted() -> None:
    history = ValueHistory()
    history.take(float("nan"), 0.0)
    history.take(b"ab", 1.0)
    assert history.low is None
    assert history.last == b"ab"


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False, width=32), max_size=30))
def test_a_sparkline_has_a_character_for_each_value(values: list[float]) -> None:
    drawn = spark(values, "01234567")
    assert len(drawn) == len(values)
    if len(set(values)) > 1:
        assert drawn[values.index(max(values))] == "7"
        assert drawn[values.index(min(values))] == "0"


@given(
    st.lists(st.tuples(st.integers(0, 5000), st.integers(-1000, 1000)), max_size=60),
    st.integers(20, 160), st.integers(5, 50), st.booleans(),
)  # fmt: skip
def test_a_graph_has_its_size_whatever_it_shows(
    samples: list[tuple[int, int]], width: int, height: int, plain: bool
) -> None:
    history, time_s = ValueHistory(), 0.0
    for gap_ms, value in samples:
        time_s += gap_ms / 1000
        history.take(value, time_s)
    lines = graph(list(history.points), width, height, (time_s - 60, time_s), ends=("-60 s", "now"), plain=plain)
    assert len(lines) == max(2, height - 2) + 2
    assert all(len(line) <= max(width, 22) for line in lines)


def test_a_store_tells_news_from_repetitions() -> None:
    store = FrameStore(decoder())
    frame = Frame(0x201, bytes.fromhex("000A24FAFFFF3712"), timestamp_s=BEGIN_S)
    assert store.take(frame)
    assert not store.take(frame)
    other = Frame(0x201, bytes.fromhex("000A25FAFFFF3712"), timestamp_s=BEGIN_S + 1)
    assert store.take(other)
    (row,) = store.sorted_rows()
    assert [history.last for history in row.histories] == [2560, 0xFFFFFA25, 0x1237]
    assert [at for at, changed_s in enumerate(row.changed_s) if changed_s == BEGIN_S + 1] == [2]
    assert (store.frames, row.count) == (3, 3)


def test_events_are_emergencies_commands_and_new_states() -> None:
    sent = [(0x701, "00"), (0x701, "7F"), (0x701, "7F"), (0x000, "0101"), (0x701, "05"), (0x081, "3081110000000000")]
    store, news = received(*sent)
    assert news == [True, True, False, True, True, True]
    assert [event.text for event in store.events] == [
        "node 1  boot-up", "node 1  is PRE-OPERATIONAL: no PDOs until NMT start",
        "NMT start -> node 1", "node 1  is OPERATIONAL",
        "EMCY node 1  0x8130 life guard or heartbeat error, register 0x11",
    ]  # fmt: skip
    assert [event.bad for event in store.events] == [False, False, False, False, True]


@given(st.lists(st.sampled_from(["00", "7F", "05", "04"]), min_size=1, max_size=12))
def test_each_boot_up_is_an_event_and_its_node_then_pre_operational(states: list[str]) -> None:
    """With a heartbeat or without it, also in a loop of restarts (CiA 301, 7.2.8.3.3)."""
    store, news = received(*((0x705, state) for state in states))
    assert [event.text for event in store.events].count("node 5  boot-up") == states.count("00")
    changed = [state == "00" or state != before for before, state in pairwise(["", *states])]
    assert news == [has_changed or at == 0 for at, has_changed in enumerate(changed)]
    assert len(store.events) == sum(changed)
    after = {"00": NmtState.PRE_OPERATIONAL}.get(states[-1], NmtState(int(states[-1], 16)))
    assert store.states == {5: after}


@pytest.mark.parametrize(
    ("can_id", "data"), [(0x705, "0000"), (0x705, ""), (0x705, "33"), (0x085, "10"), (0x000, "01")]
)
def test_a_malformed_frame_is_no_event(can_id: int, data: str) -> None:
    store, _ = received((can_id, data))
    assert (list(store.events), store.states) == ([], {})


@given(
    st.sampled_from([0x000, 0x085]), st.sampled_from([b"\x10\x23", b"\x80\x05"]), st.binary(max_size=6),
    st.sampled_from(["", "gen4", "generic"]),
)  # fmt: skip
def test_an_event_has_the_words_of_its_row(can_id: int, code: bytes, more: bytes, family: str) -> None:
    """Also of a device's profile: codes of a drive have other words."""
    store, _ = received((can_id, (code + more).hex()), family=family)
    if can_id == 0x085 or code[0] == 0x80:
        ((row,), (event,)) = store.sorted_rows(), store.events
        assert event.text.replace("EMCY node 5  ", "EMCY ") == row.reading.text
        is_of_drive = "continuous over-current at the output" in event.text
        assert is_of_drive == (code == b"\x10\x23" and bool(family)), "both families are drives"


def test_more_can_ids_than_rows_are_counted() -> None:
    store = FrameStore(Decoder())
    for can_id in range(ROWS + 7):
        store.take(Frame(can_id, b"", extended=True, timestamp_s=BEGIN_S))
    assert (len(store.rows), store.unlisted, store.frames) == (ROWS, 7, ROWS + 7)


@given(st.lists(st.binary(max_size=8), min_size=1, max_size=20))
def test_frames_of_any_length_can_be_looked_at(payloads: list[bytes]) -> None:
    store = FrameStore(decoder())
    for n, data in enumerate(payloads):
        store.take(Frame(0x201, data, timestamp_s=BEGIN_S + n))
    moment = Moment("sim", 1.0, 0, BEGIN_S + len(payloads))
    for view in (View(), View(mode=RAW), View(mode=GRAPH), View(mode=PICTURE)):
        lines = picture(store, view, moment, 80, 24)
        assert len(lines) == 24
        assert all(sum(len(cell.text) for cell in line) <= 80 for line in lines)


def test_a_tpdo_counts_before_an_rpdo_of_the_same_cob_id() -> None:
    entry = PdoMappingEntry(0x6041, 0, 16)
    configs = {Pdo.parse("rpdo1"): config(0x201), Pdo.parse("tpdo1"): config(0x201, entry)}
    (layout,) = pdo_layouts(1, configs, None, ObjectScalings()).values()
    assert layout.service.label == "TPDO1"


def test_signals_of_one_name_are_told_apart() -> None:
    signals = [
        Signal("Speed", "Speed", "606C:00"),
        Signal("Speed", "Speed", "6C02:00"),
        Signal("Speed", "Speed", "606C:00"),
    ]
    assert [one.key for one in unique(signals)] == ["Speed", "Speed (6C02:00)", "Speed (606C:00)"]


def test_columns_of_one_name_in_two_frames_are_told_apart() -> None:
    entry = PdoMappingEntry(0x6041, 0, 16)
    two = Decoder(pdo_layouts(1, {Pdo.parse("tpdo1"): config(0x181, entry)}, None, ObjectScalings()))
    two.add(pdo_layouts(5, {Pdo.parse("tpdo1"): config(0x185, entry)}, None, ObjectScalings()))
    names = [column.name for column in all_columns(two).values()]
    assert names == ["TPDO1 node 1 6041:00", "TPDO1 node 5 6041:00"]
    assert len(find_tracks(["6041"], all_columns(two))) == 2


def test_times_are_rfc_3339() -> None:
    assert utc(BEGIN_S + 0.25) == "2023-11-14T22:13:20.250000Z"


def test_what_is_too_much_is_dropped_and_counted() -> None:
    channel = "too much"
    ours = can.Bus(channel, interface="virtual", preserve_timestamps=True, ignore_config=True)
    bus = CanBus(ours, channel)
    with (
        can.Bus(channel, interface="virtual", preserve_timestamps=True, ignore_config=True) as sender,
        Listener(bus, SdoValues(set()), waiting=20) as listener,
    ):
        for n in range(30):
            sender.send(can.Message(arbitration_id=0x181, data=[n], timestamp=5.0 + n, is_extended_id=False))
        wait_for(lambda: listener.dropped == 10, "ten frames dropped")
        taken = listener.take()
    bus.close()
    assert [frame.data[0] for frame in taken] == list(range(20))
    assert taken[1].timestamp_s - taken[0].timestamp_s == pytest.approx(1.0)
    assert taken[0].timestamp_s > BEGIN_S, "a clock of the bus's own is set to the time of day"


class Full(Carrier):
    """Of what it carries something is lost before it can be read."""

    lost = 7

    def lost_frames(self) -> int:
        return self.lost


def test_what_was_lost_before_it_could_be_read_is_dropped_too() -> None:
    carrier = Full()
    bus = CanBus(can.Bus("lost", interface="virtual", ignore_config=True), "lost", carrier=carrier)
    with Listener(bus, SdoValues(set())) as listener:
        assert listener.dropped == 0, "that was before"
        carrier.lost = 12
        assert (listener.dropped, listener.overflowed) == (5, 0)
    carrier.lost = 100
    assert listener.dropped == 5, "and that after"
    bus.close()


def test_what_had_arrived_before_is_not_listened_to() -> None:
    """A computer that is slow to begin finds frames in its driver that came long before."""
    channel = "before"
    bus = CanBus(can.Bus(channel, interface="virtual", ignore_config=True), channel)
    with can.Bus(channel, interface="virtual", ignore_config=True) as sender:
        for n in range(200):
            sender.send(can.Message(arbitration_id=0x181, data=[n], is_extended_id=False))
        with Listener(bus, SdoValues(set())) as listener:
            sender.send(can.Message(arbitration_id=0x182, data=[1], is_extended_id=False))
            wait_for(lambda: any(frame.can_id == 0x182 for frame in listener._frames), "the frame")
            taken = listener.take()
    bus.close()
    assert [frame.can_id for frame in taken] == [0x182]


def test_a_bus_that_failed_before_is_told_to_who_takes() -> None:
    channel = "failed before"
    bus = CanBus(can.Bus(channel, interface="virtual", ignore_config=True), channel)
    bus.close()
    with Listener(bus, SdoValues(set())) as listener, pytest.raises(BusUnavailable):
        listener.take(5.0)


def test_no_frame_is_missing_that_was_sent_before_the_end() -> None:
    channel = "sent at the end"
    bus = CanBus(can.Bus(channel, interface="virtual", ignore_config=True), channel)
    with can.Bus(channel, interface="virtual", ignore_config=True) as sender:
        for _ in range(20):
            with Listener(bus, SdoValues(set())) as listener:
                for number in range(50):
                    sender.send(can.Message(arbitration_id=0x181, data=[number], is_extended_id=False))
                listener.stop()
                assert [frame.data[0] for frame in listener.take()] == [*range(50)]
    bus.close()


def test_who_stops_listening_can_still_take_what_came() -> None:
    channel = "stopped"
    bus = CanBus(can.Bus(channel, interface="virtual", ignore_config=True), channel)
    with (
        can.Bus(channel, interface="virtual", ignore_config=True) as sender,
        Listener(bus, SdoValues(set())) as listener,
    ):
        sender.send(can.Message(arbitration_id=0x181, data=[1], is_extended_id=False))
        wait_for(lambda: listener._frames, "the frame")
        listener.stop()
        sender.send(can.Message(arbitration_id=0x181, data=[2], is_extended_id=False))
        bus.drain()
        assert [frame.data for frame in listener.take()] == [b"\x01"]
    bus.close()


def test_what_is_sent_from_here_has_the_time_at_which_it_was_sent() -> None:
    channel = "sent from here"
    bus = CanBus(can.Bus(channel, interface="virtual", ignore_config=True), channel)
    with (
        can.Bus(channel, interface="virtual", ignore_config=True) as other,
        Listener(bus, SdoValues(set())) as listener,
    ):
        bus.send(Frame(0x605, bytes(8)))
        other.send(can.Message(arbitration_id=0x585, data=bytes(8), is_extended_id=False))
        wait_for(lambda: len(listener._frames) == 2, "the answer")
        asked, answered = listener.take()
    bus.close()
    assert asked.can_id == 0x605
    assert asked.timestamp_s <= answered.timestamp_s, "the answer came later, whenever somebody looks"


class Gateway:
    """A bus whose frames carry the times that it is made with."""

    def __init__(self, *times_s: float) -> None:
        self._times_s = times_s

    def lost_frame_count(self) -> int:
        return 0

    def tap(self, callback: Callable[[Frame, bool], None]) -> Callable[[], None]:
        self._callback = callback
        return lambda: None

    def drain(self) -> None:
        """Nothing has arrived before."""

    def idle(self, duration_s: float) -> None:
        for time_s in self._times_s:
            self._callback(Frame(0x185, b"\x37", timestamp_s=time_s), False)
        self._times_s = ()
        time.sleep(duration_s)


class BrokenDriver(Gateway):
    """A bus whose driver fails with an error that nobody foresaw, after its frames."""

    def idle(self, duration_s: float) -> None:
        super().idle(duration_s)
        raise ZeroDivisionError("in the driver")


def test_a_driver_that_fails_as_nobody_foresaw_is_told_to_who_takes() -> None:
    with Listener(BrokenDriver(time.time()), SdoValues(set())) as listener:
        assert len(listener.take(1.0)) == 1
        with pytest.raises(ZeroDivisionError, match="in the driver"):
            listener.take(5.0)


@pytest.mark.parametrize("first_s", [1e300, -1e18, float("nan"), float("inf"), 5.0])
def test_a_gateways_clock_may_be_nonsense(first_s: float) -> None:
    with Listener(Gateway(first_s, time.time(), 1e18, float("nan"), -5.0, 0.0), SdoValues(set())) as listener:
        taken = listener.take(1.0)
    assert len(taken) == 6
    for frame in taken:
        assert frame.timestamp_s == pytest.approx(time.time(), abs=FOREIGN_CLOCK_S + 30)
        assert utc(frame.timestamp_s)


def golden_store() -> FrameStore:
    """A second of a bus with one known node and one unknown."""
    names = ("Analogue input 1", "Velocity actual value", "Statusword")
    (address, layout), *_ = decoder().layouts.items()
    statusword = standards()[-1].rules[ObjectRange(0x6041, 0x6041)].physical
    scalings = (Scaling("V", Fraction(1, 256)), Scaling("rpm"), statusword)
    known = Layout(
        layout.service,
        tuple(Signal(n, n, s.object, m, s.bits) for n, s, m in zip(names, layout.signals, scalings, strict=True)),
        layout.read,
    )
    store = FrameStore(Decoder({address: known}, {1: "Gen4"}), bitrate=125_000)
    take = taking(store)
    take(Frame(0x701, b"\x05", timestamp_s=BEGIN_S - 61))
    for n in range(51):
        at_s = BEGIN_S + 0.02 * n
        value = (1000 + 100 * n).to_bytes(2, "little") + (50 * n).to_bytes(4, "little") + b"\x37\x12"
        take(Frame(0x201, value, timestamp_s=at_s))
        if n % 10 == 0:
            take(Frame(0x185, b"\x37\x12\x03", timestamp_s=at_s))
    take(Frame(0x085, bytes.fromhex("3081110000000000"), timestamp_s=BEGIN_S + 0.9))
    return store


def test_what_is_learnt_later_counts_for_what_came_before() -> None:
    """The first frames are shown at once, as bytes; once the mapping is read their values stand there, with counts."""
    store = FrameStore(Decoder())
    for number in range(3):
        store.take(Frame(0x201, bytes.fromhex("000A24FAFFFF3712"), timestamp_s=BEGIN_S + number))
    store.know(decoder())
    (row,) = store.sorted_rows()
    assert (row.service.label, row.count, row.histories[0].last) == ("TPDO1", 3, 2560)
    history = row.histories[0]
    store.know(decoder())
    assert row.histories[0] is history, "what is as before keeps its course"
    store.know(Decoder())
    assert (row.service.label, row.histories) == ("RPDO1?", [])


def test_a_silent_frame_has_no_rate_and_fades_with_its_signals() -> None:
    """Four of its periods and a second after the last frame; other rows stay as they are."""
    store = FrameStore(decoder())
    for number in range(20):
        store.take(Frame(0x201, bytes.fromhex("000A24FAFFFF3712"), timestamp_s=BEGIN_S + number / 100))
    for number in range(40):
        store.take(Frame(0x701, b"\x05", timestamp_s=BEGIN_S + number / 10))

    def drawn(now_s: float) -> dict[str, list[Cell]]:
        lines = picture(store, View(chosen=2), Moment("sim", now_s, 0, BEGIN_S + now_s), 120, 24)[3:8]
        return {"".join(cell.text for cell in line).strip(): line for line in lines}

    bright, silent = drawn(0.2), drawn(3.95)
    (row,) = [text for text in silent if text.startswith("0x201")]
    assert row.split()[4:8] == ["-", "-", "20", "3.8"]
    assert "Hz" not in row
    pdo = [line for text, line in silent.items() if not text.startswith("0x701")]
    assert {cell.style for line in pdo for cell in line if cell.text.strip(" >")} == {"dim"}
    (heartbeat,) = [line for text, line in silent.items() if text.startswith("0x701")]
    assert "bold" in {cell.style for cell in heartbeat}
    assert {"bold", "green"} <= {cell.style for line in bright.values() for cell in line}
    (same,) = [text for text in bright if text.startswith("0x201")]
    assert same.split()[4:8] == ["100.0", "Hz", "10.0", "ms"]


def test_a_gap_is_said_and_takes_what_was_seen_with_it() -> None:
    store = FrameStore(decoder(), bitrate=500_000)
    heartbeat = Reading("heartbeat", "OPERATIONAL", {"state": "OPERATIONAL"})
    store.take(Frame(0x701, b"\x05", timestamp_s=BEGIN_S), heartbeat)
    store.gap(BEGIN_S + 9, "the bus was lost for 9 s")
    assert (store.rows, store.states, store.frames) == ({}, {}, 1)
    assert (store.events[-1].text, store.events[-1].bad) == ("the bus was lost for 9 s", True)
    assert store.take(Frame(0x701, b"\x05", timestamp_s=BEGIN_S + 10), heartbeat), "its state is news again"
    assert store.events[-1].text == "node 1  is OPERATIONAL"
    assert store.frames == 2


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(-1, "0.0 s"), (0.04, "0.0 s"), (99.9, "99.9 s"), (599, "599 s"), (600, "10 min"), (1e9, "long")],
)
def test_ages_take_six_characters(seconds: float, text: str) -> None:
    assert age(seconds) == text


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (120, 40)])
@pytest.mark.parametrize("mode", ["table", RAW, GRAPH, PICTURE])
def test_screens_look_as_they_did(request: pytest.FixtureRequest, mode: str, columns: int, rows: int) -> None:
    view = View(mode=mode, chosen=1)
    drawn = picture(golden_store(), view, Moment("sim", 72.0, 3, BEGIN_S + 1.0), columns, rows)
    lines = ["".join(cell.text for cell in line).rstrip() for line in drawn]
    events = [line for line in lines if "EMCY node 5" in line and line.startswith("!")]
    assert len(events) == 1
    clock = re.compile(r"^(.) \d\d:\d\d:\d\d(\.\d\d\d)[+-]\d\d:\d\d")  # the time of day is local
    lines = [clock.sub(r"\1 HH:MM:SS\2+HH:MM", line) for line in lines]
    path = SCREENS / f"{mode}_{columns}x{rows}.txt"
    text = "\n".join([*lines, ""])
    if request.config.getoption("--update-transcripts"):
        path.write_text(text, encoding="utf-8")
    assert text == path.read_text("utf-8")


def _dialogs(name: str) -> Dialog:
    """A dialog of the monitor as its key opens it."""

    def nothing(*_given: object) -> None:
        """Act on nothing."""

    match name:
        case "nmt":
            return NmtDialog(1, {1: "Gen4", 5: ""}, nothing)
        case "sync":
            return FieldDialog("SYNC period in ms", "20", lambda _text: "")
        case "record":
            return FieldDialog("record to", "monitor.log", lambda _text: "", ".asc .blf .log .trc .mf4 .pcapng")
        case "question":
            said = (
                "080#: SYNC: nodes apply the last received RPDOs and transmit their TPDOs; "
                "send it every 20 ms until stopped?"
            )
            return Question(said, nothing)
    rows = ("rpdo1 6040=6 60FF=-100 every 50ms key 1", "7A0#1027 key 2", "185#0000 every 1s")
    return TransmitList([TransmitEntry(transmit_row(row)) for row in rows], *[nothing] * 5)


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (120, 40)])
@pytest.mark.parametrize("name", ["nmt", "sync", "record", "question", "transmit"])
def test_dialogs_look_as_they_did(request: pytest.FixtureRequest, name: str, columns: int, rows: int) -> None:
    """The picture stays above a dialog, without its line of keys."""
    block = dialog_lines(_dialogs(name), View(), columns, rows)
    height = rows - len(block) + 1
    drawn = [*picture(golden_store(), View(chosen=1), Moment("sim", 72.0, 3, BEGIN_S + 1.0), columns, height)[:-1]]
    lines = ["".join(cell.text for cell in line).rstrip() for line in (*drawn, *block)]
    assert (len(lines), max(map(len, lines)) <= columns) == (rows, True)
    lines = [re.sub(r"^(.) \d\d:\d\d:\d\d(\.\d\d\d)[+-]\d\d:\d\d", r"\1 HH:MM:SS\2+HH:MM", line) for line in lines]
    path, text = SCREENS / f"{name}_{columns}x{rows}.txt", "\n".join([*lines, ""])
    if request.config.getoption("--update-transcripts"):
        path.write_text(text, encoding="utf-8")
    assert text == path.read_text("utf-8")


@pytest.mark.parametrize(("mode", "row", "signal"), [
    ("table", 5, 0), ("table", 6, 0), ("table", 7, 1), ("table", 8, 2), ("table", 3, None), ("table", 2, None),
    ("table", 9, None), ("table", 23, None), (RAW, 5, 0), (GRAPH, 5, None),
])  # fmt: skip
def test_the_signal_on_a_line_is_found(mode: str, row: int, signal: int | None) -> None:
    store, view, moment = golden_store(), View(mode=mode), Moment("sim", 72.0, 3, BEGIN_S + 1.0)
    picture(store, view, moment, 80, 24)
    assert signal_at(store, view, moment, 24, row) == signal


@given(
    st.lists(st.tuples(st.floats(0, 10), st.floats(-1e6, 1e6)), min_size=1, max_size=60),
    st.integers(30, 70), st.booleans(), st.sampled_from([(1, 0), (Fraction(1, 4), -3), (-2, 7)]),
)  # fmt: skip
def test_a_graph_of_ranges_is_that_of_all_samples(
    samples: list[tuple[float, float]], width: int, plain: bool, scale: tuple[Fraction, Fraction]
) -> None:
    """Also of samples whose times go back."""
    factor, offset = map(Fraction, scale)
    signal = Signal("it", meaning=Scaling(factor=factor, offset=offset))
    track = Track("it", signal, [time_s for time_s, _ in samples], [value for _, value in samples])
    span_s = min(track.times_s), max(track.times_s)

    def drawn(points: list[Point]) -> list[str]:
        return graph(points, width, 12, span_s, ends=("a", "b"), plain=plain)

    ranges = track.ranges(span_s, slots(width, plain=plain))
    assert drawn(ranges) == drawn(track.points())
    assert len(ranges) <= len(samples)


@pytest.mark.parametrize(("text", "chosen"), [("1", [0]), ("s", [1]), (" ", []), ("x", [])])
def test_a_letter_chooses_its_row_and_a_blank_none(text: str, chosen: list[int]) -> None:
    done: list[int] = []
    choices = Choices("which?", [("1", "first"), ("s", "second"), (" ", "third")], done.append)
    assert choices.press(text, text) is not bool(chosen)
    assert done == chosen
