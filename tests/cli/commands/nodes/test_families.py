"""What families' makers say beyond the standard: hints behind aborts, decimal sub-indices, ways to save."""

from __future__ import annotations

import pytest

from dvtcli.domain.nmt import NmtState
from dvtcli.domain.profile import StepKind, step_kind
from dvtcli.files.profiles import load_profile
from tests.cli.commands.bench import Bench


@pytest.mark.parametrize(
    ("index", "sub_index", "kind"),
    [
        (0x1A00, 1, StepKind.ENTRY), (0x1600, 0, StepKind.COUNT), (0x1800, 1, StepKind.COB_ID),
        (0x1400, 2, StepKind.PARAMETER), (0x6041, 0, StepKind.OTHER), (0x1010, 1, StepKind.OTHER),
    ],
)  # fmt: skip
def test_a_step_s_kind(index: int, sub_index: int, kind: StepKind) -> None:
    assert step_kind(index, sub_index) is kind


def test_the_same_code_means_something_else_at_an_entry_and_at_the_count() -> None:
    profile = load_profile("roboteq")
    at_entry, at_count = profile.hint(0x1A00, 1, 0x0602_0000), profile.hint(0x1A00, 0, 0x0602_0000)
    assert at_entry is not None
    assert at_count is not None
    assert at_entry != at_count
    assert profile.hint(0x6041, 0, 0x0602_0000) is None


@pytest.mark.parametrize(
    ("family", "line", "hint"),
    [
        ("roboteq", "map tpdo1 2017 --force", "TPDOs take queries"),
        ("roboteq", "set tpdo1 --rtr --force", "--no-rtr"),
        ("tmcm", "map tpdo1 6041 6061 2703:1 --force", "read/write objects go into RPDOs only"),
        ("tmcm", "set tpdo1 --type 252 --force", "254 and 255"),
    ],
)
def test_a_refusal_brings_the_maker_s_hint(family: str, line: str, hint: str) -> None:
    with Bench((family,)) as bench:
        document = bench.run(f"{line} --json").document
        assert document["error"] == "device_refused"
        assert hint in document["hint"]


@pytest.mark.parametrize(("typed", "is_noted"), [("2005.10", True), ("2005.1", False), ("2005.0D", False)])
def test_a_sub_index_after_a_dot_that_may_be_meant_decimal_is_noted(typed: str, is_noted: bool) -> None:
    with Bench(("roboteq",)) as bench:
        ran = bench.run(f"read {typed}")
    assert ("the sub-index after . is hexadecimal; this is 2005:10" in ran.stderr) == is_noted, ran


def test_the_question_before_a_node_leaves_operational_claims_no_need() -> None:
    with Bench(("gen4",)) as bench:
        assert bench.run("nmt start --yes").code == 0
        ran = bench.run("write 6040 6")
        assert ran.code == 6, ran
        assert "take it to PRE-OPERATIONAL for this change, and back?" in ran.stdout + ran.stderr
        assert bench.session.node().access.state() is NmtState.OPERATIONAL


def test_a_decimal_sub_index_is_taken_with_a_note() -> None:
    with Bench(("roboteq",)) as bench:
        ran = bench.run("map rpdo1 0x2005-13 0x2005-14/32")
        assert ran.code == 0, ran.stderr
        assert "note: 0x2005-13: the sub-index after - is decimal; this is 2005:0D" in ran.stderr
        assert "note: 0x2005-14/32: the sub-index after - is decimal; this is 2005:0E" in ran.stderr
        (row,) = bench.run("pdo rpdo1 --json").document["pdos"]
        assert [entry["object"] for entry in row["mapping"]] == ["2005:0D", "2005:0E"]
        assert bench.run("read 2005-256").code == 2
        assert "note" not in bench.run("map rpdo1 2005:0D").stderr


def test_what_cannot_be_stored_is_said_in_one_sentence_with_the_maker_s_way() -> None:
    with Bench(("roboteq",)) as bench:
        ran = bench.run("store")
        assert ran.code == 1
        assert "error: this device cannot store" in ran.stderr
        assert "write 2017 1 --as u8` (assumed" in ran.stderr
        assert bench.run("map tpdo1 2100-1").code == 0
        assert bench.session.node().unstored
        ran = bench.run("write 2017 1")
        assert ran.code == 0
        assert "In RAM only" not in ran.stdout
        assert "store its settings (assumed" in ran.stdout
        assert not bench.session.node().unstored
        assert bench.run("write 2017 1 --json").document["stored"]
        assert len(bench.session.node().history) == 1, "a save is nothing to undo"
        assert bench.run("nmt reset-node").code == 0
        (row,) = bench.run("pdo tpdo1 --json").document["pdos"]
        assert [entry["object"] for entry in row["mapping"]] == ["2100:01"]
