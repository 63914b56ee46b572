"""The prompt on a bus that goes and comes back: real processes on both sides."""

from __future__ import annotations

from pathlib import Path

from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import CTRL_D, Terminal
from tests.simulator.serve.served import Served, bus_words, served


def opened(server: Served, open_terminal: Open) -> Terminal:
    terminal = open_terminal(*bus_words(server.port), "-n", "5", columns=120, rows=50)
    terminal.wait_prompt(prompt(server, "PRE-OP> "))
    return terminal


def prompt(server: Served, rest: str) -> str:
    return f"127.0.0.1:{server.port}/5 {rest}"


def times(terminal: Terminal, text: str) -> int:
    return terminal.text.count(text)


def test_it_says_so_waits_and_goes_on_and_nothing_that_was_read_counts(
    tmp_path: Path, open_terminal: Open, port: int
) -> None:
    with served(tmp_path, "gen4@5", port=port) as server:
        terminal = opened(server, open_terminal)
        terminal.run("set tpdo1 --timer 70")
        terminal.wait("TPDO1 set")
        terminal.wait_prompt(prompt(server, "PRE-OP*> "))
    terminal.wait("is gone (the server has closed the connection")
    terminal.until(lambda: "GONE" in terminal.toolbar, "the toolbar")
    terminal.run("pdo tpdo1")
    terminal.wait("type it again when the bus is back")
    with served(tmp_path, "gen4@5", port=port):
        terminal.wait("is back after")
        terminal.wait_prompt(prompt(server, "PRE-OP*> "))
        terminal.until(lambda: "F1 help" in terminal.toolbar and "GONE" not in terminal.toolbar, "the toolbar")
        terminal.run("verify")
        terminal.wait("has lost unstored values: TPDO1")
        terminal.wait("TPDO1  event timer is 0, expected 70")
        terminal.wait_prompt(prompt(server, "PRE-OP> "))
        terminal.run("set tpdo2 --timer 80")
        terminal.wait("TPDO2 set")
    terminal.until(lambda: times(terminal, "is gone (") == 3, "the bus to be gone again")  # an error said it, too
    terminal.wait_prompt(prompt(server, "PRE-OP*> "))
    terminal.type(CTRL_D)
    terminal.wait("not stored: leave? [y/N]")
    terminal.run("y")
    assert terminal.ended() == 0, "it does not wait for the bus to leave"


def test_another_device_is_not_taken_for_the_one_before(tmp_path: Path, open_terminal: Open, port: int) -> None:
    with served(tmp_path, "gen4@5", port=port) as server:
        terminal = opened(server, open_terminal)
    terminal.wait("is gone (")
    with served(tmp_path, "tmcm@5", port=port):
        terminal.wait("is back after")
        for line in ("set tpdo1 --timer 70", "pdo"):
            terminal.run(line)
            terminal.wait("error: node 5 is not the device that it was before the bus was lost")
            terminal.wait_prompt(prompt(server, "PRE-OP> "))
        terminal.run("node 5")
        terminal.wait("warning: node 5 is not the device that it was before the bus was lost: vendor 0x")
        terminal.run("pdo tpdo1")
        terminal.wait("TPDO1 of node 5")
        terminal.wait_prompt(prompt(server, "PRE-OP> "))
        terminal.type(CTRL_D)
        assert terminal.ended() == 0
