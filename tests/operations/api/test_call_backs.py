"""Call-backs come in the thread that called, whatever works side by side; what they must not do is refused at once."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import pytest

import dvtcli
from tests.harness.sample import heavy
from tests.posix import needs_signals
from tests.process import PATIENCE_S, environment

#: A network whose nodes hold something else than its file says.
_NETWORK = """
import os, signal, sys
import dvtcli

armed = False
bus = dvtcli.simulate("gen4@5", "gen4@6", on_progress=lambda told: armed and call_back(told))
for node_id in (5, 6):
    bus.node(node_id).set("tpdo1", timer_ms=70)
bus.import_network("now.yaml")
for node_id in (5, 6):
    bus.node(node_id).set("tpdo1", timer_ms=10)
armed = True
"""
_TIMERS = 'print([bus.node(one).pdo("tpdo1").config.communication.event_timer for one in (5, 6)])'


def program(folder: Path, *lines: str) -> str:
    """What a program prints that changes two nodes side by side; it ends in good time, or the test fails."""
    text = "\n".join([_NETWORK, *lines])
    return subprocess.run(
        [sys.executable, "-c", text], cwd=folder, env=environment(), capture_output=True, text=True,
        check=True, timeout=PATIENCE_S,
    ).stdout  # fmt: skip


@heavy
def test_they_come_in_the_thread_that_called(tmp_path: Path) -> None:
    threads: set[int] = set()

    def here(_: object) -> bool:
        threads.add(threading.get_ident())
        return True

    with dvtcli.simulate("gen4@5", "gen4@6", on_progress=here, on_message=here, ask=here) as bus:
        for timer_ms in (70, 10):
            for node_id in (5, 6):
                bus.node(node_id).set("tpdo1", timer_ms=timer_ms)
            if timer_ms == 70:
                bus.import_network(tmp_path / "now.yaml")
        threads.clear()
        assert bus.apply(tmp_path / "now.yaml")
    assert threads == {threading.get_ident()}


@heavy
def test_one_that_calls_the_bus_ends_a_change_of_several_nodes_which_is_put_back(tmp_path: Path) -> None:
    said = program(
        tmp_path,
        "def call_back(told): bus.node(5).pdos()",
        "try: bus.apply('now.yaml', yes=True)",
        "except dvtcli.errors.UsageError as refused: print(refused)",
        "armed = False",
        _TIMERS,
    )
    assert said.splitlines() == [
        "a callback must not call the bus that calls it: save the data and make the call later",
        "[10, 10]",
    ]


@heavy
@pytest.mark.parametrize("presses", [1, 2])
@needs_signals
def test_ctrl_c_in_one_is_obeyed(tmp_path: Path, presses: int) -> None:
    said = program(
        tmp_path,
        "def call_back(told):",
        f"    if told.done == 1: [os.kill(os.getpid(), signal.SIGINT) for _ in range({presses})]",
        "try: bus.apply('now.yaml', yes=True)",
        "except KeyboardInterrupt as stopped: print(stopped)",
        "armed = False",
        _TIMERS,
    )
    how = " at once" if presses == 2 else ""
    assert said.splitlines()[0].startswith(f"stopped{how} at node")
    assert said.splitlines()[0].endswith("the device: rolled_back")
    assert said.splitlines()[1:] == ["[10, 10]"]


@heavy
@needs_signals
def test_one_that_never_ends_is_left_by_a_second_ctrl_c(tmp_path: Path) -> None:
    said = program(
        tmp_path,
        "import threading, time",
        "def press():",
        "    for _ in range(2): time.sleep(0.3); os.kill(os.getpid(), signal.SIGINT)",
        "def call_back(told):",
        "    if told.done == 1: threading.Thread(target=press).start(); time.sleep(1000)",
        "try: bus.apply('now.yaml', yes=True)",
        "except KeyboardInterrupt as stopped: print(str(stopped).partition('; ')[2])",
        "armed = False",
        _TIMERS,
    )
    assert said.splitlines() == ["the device: rolled_back", "[10, 10]"]
