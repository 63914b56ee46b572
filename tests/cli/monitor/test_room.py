"""What does not fit into a screen's width is never cut into another number."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.cli.monitor.screen import picture
from dvtcli.cli.monitor.signal_lines import Moment, View
from dvtcli.cli.monitor.watch import Board, watch_picture
from dvtcli.cli.screen.widgets import cut, filled, least_and_most
from dvtcli.cli.view.lines import Cell
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling
from dvtcli.watch.decoder import Decoder, Signal
from dvtcli.watch.seen import FrameStore
from dvtcli.watch.statistics import WatchedObject
from tests.cli.monitor.test_model import BEGIN_S, decoder, taking

MOMENT = Moment("sim", 72.0, 0, BEGIN_S + 1.0)
NUMBERS = st.integers(-(2**63), 2**63) | st.floats(-1e30, 1e30) | st.integers(-20000, 20000)


def rows(values: list[int | float], width: int, *, plain: bool) -> list[str]:
    """The lines of `watch` and of `monitor`, both of *values*, *width* columns wide."""
    watched = WatchedObject(1, Signal("606C:00", "Velocity actual value", "606C:00"))
    store = FrameStore(decoder())
    for number, value in enumerate(values):
        watched.take(watched.signal, value, BEGIN_S + number)
        bits = int(value) & 0xFFFF_FFFF
        data = (bits >> 16 & 0xFFFF).to_bytes(2, "little") + bits.to_bytes(4, "little") + b"\x37\x12"
        store.take(Frame(0x201, data, timestamp_s=BEGIN_S + number))
    view = View(plain=plain)
    pictures = watch_picture(Board([watched], [(1, "TPDO1")], store, 0.1), view, MOMENT, width, 12)
    pictures += picture(store, view, MOMENT, width, 12)
    return ["".join(cell.text for cell in line) for line in pictures]


@given(st.lists(NUMBERS, min_size=1, max_size=3), st.integers(20, 130), st.booleans())
def test_every_number_of_a_narrow_screen_is_whole_or_marked(values: list[int | float], width: int, plain: bool) -> None:
    """Each is one of the same screen with room for all, unless `…` ends it, or a `~` stands before it."""
    mark = "..." if plain else "…"
    wide = rows(values, width=400, plain=plain)
    for number, line in enumerate(rows(values, width, plain=plain)):
        assert len(line) <= width
        before, _, _rounded = line.partition("~")
        numbers = [word for word in before.split() if word.lstrip("-")[:1].isdigit() and not word.endswith(mark)]
        assert set(numbers) <= set(wide[number].split()), line


@given(NUMBERS, NUMBERS, st.integers(1, 60), st.sampled_from([Scaling(), Scaling(unit="A", factor=Fraction(1, 16))]))
def test_least_and_most_are_right_to_their_digits(one: float, other: float, width: int, meaning: Scaling) -> None:
    low, high = sorted((one, other))
    said = least_and_most(meaning, low, high, width)
    assert len(said) <= max(1, width)
    if said == "…":
        assert width < 24, "two digits of two numbers, their signs and exponents"
        return
    least, most = (float(text) for text in said.lstrip("~").split(" .. "))
    near = 0.05 if said.startswith("~") else 1e-8
    assert least == pytest.approx(float(meaning.to_physical(low)), rel=near, abs=0.05)
    assert most == pytest.approx(float(meaning.to_physical(high)), rel=near, abs=0.05)


@pytest.mark.parametrize(
    ("width", "said"),
    [(24, "4294965796 .. 4294965796"), (23, "~4.29497e9 .. 4.29497e9"), (17, "~4.29e9 .. 4.29e9"), (14, "…")],
)
def test_less_room_is_fewer_digits(width: int, said: str) -> None:
    assert least_and_most(Scaling(), 4294965796, 4294965796, width) == said


def test_what_is_cut_ends_with_a_mark_in_ascii_too() -> None:
    line = [Cell("  25", "bold"), Cell("00 ± 1 rpm  ", "dim"), Cell("   ")]
    assert cut(line, 14, plain=False) == [Cell("  25", "bold"), Cell("00 ± 1 rpm", "dim")]
    assert cut(line, 5, plain=False) == [Cell("  25", "bold"), Cell("…", "dim")]
    assert cut(line, 5, plain=True) == [Cell("  ..", "bold"), Cell(".", "dim")]
    assert (filled("Speed", 7, plain=True), filled("Velocity", 7, plain=True)) == ("Speed  ", "Velo...")


@given(
    st.dictionaries(
        st.integers(1, 127), st.text("abc ", min_size=1, max_size=40).map(lambda name: f"x{name}x"), min_size=1
    ),
    st.integers(24, 130),
    st.booleans(),
)
def test_every_node_is_on_the_line_of_nodes_or_counted(names: dict[int, str], width: int, plain: bool) -> None:
    store = FrameStore(Decoder({}, names))
    store.states.update(dict.fromkeys(list(names)[::2], NmtState.PRE_OPERATIONAL))
    line = "".join(cell.text for cell in picture(store, View(plain=plain), MOMENT, width, 12)[1])
    assert len(line) <= width
    counted = sum(int(number) for number in re.findall(r"(?:^|   )(\d+) nodes?(?= PRE-OP| no heartbeat|$)", line))
    numbers = re.findall(r"(?:^|   )([\d,-]+)(?= x| PRE-OP| no heartbeat|   |$)", line)
    runs = [run.split("-") for number in numbers for run in number.split(",")]
    shown = [node for run in runs for node in range(int(run[0]), int(run[-1]) + 1)]
    assert len(shown) == len(set(shown)), line
    assert set(shown) <= set(names), line
    assert len(shown) + counted == len(names), line


def line_of_nodes(states: dict[int, NmtState], width: int, name: str = "Generic CANopen device") -> str:
    store = FrameStore(Decoder({}, dict.fromkeys(states, name)))
    store.states.update(states)
    return "".join(cell.text for cell in picture(store, View(), MOMENT, width, 12)[1])


def test_nodes_lose_the_length_of_their_states_and_their_names_before_they_are_only_counted() -> None:
    states = dict.fromkeys(range(1, 7), NmtState.PRE_OPERATIONAL)
    assert (
        line_of_nodes({1: NmtState.STOPPED, 2: NmtState.OPERATIONAL}, 80, "Gen4")
        == "1 Gen4 STOPPED   2 Gen4 OPERATIONAL"
    )
    assert line_of_nodes(states, 64) == "1 PRE-OP   2 PRE-OP   3 PRE-OP   4 PRE-OP   5 PRE-OP   6 PRE-OP"
    assert "1 Generic CANopen device PRE-OP   2 Gen" in line_of_nodes(states, 220)


def test_nodes_without_room_stand_by_their_states_those_in_another_state_than_most_first() -> None:
    states = dict.fromkeys(range(1, 21), NmtState.PRE_OPERATIONAL)
    assert line_of_nodes(states, 80) == "1-20 PRE-OP"
    states |= {9: NmtState.STOPPED}
    assert line_of_nodes(states, 80) == "9 STOPPED   1-8,10-20 PRE-OP"
    assert line_of_nodes(states, 27) == "9 STOPPED   19 nodes PRE-OP"
    assert line_of_nodes(states, 20) == "20 nodes"


def test_a_node_without_a_heartbeat_is_told_from_those_that_have_one() -> None:
    store = FrameStore(Decoder({}, dict.fromkeys(range(1, 21), "Generic CANopen device")))
    store.states.update(dict.fromkeys(range(2, 21), NmtState.OPERATIONAL))
    line = "".join(cell.text for cell in picture(store, View(), MOMENT, 80, 12)[1])
    assert line == "1 no heartbeat   2-20 OP"


def many_nodes() -> FrameStore:
    """A bus of 20 nodes whose mappings were just read: an SDO answer of each, then its heartbeat."""
    store = FrameStore(Decoder())
    take = taking(store)
    for node in range(1, 21):
        take(Frame(0x580 + node, bytes(8), timestamp_s=BEGIN_S))
        take(Frame(0x700 + node, b"\x7f", timestamp_s=BEGIN_S + 1))
    return store


def body(store: FrameStore, view: View, after_s: float) -> list[str]:
    moment = Moment("sim", after_s, 0, BEGIN_S + after_s)
    return ["".join(cell.text for cell in line) for line in picture(store, view, moment, 80, 24)[3:19]]


def test_heartbeats_stand_before_the_sdo_that_is_most_often_dvtclis_own() -> None:
    lines = body(many_nodes(), View(), 2.0)
    assert [line.split("  ")[0] for line in lines] == [
        f"0x{0x700 + node:03X} heartbeat node {node}" for node in range(1, 17)
    ]


def test_sdo_that_is_over_goes_unless_it_is_wanted() -> None:
    store, view = many_nodes(), View()
    view.choose(99, 0)
    assert body(store, view, 4.9)[-1].startswith("0x594 SDO answer node 20")
    lines = body(store, view, 5.1)
    assert [line.split("  ")[0] for line in lines[:-1]] == [
        f"0x{0x700 + node:03X} heartbeat node {node}" for node in range(6, 21)
    ]
    assert lines[-1] == "  20 idle SDO rows left out: f sdo shows them"
    assert body(store, View(filter="SDO"), 5.1)[0].startswith("0x581 SDO answer node 1 ")


def test_rows_behind_the_last_signal_are_scrolled_to() -> None:
    store, view = many_nodes(), View()
    store.know(decoder())
    store.take(Frame(0x201, bytes(8), timestamp_s=BEGIN_S + 1))
    view.choose(2, 3)
    assert body(store, view, 6.0)[3].startswith("  > 6041:00")
    view.choose(1, 3)
    assert body(store, view, 6.0)[2].startswith("  > 6041:00")
    view.choose(90, 3)
    assert body(store, view, 6.0)[-2].startswith("0x714 heartbeat node 20")
    view.choose(-9, 3)
    assert body(store, view, 6.0)[3].startswith("  > 6041:00")
    view.choose(-1, 3)
    assert body(store, view, 6.0)[2].startswith("  > 606C:00")
