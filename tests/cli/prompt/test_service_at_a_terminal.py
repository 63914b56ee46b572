"""A service call rehearsed in a terminal: each question is answered, each answer read, as an engineer does."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import ENTER, Terminal
from tests.harness.sample import heavy

PROGRAM = bytes(range(256)) * 8


def answered(terminal: Terminal, line: str, *said: str, prompt: str) -> None:
    """Type *line*, say yes to its question, and wait for the prompt below what was *said*."""
    terminal.run(line)
    terminal.until(lambda: terminal.cursor_line.endswith("[y/N]"), "a question")
    terminal.type("y")
    terminal.until(lambda: terminal.cursor_line.endswith("[y/N] y"), "its answer")
    terminal.type(ENTER)
    told(terminal, *said, prompt=prompt)


def told(terminal: Terminal, *said: str, prompt: str) -> None:
    terminal.wait_prompt(prompt)
    for text in said:
        assert text in terminal.text, f"{text!r} is not on the screen:\n{terminal.text}"


@heavy
@pytest.mark.long
def test_a_service_call_from_finding_the_node_to_watching_it(tmp_path: Path, open_terminal: Open) -> None:
    """What is waited for or looked for stands in no line that was typed."""
    (tmp_path / "fw.bin").write_bytes(PROGRAM)
    nodes = ("--sim", "loader@255", "--sim", "generic@3", "--fault", "emcy=0x3210", "--profile", "loader")
    terminal = open_terminal(*nodes, columns=120, rows=60)
    before, after = "sim/3 PRE-OP> ", "sim/5 PRE-OP> "
    terminal.wait_prompt(before)

    terminal.run("lss scan")
    told(terminal, "1 node without a node-ID", "0x00000F50", "none", prompt=before)
    told(terminal, "no node answers as node 1; this assigns that node-ID:", prompt=before)
    (hint,) = [row.strip() for row in terminal.lines if row.startswith("  lss node-id 1 ")]
    answered(terminal, hint.replace("node-id 1 ", "node-id 5 "), "(before: none)", "until it is stored", prompt=before)
    answered(terminal, "lss store 5 --prove", "stored, proved by a reset", prompt=before)
    terminal.run("scan")
    told(terminal, "2 nodes on sim", "0x00030191", prompt=before)

    terminal.run("node 5")
    told(terminal, "device type 0x00030191", prompt=after)
    answered(terminal, "download fw.bin", "2,048 bytes in", "as profile loader expects", prompt=after)
    terminal.run("faults")
    told(terminal, "error register 0x05", "voltage inside the device", prompt=after)

    terminal.run("watch 1001 6000:01 6200:01 --every 50ms")
    shown = {"5:1001:00": "generic error, voltage", "5:6000:01": "input 1, input 3", "5:6200:01": "none"}
    terminal.until(
        lambda: all(any(one in row and says in row for row in terminal.lines) for one, says in shown.items()),
        "three values",
    )
    assert terminal.lines[0].startswith("WATCH sim")
    terminal.type("q")
    terminal.wait_prompt(after)
