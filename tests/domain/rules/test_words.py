"""What findings say: what was wanted, what there is instead, and what to do next."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.object_dictionary import Access, ObjectDictionary
from dvtcli.domain.pdo import Pdo, PdoMappingEntry
from dvtcli.domain.profile import GENERIC, Severity
from dvtcli.domain.rules import Finding, Proposal, check_pdo
from dvtcli.domain.rules.mapped_object import decimal_hint, missing_object
from dvtcli.domain.rules.raw_write import ParameterWrite, length_findings, parameter_findings, write_findings
from tests.domain.rules.test_edges import RPDO1, TPDO1, proposal
from tests.laws.bench import dictionary

RPDO2 = Pdo.parse("rpdo2")
GENERIC_FILE = dictionary("generic")
STATUSWORD, CONTROLWORD = 0x6041_0010, 0x6040_0010


def mapping(pdo: Pdo, *raw: int, described: ObjectDictionary | None = None) -> Proposal:
    """*pdo* is to map the entries *raw*."""
    asked = proposal(pdo, described=described)
    return replace(asked, want=replace(asked.want, mapping=tuple(PdoMappingEntry.from_raw(one) for one in raw)))


def found(asked: Proposal, rule: str) -> Finding:
    (finding,) = (finding for finding in check_pdo(asked) if finding.rule == rule)
    return finding


def changed(index: int, **attributes: object) -> ObjectDictionary:
    """The generic file, in which the only entry of *index* has other *attributes*."""
    described = GENERIC_FILE[index]
    entries = {0: replace(described.entries[0], **attributes)}  # type: ignore[arg-type]
    return ObjectDictionary({**GENERIC_FILE, index: replace(described, entries=entries)}, GENERIC_FILE.info, "file.eds")


def test_too_many_bits_are_counted_and_the_last_object_is_named() -> None:
    finding = found(mapping(TPDO1, *[STATUSWORD] * 5), "pdo-length")
    assert "would need 80 bits, at most 64 fit" in finding.text
    assert typed(finding.hint) == "16 bits too many: drop 6041:00, or put it into another PDO"


@pytest.mark.parametrize(
    ("raw", "hint"),
    [
        (
            [0x6041_0010, 0x606C_0020, 0x6077_0010, 0x6C01_0110, 0x6C01_0210],
            "32 bits too many: drop 6C01:01 and 6C01:02",
        ),
        ([STATUSWORD] * 4 + [0x6060_0008] * 3, "24 bits too many: drop 6060:00, 6060:00 and 6060:00"),
    ],
)
def test_as_many_objects_are_named_as_must_go(raw: list[int], hint: str) -> None:
    assert typed(found(mapping(TPDO1, *raw), "pdo-length").hint) == f"{hint}, or put them into another PDO"


def test_what_cannot_be_mapped_says_for_what() -> None:
    assert found(mapping(RPDO1, STATUSWORD), "direction").text.endswith("it cannot be an RPDO's target")
    write_only = changed(0x6040, access=Access.WO)
    assert found(mapping(TPDO1, CONTROLWORD, described=write_only), "direction").text.endswith("it cannot feed a TPDO")


def test_an_object_that_is_taken_in_the_other_direction_only_says_in_which() -> None:
    strict = replace(GENERIC, rw_in_tpdo=Severity.ERROR, rw_in_rpdo=Severity.ERROR)
    described = changed(0x6040, access=Access.RW)
    for pdo, where in ((TPDO1, "an RPDO"), (RPDO1, "a TPDO")):
        asked = replace(mapping(pdo, CONTROLWORD, 0x6060_0008, described=described), profile=strict)
        said = [finding.text for finding in check_pdo(asked) if finding.rule == "read-write-object"]
        assert any(text.startswith("6040:00") and text.endswith(f"takes it in {where} only") for text in said)


def test_a_file_that_says_nothing_of_mapping_is_said_to() -> None:
    described = changed(0x6041, pdo_mapping=None)
    silent = ObjectDictionary({0x6041: described[0x6041]}, described.info, "file.eds")
    finding = found(mapping(TPDO1, STATUSWORD, 0x6061_0008, described=silent), "mappable-unknown")
    assert finding.severity is Severity.WARNING
    assert "file.eds does not state whether 6041:00" in finding.text
    assert found(mapping(TPDO1, STATUSWORD, 0x6061_0008, described=described), "mappable").severity is Severity.ERROR


def test_a_missing_sub_index_lists_the_first_dozen_that_there_are() -> None:
    entry = GENERIC_FILE[0x6041].entries[0]
    many = replace(GENERIC_FILE[0x6041], entries={sub: replace(entry, sub_index=sub) for sub in range(20)})
    described = ObjectDictionary({0x6041: many}, GENERIC_FILE.info, "file.eds")
    finding = missing_object(described, "0x1A00:01", 0x6041, 0x50)
    assert finding.text.endswith("has 00, 01, 02, 03, 04, 05, 06, 07, 08, 09, 0A, 0B")


@pytest.mark.parametrize(
    ("sub_index", "hint"),
    [
        (0x12, "sub-indices are hexadecimal: decimal 12 is 6041:0C"),
        (0x05, None),  # the same in both
        (0x1A, None),  # no decimal number
        (0x99, None),  # nor would 99 be there
    ],
)
def test_a_decimal_sub_index_is_recognised(sub_index: int, hint: str | None) -> None:
    entry = GENERIC_FILE[0x6041].entries[0]
    many = replace(GENERIC_FILE[0x6041], entries={sub: replace(entry, sub_index=sub) for sub in range(20)})
    assert decimal_hint(ObjectDictionary({0x6041: many}, GENERIC_FILE.info, "file.eds"), 0x6041, sub_index) == hint


def test_after_a_dummy_the_other_targets_are_looked_at_too() -> None:
    asked = mapping(RPDO1, 0x0005_0008, CONTROLWORD, CONTROLWORD)
    said = [finding.text for finding in check_pdo(asked) if finding.rule == "double-target"]
    assert any("mapped twice (entry 2 and 3)" in text for text in said)
    assert not [one for one in check_pdo(mapping(RPDO1, 0x0005_0008, 0x0005_0008)) if one.rule == "double-target"]


def test_a_raw_write_is_answered_with_the_command_that_does_it_in_order() -> None:
    now = proposal(TPDO1).now
    enabled = now.with_parameters(cob_id=CobId(0x181, rtr_allowed=False))

    def ask(want: object) -> Proposal:
        raise AssertionError("nothing more is asked")

    write = ParameterWrite(0x1800, 1, 0x4000_0191)
    (finding,) = parameter_findings(ask, enabled, write, tuple)  # type: ignore[arg-type]
    assert typed(finding.hint).startswith("`set tpdo1 --cob-id 0x191`")


def test_a_wrong_length_is_counted_and_named() -> None:
    (long,) = length_findings(0x1800, 2, bytes(2))
    assert (long.text, long.abort) == ("0x1800:02 has 1 byte, not 2", 0x0607_0012)
    (short,) = length_findings(0x1800, 1, bytes(3))
    assert (short.text, short.abort) == ("0x1800:01 has 4 bytes, not 3", 0x0607_0013)


def test_a_missing_object_and_a_missing_sub_index_have_hints_of_their_own() -> None:
    (finding,) = write_findings(GENERIC_FILE, 0x5FFF, 0, b"\0")
    assert typed(finding.hint) == "`objects TEXT` searches"
    (finding,) = write_findings(GENERIC_FILE, 0x1018, 0x7F, b"\0")
    assert finding.hint is None


@pytest.mark.parametrize(
    ("can_id", "use"),
    [(0x000, "NMT"), (0x001, "reserved"), (0x07F, "reserved"), (0x77F, "heartbeats"), (0x780, "reserved")],
)
def test_a_restricted_can_id_says_what_it_is_for(can_id: int, use: str) -> None:
    asked = proposal(cob_id=CobId(can_id, rtr_allowed=False))
    assert found(asked, "can-id-restricted").text.endswith(f"is restricted by CiA 301: {use}")
    assert [one.rule for one in check_pdo(asked)] == ["can-id-restricted"]


@pytest.mark.parametrize(
    ("parameter", "sub_index", "largest"),
    [("transmission_type", 2, 0xFF), ("inhibit_time", 3, 0xFFFF), ("event_timer", 5, 0xFFFF),
     ("sync_start_value", 6, 0xFF)],
)  # fmt: skip
def test_what_does_not_fit_its_object_says_what_would(parameter: str, sub_index: int, largest: int) -> None:
    fits = [one.rule for one in check_pdo(proposal(**{parameter: largest}))]
    assert "parameter-range" not in fits
    finding = next(f for f in check_pdo(proposal(**{parameter: largest + 1})) if f.rule == "parameter-range")
    assert f"{largest + 1} does not fit its object (0..{largest} counts)" in finding.text
    assert finding.place == f"0x1800:{sub_index:02X}"


def test_of_a_parameter_that_there_is_not_nothing_else_is_said() -> None:
    asked = proposal(event_timer=0x1_0000)
    now = asked.now.with_parameters(event_timer=None)
    assert [one.rule for one in check_pdo(replace(asked, now=now))] == ["parameter-exists"]


def test_a_multiplexed_pdo_is_named_with_its_count() -> None:
    asked = proposal(event_timer=9)
    finding = found(replace(asked, now=replace(asked.now, mapping=(), mpdo=0xFE)), "mpdo")
    assert finding.place == "0x1A00:00"
    assert "(count 0xFE)" in finding.text


def test_what_is_fixed_says_what_else_there_is() -> None:
    held = GENERIC_FILE[0x1A00]
    for sub_index, hint in (
        (0, "its entries can be written: a profile with `filler`"),
        (1, "this device has a fixed mapping for the PDO"),
    ):
        entries = {**held.entries, sub_index: replace(held.entries[sub_index], access=Access.RO)}
        described = ObjectDictionary({**GENERIC_FILE, 0x1A00: replace(held, entries=entries)}, GENERIC_FILE.info, "x")
        assert hint in typed(found(mapping(TPDO1, 0x6061_0008, described=described), "static-mapping").hint)


def test_dummies_that_a_device_has_are_listed_and_nobody_says_where_nobody_knows() -> None:
    asked = mapping(RPDO1, 0x0005_0008)
    for dummies, have in ((frozenset({6, 2}), "(it has 0002/8, 0006/16)"), (frozenset(), "(it has none)")):
        assert have in found(replace(asked, profile=replace(GENERIC, dummies=dummies)), "dummy-supported").text
    unknown = found(replace(asked, dictionary=None, profile=replace(GENERIC, dummies=None)), "dummy-unknown")
    assert unknown.severity is Severity.WARNING
    assert unknown.text == "no file states whether this device has the dummy 0005:00/8"


@pytest.mark.parametrize(("stated", "refused"), [(None, []), (0, []), (1, []), (8, [3, 1]), (64, [])])
def test_a_granularity_counts_where_it_is_8(stated: int | None, refused: list[int]) -> None:
    described = ObjectDictionary(dict(GENERIC_FILE), replace(GENERIC_FILE.info, granularity=stated), "file.eds")
    asked = mapping(TPDO1, 0x6041_0003, 0x6041_0001, 0x6041_0008, described=described)
    asked = replace(asked, profile=replace(GENERIC, granularity=None, partial_entries=True))
    said = [one.text for one in check_pdo(asked) if one.rule == "granularity"]
    assert said == [f"6041:00/{bits} has {bits} bits; this device maps multiples of 8" for bits in refused]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("inhibit_time", "inhibit time 3276.8 ms (32768 x 100 us) is above 3276.7 ms (32767 x 100 us), the most that"),
        ("event_timer", "event timer 32768 is above 32767, the most that"),
    ],
)
def test_the_longest_time_of_a_family_is_said_in_its_own_units(name: str, text: str) -> None:
    asked = replace(proposal(**{name: 0x8000}), profile=replace(GENERIC, max_time_count=0x7FFF))
    assert found(asked, "parameter-range").text == f"{text} a CiA 301 device takes"


@pytest.mark.parametrize(("entries", "hint"), [(0, "choose another PDO (`pdo --all`)"), (1, "spread the objects")])
def test_too_many_entries_say_where_else_they_fit(entries: int, hint: str) -> None:
    held = GENERIC_FILE[0x1A00]
    few = replace(held, entries={sub: held.entries[sub] for sub in range(entries + 1)})
    described = ObjectDictionary({**GENERIC_FILE, 0x1A00: few}, GENERIC_FILE.info, "x")
    finding = found(mapping(TPDO1, *[STATUSWORD] * (entries + 2), described=described), "entry-count")
    assert typed(finding.hint).startswith(hint)
