"""The monitor in real terminals: what a person sees and which keys do what."""

from __future__ import annotations

import re
import signal
from pathlib import Path

import pytest

from tests.cli.prompt.conftest import Open, open_terminal
from tests.cli.prompt.terminal import CTRL_C, DOWN, ENTER, ESCAPE, Terminal
from tests.cli.prompt.wire import Wire
from tests.simulator.serve.served import bus_words, served

pytestmark = pytest.mark.drawn(8, "monitor screen")

__all__ = ["open_terminal"]
PROMPT = "sim/1 OP> "
SIZES = [(80, 24), (120, 40)]


def started(open_terminal: Open, columns: int, rows: int, *words: str) -> Terminal:
    """A monitor at the prompt of a node that sends TPDO2 every 50 ms."""
    terminal = open_terminal("--sim", "gen4", *words, columns=columns, rows=rows)
    terminal.wait_prompt()
    terminal.run("nmt start")
    terminal.wait_prompt(PROMPT)
    terminal.run("monitor")
    terminal.until(lambda: terminal.lines[0].startswith("MONITOR sim") and count(terminal) > 5, "the monitor")
    terminal.wait("606C:00")  # the mapping is read while the first frames are shown
    return terminal


def count(terminal: Terminal) -> int:
    """Frames, by the header."""
    found = re.search(r"(\d+) frames", terminal.lines[0])
    return int(found[1]) if found else 0


def leave(terminal: Terminal, key: str = "q") -> None:
    terminal.type(key)
    terminal.wait_prompt(PROMPT)


@pytest.mark.parametrize(("columns", "rows"), SIZES)
def test_values_rates_and_keys_are_on_the_screen(open_terminal: Open, columns: int, rows: int) -> None:
    terminal = started(open_terminal, columns, rows)
    terminal.until(lambda: terminal.lines[1].startswith("1 Gen4 OPERATIONAL"), "the mapping, read")
    terminal.row("0x281 TPDO2 node 1 ", " Hz", " ms ", "24 FA FF FF 78 00 88 FF" + ("" if columns == 80 else "  Gen4"))
    terminal.row("606C:00  Velocity actual value ", " -1500 rpm ", " -1500 .. -1500")
    assert "0 dropped" in terminal.lines[0]
    assert terminal.lines[-1].split()[:4] == ["p", "pause", "f", "filter"]
    assert terminal.lines[-1].split()[-2:] == ["q", "quit"]
    leave(terminal)


def test_ctrl_c_leaves_the_monitor_and_only_it(open_terminal: Open) -> None:
    terminal = started(open_terminal, 80, 24)
    leave(terminal, CTRL_C)
    terminal.run("read 6041")
    terminal.wait("Statusword")
    terminal.wait_prompt(PROMPT)


def test_a_signal_from_outside_leaves_the_monitor_only(open_terminal: Open) -> None:
    terminal = started(open_terminal, 80, 24)
    terminal.child.kill(signal.SIGINT)
    terminal.wait_prompt(PROMPT)


def test_a_paused_screen_stands_still_and_counts_on(open_terminal: Open) -> None:
    terminal = started(open_terminal, 80, 24)
    terminal.type("p")
    terminal.wait("PAUSED", "p go on")
    still = count(terminal)
    terminal.type("r")  # a key that draws anew
    terminal.until(lambda: "606C:00" not in terminal.text, "the raw view")
    assert count(terminal) == still
    terminal.type("p")
    terminal.until(lambda: "PAUSED" not in terminal.text and count(terminal) > still, "the screen going on")
    leave(terminal)


def test_a_filter_is_typed_kept_and_cleared(open_terminal: Open) -> None:
    terminal = started(open_terminal, 80, 24)
    terminal.type("f")
    terminal.wait("Enter keep  Esc clear")
    terminal.type("torq")  # q is a letter here
    terminal.until(lambda: "filter: torq_" in terminal.lines[-1], "the filter's line")
    terminal.until(lambda: "606C:00" not in terminal.text and "6077:00" in terminal.text, "torque alone")
    terminal.type(ENTER)
    terminal.until(lambda: "filter: torq" in terminal.lines[0], "the filter in the header")
    terminal.type("f")
    terminal.wait("Enter keep  Esc clear")
    terminal.type(ESCAPE)
    terminal.until(lambda: "606C:00" in terminal.text and "filter:" not in terminal.lines[0], "all signals")
    leave(terminal)


@pytest.mark.parametrize(("columns", "rows"), SIZES)
def test_the_graph_of_the_chosen_signal(open_terminal: Open, columns: int, rows: int) -> None:
    terminal = started(open_terminal, columns, rows)
    terminal.type(DOWN)
    terminal.until(lambda: any(line.startswith("  > 6077:00") for line in terminal.lines), "the second signal chosen")
    terminal.type("g")
    terminal.until(lambda: "Torque actual value  12.0 % (120)" in terminal.lines[1], "the graph's title")
    terminal.until(lambda: any(line.endswith("now") and "-60 s" in line for line in terminal.lines), "the time axis")
    terminal.type("g")
    terminal.wait("606C:00")
    leave(terminal)


