"""Two prompts at one node: each changes it in its turn, and neither takes back or stores what the other one changed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import Terminal
from tests.simulator.serve.served import Served, bus_words, served

Pair = tuple[Terminal, Terminal]


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Served]:
    with served(tmp_path, "generic@1") as server:
        yield server


@pytest.fixture
def prompts(server: Served, open_terminal: Open) -> Pair:
    """Two dvtcli with one state folder, as one user's are."""
    one, other = (open_terminal(*bus_words(server.port), "-n", "1", columns=150, rows=40) for _ in range(2))
    for terminal in (one, other):
        ready(terminal)
    return one, other


def ready(terminal: Terminal) -> None:
    """Wait for a prompt that takes a line."""
    terminal.until(lambda: terminal.cursor_line.endswith(">"), "a prompt")


def done(terminal: Terminal, line: str, *shown: str) -> None:
    """Run *line*, which answers everything of *shown*."""
    terminal.run(line)
    ready(terminal)
    terminal.wait(*shown)


def timer(server: Served) -> str:
    return server.dvtcli("-n", "1", "-q", "read", "1800:5").stdout


def test_each_changes_the_node_in_its_turn_while_the_other_one_idles(server: Served, prompts: Pair) -> None:
    one, other = prompts
    for terminal, line in ((one, "map tpdo1 606C"), (other, "map tpdo2 606C"), (one, "map tpdo1 6041 606C")):
        done(terminal, line, f"TPDO{line[8]} set")
    done(other, "map tpdo1 606C", "TPDO1 set")
    assert "another dvtcli (" not in one.text + other.text
    assert server.dvtcli("-n", "1", "set", "tpdo1", "--timer", "70").returncode == 0


def test_what_the_other_one_changed_since_is_neither_undone_nor_stored(server: Served, prompts: Pair) -> None:
    one, other = prompts
    done(one, "set tpdo1 --timer 50", "TPDO1 set")
    done(other, "set tpdo1 --timer 60", "TPDO1 set")
    held = timer(server)
    for line in ("undo", "undo --all", "store"):
        done(one, f"{line}", "error:", "unchanged: nothing was written")
        assert "another dvtcli (process " in " ".join(one.text.split())
        assert "`set`" in one.text
        assert timer(server) == held
        one.type("\x0c")
        ready(one)
    done(other, "undo", "TPDO1")
    done(one, "undo", "TPDO1")
