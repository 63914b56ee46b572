"""What `learn` asks a device, and what it concludes from the answers; the device is a rule about probes here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.datatypes import BOOLEAN, U8, U16, U32, DataType
from dvtcli.domain.learning.conclusions import conclude, highest_time
from dvtcli.domain.learning.probe import Learnt, Probe, ProbeAnswer, ProbedPdo, ProbeWrite, Stand, while_operational
from dvtcli.domain.learning.probe_table import KnownAnswers, next_probes, next_time
from dvtcli.domain.learning.read_dictionary import ReadDevice, described, limit_probes, taken_beyond
from dvtcli.domain.pdo import Direction, Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry

TPDO1 = Pdo.parse("tpdo1")
COB_ID, TYPE, INHIBIT, COUNT = (0x1800, 1), (0x1800, 2), (0x1800, 3), (0x1A00, 0)
BIT, BYTE, WORD = (PdoMappingEntry(0x2000 + bits, 0, bits) for bits in (1, 8, 16))
NO = 0x0800_0020
Rule = Callable[[Probe], bool]


def subject(*fits: PdoMappingEntry, **others: Any) -> ProbedPdo:
    """TPDO1, disabled, with two empty entries, to be probed with the objects *fits*."""
    held = PdoConfig(PdoCommunicationParameter(CobId(0x181, valid=False)), ())
    return ProbedPdo(TPDO1, held, **({"parameters": {}, "entries": (0, 0)} | others), fits=fits)


def answers(asked: ProbedPdo, takes: Rule = lambda _probe: True) -> KnownAnswers:
    """The answers of a device that accepts the probes that it *takes*, and refuses all others."""
    known = KnownAnswers(asked, found := {})
    while probes := next_probes(known):
        for probe in probes:
            found[probe.name] = ProbeAnswer(probe, 0, probe.asked.data) if takes(probe) else ProbeAnswer(probe, NO)
    return known


def number(probe: Probe) -> int:
    return int.from_bytes(probe.asked.data, "little")


def entry(probe: Probe) -> PdoMappingEntry | None:
    """The mapping entry that *probe* asks for, if it does."""
    index, sub_index = probe.asked.place
    return PdoMappingEntry.from_raw(number(probe)) if index == COUNT[0] and sub_index else None


def learnt(known: KnownAnswers) -> dict[str, Learnt]:
    return {value.key: value for value in conclude({Direction.TPDO: known}, 2).profile}


def of_whole(*objects: PdoMappingEntry) -> Rule:
    """Maps whole *objects* only."""
    return lambda probe: entry(probe) in (None, *objects)


def in_steps(bits: int) -> Rule:
    """Maps any part of an object that is a multiple of *bits*."""
    return lambda probe: (mapped := entry(probe)) is None or mapped.bits % bits == 0


@pytest.mark.parametrize(
    ("fits", "takes", "granularity"),
    [
        *(((BYTE, WORD), in_steps(bits), bits) for bits in (1, 2, 4, 8)),
        ((BIT, WORD), of_whole(BIT, WORD), 1),
        ((BYTE, WORD), of_whole(BYTE, WORD), None),
    ],
)
def test_the_granularity_is_the_shortest_length_that_is_mapped_and_unknown_if_only_whole_bytes_are(
    fits: tuple[PdoMappingEntry, ...], takes: Rule, granularity: int | None
) -> None:
    value = learnt(answers(subject(*fits), takes)).get("granularity")
    assert (value and value.value) == granularity


@pytest.mark.parametrize(
    ("taken", "policy"), [({0x8000_0181}, "clear"), ({0xC000_0181}, "set"), ({0x8000_0181, 0xC000_0181}, "keep")]
)
def test_the_rtr_bit_is_what_the_device_takes_and_kept_if_it_takes_both(taken: set[int], policy: str) -> None:
    value = learnt(answers(subject(WORD), lambda probe: probe.asked.place != COB_ID or number(probe) in taken))
    assert value["rtr_bit.tpdo"].value == policy
    assert all(f"<- 0x{word:08X} accepted" in value["rtr_bit.tpdo"].evidence for word in taken if policy == "keep")


@pytest.mark.parametrize("limit", [0xFFFF, 0xFFFE, 0x8000, 0x7FFF, 10_000, 11, 10])
def test_the_highest_time_that_a_device_takes_is_found(limit: int) -> None:
    """In as many probes as 16 bits have, the highest of all and a short time."""
    known = answers(
        subject(WORD, parameters={3: b"\0\0"}), lambda probe: probe.asked.place != INHIBIT or number(probe) <= limit
    )
    found = highest_time(known, "inhibit time")
    assert found is not None
    assert (found[0], next_time(known.answers, "inhibit time")) == (limit, None)
    assert len([name for name in known.answers if name.startswith("inhibit time ")]) <= 18


def test_an_entry_that_is_too_short_is_so_by_whole_bytes() -> None:
    """Else a device that maps whole bytes only could refuse it for another reason."""
    asked = entry(answers(subject(BYTE, WORD)).answers["entry-too-short"].probe)
    assert asked == PdoMappingEntry(WORD.index, 0, 8)
    assert "entry-too-short" not in answers(subject(BYTE)).answers


@pytest.mark.parametrize("takes", [True, False])
def test_a_sub_index_of_a_dummy_is_asked_for_if_the_dummy_is_mapped(takes: bool) -> None:
    """CiA 301, 7.4.7: a dummy is mapped by the index of its data type, sub-index 0."""
    known = answers(subject(WORD), lambda probe: takes or (mapped := entry(probe)) is None or not mapped.is_dummy)
    assert ("dummy-sub-index" in known.answers) == takes
    if takes:
        asked = entry(known.answers["dummy-sub-index"].probe)
        assert asked is not None
        assert (asked.sub_index, 1 <= asked.index <= 7) == (1, True)


def test_where_one_object_is_mapped_a_dummy_is_the_other_entry() -> None:
    asked = entry(answers(subject(WORD)).answers["entry-while-counted"].probe)
    assert asked is not None
    assert asked.is_dummy


def test_what_needs_remote_requests_is_asked_with_the_type_that_was_taken_before() -> None:
    known = answers(
        subject(WORD, parameters={2: b"\xff"}), lambda probe: probe.asked.place != TYPE or number(probe) != 253
    )
    assert number(known.answers["type-without-rtr"].probe) == 252


def test_a_missing_object_is_mapped_with_a_length_that_no_device_refuses() -> None:
    (asked,) = (probe for probe in while_operational(subject()) if probe.name.startswith("missing-object"))
    assert entry(asked) == PdoMappingEntry(0x5FFE, 0, 16)


@pytest.mark.parametrize(
    ("limits", "asked"),
    [
        ((1, 240), {"below": 0, "above": 241}),
        ((0, 251), {"above": 254}),
        ((254, 255), {}),
        ((0, 255), {}),
    ],
)
def test_values_beside_limits_are_asked_that_the_type_has_and_that_need_no_remote_request(
    limits: tuple[int, int], asked: dict[str, int]
) -> None:
    one = subject(parameters={2: b"\xff"}, limits={TYPE: limits})
    assert {probe.name.split()[2]: number(probe) for probe in limit_probes(one)} == asked


@pytest.mark.parametrize(
    ("write", "check"),
    [
        (ProbeWrite(*COUNT, b"\x05"), "count-above-limit"),
        (ProbeWrite(0x1A00, 1, bytes(4)), "entry-below-limit"),
        (ProbeWrite(*COB_ID, (0x8000_0181).to_bytes(4, "little")), "cob-id-above-limit"),
        (ProbeWrite(*TYPE, b"\0"), "type-below-limit"),
        (ProbeWrite(*COUNT, b"\x04"), None),
    ],
)
def test_a_value_beyond_a_limit_that_is_taken_is_an_answer_about_it(write: ProbeWrite, check: str | None) -> None:
    limits = {COUNT: (0, 4), (0x1A00, 1): (1, 0xFFFF_FFFF), COB_ID: (0, 0x7FF), TYPE: (1, 240)}
    answer = ProbeAnswer(Probe(TPDO1, "it", "it", Stand.EMPTY, (write,)), 0)
    assert dict(taken_beyond(subject(limits=limits), [answer])) == ({} if check is None else {check: answer})


@pytest.mark.parametrize(
    ("mapped", "read", "kind"),
    [(1, 8, BOOLEAN), (1, None, BOOLEAN), (16, None, U16), (8, 16, U16), (1, 32, U32), (8, 8, U8), (2, 8, U8)],
)
def test_a_mapped_object_is_as_long_as_it_reads_else_as_it_is_mapped(
    mapped: int, read: int | None, kind: DataType
) -> None:
    """A BOOLEAN is mapped as 1 bit, and read as a byte."""
    objects = {Direction.TPDO: [PdoMappingEntry(0x2000, 1, mapped)]}
    lengths = {} if read is None else {(0x2000, 1): read}
    found = described(ReadDevice(1, "", {}, {}, {}, objects, lengths)).entry(0x2000, 1)
    assert found is not None
    assert found.data_type == kind
