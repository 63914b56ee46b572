"""dvtcli on macOS' standard library: no rtnetlink, no CAN sockets, and what is synced is on the disk."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from tests.cli.prompt.wire import Wire
from tests.elsewhere.running import MACOS, run
from tests.simulator.serve.served import bus_words

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the double stands on Linux")


def test_a_change_and_its_undo(tmp_path: Path) -> None:
    wire = Wire()
    try:
        words = [*bus_words(wire.port), "-n", "5", "--eds", str(wire.eds), "--yes"]
        ran = run(MACOS, tmp_path, *words, "map", "tpdo1", "6041", "606C", "--sync", "1")
        assert ran.code == 0, ran.stderr
        assert run(MACOS, tmp_path, *words, "undo", "--all").code == 0
    finally:
        wire.close()


def test_socketcan_is_said_to_be_no_way_there(tmp_path: Path) -> None:
    ran = run(MACOS, tmp_path, "-i", "socketcan", "-c", "can0", "-n", "1", "read", "1000")
    assert ran.code == 5
    assert "Traceback" not in ran.stderr
    assert "only Linux has SocketCAN" in ran.stderr
    found = json.loads(run(MACOS, tmp_path, "doctor", "--json").stdout)["checks"]
    assert not [one for one in found if one["check"] == "interface" and one["text"].startswith("socketcan")]
