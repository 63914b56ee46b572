"""The first start and `doctor` find an slcan adapter where USB serial ports are, and work with it.

/dev is a copy of their own for these processes, with a strict adapter on a pseudo-terminal as ttyACM0 in it: nothing
else on this machine sees it.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.util import find_spec
from itertools import count
from pathlib import Path

import can
import pytest

from tests.bus.slcan_adapter import SlcanAdapter
from tests.cli.commands.bus import device
from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import CTRL_D
from tests.harness.sample import heavy
from tests.process import PATIENCE_S, documents, environment
from tests.served_nodes import ServedNodes

#: in a mount namespace of its own: a /dev with all that there was, and ttyACM0; then what is given
_DEV = """
mkdir "$1/dev" && mount --rbind /dev "$1/dev" && mount -t tmpfs none /dev &&
for one in "$1"/dev/*; do ln -s "$one" /dev/; done &&
if [ -n "$2" ]; then ln -s "$1/dev/pts/${2##*/}" /dev/ttyACM0; fi && shift 2 && exec "$@"
"""
_NUMBERS = count(1)


def own_dev(folder: Path, port: str, *command: str) -> list[str]:
    """*command* with a /dev in which *port* is ttyACM0; *folder* is for its making."""
    return ["unshare", "--mount", "sh", "-c", _DEV, "sh", str(folder), port, *command]


def may_unshare(folder: Path) -> bool:
    """Whether this system lets us have a /dev of our own."""
    if sys.platform != "linux" or not shutil.which("unshare") or os.geteuid() != 0:
        return False
    folder.mkdir()
    return subprocess.run(own_dev(folder, "", "true"), capture_output=True, check=False).returncode == 0


@pytest.fixture
def adapter(tmp_path: Path) -> Iterator[SlcanAdapter]:
    """An adapter with a Gen4 as node 1 behind it."""
    if not find_spec("serial"):
        pytest.skip("pyserial is not installed")
    if not may_unshare(tmp_path / "try"):
        pytest.skip("a mount namespace of one's own needs Linux, unshare and root")
    (tmp_path / "mounts").mkdir()
    channel = f"first-slcan-{next(_NUMBERS)}"
    with (
        can.Bus(channel, interface="virtual", ignore_config=True) as theirs,
        ServedNodes(theirs, [device("gen4")]),
        SlcanAdapter(channel) as made,
    ):
        yield made


@heavy
def test_it_is_offered_taken_with_a_bit_rate_and_kept(
    adapter: SlcanAdapter, open_terminal: Open, tmp_path: Path
) -> None:
    words = own_dev(tmp_path / "mounts", adapter.port, sys.executable, "-m", "dvtcli", "-n", "1")
    terminal = open_terminal(command=words)
    terminal.wait("Use which?")
    (row,) = [line for line in terminal.lines if "/dev/ttyACM0" in line]
    assert row.split()[1] == "slcan"
    assert "only if an slcan adapter is on it" in row
    terminal.type(f"{row.split()[0]}\r")
    terminal.wait("Bit rate of the network in bit/s? [500000]")
    terminal.type("250\r")
    terminal.wait("'250' is not a bit rate")
    terminal.wait("125k, 250k, 500k and 1M are usual")
    terminal.type("250k\r")
    terminal.wait("Save as default in dvtcli.toml? [y/N]")
    terminal.type("y\r")
    terminal.wait_prompt("/dev/ttyACM0/1 PRE-OP> ")
    assert adapter.bit_rate_kbit == 250
    terminal.run("read 1018:1")
    terminal.wait("0x0000001E")
    terminal.wait_prompt("/dev/ttyACM0/1 PRE-OP> ")  # before it is there a terminal takes Ctrl-D for an end of input
    terminal.type(CTRL_D)
    assert terminal.ended() == 0
    kept = tomllib.loads((tmp_path / "dvtcli.toml").read_text("utf-8"))
    assert kept == {"interface": "slcan", "channel": "/dev/ttyACM0", "bitrate": 250_000}


@heavy
def test_doctor_lists_it_and_what_it_says_opens(adapter: SlcanAdapter, tmp_path: Path) -> None:
    words = own_dev(
        tmp_path / "mounts", adapter.port, sys.executable, "-m", "dvtcli", "-i", "slcan", "-c", "/dev/ttyACM0",
        "-b", "500000", "-n", "1", "doctor", "--json",
    )  # fmt: skip
    done = subprocess.run(
        words, env=environment(), capture_output=True, text=True, timeout=PATIENCE_S, check=False,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip
    (document,) = documents(done.stdout)
    checks = document["checks"]
    (found,) = [one for one in checks if one["check"] == "interface"]
    assert (found["text"].split()[:2], found["verdict"]) == (["slcan", "/dev/ttyACM0"], "ok")
    (bus,) = [one for one in checks if one["check"] == "bus"]
    assert bus["verdict"] == "ok", bus
    (node,) = [one for one in checks if one["check"] == "node"]
    assert "node 1" in node["text"]