def test_only_ascii_where_it_is_asked_for(open_terminal: Open) -> None:
    terminal = started(open_terminal, 80, 24, "--ascii")
    terminal.type("g")
    terminal.until(lambda: "-60 s" in terminal.text and "*" in terminal.text, "the graph in stars")
    assert terminal.text.isascii()
    leave(terminal)


def test_another_size_is_another_picture(open_terminal: Open) -> None:
    terminal = started(open_terminal, 120, 40)
    terminal.until(lambda: "Device measurements.Battery current" in terminal.text, "the whole name")
    terminal.resize(60, 20)
    terminal.until(
        lambda: "q quit" not in terminal.text.splitlines()[0] and terminal.lines[19].startswith(" p pause"),
        "the keys in the last row of the smaller screen",
    )
    assert all(len(line) <= 60 for line in terminal.lines)
    terminal.resize(120, 40)
    terminal.until(lambda: terminal.lines[39].endswith("q quit"), "the keys in the last row of the larger screen")
    leave(terminal)


def test_states_have_lines(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4")
    terminal.wait_prompt()
    terminal.run("monitor")
    terminal.wait("node 1  is PRE-OPERATIONAL")
    terminal.type("q")
    terminal.wait_prompt()


def test_a_monitor_of_its_own_ends_with_its_time(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4", "monitor", "--duration", "1")
    assert terminal.ended() == 0
    assert b"MONITOR " in terminal.written
    assert b"\x1b[?1049l" in terminal.written, "the screen from before is back"


def test_a_terminated_monitor_leaves_the_terminal_as_it_was(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4", "monitor")
    terminal.wait("heartbeat node 1")
    terminal.child.kill(signal.SIGTERM)
    assert terminal.ended() == 143
    assert b"\x1b[?1049l" in terminal.written
    assert "Traceback" not in terminal.text


def test_a_bus_that_goes_and_comes_back_is_waited_for(tmp_path: Path, open_terminal: Open, port: int) -> None:
    with served(tmp_path, "gen4@5", port=port) as server:
        terminal = open_terminal(*bus_words(server.port), "monitor", "--nodes", "5", columns=120)
        terminal.until(lambda: count(terminal) > 0, "frames")
    terminal.wait("LOST for")
    before = count(terminal)
    with served(tmp_path, "gen4@5", port=port):
        terminal.until(lambda: "GONE" not in terminal.lines[0] and count(terminal) > before, "frames of now")
        terminal.wait("the bus was lost for")
    terminal.wait("LOST for")
    terminal.type("q")
    assert terminal.ended() == 0
    said = terminal.written.decode().rpartition("MONITOR")[2]
    assert (said.count("is gone ("), said.count("is back after")) == (2, 1)


def test_frames_are_shown_before_the_mapping_is_known(tmp_path: Path, open_terminal: Open) -> None:
    """Node 9 is not there, and has half a minute to answer; `m` does nothing more meanwhile."""
    with served(tmp_path, "gen4@5") as server:
        words = (*bus_words(server.port), "--timeout", "30", "monitor", "--nodes", "9")
        terminal = open_terminal(*words)
        terminal.until(lambda: "reading the mapping of node 9" in terminal.lines[1], "the node that is asked")
        terminal.wait("heartbeat node 5")
        terminal.type("mq")
        assert terminal.ended() == 0


def test_a_mapping_is_read_anew_by_a_key_and_its_node_has_its_name(tmp_path: Path, open_terminal: Open) -> None:
    with served(tmp_path, "gen4@5") as server:
        assert server.dvtcli("-n", "5", "nmt", "start").returncode == 0
        terminal = open_terminal(*bus_words(server.port), "monitor", "--nodes", "5", columns=100)
        terminal.until(lambda: "5 Gen4 OPERATIONAL" in terminal.lines[1], "the node's name and state")
        terminal.until(lambda: "606C:00" in terminal.text and "reading" not in terminal.lines[1], "its mapping")
        assert server.dvtcli("-n", "5", "--yes", "map", "tpdo2", "6041").returncode == 0
        terminal.type("m")
        terminal.until(lambda: "606C:00" not in terminal.text and "TPDO2 node 5" in terminal.text, "the new mapping")
        terminal.type("q")
        assert terminal.ended() == 0


def test_a_bus_that_fails_ends_the_monitor_with_its_reason(open_terminal: Open) -> None:
    wire = Wire()
    try:
        terminal = open_terminal(*bus_words(wire.port), "-n", "5", "monitor", "--no-reconnect")
        terminal.wait("MONITOR socketcand")
        wire.say(0x705, b"\x05")
        terminal.wait("node 5  is OPERATIONAL")
        wire.hang_up()
        assert terminal.ended() == 5
    finally:
        wire.close()
    assert "failed (receive)" in terminal.text
    assert "Press ENTER" not in terminal.text, "prompt_toolkit's own words for an exception that nobody expected"
