"""Links: every bit that an RPDO hears lies where the TPDO sends it; no CAN-ID is given twice, nor a reserved one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.datatypes import BY_SHORT_NAME
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.links import (
    Linked,
    LinkSide,
    agrees,
    free_can_id,
    linked,
    may_keep,
    receivers,
    slot_for,
    watch_time_ms,
    watched_ms,
)
from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.object_dictionary import DeviceInfo, ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.pdo import (
    MAX_PDO_BITS,
    Pdo,
    PdoCommunicationParameter,
    PdoConfig,
    PdoMappingEntry,
    split_dummy,
    total_bits,
)
from dvtcli.domain.profile import GENERIC, Severity
from dvtcli.domain.rules.can_id import restricted_use
from dvtcli.operations.plans.judge_network import in_keys

SENT, HEARD = 0x2100, 0x2200
OFF = PdoCommunicationParameter(CobId(0x181, valid=False))
ALL_DUMMIES = frozenset(range(1, 8))


def side(node_id: int, pdo: str, words: str, dummies: frozenset[int] = ALL_DUMMIES) -> LinkSide:
    """A PDO that maps objects of the types in *words* (`u16 i32`); a number skips so many bits of 8."""
    base = SENT if pdo.startswith("t") else HEARD
    mapping, objects = [], {}
    for number, word in enumerate(words.split()):
        if word.isdecimal():
            mapping.append(PdoMappingEntry({1: 1, 8: 5, 16: 6, 32: 7}[int(word)], 0, int(word)))
            continue
        kind = BY_SHORT_NAME[word]
        entry = OdEntry(base + number, 0, f"{pdo} {number}", kind, pdo_mapping=True)
        objects[entry.index] = OdObject(entry.index, entry.name, ObjectType.VAR, {0: entry})
        mapping.append(PdoMappingEntry(entry.index, 0, kind.bits or 0))
    dictionary = ObjectDictionary(objects, DeviceInfo(dummies=dummies), f"{pdo}.eds")
    return LinkSide(Endpoint(node_id, Pdo.parse(pdo)), PdoConfig(OFF, tuple(mapping)), GENERIC, dictionary)


def link(sent: str, received: str, dummies: frozenset[int] = ALL_DUMMIES) -> Linked:
    return linked(side(1, "tpdo1", sent), side(5, "rpdo2", received, dummies))


def layout(one: Linked) -> str:
    """The mapping by its own words: the number of a consumer's object, or of skipped bits in brackets."""
    return " ".join(f"({entry.bits})" if entry.is_dummy else str(entry.index - HEARD) for entry in one.mapping)


@pytest.mark.parametrize(
    ("sent", "received", "expected"),
    [
        ("i16 i32 u16", "i16 i32 u16", "0 1 2"),
        ("i16 i32 u16", "i32", "(16) 0 (16)"),
        ("i16 i32 u16", "u16", "(32) (16) 0"),  # by type, which tells the two of 16 bits apart
        ("i16 i32 u16", "u16 i16", "1 (32) 0"),  # in another order, where types leave no doubt
        ("i16 i32 u16", "16 i32 16", "(16) 1 (16)"),
        ("i32 i32", "32 i32", "(32) 1"),
        ("i32 i32", "i32 i32", "0 1"),
        ("bool bool u8", "u8", "(1) (1) 0"),
    ],
)
def test_objects_find_their_places(sent: str, received: str, expected: str) -> None:
    found = link(sent, received)
    assert (layout(found), found.findings) == (expected, ())


@pytest.mark.parametrize(
    ("sent", "received", "rule"),
    [
        ("i32 i32", "i32", "link-place"),
        ("u16 u16 u16", "u16 u16", "link-place"),
        ("i16", "i32", "link-length"),
        ("i16 i16", "i16 i16 i16", "link-length"),
        ("", "i16", "link-producer"),
        ("i16", "", "link-consumer"),
        ("i16", "16", "link-consumer"),
        ("u64 u64", "u64", "link-producer"),
    ],
)
def test_what_is_not_clear_is_refused(sent: str, received: str, rule: str) -> None:
    found = link(sent, received)
    assert [one.rule for one in found.findings] == [rule]
    assert found.mapping == ()
    if rule in ("link-length", "link-place"):
        assert "`mapping:" in typed(in_keys(found.findings[0].hint)), "whoever wrote a file types no command"


@pytest.mark.parametrize(("sent", "received"), [("i32 i32", "i32"), ("u16 u16 u16", "u16 u16"), ("u8 u8 i16", "u8")])
@pytest.mark.parametrize("dummies", [ALL_DUMMIES, frozenset[int]()])
def test_the_hint_of_an_ambiguous_link_makes_the_link(sent: str, received: str, dummies: frozenset[int]) -> None:
    """Each mapping that the hint names is placed without doubt; without dummies, it is the producer's."""
    (found,) = link(sent, received, dummies).findings
    assert isinstance(found.hint, Hint)
    steps = [step for step in found.hint if step.action is Action.MAP]
    assert len(steps) == (2 if dummies else 1)
    for step in steps:
        entries = [made for word in step.arguments["objects"] for made in entries_of(word)]
        sides = side(1, "tpdo1", sent), side(5, "rpdo2", received, dummies)
        mapped = {str(end): replace(end, config=replace(end.config, mapping=tuple(entries))) for end in sides}
        assert str(step.arguments["pdo"]) == ("5:rpdo2" if dummies else "1:tpdo1")
        made = linked(*(mapped[str(end)] if str(end) == str(step.arguments["pdo"]) else end for end in sides))
        assert made.mapping
        assert not any(finding.severity is Severity.ERROR for finding in made.findings)


