"""Each rule finds the fault that it is for, in its line, and is silent where the same place is sound."""

from __future__ import annotations

import re
from collections import Counter

import pytest

from dvtcli.files.device_lint import RULES
from dvtcli.files.eds.findings import EdsFinding
from tests.files.lint.planted import DCF, OTHERS, PLANTED, Planted, in_section, section, without
from tests.files.lint.sample import NAME, SOUND, found, record, var

#: what is no file of that name, or with other line ends, than the sound one
ELSEWHERE = {"lf", "valve.eds"}


def checked(text: str, name: str) -> tuple[EdsFinding, ...]:
    """What all rules say of a file called *name*; `lf`: one whose lines end so."""
    return found(text.encode()) if name == "lf" else found(text, name)


def objects_of(rule: str, text: str) -> list[str]:
    """The objects in which *rule* finds something in *text*."""
    return [one.object for one in found(text) if one.rule == rule]


def expected_line(case: Planted) -> int:
    """Where `[section]|part`, or `part`, stands; 1 for nothing."""
    name, _, part = case.at.rpartition("|")
    assert name or case.text.count(part) == 1 or not part, (case.text.count(part), part)
    start = case.text.index(f"{name}\n") if name else 0
    return case.text[: case.text.index(part, start)].count("\n") + 1


@pytest.mark.drawn(20)
@pytest.mark.parametrize("case", [*PLANTED, *OTHERS], ids=str)
def test_a_planted_fault_is_found_in_its_line(case: Planted) -> None:
    (rule,) = [rule for rule in RULES if rule.name == case.rule]
    mine = [one for one in checked(case.text, case.name) if one.rule == case.rule]
    assert mine, [(one.line, one.rule, one.text) for one in checked(case.text, case.name)]
    assert {one.severity for one in mine} == {rule.severity}
    assert expected_line(case) in [one.line for one in mine], mine
    assert case.said in mine[0].text


@pytest.mark.drawn(12)
@pytest.mark.parametrize("case", PLANTED, ids=str)
def test_where_it_is_sound_the_rule_is_silent(case: Planted) -> None:
    name = NAME if case.name in ELSEWHERE or case.twin is SOUND else case.name
    assert [one for one in checked(case.twin, name) if one.rule == case.rule] == []


def test_a_sound_file_has_no_finding_at_all() -> None:
    assert found(SOUND) == ()
    assert found(DCF, "pump.dcf") == ()


@pytest.mark.parametrize(("default", "notes"), [("$NODEID+0x80", 0), ("0x85", 0), ("0x86", 1)])
def test_a_set_value_with_the_node_id_is_compared_as_the_node_has_it(default: str, notes: int) -> None:
    values = f"DefaultValue={default}\nParameterValue=$NODEID+0x80"
    text = in_section("6000", "DefaultValue=0", values, DCF)
    assert "NodeID=5\n" in text
    assert sum(one.rule == "value-of-read-only" for one in found(text, "pump.dcf")) == notes


@pytest.mark.parametrize(("default", "notes"), [("$NODEID+0x80", 0), ("0x85", 0), ("$NODEID+0x300", 1)])
def test_without_a_node_id_a_set_value_may_be_that_of_any_node(default: str, notes: int) -> None:
    """Some tools write what one node holds, and not which node that is."""
    section = DCF[DCF.index("[6000]") : DCF.index("[6001]")]
    values = f"DefaultValue={default}\nParameterValue=0x85"
    set_so = section.replace("DataType=0x0005", "DataType=0x0007").replace("DefaultValue=0", values)
    text = DCF.replace(section, set_so).replace("NodeID=5\n", "")
    assert sum(one.rule == "value-of-read-only" for one in found(text, "pump.dcf")) == notes


@pytest.mark.parametrize("limit", ["LowLimit", "HighLimit"])
@pytest.mark.parametrize(
    ("value", "rule"), [("010", "leading-zero"), ("$NODEID+010", "leading-zero"), ("08", "odd-value")]
)
def test_a_limit_with_a_leading_zero_is_told_like_a_default(limit: str, value: str, rule: str) -> None:
    text = in_section("2000", f"{limit}={'-500' if limit == 'LowLimit' else '500'}", f"{limit}={value}")
    said = [one.text for one in found(text) if one.rule == rule]
    assert [one for one in said if limit in one], said
    plain = in_section("2000", "DefaultValue=100", f"DefaultValue={value}")
    assert [one for one in found(plain) if one.rule == rule and "DefaultValue" in one.text]


