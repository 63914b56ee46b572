"""What `undo` puts back after it was stored is in RAM only: the next `store`, of whichever process, knows it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy
from tests.process import PATIENCE_S


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def in_a_process(wire: Wire, *lines: str) -> list[dict[str, Any]]:
    with Bench((), {**wire.options, "yes": True}) as bench:
        ran = bench.script(*(f"{line} --json" for line in lines))
        assert ran.code == 0, ran
        return ran.documents


def heard_boot_up(wire: Wire) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while not any((frame.arbitration_id, bytes(frame.data)) == (0x701, b"\0") for frame in wire.frames()):
        assert time.monotonic() < deadline_s, "no boot-up message"
        time.sleep(0.01)


@heavy
@pytest.mark.parametrize("line", ["set tpdo1 --timer 70", "write 1017 1000"])
@pytest.mark.parametrize("together", [True, False])
def test_the_next_store_names_it(line: str, together: bool) -> None:
    label = "TPDO1" if "tpdo1" in line else "1017:00"
    with Wire(device("generic")) as wire:
        lines = [line, "store", "undo"]
        for words in [lines] if together else [[one] for one in lines]:
            in_a_process(wire, *words)
        (stored,) = in_a_process(wire, "store --prove")
        assert (stored["changed"], stored["proved"], stored["notes"]) == ([label], True, [])
        (again,) = in_a_process(wire, "store")
        assert again["changed"] == []


def test_a_restart_takes_it_and_then_it_is_no_change() -> None:
    node = device("generic")
    with Wire(node) as wire:
        for line in ("set tpdo1 --timer 70", "store", "undo"):
            in_a_process(wire, line)
        wire.frames()
        wire.power_cycle(node)
        heard_boot_up(wire)  # a process that meets the node before that sees it restart, and stores nothing
        (stored,) = in_a_process(wire, "store")
    assert stored["changed"] == []


def test_what_was_never_stored_is_as_stored_again() -> None:
    with Wire(device("generic")) as wire:
        for line in ("store", "set tpdo1 --timer 70", "undo"):
            in_a_process(wire, line)
        (stored,) = in_a_process(wire, "store")
    assert stored["changed"] == []


@heavy
def test_it_is_no_change_that_undo_reverts() -> None:
    with Wire(device("generic")) as wire:
        for line in ("set tpdo1 --timer 70", "set tpdo1 --timer 71", "store", "undo"):
            in_a_process(wire, line)
        (undone,) = in_a_process(wire, "undo")
        assert [step["after"] for step in undone["steps"]] == ["00 00"]
        with Bench((), {**wire.options, "yes": True}) as bench:
            assert bench.run("undo").code == 2