def drive_side(node_id: int, pdo: str, indices: list[int], dummies: frozenset[int]) -> LinkSide:
    """A PDO of a drive that maps u16 objects at *indices*."""
    entries = {index: OdEntry(index, 0, f"{index:04X}", BY_SHORT_NAME["u16"], pdo_mapping=True) for index in indices}
    objects = {index: OdObject(index, entry.name, ObjectType.VAR, {0: entry}) for index, entry in entries.items()}
    mapping = tuple(PdoMappingEntry(index, 0, 16) for index in indices)
    dictionary = ObjectDictionary(objects, DeviceInfo(dummies=dummies), f"{pdo}.eds")
    return LinkSide(Endpoint(node_id, Pdo.parse(pdo)), PdoConfig(OFF, mapping), GENERIC, dictionary)


@pytest.mark.parametrize("dummies", [ALL_DUMMIES, frozenset[int]()])
@pytest.mark.parametrize("controlword", [0x6040, 0x6840])
@pytest.mark.parametrize("sent", [[0x6041, 0x6077], [0x6077, 0x6078], [0x6077, 0x6041, 0x2100], [0x6040, 0x6077]])
def test_no_hint_leads_a_measured_value_into_a_controlword(
    sent: list[int], controlword: int, dummies: frozenset[int]
) -> None:
    """What the hint maps would be linked at once: a value that is no command would move the drive."""
    sides = drive_side(1, "tpdo1", sent, dummies), drive_side(5, "rpdo2", [controlword], dummies)
    (found,) = linked(*sides).findings
    assert found.rule == "link-place"
    assert isinstance(found.hint, Hint)
    steps = [step for step in found.hint if step.action is Action.MAP]
    assert steps
    for step in steps:
        if "objects" not in step.arguments:
            assert str(step.arguments["pdo"]) == "5:rpdo2"
            continue
        entries = tuple(made for word in step.arguments["objects"] for made in entries_of(word))
        mapped = [
            replace(end, config=replace(end.config, mapping=entries)) if str(step.arguments["pdo"]) == str(end) else end
            for end in sides
        ]
        assert [one.rule for one in linked(*mapped).findings if one.rule == "link-command"] == []


def test_a_controlword_is_offered_last_for_a_value_that_is_no_command() -> None:
    producer = drive_side(1, "tpdo1", [0x6077], ALL_DUMMIES)
    consumer = drive_side(5, "rpdo1", [0x6040, 0x6840, 0x6072], ALL_DUMMIES)
    offered = receivers(producer, producer.config.mapping[0], consumer)
    assert [entry.index for entry in offered] == [0x6072, 0x6040, 0x6840]


def entries_of(word: str) -> tuple[PdoMappingEntry, ...]:
    """The entries of `2100:00/16` or `dummy/16`."""
    place, _, bits = word.partition("/")
    if place == "dummy":
        return split_dummy(int(bits), ALL_DUMMIES)
    index, _, sub_index = place.partition(":")
    return (PdoMappingEntry(int(index, 16), int(sub_index, 16), int(bits)),)


def test_an_rpdo_of_dummies_only_is_called_so() -> None:
    assert [one.text for one in link("i16", "16").findings] == ["5:rpdo2 maps dummies only"]
    assert [one.text for one in link("i16", "").findings] == ["5:rpdo2 maps nothing"]


def test_a_node_does_not_hear_itself() -> None:
    found = linked(side(5, "tpdo1", "u8"), side(5, "rpdo1", "u8"))
    assert [one.rule for one in found.findings] == ["link-self"]


def test_a_multiplexed_or_half_pdo_is_no_side_of_a_link() -> None:
    good = side(1, "tpdo1", "u8")
    for config in (
        PdoConfig(OFF, (), mpdo=0xFE),
        PdoConfig(OFF, good.config.mapping, held_count=2, unread=((0x1A00, 2),)),
    ):
        odd = LinkSide(good.end, config, GENERIC)
        assert [one.rule for one in linked(odd, side(5, "rpdo1", "u8")).findings] == ["link-producer"]


def test_types_that_differ_and_parts_are_said() -> None:
    assert [(one.rule, one.text) for one in link("i16 i32", "u16").findings] == [
        ("link-type", '2200:00 "rpdo2 0" of 5:rpdo2 is u16 and receives 2100:00 "tpdo1 0", i16')
    ]
    found = link("i16 u16", "16 u8 8")
    assert [(one.rule, one.text) for one in found.findings] == [
        ("link-part", '2201:00 "rpdo2 1" of 5:rpdo2 receives 8 of the 16 bits of 2101:00 "tpdo1 1"')
    ]


