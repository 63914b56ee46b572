"""A link that goes and comes back, set down or taken away: the prompt, a monitor and a waiting command go on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dvtcli.bus.kernel_links import kernel_links
from tests.cli.commands.bus import device
from tests.cli.prompt.conftest import Open, open_terminal
from tests.harness.forked import Forked
from tests.process import PATIENCE_S, documents, start
from tests.simulator.serve.served import own_environment, wait_for
from tests.socketcan.conftest import ANSWER_S, PAIRS, ip, on

__all__ = ["open_terminal"]
ANSWERS = ("--timeout", str(ANSWER_S))
VCAN = ("-i", "socketcan", "-c", "vcan0", *ANSWERS)


@contextmanager
def beside(folder: Path, link: str) -> Iterator[Forked]:
    """A dvtcli that serves a Gen4 on *link*, and joins it again whenever it is back."""
    ready = folder / f"ready-{link}"
    words = ["sim", "gen4@1", "-i", "socketcan", "-c", link, "--reconnect", "--ready-file", str(ready)]
    process = start(words, env=own_environment(folder))
    try:
        wait_for(ready.exists, "the node")
        yield process
    finally:
        process.kill()


def events(process: Forked) -> list[tuple[str, str | None]]:
    """What its documents say of the bus, and why."""
    found = documents(process.so_far()[0].rpartition("\n")[0])
    return [(one["event"], one["why"]) for one in found if one["schema"] == "dvtcli.bus/1"]


def test_a_prompt_goes_on_after_the_link_was_down(tmp_path: Path, open_terminal: Open) -> None:
    with beside(tmp_path, "vcan0"):
        terminal = open_terminal(*VCAN, "-n", "1", columns=200, rows=40)
        terminal.wait_prompt("vcan0/1 PRE-OP> ")
        ip("set", "vcan0", "down")
        terminal.wait("socketcan:vcan0 is gone (")
        terminal.wait("sudo ip link set vcan0 up): waiting for it")
        terminal.run("read 1000")
        terminal.wait("type it again when the bus is back")
        ip("set", "vcan0", "up")
        terminal.wait("socketcan:vcan0 is back after")
        terminal.until(lambda: "F1 help" in terminal.toolbar and "GONE" not in terminal.toolbar, "the toolbar")
        terminal.run("read 1018:1")
        terminal.wait("0x0000001E")


def test_a_monitor_goes_on_after_the_adapter_was_unplugged(tmp_path: Path) -> None:
    ip("add", "vcan6", "type", "vcan")
    ip("set", "vcan6", "up")
    try:
        with beside(tmp_path, "vcan6") as node:
            words = ["-i", "socketcan", "-c", "vcan6", *ANSWERS, "monitor", "--nodes", "1", "--json"]
            monitor = start(words, env=own_environment(tmp_path))
            wait_for(lambda: "dvtcli.frame/1" in monitor.so_far()[0], "frames")
            ip("del", "vcan6")
            wait_for(lambda: [event for event, _ in events(monitor)] == ["gone"], "the end of the bus to be told")
            assert "vcan6 is gone: plug the adapter in again" in str(events(monitor)[0][1])
            ip("add", "vcan6", "type", "vcan")
            ip("set", "vcan6", "up")
            wait_for(
                lambda: [event for event, _ in events(monitor)] == ["gone", "back"], "the bus to be told to be back"
            )
            told = len(monitor.so_far()[0])
            wait_for(lambda: "dvtcli.frame/1" in monitor.so_far()[0][told:], "frames of now")
            assert "is back after" in node.so_far()[1]
            monitor.kill()
    finally:
        if any(link.name == "vcan6" for link in kernel_links()):
            ip("del", "vcan6")


@pytest.mark.parametrize(("ours", "theirs"), PAIRS[1:])
def test_a_command_waits_for_a_link_that_is_down(tmp_path: Path, ours: str, theirs: str) -> None:
    with on(theirs, device("gen4")):
        ip("set", ours, "down")
        words = ["-i", "socketcan", "-c", ours, *ANSWERS, "-n", "1", "read", "1018:1", "--reconnect"]
        reading = start(words, env=own_environment(tmp_path))
        wait_for(lambda: f"sudo ip link set {ours} up): waiting for it" in reading.so_far()[1], "it to wait")
        ip("set", ours, "up")
        out, errors = reading.communicate(PATIENCE_S)
    assert (reading.returncode, "0x0000001E" in out) == (0, True), errors
