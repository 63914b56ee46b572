"""Single objects in a proof: those of earlier commands are compared, commands to the machine are not settings."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.abort import Abort
from dvtcli.files.eds.reader import read_eds
from dvtcli.files.user_folders import user_folder
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def on_bus(wire: Wire, *, eds: bool = True) -> Bench:
    given = {"eds": str(family_eds("generic"))} if eds else {}
    return Bench((), {**wire.options, "yes": True, **given})


@pytest.mark.parametrize("eds", [True, False])
def test_an_object_of_an_earlier_process_that_is_not_kept_is_named(eds: bool) -> None:
    with Wire(device("generic"), faults=("stores-nothing",)) as wire:
        with on_bus(wire, eds=eds) as first:
            assert first.run("write 1017 1000").code == 0
        with on_bus(wire, eds=eds) as second:
            ran = second.run("store --prove --json")
    assert ran.code == 1, ran.stdout
    assert ran.document["proved"] is False
    assert [text.partition(":00")[0] for text in ran.document["differences"]] == ["1017"]


def test_an_object_of_an_earlier_process_is_compared_with_its_default_too() -> None:
    with Wire(device("generic"), faults=("restores-nothing",)) as wire:
        with on_bus(wire) as first:
            assert first.script("write 1017 1000", "store").code == 0
        with on_bus(wire) as second:
            ran = second.run("restore --prove --json")
    assert ran.code == 1, ran.stdout
    assert [text.partition(":00")[0] for text in ran.document["differences"]] == ["1017"]


def test_what_was_taken_back_is_not_looked_for() -> None:
    with Wire(device("generic")) as wire:
        with on_bus(wire) as first:
            assert first.script("write 1017 1000", "undo").code == 0
        with on_bus(wire) as second:
            ran = second.run("store --prove --json")
    assert (ran.code, ran.document["objects"]) == (0, 0)


def test_a_history_that_cannot_be_read_is_said(tmp_path: Path) -> None:
    with Wire(device("generic")) as wire:
        with on_bus(wire) as first:
            assert first.run("write 1017 1000").code == 0
        (path,) = (user_folder("state") / "changes").glob("*.json")
        path.write_text("{")
        with on_bus(wire) as second:
            ran = second.run("store --prove --json")
    assert ran.code == 0, ran.stdout
    assert any(str(path) in note for note in ran.document["notes"]), ran.document["notes"]


@pytest.mark.parametrize("family", ["generic", "tmcm"])
@pytest.mark.parametrize("eds", [True, False])
def test_a_command_to_the_drive_is_no_setting(family: str, eds: bool) -> None:
    given = {"eds": str(family_eds(family))} if eds else {}
    with Wire(device(family)) as wire, Bench((), {**wire.options, "yes": True, **given}) as bench:
        assert bench.run("write 6040 6 --as u16").code == 0
        assert bench.run("disable tpdo2").code == 0
        ran = bench.run("store --prove --json")
    assert ran.code == 0, ran.stdout
    assert (ran.document["proved"], ran.document["objects"]) == (True, 0)
    assert any("0x6040:00" in note for note in ran.document["notes"]), "and that is said"


def test_a_setting_that_an_rpdo_can_take_is_one_all_the_same() -> None:
    with Wire(device("generic"), faults=("stores-nothing",)) as wire, on_bus(wire) as bench:
        assert bench.run("write 6060 1").code == 0
        ran = bench.run("store --prove --json")
    assert ran.code == 1
    assert [text.partition(":00")[0] for text in ran.document["differences"]] == ["6060"]


def test_a_proof_of_what_may_have_been_so_before_says_that_in_json_too() -> None:
    with Bench(("generic",), {"yes": True}) as bench:
        for line, word in (("store --prove", "save"), ("restore --prove", "load")):
            (note,) = bench.run(f"{line} --json").document["notes"]
            assert note.startswith("dvtcli knows of no")
            assert f"not that the {word} " in note
            said = " ".join(bench.run(line).stdout.split())
            assert note in said, "it is the sentence of the screen"
        assert bench.run("set tpdo1 --timer 70").code == 0
        assert bench.run("store --prove --json").document["notes"] == []
        assert bench.run("restore --prove --json").document["notes"] == []


class Shy(StrictDevice):
    """A device that refuses to have 0x1017 read, with the abort code *refuses* once it is set."""

    refuses: Abort | None = None

    def upload(self, index: int, sub_index: int) -> bytes:
        if index == 0x1017 and self.refuses is not None:
            raise Refusal(self.refuses)
        return super().upload(index, sub_index)


@pytest.mark.parametrize("code", [Abort.DEVICE_STATE, Abort.NO_OBJECT])
@pytest.mark.parametrize("line", ["store --prove --json", "restore --prove --json"])
def test_an_object_that_cannot_be_read_is_not_called_equal(line: str, code: Abort) -> None:
    """An answer that may be another one a moment later is no proof; one that lasts is said."""
    node = Shy(read_eds(family_eds("generic")).dictionary, load_family("generic"), 1)
    with Wire(node) as wire:
        with on_bus(wire) as first:
            assert first.script("write 1017 1000", "store").code == 0
        with wire.lock:
            node.refuses = code
        with on_bus(wire) as second:
            ran = second.run(line)
    document, passes = ran.document, code == Abort.DEVICE_STATE
    if passes and line.startswith("store"):  # nothing is stored of which it is known that it cannot be compared
        assert (ran.code, document["state"]) == (1, "unchanged")
        assert "not compared: 0x1017:00 refused" in document["why"]
        return
    assert (ran.code, document["proved"], document["objects"]) == (int(passes), not passes, 0), document
    said = document["unproved"] if passes else "; ".join(document["notes"])
    assert "not compared: 0x1017:00 refused" in said
    assert f"0x{code:08X}" in said