@pytest.mark.parametrize("access", ["ro", "const"])
def test_the_number_of_errors_is_no_highest_sub_index(access: str) -> None:
    errors = record("1003", "Errors", ("Number of errors", 5, access, "0"), ("Error", 7, "ro", "0"), kind=8)
    assert [one for one in found(SOUND + errors) if one.rule == "highest-sub-index"] == []


def test_of_a_part_of_the_identity_that_the_standard_does_not_have_it_says_nothing() -> None:
    """A real file has a sub-index 06 of a maker's own."""
    text = SOUND + "[1018sub6]\nParameterName=Build\nDataType=0x0005\nAccessType=ro\nPDOMapping=0\n"
    assert "standard-type" not in {one.rule for one in found(text)}


def test_every_rule_has_a_fault_that_it_finds() -> None:
    assert Counter(case.rule for case in PLANTED) == Counter(rule.name for rule in RULES)


def test_there_are_rules_enough_and_each_says_what_it_is() -> None:
    assert len(RULES) >= 100
    for rule in RULES:
        assert rule.name == rule.name.lower().replace("_", "-").replace(" ", "-")
        assert len(rule.sense) > 10, rule.name
        assert rule.source, rule.name


@pytest.mark.parametrize(
    ("default", "limit", "said"), [("100", "99", "100 (0x64) is above HighLimit 99 (0x63)"),
                                   ("10", "9", "10 (0xA) is above HighLimit 9")],
)  # fmt: skip
def test_a_finding_names_object_and_type(default: str, limit: str, said: str) -> None:
    text = in_section("2000", "DefaultValue=100", f"DefaultValue={default}")
    (one,) = found(text.replace("HighLimit=500", f"HighLimit={limit}"))
    assert (one.rule, one.object, one.text) == (
        "default-outside-limits", "2000:00", f"2000:00 INTEGER16: DefaultValue {said}",
    )  # fmt: skip


def test_a_default_is_judged_by_its_object_and_by_its_bits() -> None:
    for rule, index, default, finds in (
        ("service-can-id", "1005", "0x00000581", True),
        ("service-can-id", "1005", "0x80000581", True),  # bit 31 has no meaning there
        ("service-can-id", "1014", "0x00000581", True),
        ("service-can-id", "1014", "0x80000581", False),  # EMCY is disabled
        ("fixed-cob-id", "1014", "0x00000081", True),
        ("fixed-cob-id", "1014", "0x80000081", False),
        ("profile-objects", "1000", "0x00020192", True),
        ("profile-objects", "1000", "0x00030191", False),
    ):
        (line,) = (line for line in section(index).splitlines() if line.startswith("DefaultValue="))
        text = in_section(index, line, f"DefaultValue={default}")
        assert objects_of(rule, text) == [f"{index}:00"] * finds, (rule, index, default)


def test_an_io_module_has_an_input_or_an_output() -> None:
    text = SOUND
    for index in re.findall(r"(?m)^\[(6\w{3})\]", SOUND):
        assert objects_of("profile-objects", text) == []
        text = without(index, text)
    assert objects_of("profile-objects", text) == ["1000:00"]


def test_the_sync_counter_overflows_at_2_to_240() -> None:
    for counted, finds in ((0, False), (1, True), (2, False), (240, False), (241, True)):
        text = SOUND + var("1019", "SYNC counter", 5, "rw", str(counted))
        assert objects_of("sync-counter", text) == ["1019:00"] * finds, counted


def test_a_bit_rate_that_the_standard_lacks_is_no_slip_of_the_pen() -> None:
    text = SOUND.replace("BaudRate_125=", "BaudRate_100=1\nBaudRate_125=")
    assert [(one.rule, one.text) for one in found(text)] == [("unknown-key", "BaudRate_100 is not known")]


def test_no_rule_is_asked_twice() -> None:
    names = [rule.name for rule in RULES]
    assert sorted(set(names)) == sorted(names)
