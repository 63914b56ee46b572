"""A PDO that could not be read whole on one side of a restart is no proof: what was not read was not compared."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.pdo import Pdo
from dvtcli.files.user_folders import user_folder
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.bus.devices import unknown_dictionary
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire
from tests.harness.sample import heavy
from tests.small_eds import U32, communication, plain, var

NOT_NOW, COUNT, TIMER = 0x08000022, (0x1A00, 0), (0x1800, 5)


class BusyDevice(StrictDevice):
    """Does not tell *untold* (how many objects TPDO1 maps) while it is busy, as it is after some of its *boots*."""

    def __init__(self, *boots: int, untold: tuple[int, int] = COUNT) -> None:
        super().__init__(unknown_dictionary(), load_family("generic"), 1)
        self.boots, self.booted, self.is_busy, self.untold = boots, 0, False, untold

    def upload(self, index: int, sub_index: int) -> bytes:
        if self.is_busy and (index, sub_index) == self.untold:
            raise Refusal(NOT_NOW)
        return super().upload(index, sub_index)

    def boot_up(self) -> None:
        self.booted += 1
        self.is_busy = self.booted in self.boots
        super().boot_up()


@heavy
def test_a_store_is_not_proved_by_a_mapping_that_was_not_read_before() -> None:
    device = BusyDevice()
    with Wire(device, faults=("stores-nothing",)) as wire:
        with Bench((), wire.options) as bench:
            assert bench.run("map tpdo1 6061").code == 0
            bench.session.end_line(0)
        with wire.lock:
            device.is_busy = True
        with Bench((), wire.options) as bench:
            ran = bench.run("store --prove --yes --json")
    assert ran.code == 1, ran
    assert "TPDO1: 0x1A00:00 could not be read before" in ran.stdout


def test_a_restore_is_not_proved_by_a_mapping_that_is_not_read_after_it() -> None:
    """Without an EDS a PDO has to be otherwise than before: one that is not told now is not."""
    device = BusyDevice(3)
    with Wire(device, faults=("restores-nothing",)) as wire, Bench((), wire.options) as bench:
        ran = bench.run("restore --prove --yes --json")
    assert ran.code == 1, ran
    assert "nothing differs from what was stored before" in ran.stdout


def test_a_restore_beside_an_eds_is_not_proved_either_where_the_mapping_is_not_read_after_it() -> None:
    device = BusyDevice(2)
    options = {"eds": str(family_eds("generic"))}
    with Wire(device, faults=("restores-nothing",)) as wire, Bench((), {**wire.options, **options}) as bench:
        ran = bench.run("restore --prove --yes --json")
    assert ran.code == 1, ran
    assert "TPDO1: 0x1A00:00 cannot be read, its default is 0x01" in ran.stdout


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (True, True, "not compared: 0x1800:05 cannot be read"),
        (True, False, "not compared: 0x1800:05 cannot be read"),
        (False, True, "TPDO1: event timer 0x1800:05 cannot be read"),
    ],
)
def test_a_timer_that_a_device_does_not_tell_for_a_moment_is_not_proved(before: bool, after: bool, said: str) -> None:
    device = BusyDevice(*((2,) if after else ()), untold=TIMER)
    device.is_busy = before
    with Wire(device) as wire, Bench((), wire.options) as bench:
        device.is_busy = before
        ran = bench.run("store --prove --yes --json")
    assert ran.code == 1, ran
    assert ran.document.get("proved") is (None if before else False), "it is said before the store"
    assert said in ran.stdout


def test_nor_is_a_restore_that_does_not_tell_a_timer() -> None:
    device = BusyDevice(2, untold=TIMER)
    options = {"eds": str(family_eds("generic"))}
    with Wire(device, faults=("restores-nothing",)) as wire, Bench((), {**wire.options, **options}) as bench:
        ran = bench.run("restore --prove --yes --json")
    assert ran.code == 1, ran
    assert "TPDO1: 0x1800:05 cannot be read, its default is 0x" in ran.stdout


@heavy
def test_a_timer_that_could_not_be_read_is_neither_saved_nor_changed_nor_expected() -> None:
    device = BusyDevice(untold=TIMER)
    with Wire(device) as wire, Bench((), wire.options) as bench:
        bench.session.node(1)
        device.is_busy = True
        shown = bench.run("pdo --json").document["pdos"][0]
        assert (shown["event_timer_ms"], shown["enabled"]) == (None, True)
        assert shown["inconsistent"] == "its event timer 0x1800:05 cannot be read"
        assert bench.run("pdo").stdout.count("TPDO1 is inconsistent: its event timer 0x1800:05 cannot be read\n") == 1
        assert bench.run("set tpdo2 --timer 30").code == 0
        (backup,) = (user_folder("state") / "backups").glob("*.dvt")
        (line,) = (line for line in backup.read_text().splitlines() if "tpdo1 is inconsistent" in line)
        assert line.startswith("# ")
        refused = bench.run("set tpdo1 --timer 40")
        refused.failed(1, "0x08000022")
        node = bench.session.node(1)
        assert (Pdo.parse("tpdo1") in node.expected.pdos, node.expected.is_complete) == (False, False)
        device.is_busy = False
        assert bench.run("set tpdo2 --timer 31").code == 0
        assert (Pdo.parse("tpdo1") in node.expected.pdos, node.expected.is_complete) == (True, True)
        assert bench.run("verify").code == 0
    assert device.value(*TIMER) == bytes(2)


def test_what_an_eds_tells_no_default_of_is_said_and_the_rest_compared(tmp_path: Path) -> None:
    """CAN-ID 0x000 is NMT's: a file that says so of a PDO tells no COB-ID."""
    eds = plain()
    eds.record(0x1800, "Communication 1", communication(0))
    eds.record(0x1011, "Restore", {1: var("Restore all", U32, 1)})
    path = tmp_path / "untold.eds"
    path.write_text(eds.text())
    for fault, code in (((), 0), (("restores-nothing",), 1)):
        with Bench((str(path),), {"fault": fault, "yes": True}) as bench:
            assert bench.script("set tpdo1 --timer 70", "store").code == 0
            document = bench.run("restore --prove --json").document
            assert document["proved"] is not bool(code)
            assert document["compared"] == 4
            assert "not compared: 0x1800:01, of which the EDS has no default" in "; ".join(document["notes"])
            assert [text for text in document["differences"] if "0x1800:05" not in text] == []
