"""`check` of what was on the bus in cells of the fault matrix: the fault is the first finding."""

from __future__ import annotations

import random
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable
from dvtcli.watch.decoder import Decoder
from dvtcli.watch.recording_checks.recording_rules import RecordingCheck
from tests.faults.matrix import Cell, Run, cells_of, groups
from tests.faults.sequences import FAULTS, SEQUENCES, UNHEARD
from tests.harness.sample import heavy
from tests.laws.bench import NODE

#: cells that are drawn, and of how many of them (share) the fault is to be the first finding
CELLS, WANTED = 100, 0.95
#: how long is recorded after the session (s)
AFTERWARDS_S = 5.0
_LOST, _REFUSED = frozenset({"sdo-given-up", "sdo-no-answer"}), frozenset({"refused-write"})
_RESTARTED, _OFF = frozenset({"boot-up-in-operation"}), frozenset({"heartbeat-stops", *_LOST})
#: what of each fault is to be found, the first of two; of a late answer that the client waits for, a bus that is gone
#: for the recorder, too, and a restart without a frame nothing is to be seen
FINDINGS: dict[str, frozenset[str]] = {
    **dict.fromkeys(("refuse", "refuse-state", "refuse-local", "refuse+refuse", "refuse+lost", "refuse+silent"),
                    _REFUSED),
    **dict.fromkeys(("lose-request", "lose-response", "late-0.7s", "late-3s", "late+lost", "malformed"), _LOST),
    "lost+bus-error": _LOST,
    "duplicate": frozenset({"two-nodes-answer"}),
    "foreign": frozenset({"sdo-unasked"}),
    "toggle": frozenset({"sdo-given-up", "sdo-segments"}),
    **dict.fromkeys([fault for fault in FAULTS if "reset-" in fault and fault != UNHEARD], _RESTARTED),
    "lost+reset": _RESTARTED | _LOST,
    "refuse+reset": _REFUSED | _RESTARTED,
    **dict.fromkeys(("silent", "power-loss"), _OFF),
}  # fmt: skip
UNSEEN = {"late-0.3s", "bus-error", UNHEARD}


def on_the_bus(cell: Cell, folder: Path) -> list[Frame]:
    """What is sent while the lines of *cell* run, and some seconds after that."""
    run = Run.of(cell.family, cell.start, cell.faults, folder)
    frames: list[Frame] = []

    def take(frame: Frame, sent: bool) -> None:
        at_s = run.bus.now_s() if sent else frame.timestamp_s
        frames.append(Frame(frame.can_id, frame.data, frame.extended, frame.remote, at_s))

    run.bus.tap(take)
    run.session(SEQUENCES[cell.family][cell.sequence])
    with suppress(BusUnavailable):
        run.bus.sleep(AFTERWARDS_S)
    return frames


def first_finding(frames: list[Frame]) -> str:
    check = RecordingCheck(Decoder().layout, lambda _node_id, _index, _sub_index: "")
    for number, frame in enumerate(frames, 1):
        check.take(number, frame)
    found = sorted(check.problems(), key=lambda problem: problem.order)
    return found[0].rule.name if found else ""


def drawn_recordings(seed: int, count: int) -> Iterator[tuple[Cell, list[Frame]]]:
    """Cells of all faults by turns, each of another sequence, in which the fault happened: a reset has its boot-up."""
    draw = random.Random(seed)
    faults = sorted(FINDINGS)
    for number in range(count):
        fault, frames = faults[number % len(faults)], list[Frame]()
        while not frames or ("reset-" in fault and (0x700 + NODE, b"\0") not in [(f.can_id, f.data) for f in frames]):
            cells = [cell for cell in cells_of(*draw.choice(groups())) if cell.fault == fault]
            if cells:
                cell = draw.choice(cells)
                with tempfile.TemporaryDirectory() as folder:
                    frames = on_the_bus(cell, Path(folder))
        yield cell, frames


def test_every_fault_of_the_matrix_is_looked_for() -> None:
    assert {*FINDINGS} | UNSEEN == {*FAULTS}


@heavy
def test_the_fault_is_the_first_finding() -> None:
    missed: Counter[str] = Counter()
    for cell, frames in drawn_recordings(1, CELLS):
        found = first_finding(frames)
        if found not in FINDINGS[cell.fault]:
            missed[f"{cell}: {found or 'nothing'}"] += 1
    assert missed.total() <= (1 - WANTED) * CELLS, missed
