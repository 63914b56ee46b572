"""Which remembered changes a node still holds that no store took: they are named with the next store, and no others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from dvtcli.device.change.change_history import ChangeHistory
from dvtcli.device.change.plan_document import Identity
from dvtcli.device.node import Node
from dvtcli.device.store.unstored import held_unstored
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, Plan, Step, ValueChange, plan_pdo
from dvtcli.domain.profile import GENERIC, StorePolicy
from tests.laws.bench import NODE, DirectBus, booted, dictionary

IDENTITY: Identity = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}
TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")
HEARTBEAT = (0x1017, 0)


class Bench:
    """A node, and what is remembered of its changes by whichever process."""

    def __init__(self, folder: Path) -> None:
        self.node = Node(DirectBus.of(booted()), NODE, dictionary("generic"))
        self.history = ChangeHistory(folder, "can0")

    def timed(self, pdo: Pdo, timer_ms: int) -> PdoConfig:
        now = self.node.pdo(pdo)
        return now.with_parameters(event_timer=timer_ms)

    def made(self, change: Change) -> None:
        """*change* is made, and remembered."""
        for step in change.steps:
            self.node.sdo.download(step.index, step.sub_index, step.after)
        self.history.add(Plan(NODE, (change,)), IDENTITY)

    def set_timer(self, pdo: Pdo, timer_ms: int) -> None:
        self.made(plan_pdo(pdo, self.node.pdo(pdo), self.timed(pdo, timer_ms)))

    def written(self, number: int) -> ValueChange:
        before = self.node.upload(*HEARTBEAT)
        return ValueChange(Step(*HEARTBEAT, before, number.to_bytes(2, "little"), "write"))

    def named(self) -> dict[str, int]:
        return dict(held_unstored(self.node, self.history, IDENTITY))


def test_what_is_held_is_named_in_order_and_what_a_store_took_is_not(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.set_timer(TPDO2, 70)
    bench.made(bench.written(1000))
    bench.set_timer(TPDO1, 50)
    assert list(bench.named().items()) == [("TPDO2", 0x1801), ("1017:00", 0x1017), ("TPDO1", 0x1800)]
    bench.history.was_stored(NODE, IDENTITY, {"TPDO2", "1017:00"})
    assert bench.named() == {"TPDO1": 0x1800}
    bench.set_timer(TPDO2, 71)
    assert list(bench.named()) == ["TPDO1", "TPDO2"], "changed once more since"


def test_what_a_restart_took_or_somebody_else_replaced_is_not_named(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.set_timer(TPDO1, 50)
    bench.made(bench.written(1000))
    bench.node.sdo.download(0x1800, 5, b"\7\0")
    assert list(bench.named()) == ["1017:00"]
    bench.node.sdo.download(*HEARTBEAT, b"\7\0")
    assert bench.named() == {}


def test_what_changed_nothing_or_is_kept_without_a_store_is_not_named(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    held = bench.node.upload(*HEARTBEAT)
    bench.made(bench.written(int.from_bytes(held, "little")))
    assert bench.named() == {}
    bench.set_timer(TPDO1, 50)
    bench.node.profile = replace(GENERIC, store=StorePolicy(covers=(0x1017, 0x1017)))
    assert bench.named() == {}


def test_what_cannot_be_read_is_not_claimed(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    step = Step(*HEARTBEAT, None, bench.node.upload(*HEARTBEAT), "write-only, as it was said")
    bench.history.add(Plan(NODE, (ValueChange(step),)), IDENTITY)
    missing = Step(0x5FFF, 0, b"\0", b"\1", "a device with another firmware has it no more")
    bench.history.add(Plan(NODE, (ValueChange(missing),)), IDENTITY)
    now = bench.node.pdo(TPDO1)
    gone = plan_pdo(Pdo.parse("tpdo400"), now, bench.timed(TPDO1, 50))
    bench.history.add(Plan(NODE, (gone,)), IDENTITY)
    assert bench.named() == {}


def test_a_file_that_is_damaged_names_nothing(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.set_timer(TPDO1, 50)
    bench.history.path(NODE, IDENTITY).write_text("{", "utf-8")
    assert bench.named() == {}
