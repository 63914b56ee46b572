"""Links of a kernel, for tests that need real ones; skipped with the reason where there are none."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can
import pytest

from dvtcli.bus.kernel_links import kernel_links
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.process import PATIENCE_S
from tests.served_nodes import ServedNodes

#: how long an answer may take on a busy machine, where one is wanted (s): of SDO, by any client
ANSWER_S = 20.0
#: ours and the nodes' end: of a link that is looped back, of a pair, and of two controllers on one wire
PAIRS = [("vcan0", "vcan0"), ("vxcan0", "vxcan1"), ("can0", "can1")]
#: what `run` makes in its machine: links may be set down, deleted and flooded there
MACHINE = Path("/run/dvtcli-socketcan")


def why_not() -> str:
    """What keeps these tests from running here; empty where they can."""
    if not hasattr(socket, "AF_CAN"):
        return "this Python has no AF_CAN"
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except OSError as failed:
        return f"this kernel has no CAN ({failed.strerror}): tests/socketcan/run starts a machine that has"
    if not MACHINE.exists():
        return "links are set down and flooded here: tests/socketcan/run starts a machine for that"
    return ""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Every test of this folder needs a kernel's CAN."""
    reason, folder = why_not(), f"{Path(__file__).parent}{os.sep}"
    for item in items:
        if str(item.path).startswith(folder):
            item.add_marker(pytest.mark.kernel)
            if reason:
                item.add_marker(pytest.mark.skip(reason=reason))


def ip(*words: str) -> None:
    """Change a link."""
    subprocess.run(["ip", "link", *words], check=True, capture_output=True, text=True)


def tool(*words: str) -> str:
    """Run one of can-utils to its end; what it printed."""
    assert shutil.which(words[0]), f"{words[0]} is not here"
    done = subprocess.run(
        words, check=True, capture_output=True, text=True, timeout=PATIENCE_S, stdin=subprocess.DEVNULL
    )
    return done.stdout


@contextmanager
def on(link: str, *devices: StrictDevice, **options: Any) -> Iterator[ServedNodes]:
    """Simulated *devices* on *link*, in this process, over a socket of their own."""
    theirs = can.Bus(link, interface="socketcan", ignore_config=True, **options)
    try:
        with ServedNodes(theirs, devices) as network:
            yield network
    finally:
        theirs.shutdown()


@pytest.fixture(autouse=True)
def links_as_they_were() -> Iterator[None]:
    """What a test did to the links is undone after it."""
    yield
    if not why_not():
        for link in kernel_links():
            if not link.up:
                ip("set", link.name, "up")
