"""A question about one of several nodes that are changed side by side: Ctrl-C ends it, and all is put back."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import CTRL_C, Terminal
from tests.harness.sample import heavy
from tests.simulator.serve.served import bus_words, served

NETWORK = """\
left: {node_id: 1, dcf: strict/generic.eds, tpdo: {1: {event_timer: 20}}}
right: {node_id: 2, dcf: strict/generic.eds, tpdo: {1: {event_timer: 20}}}
"""


@pytest.fixture
def terminal(tmp_path: Path, open_terminal: Open) -> Iterator[Terminal]:
    """A prompt on two running nodes that take PDO writes in PRE-OPERATIONAL only, which no profile says."""
    folder = tmp_path / "strict"
    shutil.copytree(family_eds("generic").parent, folder)
    (folder / "profile.toml").unlink()
    family = folder / "simulated.toml"
    family.write_text(f"pre_operational_writes = [[0x1400, 0x1BFF]]\n{family.read_text()}")
    network = tmp_path / "net.yaml"
    network.write_text(NETWORK)
    with served(tmp_path, f"{folder}@1", f"{folder}@2") as nodes:
        assert nodes.dvtcli("--yes", "nmt", "start", "all").returncode == 0
        terminal = open_terminal(*bus_words(nodes.port), "-b", "500000", columns=160, rows=50)
        terminal.until(lambda: terminal.cursor_line.endswith(">"), "a prompt")
        terminal.run(f"apply {network}")
        terminal.wait("[y/N]")
        terminal.run("y")
        terminal.until(lambda: "PRE-OPERATIONAL" in terminal.cursor_line, "the question about PRE-OPERATIONAL")
        yield terminal
        for node_id in ("1", "2"):
            assert json.loads(nodes.dvtcli("-n", node_id, "--json", "read", "1800:05").stdout)["value"] == 0


@heavy
def test_control_c_at_the_question_puts_all_back(terminal: Terminal) -> None:
    terminal.type(CTRL_C)
    terminal.until(lambda: terminal.cursor_line.endswith(">"), "a prompt")
    terminal.wait("stopped at once", "rolled back")
