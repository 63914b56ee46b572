"""`bus.plan` and `bus.apply`: a network file by a program."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

import dvtcli
from dvtcli.errors import InputFileError, SafetyRefusal, UsageError
from tests.harness.sample import heavy
from tests.process import ROOT


@heavy
def test_a_program_plans_and_applies_a_network_file(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    file.write_text("a: {node_id: 1, tpdo: {1: {event_timer: 70}}}\nb: {node_id: 5, tpdo: {1: {event_timer: 80}}}\n")
    with dvtcli.simulate("generic@1", "generic@5", ask=lambda question: "nodes 1 and 5" in question) as bus:
        planned = bus.plan(file)
        assert (bool(planned), planned.plan.writes, planned.exit_code) == (False, 2, 0)
        assert bus.apply(file)
        assert bus.plan(file)
        assert [bus.node(one).pdos()["tpdo1"].config.communication.event_timer for one in (1, 5)] == [70, 80]
    with dvtcli.simulate("generic@1", "generic@5") as bus:
        with pytest.raises(SafetyRefusal):
            bus.apply(file)
        assert bus.apply(file, yes=True).exit_code == 0
        assert bus.node(5).pdos()["tpdo1"].config.communication.event_timer == 80


def test_load_of_a_file_and_of_the_nodes() -> None:
    file = ROOT / "examples" / "line.yaml"
    with dvtcli.simulate("gen4@1", "generic@5") as bus:
        fits = bus.load(file, for_s=0, bit_rate=125_000)
        assert fits
        assert fits.document()["fits"] is True
        assert not bus.load(for_s=0)
        tried = bus.load(for_s=0, inhibit_ms={"1:tpdo1": 20, "5:tpdo1": 20, "5:tpdo2": 50}, sync_ms=10)
        assert tried
        with pytest.raises(UsageError):
            bus.load(for_s=0, inhibit_ms={"1:rpdo1": 20})
        with pytest.raises(UsageError):
            bus.load(for_s=0, inhibit_ms={"300:tpdo1": 20})
        with pytest.raises(UsageError):
            bus.load(for_s=0, bit_rate=5)
        with pytest.raises(UsageError):
            bus.load(for_s=-1)


@heavy
def test_check_of_files_of_nodes_and_of_both(tmp_path: Path) -> None:
    file = ROOT / "examples" / "line.yaml"
    with dvtcli.simulate("gen4@1", "generic@5") as bus:
        checked = bus.check(file)
        assert checked
        assert [(one.path, one.bus, one.is_live) for one in checked.reports] == [
            (str(file), "", False), ("sim", "", True), (str(file), "sim", True),
        ]  # fmt: skip
        assert checked.document()["schema"] == "dvtcli.network-check/1"
        of_file, of_bus, _ = checked.reports
        assert {finding.line for finding in of_bus.findings} == {0}, "a bus has no lines"
        assert {found["line"] for found in of_bus.fields()["findings"]} == {None}
        assert 0 not in {finding.line for finding in of_file.findings}
        strict = bus.check(rules=["unbounded-event-pdo"], strict=True)
        assert (bool(strict), strict.exit_code, len(strict.reports[0].findings)) == (False, 3, 3)
        assert bus.check(without=["unbounded-event-pdo"], for_s=0.05, bit_rate=125_000).reports[0].heard is not None
        missing = bus.check(tmp_path / "none.yaml")
        assert (missing.exit_code, missing.reports[0].findings[0].rule) == (2, "network-file")
        for wrong in ({"rules": "x"}, {"rules": ["no-such"]}, {"bit_rate": 5}, {"for_s": -1}, {"strict": 1}):
            with pytest.raises(UsageError):
                bus.check(**wrong)  # type: ignore[arg-type]


def test_the_time_that_an_answer_takes_is_none_of_the_change_s(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    file.write_text("a: {node_id: 1, tpdo: {1: {event_timer: 20}}}\n")
    answered: list[float] = []

    def think(_question: str) -> bool:
        time.sleep(0.2)
        answered.append(time.monotonic())
        return True

    with dvtcli.simulate("gen4@1", ask=think) as bus:
        done = bus.apply(str(file))
    assert done.seconds <= time.monotonic() - answered[0]


def test_the_errors_of_a_file_are_in_the_notes_of_the_exception(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    file.write_text("a:\n  node_id: 1\n  tpdoo: {1: {event_timer: 70}}\n  stroe: true\n")
    with dvtcli.simulate("generic@1") as bus, pytest.raises(InputFileError, match="2 errors") as raised:
        bus.apply(file, yes=True)
    notes = raised.value.__notes__
    assert notes[0].startswith(f"error: {file}:3:3: unknown key 'tpdoo' in node a, did you mean 'tpdo'?")
    assert notes[1].startswith(f"error: {file}:4:3: unknown key 'stroe' in node a, did you mean 'store'?")
    assert [complaint.line for complaint in raised.value.complaints] == [3, 4]


def test_a_recording_is_no_network_to_check() -> None:
    file = ROOT / "examples" / "run.log"
    with dvtcli.simulate("gen4") as bus, pytest.raises(UsageError, match="is a recording, and this call") as raised:
        bus.check(file)
    assert raised.value.hint == "`dvtcli --json check RECORDING` checks recordings"


@pytest.mark.parametrize(
    ("dcf", "says"),
    [
        ("eds-files/lelly.eds", "did you mean 'eds-files/lely.eds'?"),
        ("lelly.eds", "did you mean 'here.lely.eds'?"),
        ("gne4", "did you mean 'gen4'?"),
        ("nowhere/0815.eds", "families are"),
    ],
)
def test_a_mistyped_file_is_suggested_from_its_own_folder(dcf: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "eds-files").mkdir()
    for name in ("eds-files/lely.eds", "here.lely.eds"):
        (tmp_path / name).write_text("")
    file = tmp_path / "net.yaml"
    file.write_text(f"a: {{node_id: 1, dcf: {dcf}}}\n")
    with dvtcli.simulate("generic@1") as bus, pytest.raises(InputFileError) as raised:
        bus.plan(file)
    assert says in raised.value.complaints[0].text
