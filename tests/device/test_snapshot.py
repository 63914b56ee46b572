"""What a node holds of what a store keeps: its PDOs, and what was written to single objects, by whichever process."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.device.store.prove_store import Snapshot
from dvtcli.domain.plan import Plan, Step, ValueChange
from tests.device.test_apply_plan import HEARTBEAT, Bench
from tests.laws.bench import NODE


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    yield made
    made.guard.lock.release()


def written(*place: int, before: bytes | None = b"\0\0") -> Plan:
    return Plan(NODE, (ValueChange(Step(place[0], place[1], before, b"\1\0", "write")),))


def test_what_an_earlier_process_wrote_counts_but_for_parts_of_pdos_and_what_cannot_be_read(bench: Bench) -> None:
    identity = bench.node.identity()
    for plan in (written(*HEARTBEAT), written(0x1800, 5), written(0x1A00, 5), written(0x2005, 1, before=None)):
        bench.guard.history.add(plan, identity)
    held = Snapshot.now(bench.node)
    assert held.values == {HEARTBEAT: bench.device.upload(*HEARTBEAT)}
    assert held.pdos == bench.node.pdos()


def test_what_saves_settings_is_none_of_them(tmp_path: Path) -> None:
    bench = Bench(tmp_path, "roboteq")
    saved_by = bench.node.profile.store.saved_by
    assert saved_by is not None
    bench.guard.history.add(written(*saved_by), bench.node.identity())
    assert Snapshot.now(bench.node).values == {}
    bench.guard.lock.release()
