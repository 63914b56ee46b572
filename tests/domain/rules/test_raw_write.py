"""What the rules say of a `write` to one object, and that the strict device says the same."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.objects import COB_ID_EMCY, COB_ID_SYNC
from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry
from dvtcli.domain.profile import GENERIC
from dvtcli.domain.rules import Proposal
from dvtcli.domain.rules.can_id import service_findings
from dvtcli.domain.rules.raw_write import (
    ParameterWrite,
    length_findings,
    parameter_findings,
    parameter_size,
    with_raw,
    write_findings,
)
from dvtcli.errors import SdoAborted
from tests.laws.bench import NODE, DirectSdo, booted, dictionary

TOO_LONG, TOO_SHORT, RANGE, LOW, HIGH = 0x0607_0012, 0x0607_0013, 0x0609_0030, 0x0609_0032, 0x0609_0031
NO_OBJECT, NO_SUB_INDEX, READ_ONLY, UNSUPPORTED = 0x0602_0000, 0x0609_0011, 0x0601_0002, 0x0601_0000
TPDO1 = Pdo.parse("tpdo1")


def answer(sdo: DirectSdo, index: int, sub_index: int, data: bytes) -> int | None:
    """What the device aborts a write with, None where it takes it."""
    try:
        sdo.download(index, sub_index, data)
    except SdoAborted as aborted:
        return aborted.code
    return None


# By the file ----------------------------------------------------------------------------------------------------


def limited(low: int | None, high: int | None) -> ObjectDictionary:
    """The generic dictionary, whose heartbeat time has limits."""
    described = dictionary("generic")
    time = described[0x1017]
    entries = {0: replace(time.entries[0], low=low, high=high)}
    return ObjectDictionary({**described, 0x1017: replace(time, entries=entries)}, described.info, "limited.eds")


@pytest.mark.parametrize(
    ("place", "data", "found"),
    [
        ((0x5FFF, 0), b"\0", [("object-exists", NO_OBJECT)]),
        ((0x1800, 9), b"\0", [("object-exists", NO_SUB_INDEX)]),
        ((0x1018, 1), bytes(4), [("access", READ_ONLY)]),
        ((0x1017, 0), bytes(3), [("length", TOO_LONG)]),
        ((0x1017, 0), bytes(1), [("length", TOO_SHORT)]),
        ((0x1017, 0), bytes(2), []),
    ],
)
def test_existence_access_and_length(place: tuple[int, int], data: bytes, found: list[tuple[str, int]]) -> None:
    findings = write_findings(dictionary("generic"), *place, data)
    assert [(finding.rule, finding.abort) for finding in findings] == found
    assert {finding.place for finding in findings} <= {f"0x{place[0]:04X}:{place[1]:02X}"}
    assert [answer(DirectSdo(booted()), *place, data)] == ([code for _, code in found] or [None])
    assert write_findings(None, *place, data) == ()


@pytest.mark.parametrize(
    ("value", "low", "high", "code"),
    [
        (9, 10, 500, LOW), (10, 10, 500, None), (500, 10, 500, None), (501, 10, 500, HIGH),
        (9, 10, None, LOW), (10, 10, None, None), (501, None, 500, HIGH), (500, None, 500, None),
        (9, 500, 10, None), (600, 500, 10, None), (0, 7, 7, None), (9, None, None, None),
    ],
)  # fmt: skip
def test_limits(value: int, low: int | None, high: int | None, code: int | None) -> None:
    findings = write_findings(limited(low, high), 0x1017, 0, value.to_bytes(2, "little"))
    assert [finding.abort for finding in findings] == ([] if code is None else [code])


def test_text_and_unknown_types_have_no_length_or_limits() -> None:
    described = dictionary("generic")
    name = described[0x1017]
    unknown = {0: replace(name.entries[0], data_type=None, low=5, high=6)}
    strange = ObjectDictionary({0x1017: replace(name, entries=unknown)}, described.info, "strange.eds")
    assert write_findings(strange, 0x1017, 0, bytes(9)) == ()


# By the standard ------------------------------------------------------------------------------------------------

SIZES = {0: 1, 1: 4, 2: 1, 3: 2, 4: 1, 5: 2, 6: 1, 7: None}


@pytest.mark.parametrize("index", [0x1400, 0x15FF, 0x1800, 0x19FF])
def test_sizes_of_communication_parameters(index: int) -> None:
    assert {sub_index: parameter_size(index, sub_index) for sub_index in SIZES} == SIZES


@pytest.mark.parametrize("index", [0x1600, 0x17FF, 0x1A00, 0x1BFF])
def test_sizes_of_mapping_parameters(index: int) -> None:
    assert [parameter_size(index, sub_index) for sub_index in (0, 1, 8, 64)] == [1, 4, 4, 4]


@pytest.mark.parametrize(
    ("sub_index", "length", "code"),
    [
        (1, 3, TOO_SHORT),
        (1, 4, None),
        (1, 5, TOO_LONG),
        (5, 1, TOO_SHORT),
        (5, 2, None),
        (5, 4, TOO_LONG),
        (7, 9, None),
    ],
)
def test_lengths_without_a_file(sub_index: int, length: int, code: int | None) -> None:
    findings = length_findings(0x1800, sub_index, bytes(length))
    assert [(finding.rule, finding.abort) for finding in findings] == ([] if code is None else [("length", code)])


def test_a_raw_value_becomes_the_parameter_of_its_sub_index() -> None:
    parameter = read_pdo(DirectSdo(booted()), TPDO1).communication
    assert with_raw(parameter, 1, 0xC000_0190) == replace(parameter, cob_id=CobId.from_raw(0xC000_0190))
    for sub_index, name in {2: "transmission_type", 3: "inhibit_time", 5: "event_timer", 6: "sync_start_value"}.items():
        assert with_raw(parameter, sub_index, 9) == replace(parameter, **{name: 9})  # type: ignore[arg-type]
    for sub_index in (0, 4, 7):
        assert with_raw(parameter, sub_index, 9) == parameter


# By the PDO -----------------------------------------------------------------------------------------------------


def found(sdo: DirectSdo, write: ParameterWrite, *entries: PdoMappingEntry) -> list[tuple[str, int | None]]:
    now = read_pdo(sdo, TPDO1)

    def proposal(want: PdoConfig) -> Proposal:
        return Proposal(NODE, TPDO1, now, want, {}, GENERIC, dictionary("generic"))

    findings = parameter_findings(proposal, now, write, lambda: entries)
    twice = [finding.place for finding in findings if finding.rule == "mapped-twice"]
    assert twice == [f"0x1A00:{at:02X}" for at, entry in enumerate(entries, 1) if entry in entries[: at - 1]]
    assert {finding.place for finding in findings} - {*twice} <= {write.place}
    return [(finding.rule, finding.abort) for finding in findings if finding.severity.name == "ERROR"]


OFF, LIVE = "off", "live"
STATUSWORD, VELOCITY = PdoMappingEntry(0x6041, 0, 16), PdoMappingEntry(0x606C, 0, 32)
WRITES: list[tuple[str, int, int, int, list[tuple[str, int]]]] = [
    (LIVE, 0x1800, 1, 0x4000_0190, [("cob-id-while-valid", RANGE)]),
    (LIVE, 0x1800, 1, 0xC000_0181, []),
    (LIVE, 0x1800, 1, 0x4000_0181, []),
    (LIVE, 0x1800, 2, 1, []),
    (LIVE, 0x1800, 2, 245, [("transmission-type", RANGE)]),
    (LIVE, 0x1800, 3, 7, [("frozen-while-valid", RANGE)]),
    (LIVE, 0x1800, 5, 7, []),
    (LIVE, 0x1800, 6, 7, [("frozen-while-valid", RANGE)]),
    (LIVE, 0x1A00, 0, 0, [("mapping-while-valid", UNSUPPORTED)]),
    (LIVE, 0x1A00, 1, STATUSWORD.raw, [("mapping-while-valid", UNSUPPORTED)]),
    (OFF, 0x1800, 1, 0x4000_0190, []),
    (OFF, 0x1800, 1, 0x4000_0601, [("can-id-restricted", RANGE)]),
    (OFF, 0x1800, 3, 7, []),
    (OFF, 0x1800, 6, 7, []),
    (OFF, 0x1A00, 0, 0, []),
    (OFF, 0x1A00, 1, STATUSWORD.raw, [("entry-while-counted", UNSUPPORTED)]),
]


def device(state: str) -> DirectSdo:
    sdo = DirectSdo(booted())
    if state == OFF:
        sdo.download(0x1800, 1, (0xC000_0181).to_bytes(4, "little"))
    return sdo


@pytest.mark.parametrize(("state", "index", "sub_index", "value", "expected"), WRITES)
def test_a_parameter_written_by_hand(
    state: str, index: int, sub_index: int, value: int, expected: list[tuple[str, int]]
) -> None:
    sdo = device(state)
    size = parameter_size(index, sub_index)
    assert size is not None
    assert found(sdo, ParameterWrite(index, sub_index, value)) == expected
    codes = [code for _, code in expected] or [None]
    assert [answer(sdo, index, sub_index, value.to_bytes(size, "little"))] == codes


def test_a_mapping_written_by_hand() -> None:
    sdo = device(OFF)
    sdo.download(0x1A00, 0, b"\0")
    assert found(sdo, ParameterWrite(0x1A00, 1, STATUSWORD.raw)) == []
    assert found(sdo, ParameterWrite(0x1A00, 2, 0x5FFF_0010)) == [("object-exists", NO_OBJECT)]
    assert found(sdo, ParameterWrite(0x1A00, 0, 2), STATUSWORD, VELOCITY) == []
    assert found(sdo, ParameterWrite(0x1A00, 0, 3), STATUSWORD, VELOCITY) == [("entry-count", 0x0604_0042)]
    assert found(sdo, ParameterWrite(0x1A00, 0, 3), VELOCITY, VELOCITY, STATUSWORD) == [("pdo-length", 0x0604_0042)]
    for count in (0xFE, 0xFF):
        assert found(sdo, ParameterWrite(0x1A00, 0, count)) == [("mpdo", 0x0604_0042)]
    assert found(sdo, ParameterWrite(0x1800, 1, 0x4000_0181)) == [("empty-mapping", RANGE)]
    assert found(sdo, ParameterWrite(0x1800, 4, 7)) == []


@pytest.mark.parametrize("index", [0x1400, 0x15FF, 0x1600, 0x17FF, 0x1800, 0x19FF, 0x1A00, 0x1BFF])
def test_the_first_and_last_parameter_of_each_kind(index: int) -> None:
    pdo = Pdo.at(index)
    assert pdo is not None
    now = read_pdo(DirectSdo(booted()), TPDO1)

    def proposal(want: PdoConfig) -> Proposal:
        return Proposal(NODE, pdo, now, want, {}, GENERIC)

    findings = parameter_findings(proposal, now, ParameterWrite(index, 2, 245), tuple)
    expected = "transmission-type" if index == pdo.communication_index else "mapping-while-valid"
    assert (findings[0].rule, findings[0].place) == (expected, f"0x{index:04X}:02")


@pytest.mark.parametrize(
    ("index", "raw", "rules"),
    [
        (COB_ID_EMCY, 0x085, []),
        (COB_ID_EMCY, 0x089, ["can-id-default"]),
        (COB_ID_EMCY, 0x8000_0089, []),
        (COB_ID_EMCY, 0x601, ["can-id-restricted"]),
        (COB_ID_EMCY, 0x2000_0089, []),
        (COB_ID_SYNC, 0x080, []),
        (COB_ID_SYNC, 0x089, []),
        (COB_ID_SYNC, 0x701, ["can-id-restricted"]),
    ],
)
def test_the_cob_id_of_a_service_is_judged_by_whose_it_is(index: int, raw: int, rules: list[str]) -> None:
    assert [found.rule for found in service_findings(5, index, raw)] == rules
