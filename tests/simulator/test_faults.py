"""Faults in words, and what each of them does to the frames."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.simulated_faults import Fault, FaultKind, own_of, read_faults
from dvtcli.simulator.network.station import SimulatedNode
from tests.simulator.bench import booted

DOWNLOAD = bytes.fromhex("2F 00 18 02 05 00 00 00")
ACKNOWLEDGED = bytes.fromhex("60 00 18 02 00 00 00 00")
UPLOAD = bytes.fromhex("40 00 18 02 00 00 00 00")
SEGMENTED = bytes.fromhex("21 00 18 02 01 00 00 00")
SEGMENT = bytes.fromhex("0D 05 00 00 00 00 00 00")
STORE = bytes.fromhex("23 10 10 01") + b"save"


TIMED = (
    FaultKind.LATE,
    FaultKind.RESET,
    FaultKind.RESET_AFTER_READ,
    FaultKind.RESET_AT_READ,
    FaultKind.SLOW_STORE,
    FaultKind.CORRECTS,
    FaultKind.EMCY,
)


class Bench:
    """A node with faults, asked frame by frame at times that the test says."""

    def __init__(self, *faults: str) -> None:
        self.device = booted()
        self.device.set_value(0x1017, 0, b"\0\0")
        self.device.download(0x1010, 1, b"save")  # no heartbeats between the answers, nor after a reset
        self.node = SimulatedNode(self.device, [Fault.parse(text) for text in faults])

    def ask(self, request: bytes, now_s: float = 0.0) -> list[bytes]:
        return [frame.data for frame in self.node.handle(Frame(0x601, request), now_s)]

    def poll(self, now_s: float) -> list[bytes]:
        return [frame.data for frame in self.node.poll(now_s)]

    @property
    def held(self) -> bytes:
        return self.device.value(0x1800, 2)


HIGHEST_CODE = {
    FaultKind.REFUSE: 0xFFFF_FFFF, FaultKind.REFUSE_READ: 0xFFFF_FFFF, FaultKind.EMCY: 0xFFFF,
    FaultKind.BIT_RATE: 1_000_000,
}  # fmt: skip


@st.composite
def some_fault(draw: st.DrawFn) -> Fault:
    kind = draw(st.sampled_from(FaultKind))
    seconds = st.integers(0, 3_600_000).map(lambda ms: ms / 1000)
    place = st.tuples(st.integers(0x1000, 0xFFFF), st.integers(0, 0xFF))
    altering = kind in (FaultKind.ALTERS, FaultKind.ENABLE_ALTERS)
    return Fault(
        kind,
        draw(st.integers(1, 10**6)) if kind.counted else None,
        draw(st.integers(0, HIGHEST_CODE[kind])) if kind in HIGHEST_CODE else None,
        draw(seconds) if kind in TIMED else None,
        draw(st.none() | st.integers(1, 127)),
        draw(place) if altering else None,
        draw(st.integers(0, 0xFFFF_FFFF)) if altering else None,
    )


def test_an_upload_is_refused_when_it_is_its_turn() -> None:
    bench = Bench("refuse-read@2=0x08000022")
    read, refused = bytes.fromhex("4000180200000000"), bytes.fromhex("8000180222000008")
    assert refused not in bench.ask(read) + bench.ask(read), "nothing was downloaded yet"
    bench.ask(bytes.fromhex("2F00180201000000"))
    assert [bench.ask(read) == [refused] for _ in range(3)] == [False, True, False]


@given(some_fault())
def test_what_is_written_is_read_back(fault: Fault) -> None:
    assert Fault.parse(str(fault)) == fault


@given(st.text(max_size=40) | st.from_regex(r"([0-9a-z]+:)?[a-z-]+(@\w+)?(=[\w.]+)?", fullmatch=True))
def test_any_text_is_a_fault_or_a_value_error(text: str) -> None:
    try:
        fault = Fault.parse(text)
    except ValueError:
        return
    assert Fault.parse(str(fault)) == fault


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("refuse@4=0x06040041", "refuse@4=0x06040041"),
        ("refuse@4=100925505", "refuse@4=0x06040041"),
        ("0x7F:late@2=.5", None),
        ("0x7F:late@2=0.5", "127:late@2=0.5"),
        ("reset@3", "reset@3=0.1"),
        (" silent@1 ", "silent@1"),
        ("store-fails", "store-fails"),
        ("slow-store=12", "slow-store=12.0"),
        ("silent", None),
        ("silent@0", None),
        ("silent@-1", None),
        ("silent@1=3", None),
        ("refuse@1", None),
        ("refuse@1=0x100000000", None),
        ("late@1", None),
        ("late@1=-1", None),
        ("late@1=nan", None),
        ("late@1=3601", None),
        ("store-fails@1", None),
        ("slow-store", None),
        ("0:silent@1", None),
        ("128:silent@1", None),
        ("x:silent@1", None),
        ("Silent@1", None),
        ("loose-request@1", None),
        ("", None),
        ("refuse@٣=0x1", None),
    ],
)
def test_forms(text: str, written: str | None) -> None:
    if written is None:
        with pytest.raises(ValueError, match=r"."):
            Fault.parse(text)
    else:
        assert str(Fault.parse(text)) == written


def test_an_unknown_word_lists_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"refuse@K=CODE, refuse-read@K=CODE, .*, store-fails"):
        Fault.parse("what")


def test_faults_find_their_nodes() -> None:
    read = read_faults(["silent@1", "5:late@2=1", "3:silent@1"], [3, 5][::-1])
    assert [str(fault) for fault in own_of(5, 5, read)] == ["silent@1", "5:late@2=1.0"]
    assert [str(fault) for fault in own_of(3, 5, read)] == ["3:silent@1"]


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["silent@1", "refuse@1=1"], "refuse@1=1: silent@1 happens there already"),
        (["silent@1", "3:refuse@1=1"], "happens there already"),
        (["slow-store=1", "slow-store=2"], "happens there already"),
        (["4:silent@1"], "4:silent@1: no simulated node 4"),
        (["nothing"], "nothing: no such fault"),
    ],
)
def test_faults_that_do_not_fit(words: list[str], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        read_faults(words, [3])


def test_only_the_beginning_of_a_download_counts() -> None:
    bench = Bench("refuse@3=0x08000000")
    assert bench.ask(UPLOAD)
    assert bench.ask(bytes.fromhex("2F 00 10 00 00 00 00 00"))[0][0] == 0x80, "refused by the device itself: counts"
    assert bench.ask(SEGMENTED) == [ACKNOWLEDGED]
    assert bench.ask(SEGMENT)[0][0] == 0x20
    assert bench.ask(DOWNLOAD) == [bytes.fromhex("80 00 18 02 00 00 00 08")]
    assert bench.ask(DOWNLOAD) == [ACKNOWLEDGED], "it happens once"


def test_refused_is_not_taken() -> None:
    bench = Bench("refuse@1=0x06040041")
    before = bench.held
    assert bench.ask(DOWNLOAD) == [bytes.fromhex("80 00 18 02 41 00 04 06")]
    assert bench.held == before


def test_a_lost_request_is_not_taken_and_a_lost_response_is() -> None:
    for fault, taken in (("lose-request@1", False), ("lose-response@1", True)):
        bench = Bench(fault)
        assert bench.ask(DOWNLOAD) == []
        assert (bench.held == b"\x05") is taken
        assert bench.ask(DOWNLOAD) == [ACKNOWLEDGED]


def test_late_is_taken_at_once_and_delays_what_follows() -> None:
    bench = Bench("late@1=0.8")
    assert bench.ask(DOWNLOAD, 10.0) == []
    assert bench.held == b"\x05"
    assert bench.ask(UPLOAD, 10.5) == [], "a server answers in order"
    assert bench.poll(10.7) == []
    assert bench.node.next_poll_s() == pytest.approx(10.8)
    assert bench.poll(10.8) == [ACKNOWLEDGED, bytes.fromhex("4F 00 18 02 05 00 00 00")]
    assert bench.node.next_poll_s() is None
    assert bench.ask(UPLOAD, 10.9) == [bytes.fromhex("4F 00 18 02 05 00 00 00")]


def test_duplicate_foreign_and_malformed() -> None:
    assert Bench("duplicate@1").ask(DOWNLOAD) == [ACKNOWLEDGED, ACKNOWLEDGED]
    assert Bench("foreign@1").ask(DOWNLOAD) == [bytes.fromhex("60 00 18 42 00 00 00 00"), ACKNOWLEDGED]
    bench = Bench("malformed@1")
    assert bench.ask(DOWNLOAD) == [ACKNOWLEDGED[:3]]
    assert bench.held == b"\x05"


def test_a_wrong_toggle_bit_in_a_download() -> None:
    bench = Bench("toggle@1")
    assert bench.ask(SEGMENTED) == [ACKNOWLEDGED]
    assert bench.ask(SEGMENT)[0][0] == 0x30
    assert bench.held == b"\x05"


def test_a_wrong_toggle_bit_in_the_read_that_follows() -> None:
    bench = Bench("toggle@1")
    assert bench.ask(DOWNLOAD) == [ACKNOWLEDGED]
    assert bench.ask(UPLOAD) == [bytes.fromhex("41 00 18 02 01 00 00 00")]
    assert bench.ask(b"\x60" + bytes(7)) == [bytes.fromhex("1D 05 00 00 00 00 00 00")]
    assert bench.ask(UPLOAD) == [bytes.fromhex("4F 00 18 02 05 00 00 00")], "it happens once"


def test_a_reset_loses_what_was_not_stored_and_is_silent_until_it_has_booted() -> None:
    bench = Bench("reset@2=0.3")
    before = bench.held
    assert bench.ask(DOWNLOAD, 5.0) == [ACKNOWLEDGED]
    assert bench.ask(DOWNLOAD, 5.0) == []
    assert bench.held == before
    assert bench.device.state is NmtState.INITIALISING
    assert bench.ask(UPLOAD, 5.1) == []
    assert bench.node.handle(Frame(0, b"\x01\x00"), 5.1) == []
    assert bench.poll(5.2) == []
    assert bench.node.next_poll_s() == pytest.approx(5.3)
    assert bench.node.poll(5.3) == [Frame(0x701, b"\0")]
    assert bench.device.state is NmtState.PRE_OPERATIONAL
    assert bench.ask(UPLOAD, 5.4)


def test_a_silent_node_is_dead_whatever_it_hears() -> None:
    bench = Bench("silent@1")
    bench.device.set_value(0x1017, 0, b"\x64\0")
    assert bench.ask(DOWNLOAD) == []
    assert bench.ask(UPLOAD) == []
    assert bench.node.handle(Frame(0, b"\x82\x00")) == []
    assert bench.poll(1000.0) == []
    assert bench.node.next_poll_s() is None
    assert not bench.node.bus_failed


def test_a_bus_error_is_the_buss() -> None:
    bench = Bench("bus-error@2")
    bench.ask(DOWNLOAD)
    assert not bench.node.bus_failed
    assert bench.ask(DOWNLOAD) == []
    assert bench.node.bus_failed


def test_stores() -> None:
    slow, broken = Bench("slow-store=2"), Bench("store-fails")
    assert slow.ask(STORE, 1.0) == []
    assert slow.poll(3.0) == [bytes.fromhex("60 10 10 01 00 00 00 00")]
    assert broken.ask(STORE) == [bytes.fromhex("80 10 10 01 00 00 06 06")]


def test_a_store_that_stores_nothing() -> None:
    bench = Bench("stores-nothing")
    kept = bench.held
    bench.ask(DOWNLOAD)
    assert bench.ask(STORE)[0][0] == 0x60
    bench.device.nmt(0x81)
    assert bench.held == kept


def test_a_restore_that_restores_nothing() -> None:
    bench = Bench("restores-nothing")
    bench.ask(DOWNLOAD)
    bench.ask(STORE)
    assert bench.ask(bytes.fromhex("23 11 10 01") + b"load")[0][0] == 0x60
    bench.device.nmt(0x81)
    assert bench.held == DOWNLOAD[4:5]


def test_ram_that_a_reset_leaves_alone() -> None:
    bench = Bench("keeps-ram")
    kept = bench.held
    bench.ask(DOWNLOAD)
    for command in (0x81, 0x82):
        bench.device.nmt(command)
        assert bench.held == DOWNLOAD[4:5]
    bench.device.restart()
    assert bench.held == kept, "a power cycle does not"


def test_ram_that_is_kept_is_restored_all_the_same() -> None:
    bench = Bench("keeps-ram")
    kept = bench.held
    bench.ask(DOWNLOAD)
    bench.ask(bytes.fromhex("23 11 10 01") + b"load")
    bench.device.nmt(0x81)
    assert bench.held == kept


def test_a_device_that_saves_by_itself() -> None:
    bench = Bench("saves-itself")
    bench.ask(DOWNLOAD)
    bench.device.restart()
    assert bench.held == DOWNLOAD[4:5]


def test_a_node_that_ignores_nmt_but_resets() -> None:
    bench = Bench("ignores-nmt")
    for command in (1, 2, 0x80):
        bench.device.nmt(command)
        assert bench.device.state is NmtState.PRE_OPERATIONAL
    bench.ask(DOWNLOAD)
    bench.device.nmt(0x81)
    assert bench.held != DOWNLOAD[4:5]
