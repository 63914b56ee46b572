"""What does not forbid a store: raw writes to a PDO beside its words, and a restore that took what was set."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Locks of our own: others test on buses of the same name."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


RAW = (
    "write 1800:1 0xC0000181",
    "write 1A00:0 0",
    "write 1A00:1 0x60410010",
    "write 1A00:0 1",
    "write 1800:1 0x40000181",
)


@pytest.mark.parametrize(
    "lines",
    [
        (*RAW, "map tpdo1 6064"),
        ("map tpdo1 6064", "write 1800:5 70 --force"),
        ("write 1800:5 70", "set tpdo1 --timer 80"),
    ],
)
def test_raw_writes_and_words_for_one_pdo_do_not_forbid_the_store(lines: tuple[str, ...]) -> None:
    with Bench(("generic",), {"yes": True}) as bench:
        for line in lines:
            assert bench.run(line).code == 0, line
        ran = bench.run("store")
        assert ran.code == 0, ran.stderr


def test_a_raw_write_to_a_pdo_that_is_lost_still_forbids_the_store() -> None:
    node = device("generic")
    with Wire(node) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.run("write 1800:5 70").code == 0
        with wire.lock:
            node.set_value(0x1800, 5, b"\0\0")
        assert bench.run("store").code == 6


def test_a_store_after_a_restore_and_a_power_cycle_is_legitimate() -> None:
    node = device("generic")
    with Wire(node) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.run("map tpdo1 6064 606C").code == 0
        assert bench.run("restore").code == 0
        boot_ups = bench.session.node().bus.boot_ups(1)
        wire.power_cycle(node)
        assert bench.session.node().bus.wait_boot_up(1, boot_ups, 5.0)
        ran = bench.run("store")
        assert ran.code == 0, ran.stderr
        wire.power_cycle(node)
        assert bench.session.node().bus.wait_boot_up(1, boot_ups + 1, 5.0)
        assert bench.run("store").code == 6, "nobody was told to do that"


def test_what_is_changed_between_a_restore_and_a_power_cycle_is_lost_and_that_is_told() -> None:
    node = device("generic")
    with Wire(node) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.run("restore").code == 0
        assert bench.run("map tpdo1 6064 606C").code == 0
        boot_ups = bench.session.node().bus.boot_ups(1)
        wire.power_cycle(node)
        assert bench.session.node().bus.wait_boot_up(1, boot_ups, 5.0)
        ran = bench.run("set tpdo1 --timer 70")
        ran.failed(6, "restarted since it was read")
