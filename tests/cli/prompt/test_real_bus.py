"""The prompt on a bus outside of its process: what nodes say by themselves, and Ctrl-C in the middle of a change."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import CTRL_C, CTRL_D, PATIENCE_S, Terminal
from tests.cli.prompt.wire import Wire
from tests.harness.sample import heavy
from tests.simulator.serve.served import bus_words

PRE_OPERATIONAL, OPERATIONAL = b"\x7f", b"\x05"


@pytest.fixture
def wire() -> Iterator[Wire]:
    wire = Wire()
    yield wire
    wire.close()


@pytest.fixture
def terminal(wire: Wire, open_terminal: Open) -> Terminal:
    """A prompt on *wire*, with the node's EDS, ready to type at."""
    return opened(wire, open_terminal)


def opened(wire: Wire, open_terminal: Open, *options: str, state: str = "PRE-OP") -> Terminal:
    words = [*bus_words(wire.port), "--timeout", str(PATIENCE_S), "-n", "5", "--eds", str(wire.eds)]
    terminal = open_terminal(*words, *options, columns=120, rows=40)
    terminal.wait_prompt(prompt(wire, f"{state}> "))
    return terminal


@contextmanager
def held_up(wire: Wire, download: int) -> Iterator[None]:
    """While the block runs, the node does not see its *download*-th SDO download, and whoever sent it waits."""
    go_on = threading.Event()
    wire.at_download = lambda number: go_on.wait(PATIENCE_S) if number == download else None
    try:
        yield
    finally:
        go_on.set()
        wire.at_download = lambda _number: None


def prompt(wire: Wire, rest: str) -> str:
    return f"127.0.0.1:{wire.port}/5 {rest}"


def test_control_c_in_the_middle_of_a_change_rolls_it_back(wire: Wire, terminal: Terminal) -> None:
    before = {at: wire.device.value(*at) for at in [(0x1800, 1), (0x1800, 2), (0x1A00, 0), (0x1A00, 1)]}
    with held_up(wire, download=4):
        terminal.run("map tpdo1 6C01:1 606C 6041 --cob-id 0x201 --sync 1")
        terminal.until(lambda: wire.downloads == 4, "the fourth write")
        assert wire.device.value(0x1A00, 0) == b"\x00"
        terminal.type(CTRL_C)
        terminal.wait("stopping at the next safe point")
    terminal.wait_prompt(prompt(wire, "PRE-OP> "))
    terminal.wait("stopped after step", "rolled back: everything is as before")
    assert {at: wire.device.value(*at) for at in before} == before

    terminal.run("map tpdo1 6041 --sync 1")
    terminal.wait("TPDO1 set")
    terminal.wait_prompt(prompt(wire, "PRE-OP*> "))


def test_a_prompt_reads_no_pdo_and_the_menu_says_what_commands_have_read(wire: Wire, terminal: Terminal) -> None:
    terminal.run("set tpdo1 --timer 70")
    terminal.wait("TPDO1 set")
    terminal.wait_prompt(prompt(wire, "PRE-OP*> "))
    wire.uploads.clear()
    terminal.run("help")
    terminal.wait_prompt(prompt(wire, "PRE-OP*> "))
    terminal.type("pdo tpdo")
    terminal.wait("bits free")
    assert set(wire.uploads) == {"5110:00"}, "the family's own NMT state, once before each prompt"


def test_control_c_stops_a_command_and_not_the_prompt(wire: Wire, terminal: Terminal) -> None:
    terminal.run("sync --period 20 --count 100000")
    terminal.until(lambda: wire.syncs >= 2, "SYNC on the bus")
    terminal.type(CTRL_C)
    terminal.wait_prompt(prompt(wire, "PRE-OP> "))
    terminal.run("pdo")
    terminal.wait("MAPPED OBJECTS")


def test_what_a_node_says_appears_above_the_line_being_typed(wire: Wire, terminal: Terminal) -> None:
    terminal.type("map tpdo1 6041")
    terminal.until(lambda: terminal.cursor_line.endswith("map tpdo1 6041"), "the line")
    wire.say(0x085, bytes.fromhex("30 81 11 01 02 03 04 05"))
    said = "node 5  EMCY 0x8130 life guard or heartbeat error  register 0x11  01 02 03 04 05"
    terminal.until(lambda: said in terminal.text and "EMCY 1: 0x8130" in terminal.toolbar, "the emergency")
    terminal.until(lambda: terminal.cursor_line.endswith("PRE-OP> map tpdo1 6041"), "the line below it")

    wire.say(0x705, OPERATIONAL)
    terminal.wait("node 5  is OPERATIONAL")
    terminal.until(lambda: terminal.cursor_line == prompt(wire, "OP> map tpdo1 6041"), "the new state in the prompt")
    wire.say(0x705, b"\x00")
    terminal.wait("node 5  boot-up")
    terminal.until(lambda: terminal.cursor_line == prompt(wire, "PRE-OP> map tpdo1 6041"), "the state after a boot-up")
    assert "is PRE-OPERATIONAL" not in terminal.text


def test_a_flood_of_messages_is_cut_and_counted(wire: Wire, terminal: Terminal) -> None:
    for number in range(300):
        wire.say(0x085, bytes([0x00, 0x10, number & 0xFF]))

    def shown() -> int:
        return terminal.written.count(b"node 5  EMCY ")

    def counted() -> int:
        return sum(map(int, re.findall(rb"(\d+) more messages of nodes are not shown", terminal.written)))

    terminal.until(lambda: shown() + counted() == 300, "each of them, shown or counted")
    terminal.wait("EMCY 300: 0x1000 generic error")
    assert shown() >= 10
    assert counted() > 0
    terminal.wait_prompt(prompt(wire, "PRE-OP> "))
    terminal.type(CTRL_D)
    assert terminal.ended() == 0


@heavy
def test_a_heartbeat_that_stops_is_said(wire: Wire, terminal: Terminal) -> None:
    for _ in range(3):
        wire.say(0x705, PRE_OPERATIONAL)
    terminal.wait("NO HEARTBEAT")
    terminal.wait("node 5  heartbeat lost: the last was received")
    wire.say(0x705, PRE_OPERATIONAL)
    terminal.wait("node 5  heartbeat is back")


def test_the_load_is_shown_where_the_bit_rate_is_known(wire: Wire, open_terminal: Open) -> None:
    terminal = opened(wire, open_terminal, "-b", "125000")
    terminal.wait("load 0%")

    def loaded() -> bool:
        for number in range(20):
            wire.say(0x185, bytes([number] * 8))
        return re.search(r"load [1-9]", terminal.toolbar) is not None

    terminal.until(loaded, "a load")


def test_a_bus_of_unknown_bit_rate_shows_no_load(terminal: Terminal) -> None:
    terminal.wait("F1 help")
    assert "load" not in terminal.toolbar


def test_a_bus_that_goes_away_is_said_and_the_prompt_stays(wire: Wire, open_terminal: Open) -> None:
    terminal = opened(wire, open_terminal, "--no-reconnect")
    wire.hang_up()
    terminal.wait("FAILED")
    terminal.wait("failed (receive): no more frames are received")
    terminal.run("pdo")
    terminal.wait("error: ")
    terminal.wait_prompt(prompt(wire, "").rstrip() + "> ")
    terminal.type(CTRL_D)
    assert terminal.ended() == 0
