"""Objects that cannot be read back: what was written is acknowledged, named, and never called equal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.files.device_file import read_device_file
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.cli.commands.bench import Bench, Ran, beside
from tests.small_eds import U8, U16, U32, plain, var

COMMAND, MODE, BUSY, CONTROL, PROGRAM, SETTING = 0x2050, 0x2051, 0x2060, 0x6040, 0x1F51, 0x2070


@pytest.fixture
def eds(tmp_path: Path) -> Path:
    made = plain()
    made.variable(COMMAND, var("Zero now", U8, access="wo"))
    made.variable(MODE, var("Teach", U16, access="wo"))
    made.variable(BUSY, var("Pump control word", U16, 0))
    made.variable(SETTING, var("Ramp", U16, 100))
    made.variable(CONTROL, var("Controlword", U16, 0))
    made.record(PROGRAM, "Program control", {1: var("Program 1", U8, 0)})
    made.record(0x1011, "Restore", {1: var("Restore all", U32, 1)})
    path = tmp_path / "blind.eds"
    path.write_text(made.text(), "utf-8")
    return path


@pytest.fixture
def bench(eds: Path) -> Iterator[Bench]:
    with Bench((str(eds),), {"yes": True}) as made:
        yield made


def uploads_behind(bench: Bench, line: str, index: int) -> tuple[Ran, int]:
    """What *line* said, and how many uploads of *index* came behind its last download."""
    seen: list[bytes] = []

    def note(frame: Frame, ours: bool) -> None:
        if ours and frame.can_id & 0x780 == 0x600:
            seen.append(bytes(frame.data))

    untap = bench.session.open_network().bus.tap(note)
    ran = bench.run(line)
    untap()
    last = max(n for n, data in enumerate(seen) if data[0] >> 5 == 1)
    return ran, sum(data[0] >> 5 == 2 and data[1:3] == index.to_bytes(2, "little") for data in seen[last:])


@pytest.mark.parametrize(
    ("words", "index", "said"),
    [
        ("2050 1", COMMAND, "write-only: nothing can be read back"),
        ("2051 7", MODE, "write-only: nothing can be read back"),
        ("1F51:1 1", PROGRAM, "it reads back a state, not the written value"),
    ],
)
def test_a_write_is_acknowledged_and_not_called_equal(bench: Bench, words: str, index: int, said: str) -> None:
    ran, count = uploads_behind(bench, f"write {words}", index)
    assert (ran.code, count) == (0, 0)
    assert f"1 write, acknowledged; {said}" in ran.stdout
    assert "equal" not in ran.stdout
    assert f"warning: 0x{index:04X}:0" in ran.stderr
    assert "the written value cannot be read back" in ran.stderr


@pytest.mark.parametrize("options", ["", "--dry-run"])
@pytest.mark.parametrize("words", ["2050 1", "2051 7", "1F51:1 1"])
def test_its_document_says_so(bench: Bench, words: str, options: str) -> None:
    document = bench.run(f"write {words} --json {options}").document
    assert (document["verified"], document["readable"]) == (False, False)
    assert [finding["rule"] for finding in document["findings"]] == ["write-only"]
    other = bench.run(f"write 2070 5 --json {options}").document
    assert (other["verified"], other["readable"], other["findings"]) == (True, True, [])


def test_a_dry_run_claims_nothing_either(bench: Bench) -> None:
    ran = bench.run("write 2050 1 --dry-run")
    assert (ran.code, "equal" in ran.stdout) == (0, False)
    assert "on the twin, acknowledged; write-only: nothing can be read back" in ran.stdout


@pytest.mark.parametrize("words", ["2050 1", "1F51:1 1"])
def test_verify_names_what_it_cannot_compare(bench: Bench, words: str) -> None:
    """Beside what it compares; alone it is nothing to compare, and not that nothing was changed."""
    name = {"2050 1": "2050:00", "1F51:1 1": "1F51:01"}[words]
    assert bench.run(f"write {words}").code == 0
    alone = bench.run("verify")
    assert alone.code == 2
    assert f"this session's changes set only {name} of node 1, which cannot be read back" in alone.stderr
    assert bench.run("write 2070 5").code == 0
    ran = bench.run("verify")
    assert ran.code == 0
    assert "1 parameter of 1 object equal" in ran.stdout
    assert f"{name} cannot be read back: not compared" in ran.stdout
    document = bench.run("verify --json").document
    assert document["not_comparable"] == [{"node": 1, "object": name}]
    assert (document["objects"], document["equal"]) == (1, True)


def test_verify_of_a_script_names_it_too(bench: Bench, tmp_path: Path) -> None:
    script = tmp_path / "set.dvt"
    script.write_text("write 2050 1\nwrite 2070 100\n", "utf-8")
    ran = bench.run(f"verify {script}")
    assert ran.code == 0, ran.stderr
    assert "2050:00 cannot be read back: not compared" in ran.stdout
    script.write_text("write 2050 1\n", "utf-8")
    alone = bench.run(f"verify {script}")
    assert alone.code == 2
    assert f"{script} sets only 2050:00 of node 1, which cannot be read back" in alone.stderr


def test_verify_of_a_device_file_names_it_too(bench: Bench, eds: Path, tmp_path: Path) -> None:
    assert bench.run(f"backup {tmp_path / 'x.dcf'}").code == 0
    text = (tmp_path / "x.dcf").read_text("utf-8")
    dcf = tmp_path / "y.dcf"
    dcf.write_text(text.replace("ParameterName=Zero now", "ParameterName=Zero now\nParameterValue=1"), "utf-8")
    ran = bench.run(f"verify {dcf} --json")
    assert ran.code == 0, ran
    assert {"node": 1, "object": "2050:00"} in ran.document["not_comparable"]
    assert "2050:00" in bench.run(f"verify {dcf}").stdout


@pytest.mark.parametrize(
    ("fault", "code", "state"),
    [
        ("refuse@1=0x08000022", 1, "rolled_back"),
        ("refuse@1=0x06090030", 1, "rolled_back"),
        ("lose-response@1", 5, "unknown"),
    ],
)
def test_a_failure_does_not_say_that_it_is_as_it_was(eds: Path, fault: str, code: int, state: str) -> None:
    with Bench((str(eds),), {"fault": (fault,), "timeout": 0.1}) as bench:
        ran = bench.run("write 2050 1")
        assert (ran.code, "equal" in ran.stderr) == (code, False), ran
    with Bench((str(eds),), {"fault": (fault,), "timeout": 0.1}) as bench:
        assert bench.run("write 2050 1 --json").document["state"] == state


def test_undo_says_that_it_stays(bench: Bench) -> None:
    assert bench.run("write 1F51:1 1").code == 0
    ran = bench.run("undo")
    assert ran.code == 2
    assert "0x1F51:01 reads back a state: its old value is not known, so it stays" in ran.stderr


@pytest.mark.parametrize("line", ["write 2050 1", "write 1F51:1 1"])
@pytest.mark.parametrize("undo", ["undo --force", "undo --all --force", "undo --force --dry-run"])
def test_a_forced_undo_claims_nothing_of_it(bench: Bench, line: str, undo: str) -> None:
    for said in ("", " --json"):
        assert bench.run(line).code == 0
        ran = bench.run(undo + said)
        assert ran.code == 0, ran
        if said:
            assert (ran.document["verified"], ran.document["readable"], ran.document["writes"]) == (False, False, 0)
        else:
            assert "NOT rolled back: the earlier values are not known; nothing was written" in ran.stdout
            assert "as wanted" not in ran.stdout


@pytest.mark.parametrize("is_same", [False, True])
def test_nor_an_undo_of_all_that_puts_others_back(bench: Bench, is_same: bool) -> None:
    for said in ("", " --json"):
        for line in ("write 2070 5", "write 2050 1", *(["write 2070 100 --force"] if is_same else [])):
            assert bench.run(line).code == 0
        ran = bench.run(f"undo --all --force{said}")
        assert ran.code == 0, ran
        if said:
            assert (ran.document["verified"], ran.document["readable"]) == (False, False)
        else:
            assert "2050:00 NOT rolled back: the earlier values are not known" in ran.stdout
            assert "As it was before" not in ran.stdout


@pytest.mark.parametrize("lines", [["write 2070 5", "write 2050 1"], ["write 2050 1", "write 2070 5"]])
def test_an_atomic_script_that_wrote_it_is_left_changed(bench: Bench, tmp_path: Path, lines: list[str]) -> None:
    script = tmp_path / "set.dvt"
    script.write_text("\n".join([*lines, "write 2FFF 1"]), "utf-8")
    ran = bench.run(f"run --atomic {script}")
    assert ran.code == 7, ran
    assert "0x2050:00 is write-only: its old value is not known, so it stays" in ran.stderr
    assert "everything is as before" not in ran.stderr
    assert "= 100 " in bench.run("read 2070").stdout


def test_a_store_does_not_compare_it_and_says_so(bench: Bench) -> None:
    assert bench.run("write 2050 1").code == 0
    ran = bench.run("store --prove")
    assert ran.code == 0, ran
    assert "not compared: 0x2050:00 is write-only" in ran.stdout


class Busy(StrictDevice):
    """Its control words show bit 15 once they were written, as long as the command is carried out."""

    words = (BUSY, CONTROL)

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        super().download(index, sub_index, data)
        if index in self.words:
            self.set_value(index, sub_index, (int.from_bytes(data, "little") | 0x8000).to_bytes(2, "little"))


class Deaf(Busy):
    """Acknowledges what is written to its control words, and keeps what they held."""

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        held = self.upload(index, sub_index) if index in self.words else b""
        super().download(index, sub_index, data)
        if held:
            self.set_value(index, sub_index, held)


def on_bus(eds: Path, kind: Callable[..., StrictDevice], tmp_path: Path) -> Bench:
    device = kind(read_device_file(eds).dictionary, load_family("generic"), 1)
    device.boot_up()
    options: dict[str, Any] = {"sim": (), "node": 1, "eds": str(eds), "yes": True, "journal": str(tmp_path / "state")}
    return Bench((), options, beside([device]))


@pytest.mark.parametrize("place", ["2060:00", "6040:00"])
def test_a_control_word_with_a_busy_bit_is_acknowledged(eds: Path, tmp_path: Path, place: str) -> None:
    with on_bus(eds, Busy, tmp_path) as bench:
        ran = bench.run(f"write {place} 6 --json")
        assert ran.code == 0, ran
        assert (ran.document["verified"], ran.document["readable"]) == (False, False)
        assert [finding["rule"] for finding in ran.document["findings"]] == ["write-only"]
        said = bench.run(f"write {place} 7")
        assert "acknowledged; it reads back a state, not the written value" in said.stdout
        assert f"0x{place} is a control word and reads back 0x8007" in said.stderr
        assert f"only {place} of node 1, which cannot be read back" in bench.run("verify").stderr
        assert bench.run("write 2070 9").code == 0
        assert bench.run("store").code == 0


@pytest.mark.parametrize("place", ["2060:00", "6040:00"])
def test_one_that_does_not_change_is_refused_as_any_object(eds: Path, tmp_path: Path, place: str) -> None:
    with on_bus(eds, Deaf, tmp_path) as bench:
        ran = bench.run(f"write {place} 6")
        assert ran.code == 1
        assert "reads back differently" in ran.stderr