def test_what_cannot_be_skipped_is_refused() -> None:
    assert layout(link("u32 u8", "u8", frozenset({5}))) == "(8) (8) (8) (8) 0"
    assert [one.rule for one in link("u8 u32", "u8", frozenset()).findings] == ["link-skip"]
    assert [one.rule for one in link("bool u8", "u8", frozenset({5})).findings] == ["link-skip"]


WORDS = st.sampled_from(["bool", "u8", "i8", "u16", "i16", "u32", "i32", "r32", "u64"])


@st.composite
def frames(draw: st.DrawFn) -> tuple[str, str]:
    """What a TPDO sends, up to 64 bits, and what an RPDO wants to hear, with or without dummies."""
    sent = [word for word in draw(st.lists(WORDS, min_size=1, max_size=10))]  # noqa: C416
    sizes = accumulate(BY_SHORT_NAME[word].bits or 0 for word in sent)
    sent = [word for word, end in zip(sent, sizes, strict=True) if end <= MAX_PDO_BITS]
    received = draw(st.lists(st.one_of(st.sampled_from(sent), WORDS, st.sampled_from(["8", "16"])), max_size=6))
    return " ".join(sent), " ".join(received)


def starts(mapping: tuple[PdoMappingEntry, ...]) -> Iterator[tuple[int, PdoMappingEntry]]:
    """Each entry with its first bit."""
    return zip(accumulate((entry.bits for entry in mapping), initial=0), mapping, strict=False)


@given(frames(), st.frozensets(st.integers(1, 7)))
def test_every_bit_that_is_heard_lies_where_it_is_sent(pair: tuple[str, str], dummies: frozenset[int]) -> None:
    producer, consumer = side(1, "tpdo1", pair[0]), side(5, "rpdo2", pair[1], dummies)
    found = linked(producer, consumer)
    if not found.mapping:
        assert len(found.findings) >= 1
        return
    sent, wanted = producer.config.mapping, consumer.config.mapping
    assert total_bits(found.mapping) == total_bits(sent) <= MAX_PDO_BITS
    assert agrees(sent, found.mapping)
    received = [entry for entry in found.mapping if not entry.is_dummy]
    assert sorted(received) == sorted(entry for entry in wanted if not entry.is_dummy)
    if found.mapping != wanted:  # placed by us: whole values only, and only dummies that the device has
        spans = {(start, entry.bits) for start, entry in starts(sent)}
        placed = list(starts(found.mapping))
        assert {(start, entry.bits) for start, entry in placed if not entry.is_dummy} <= spans
        assert {entry.index for _, entry in placed if entry.is_dummy} <= dummies
    assert linked(producer, LinkSide(consumer.end, PdoConfig(OFF, found.mapping), GENERIC)).mapping == found.mapping


@given(st.lists(st.tuples(st.integers(1, 127), st.integers(1, 512)), min_size=1, max_size=60, unique=True))
def test_no_can_id_is_given_twice_and_no_reserved_one(tpdos: list[tuple[int, int]]) -> None:
    used: set[int] = {0x080}
    for node_id, number in tpdos:
        end = Endpoint(node_id, Pdo.parse(f"tpdo{number}"))
        can_id = free_can_id(end, used)
        assert can_id is not None
        assert can_id not in used
        assert restricted_use(can_id) is None
        assert not 0x080 <= can_id <= 0x100
        if number <= 4 and 0x180 + 0x100 * (number - 1) + node_id not in used:
            assert can_id == end.pdo.default_can_id(node_id)
        used.add(can_id)


def test_where_every_can_id_is_in_use_there_is_none() -> None:
    end = Endpoint(1, Pdo.parse("tpdo1"))
    assert free_can_id(end, set(range(0x800)) - {0x6E5, 0x57F}) == 0x57F
    assert free_can_id(end, range(0x800)) is None


@pytest.mark.parametrize(
    ("cob_id", "keeps"),
    [(CobId(0x181), True), (CobId(0), False), (CobId(0x80), False), (CobId(0x601), False), (CobId(0x2A0), False),
     (CobId(0x601, extended=True), True), (CobId(0x801), False)],
)  # fmt: skip
def test_a_can_id_that_may_be_kept(cob_id: CobId, keeps: bool) -> None:
    assert may_keep(cob_id, {0x2A0}) is keeps


def test_a_heartbeat_is_late_after_three() -> None:
    assert (watch_time_ms(100), watch_time_ms(30000), watch_time_ms(0xFFFF)) == (300, 0xFFFF, None)
    slots = {1: 0x0005_0000, 2: 0x0001_012C}
    assert (watched_ms(slots, 1), watched_ms(slots, 5)) == (300, 0)
    assert (slot_for(slots, 1), slot_for(slots, 5), slot_for({1: 0x0001_012C}, 5)) == (2, 1, None)
