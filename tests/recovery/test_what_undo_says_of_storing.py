"""`undo` says that `store` keeps what it put back only where a store may have taken something else since."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.files.eds.reader import parse_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device
from tests.small_eds import plain

AS_BEFORE = "As before the change, which dvtcli did not store."
IN_RAM = "In RAM only: `store` keeps it."


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def said_last(wire: Wire, *lines: str) -> str:
    with Bench((), {**wire.options, "yes": True}) as bench:
        for line in lines:
            ran = bench.run(line)
            assert ran.code == 0, ran
        return ran.stdout


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (["set tpdo1 --timer 70"], AS_BEFORE),
        (["set tpdo1 --timer 70", "store", "set tpdo1 --timer 71"], AS_BEFORE),
        (["set tpdo1 --timer 70", "store", "set tpdo2 --timer 71"], AS_BEFORE),
        (["set tpdo1 --timer 70", "set tpdo2 --timer 71"], AS_BEFORE),
        (["set tpdo1 --timer 70", "store", "restore", "nmt reset-node", "set tpdo1 --timer 71"], AS_BEFORE),
        (["write 1017 1000"], AS_BEFORE),
        (["set tpdo1 --timer 70", "store"], IN_RAM),
        (["set tpdo1 --timer 70", "set tpdo1 --timer 71"], IN_RAM),
        (["set tpdo1 --timer 70", "store", "undo", "set tpdo1 --timer 71"], IN_RAM),
        (["set tpdo1 --timer 70", "store", "undo", "set tpdo1 --timer 71", "set tpdo1 --timer 72"], IN_RAM),
    ],
)
def test_undo(together: bool, lines: list[str], says: str) -> None:
    with Wire(device("generic")) as wire:
        for words in [] if together else lines:
            said_last(wire, words)
        said = said_last(wire, *(lines if together else []), "undo")
    assert says in said
    assert (AS_BEFORE if says == IN_RAM else IN_RAM) not in said


def test_what_is_left_unstored_after_it_is_named_by_the_next_store() -> None:
    with Bench(("generic",), {"yes": True}) as bench:
        for line in ("set tpdo1 --timer 70", "store", "undo", "set tpdo1 --timer 71", "set tpdo2 --timer 72", "undo"):
            assert bench.run(line).code == 0
        assert "TPDO1" in bench.run("store --json").document["changed"]


@pytest.mark.parametrize("described", [True, False])
def test_who_cannot_store_is_not_told_to(described: bool, tmp_path: Path) -> None:
    file = plain()
    del file.objects[0x1010]
    eds = tmp_path / "bare.eds"
    eds.write_text(file.text())
    with Wire(StrictDevice(parse_eds(file.text().encode(), "bare.eds").dictionary, load_family("generic"), 1)) as wire:
        for line in ("write 1017 70", "write 1017 80"):
            with Bench((), {**wire.options, **({"eds": str(eds)} if described else {})}) as bench:
                said = bench.run(line).stdout
            assert "In RAM only: the device has no 0x1010 to store it with, `undo` reverts it." in said
