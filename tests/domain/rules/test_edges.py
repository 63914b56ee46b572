"""Rules at their edges: the first and last value of a range, and the one beyond it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import pytest

from dvtcli.device.read_pdos import present_pdos, read_pdo
from dvtcli.domain.cob_id import CobId, taken_by_services
from dvtcli.domain.object_dictionary import Access, ObjectDictionary
from dvtcli.domain.pdo import Direction, Pdo, PdoConfig, PdoMappingEntry
from dvtcli.domain.profile import GENERIC, Severity
from dvtcli.domain.rules import Proposal, check_pdo
from dvtcli.domain.rules.can_id import FREE_POOL, automatic_can_id, default_owner
from dvtcli.domain.rules.mapped_object import is_taken
from tests.laws.bench import NODE, DirectSdo, booted, dictionary

TPDO1, TPDO2, TPDO5, RPDO1 = (Pdo.parse(text) for text in ("tpdo1", "tpdo2", "tpdo5", "rpdo1"))
EMCY_OF_THIS_NODE = 0x080 + NODE


def taken(sync: int, emcy: int | None) -> Callable[[], dict[tuple[int, bool], str]]:
    """What SYNC and EMCY with those COB-IDs take (None: no 0x1014)."""
    return lambda: taken_by_services(NODE, sync, emcy, {})


def held() -> dict[Pdo, PdoConfig]:
    sdo = DirectSdo(booted())
    return {pdo: read_pdo(sdo, pdo) for pdo in present_pdos(sdo, dictionary("generic"))}


def proposal(pdo: Pdo = TPDO1, *, described: ObjectDictionary | None = None, **parameters: object) -> Proposal:
    """*pdo* of a generic device with other communication *parameters*."""
    others = held()
    now = others.pop(pdo)
    want = now.with_parameters(**parameters)  # type: ignore[arg-type]
    return Proposal(NODE, pdo, now, want, others, GENERIC, described or dictionary("generic"))


def rules(asked: Proposal, severity: Severity = Severity.ERROR) -> list[str]:
    return [finding.rule for finding in check_pdo(asked) if finding.severity is severity]


# CAN-IDs --------------------------------------------------------------------------------------------------------

RESTRICTED = [
    0x000, 0x001, 0x07F, 0x101, 0x180, 0x581, 0x5FF, 0x601, 0x67F, 0x6E0, 0x6FF, 0x701, 0x77F, 0x780, 0x7FF,
]  # fmt: skip
#: beside a restricted range, and neither SYNC nor an EMCY
FREE = [0x100, 0x181, 0x580, 0x600, 0x680, 0x6DF, 0x700]


@pytest.mark.parametrize("can_id", RESTRICTED, ids=hex)
def test_the_first_and_last_can_id_of_each_restricted_range(can_id: int) -> None:
    assert rules(proposal(cob_id=CobId(can_id, rtr_allowed=False))) == ["can-id-restricted"]
    assert rules(proposal(cob_id=CobId(can_id, rtr_allowed=False, valid=False))) == []


@pytest.mark.parametrize("can_id", FREE, ids=hex)
def test_the_can_ids_beside_the_restricted_ranges_are_free(can_id: int) -> None:
    assert rules(proposal(cob_id=CobId(can_id, rtr_allowed=False))) == []


@pytest.mark.parametrize("can_id", [0x800, 0x1FFF_FFFF], ids=hex)
def test_a_can_id_beyond_11_bits(can_id: int) -> None:
    assert rules(proposal(cob_id=CobId(can_id, rtr_allowed=False))) == ["can-id-length"]
    assert rules(proposal(cob_id=CobId(can_id, rtr_allowed=False, valid=False))) == ["can-id-length"]


def test_an_extended_can_id_is_never_restricted_nor_a_service() -> None:
    for can_id in (0x000, 0x080, EMCY_OF_THIS_NODE, 0x082, 0x100, 0x6E0):
        asked = proposal(cob_id=CobId(can_id, rtr_allowed=False, extended=True))
        assert (rules(asked), rules(asked, Severity.WARNING), rules(asked, Severity.NOTE)) == ([], [], [])


@pytest.mark.parametrize(
    ("can_id", "severity"),
    [
        (0x080, Severity.ERROR), (EMCY_OF_THIS_NODE, Severity.ERROR), (0x082, Severity.WARNING),
        (0x0FF, Severity.WARNING), (0x100, Severity.WARNING),
    ],
)  # fmt: skip
def test_services_of_this_node_are_errors_and_those_of_others_warnings(can_id: int, severity: Severity) -> None:
    assert rules(proposal(cob_id=CobId(can_id, rtr_allowed=False)), severity) == ["can-id-in-use"]


def test_services_may_have_moved() -> None:
    wanted = CobId(0x690, rtr_allowed=False)
    assert rules(replace(proposal(cob_id=wanted), services=taken(0x690, None))) == ["can-id-in-use"]
    assert rules(replace(proposal(cob_id=wanted), services=taken(0x080, 0x690))) == ["can-id-in-use"]
    moved = replace(
        proposal(cob_id=CobId(EMCY_OF_THIS_NODE, rtr_allowed=False)),
        services=taken(0x080, 0x690),
    )
    assert (rules(moved), rules(moved, Severity.WARNING)) == ([], ["can-id-in-use"])


@pytest.mark.parametrize(
    ("can_id", "owner"),
    [
        (0x180, None), (0x181, ("tpdo1", 1)), (0x1FF, ("tpdo1", 127)), (0x200, None), (0x201, ("rpdo1", 1)),
        (0x481, ("tpdo4", 1)), (0x57F, ("rpdo4", 127)), (0x580, None),
    ],
)  # fmt: skip
def test_whose_default_a_can_id_is(can_id: int, owner: tuple[str, int] | None) -> None:
    found = default_owner(can_id)
    assert found == (None if owner is None else (Pdo.parse(owner[0]), owner[1]))


# --cob-id auto --------------------------------------------------------------------------------------------------


def with_other(asked: Proposal, can_id: int, *, valid: bool = True) -> Proposal:
    """*asked*, where TPDO2 uses *can_id*."""
    other = replace(asked.others[TPDO2].communication, cob_id=CobId(can_id, valid=valid, rtr_allowed=False))
    return replace(asked, others={**asked.others, TPDO2: replace(asked.others[TPDO2], communication=other)})


def test_auto_is_the_default_of_the_pdo() -> None:
    assert automatic_can_id(proposal()) == 0x180 + NODE
    assert automatic_can_id(proposal(RPDO1)) == 0x200 + NODE
    assert automatic_can_id(with_other(proposal(), 0x180 + NODE, valid=False)) == 0x180 + NODE


def test_auto_takes_no_can_id_that_is_in_use() -> None:
    first = 0x680
    assert automatic_can_id(with_other(proposal(), 0x180 + NODE)) == first
    assert automatic_can_id(replace(proposal(), services=taken(0x180 + NODE, None))) == first
    assert automatic_can_id(replace(proposal(), services=taken(0x080, 0x180 + NODE))) == first
    beyond = replace(proposal(), pdo=TPDO5)
    assert automatic_can_id(beyond) == first
    assert automatic_can_id(with_other(beyond, first)) == first + 1
    assert automatic_can_id(with_other(beyond, first, valid=False)) == first
    assert automatic_can_id(replace(with_other(beyond, first), services=taken(first + 1, None))) == first + 2
    assert automatic_can_id(replace(with_other(beyond, first), services=taken(0x080, first + 1))) == first + 2


def test_auto_has_an_end() -> None:
    asked = replace(proposal(), pdo=TPDO5)
    template = asked.others[TPDO2]
    full = {
        Pdo(Direction.TPDO, 10 + number): template.with_parameters(cob_id=CobId(can_id, rtr_allowed=False))
        for number, can_id in enumerate(FREE_POOL)
    }
    assert automatic_can_id(replace(asked, others=full)) is None
    del full[Pdo(Direction.TPDO, 10 + len(FREE_POOL) - 1)]
    assert automatic_can_id(replace(asked, others=full)) == 0x6DF


# Limits and lengths ---------------------------------------------------------------------------------------------


def limited(low: int | None, high: int | None) -> ObjectDictionary:
    """The generic dictionary, whose event timer of TPDO1 has limits."""
    described = dictionary("generic")
    parameter = described[0x1800]
    entries = {**parameter.entries, 5: replace(parameter.entries[5], low=low, high=high)}
    return ObjectDictionary({**described, 0x1800: replace(parameter, entries=entries)}, described.info, "limited.eds")


@pytest.mark.parametrize(
    ("timer_ms", "low", "high", "found"),
    [
        (9, 10, 500, ["parameter-range"]), (10, 10, 500, []), (500, 10, 500, []), (501, 10, 500, ["parameter-range"]),
        (9, 10, None, ["parameter-range"]), (501, None, 500, ["parameter-range"]), (9, 0, 0, []), (9, 500, 10, []),
    ],
)  # fmt: skip
def test_limits_of_the_file(timer_ms: int, low: int | None, high: int | None, found: list[str]) -> None:
    assert rules(proposal(described=limited(low, high), event_timer=timer_ms)) == found


def parameter(sub_index: int, **values: object) -> ObjectDictionary:
    """The generic dictionary with other *values* for a sub-index of TPDO1's communication parameter; none: without."""
    described = dictionary("generic")
    held = described[0x1800]
    entries = {number: entry for number, entry in held.entries.items() if number != sub_index}
    if values:
        entries[sub_index] = replace(held.entries[sub_index], **values)  # type: ignore[arg-type]
    return ObjectDictionary({**described, 0x1800: replace(held, entries=entries)}, described.info, "other.eds")


def test_a_parameter_that_the_file_fixes_or_does_not_know() -> None:
    assert rules(proposal(described=parameter(5, access=Access.RO), event_timer=9)) == ["parameter-static"]
    assert rules(proposal(described=parameter(5), event_timer=9)) == []


@pytest.mark.parametrize(
    ("sub_index", "values", "low", "text"),
    [
        (3, {"inhibit_time": 50}, 60, "inhibit time 5.0 ms (50 x 100 us) is below the limit 6.0 ms (60 x 100 us)"),
        (5, {"event_timer": 50}, 60, "event timer 50 is below the limit 60"),
        (1, {"cob_id": CobId(0x190)}, 0x191, "COB-ID 0x00000190 is below the limit 0x00000191"),
    ],
)
def test_a_limit_is_said_in_the_parameter_s_own_units(
    sub_index: int, values: dict[str, object], low: int, text: str
) -> None:
    (finding, *_) = check_pdo(proposal(described=parameter(sub_index, low=low, high=None), **values))
    assert finding.text.startswith(text)


@pytest.mark.parametrize(
    ("stated", "bits", "found"),
    [
        (8, 12, ["granularity"]), (8, 16, []), (64, 16, []), (64, 12, []), (0, 12, []), (1, 12, []), (None, 12, []),
    ],
)  # fmt: skip
def test_only_1_and_8_are_a_granularity(stated: int | None, bits: int, found: list[str]) -> None:
    generic = dictionary("generic")
    described = ObjectDictionary(dict(generic), replace(generic.info, granularity=stated), "stated.eds")
    asked = proposal(described=described)
    asked = replace(asked, want=replace(asked.want, mapping=(PdoMappingEntry(0x6041, 0, bits),)))
    assert [rule for rule in rules(asked) if rule == "granularity"] == found


# Communication parameters ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "fits"), [("transmission_type", 0xFF), ("inhibit_time", 0xFFFF), ("event_timer", 0xFFFF)]
)
def test_a_value_that_its_object_cannot_hold(name: str, fits: int) -> None:
    assert rules(proposal(**{name: fits})) == []
    assert rules(proposal(**{name: fits + 1}))[0] == "parameter-range"


def test_a_sync_start_value_is_one_byte() -> None:
    for value, found in ((0xFF, []), (0x100, ["parameter-range"])):
        asked = proposal(sync_start_value=value)
        has_one = asked.now.with_parameters(sync_start_value=0)
        assert rules(replace(asked, now=has_one)) == found


def test_type_255_fits() -> None:
    asked = proposal(transmission_type=0xFF)
    other = asked.now.with_parameters(transmission_type=1)
    assert rules(replace(asked, now=other)) == []


def test_every_word_is_a_cob_id() -> None:
    assert rules(proposal(cob_id=CobId.from_raw(0xFFFF_FFFF))) == []


@pytest.mark.parametrize("name", ["inhibit_time", "event_timer"])
def test_the_longest_time_of_a_family(name: str) -> None:
    family = replace(GENERIC, max_time_count=0x7FFF)
    assert rules(replace(proposal(**{name: 0x7FFF}), profile=family)) == []
    assert rules(replace(proposal(**{name: 0x8000}), profile=family)) == ["parameter-range"]
    assert rules(replace(proposal(cob_id=CobId(0x190, rtr_allowed=False)), profile=family)) == []


@pytest.mark.parametrize(
    ("pdo", "fine", "reserved"),
    [(TPDO1, (0, 1, 240, 254, 255), (241, 251)), (RPDO1, (0, 1, 240, 254, 255), (241, 251, 252, 253))],
)
def test_reserved_transmission_types(pdo: Pdo, fine: tuple[int, ...], reserved: tuple[int, ...]) -> None:
    generous = replace(GENERIC, transmission_types=((0, 255),))
    for kind in fine:
        assert rules(replace(proposal(pdo, transmission_type=kind), profile=generous)) == []
    for kind in reserved:
        assert rules(replace(proposal(pdo, transmission_type=kind), profile=generous)) == ["transmission-type"]


@pytest.mark.parametrize("kind", [252, 253])
def test_a_type_that_answers_rtr_needs_rtr(kind: int) -> None:
    assert rules(proposal(transmission_type=kind)) == ["transmission-type"]
    assert rules(proposal(transmission_type=kind, cob_id=CobId(0x181, rtr_allowed=True))) == []


def test_a_parameter_that_the_device_lacks() -> None:
    asked = proposal(sync_start_value=3)
    lacking = asked.now.with_parameters(sync_start_value=None)
    assert rules(replace(asked, now=lacking)) == ["parameter-exists"]
    left_alone = asked.want.with_parameters(sync_start_value=None)
    assert rules(replace(asked, want=left_alone)) == []


# Clashes --------------------------------------------------------------------------------------------------------


def test_a_can_id_of_the_other_frame_format_is_another_one() -> None:
    asked = proposal(cob_id=CobId(0x2A5, rtr_allowed=False))
    assert rules(with_other(asked, 0x2A5)) == ["can-id-clash"]
    assert rules(with_other(asked, 0x2A6)) == []
    off = with_other(asked, 0x2A5, valid=False)
    assert (rules(off), "can-id-default" in rules(off, Severity.NOTE)) == ([], True)
    other = with_other(asked, 0x2A5).others[TPDO2]
    extended = other.with_parameters(cob_id=CobId(0x2A5, extended=True))
    assert rules(replace(asked, others={**asked.others, TPDO2: extended})) == []


def test_another_pdo_s_default_is_noted_unless_it_is_ours_or_said_already() -> None:
    assert rules(proposal(cob_id=CobId(0x180 + NODE)), Severity.NOTE) == []
    assert rules(proposal(cob_id=CobId(0x180 + NODE + 1)), Severity.NOTE) == ["can-id-default"]
    others_default = with_other(proposal(cob_id=CobId(0x280 + NODE)), 0x280 + NODE, valid=False)
    assert rules(others_default, Severity.NOTE) == ["can-id-default"]
    assert rules(with_other(others_default, 0x2A5), Severity.NOTE) == ["can-id-default"]


# Mappings -------------------------------------------------------------------------------------------------------


def mapped(asked: Proposal, *entries: tuple[int, int, int]) -> Proposal:
    """*asked*, which maps nothing now, with these entries."""
    wanted = tuple(PdoMappingEntry(*entry) for entry in entries)
    return replace(asked, now=replace(asked.now, mapping=()), want=replace(asked.want, mapping=wanted))


def described_with(index: int, **values: object) -> ObjectDictionary:
    """The generic dictionary with other *values* for sub-index 0 of *index*."""
    generic = dictionary("generic")
    one = generic[index]
    entries = {**one.entries, 0: replace(one.entries[0], **values)}  # type: ignore[arg-type]
    return ObjectDictionary({**generic, index: replace(one, entries=entries)}, generic.info, "described.eds")


@pytest.mark.parametrize(("bits", "found"), [(8, []), (16, []), (24, ["entry-length"])])
def test_an_entry_is_at_most_as_long_as_its_object(bits: int, found: list[str]) -> None:
    partly = replace(GENERIC, partial_entries=True)
    assert rules(replace(mapped(proposal(), (0x6041, 0, bits)), profile=partly)) == found


def test_a_part_of_an_object_only_where_the_family_defines_it() -> None:
    whole = replace(GENERIC, partial_entries=False)
    assert rules(replace(mapped(proposal(), (0x6041, 0, 16)), profile=whole)) == []
    assert rules(replace(mapped(proposal(), (0x6041, 0, 8)), profile=whole)) == ["entry-length"]


@pytest.mark.parametrize(
    ("access", "tpdo", "rpdo"),
    [
        (Access.RO, [], ["direction"]), (Access.CONST, [], ["direction"]), (Access.RWR, [], ["direction"]),
        (Access.WO, ["direction"], []), (Access.RW, [], []), (Access.RWW, [], []),
    ],
)  # fmt: skip
def test_access_decides_the_direction(access: Access, tpdo: list[str], rpdo: list[str]) -> None:
    described = described_with(0x6041, access=access, pdo_mapping=True)
    lenient = replace(GENERIC, rw_in_tpdo=None, rww_in_tpdo=None, rw_in_rpdo=None)
    for pdo, found in ((TPDO1, tpdo), (RPDO1, rpdo)):
        asked = mapped(proposal(pdo, described=described), (0x6041, 0, 16))
        assert rules(replace(asked, profile=lenient)) == found


@pytest.mark.parametrize("stated", [True, False, None])
@pytest.mark.parametrize("severity", [None, Severity.WARNING, Severity.ERROR])
@pytest.mark.parametrize("silent", [False, True])
def test_what_is_listed_as_mappable_is_what_a_mapping_takes(
    stated: bool | None, severity: Severity | None, silent: bool
) -> None:
    family = replace(GENERIC, rw_in_tpdo=severity, rww_in_tpdo=severity, rw_in_rpdo=severity)
    for access, pdo in product(Access, (TPDO1, RPDO1)):
        described = described_with(0x6041, access=access, pdo_mapping=stated)
        if silent:
            alone = {index: described[index] for index in (0x6041, pdo.mapping_index)}
            bare = {i: replace(o, entries={n: replace(e, pdo_mapping=None) for n, e in o.entries.items()})
                    for i, o in alone.items()}  # fmt: skip
            described = ObjectDictionary(bare, described.info, "silent.eds")
        asked = replace(mapped(proposal(pdo, described=described), (0x6041, 0, 16)), profile=family)
        listed = is_taken(family, described, described[0x6041].entries[0], tpdo=pdo.is_tpdo)
        assert (rules(asked) == []) is listed, (access, pdo)


def test_a_static_mapping_is_said_once_and_only_where_it_changes() -> None:
    fixed = described_with(0x1A00, access=Access.RO)
    assert rules(mapped(proposal(described=fixed), (0x6041, 0, 16))) == ["static-mapping"]
    assert rules(proposal(described=fixed, event_timer=5)) == []
    assert rules(mapped(proposal(described=dictionary("generic")), (0x6041, 0, 16))) == []
    unknown = replace(mapped(proposal(), (0x6041, 0, 16)), dictionary=None)
    assert rules(unknown) == []
    assert rules(unknown, Severity.NOTE) == ["no-dictionary"]


def test_a_target_has_one_writer() -> None:
    asked = mapped(proposal(RPDO1), (0x6040, 0, 16))
    rpdo2 = Pdo.parse("rpdo2")
    other = replace(asked.others[rpdo2], mapping=(PdoMappingEntry(0x6040, 0, 16),))
    live = other.with_parameters(cob_id=other.communication.cob_id.enabled())
    off = other.disabled()
    assert "double-target" in rules(replace(asked, others={rpdo2: live}), Severity.WARNING)
    assert "double-target" not in rules(replace(asked, others={rpdo2: off}), Severity.WARNING)
    assert "double-target" not in rules(replace(asked, others={TPDO2: live}), Severity.WARNING)
    assert rules(mapped(proposal(RPDO1), (0x6040, 0, 16), (0x6040, 0, 16))) == ["double-target"]


# What is shown and stops nothing, and what is never touched -----------------------------------------------------


def test_the_types_that_a_family_takes_are_said() -> None:
    family = replace(GENERIC, transmission_types=((1, 1), (5, 9)))
    (finding,) = check_pdo(replace(proposal(transmission_type=2), profile=family))
    assert "takes types 1, 5..9, not 2" in finding.text


def test_an_event_timer_is_warned_of_where_the_type_has_none() -> None:
    family = replace(GENERIC, event_timer_types=((254, 255),))

    def warned(**parameters: int) -> list[str]:
        return rules(replace(proposal(**parameters), profile=family), Severity.WARNING)

    assert warned(event_timer=9, transmission_type=1) == ["event-timer"]
    assert warned(event_timer=0, transmission_type=1) == []
    assert warned(event_timer=9, transmission_type=254) == []
    moved = replace(proposal(event_timer=9, transmission_type=1), profile=family)
    same = replace(moved, now=replace(moved.want, mapping=()))
    assert rules(same, Severity.WARNING) == []


@pytest.mark.parametrize("count", [0xFE, 0xFF])
def test_a_multiplexed_pdo_is_left_alone(count: int) -> None:
    asked = proposal()
    multiplexed = replace(asked.now, mapping=(), mpdo=count)
    assert "mpdo" in rules(replace(asked, now=multiplexed))
    assert rules(replace(asked, now=multiplexed, want=multiplexed)) == []


# Counts, fixed entries and advice -------------------------------------------------------------------------------


def test_an_entry_that_the_file_fixes_is_named() -> None:
    generic = dictionary("generic")
    held = generic[0x1A00]
    for sub_index, filler, found in (
        (0, None, ["0x1A00:00"]),
        (1, None, ["0x1A00:01"]),
        (0, 5, []),
        (1, 5, ["0x1A00:01"]),
        (2, None, []),
    ):
        entries = {**held.entries, sub_index: replace(held.entries[sub_index], access=Access.RO)}
        described = ObjectDictionary({**generic, 0x1A00: replace(held, entries=entries)}, generic.info, "fixed.eds")
        asked = replace(mapped(proposal(described=described), (0x6041, 0, 16)), profile=replace(GENERIC, filler=filler))
        findings = [finding for finding in check_pdo(asked) if finding.rule == "static-mapping"]
        assert [finding.place for finding in findings] == found


def test_as_many_entries_as_the_device_takes() -> None:
    bytes_8 = ((0x6061, 0, 8),) * 8
    assert rules(mapped(proposal(), *bytes_8)) == []
    bytes_4 = ((0x6061, 0, 8), (0x6000, 1, 8), (0x6000, 2, 8), (0x1001, 0, 8))
    few = replace(GENERIC, max_entries=3)
    findings = check_pdo(replace(mapped(proposal(), *bytes_4), profile=few))
    assert [(finding.rule, finding.place, finding.abort) for finding in findings] == [
        ("entry-count", "0x1A00:00", 0x0604_0042)
    ]
    assert check_pdo(replace(mapped(proposal(), *bytes_4[:3]), profile=few)) == ()
    room = len(dictionary("generic")[0x1A00].entries) - 1
    (over,) = [f for f in check_pdo(mapped(proposal(), *((0x6061, 0, 1),) * (room + 1))) if f.rule == "entry-count"]
    assert (over.place, over.abort) == (f"0x1A00:{room + 1:02X}", 0x0609_0011)
    assert f"{room + 1} entries were requested, TPDO1 has at most {room}" in over.text


@pytest.mark.parametrize(("bits", "found"), [(64, []), (65, ["pdo-length"])])
def test_as_many_bits_as_a_pdo_holds(bits: int, found: list[str]) -> None:
    family = replace(GENERIC, granularity=1, partial_entries=True)
    asked = mapped(proposal(), (0x606C, 0, 32), (0x606C, 0, 31), (0x6061, 0, bits - 63))
    assert rules(replace(asked, profile=family)) == found


def test_without_a_file_that_is_said_once() -> None:
    asked = replace(mapped(proposal(), (0x6041, 0, 16), (0x606C, 0, 32)), dictionary=None)
    (finding,) = [finding for finding in check_pdo(asked) if finding.severity is Severity.NOTE]
    assert (finding.rule, finding.place) == ("no-dictionary", "0x1A00:00")
    assert finding.text.startswith("no EDS: 6041:00, 606C:00 cannot be checked beforehand")
    assert [
        f
        for f in check_pdo(replace(asked, want=replace(asked.want, mapping=asked.now.mapping)))
        if f.rule == "no-dictionary"
    ] == []


@pytest.mark.parametrize("severity", [Severity.ERROR, Severity.WARNING, Severity.NOTE])
@pytest.mark.parametrize(
    ("field", "pdo", "access"),
    [("rw_in_tpdo", TPDO1, Access.RW), ("rww_in_tpdo", TPDO1, Access.RWW), ("rw_in_rpdo", RPDO1, Access.RW)],
)
def test_what_a_family_says_of_objects_that_the_host_may_write(
    severity: Severity, field: str, pdo: Pdo, access: Access
) -> None:
    lenient = replace(GENERIC, rw_in_tpdo=None, rww_in_tpdo=None, rw_in_rpdo=None)
    described = described_with(0x6041, access=access, pdo_mapping=True)
    asked = replace(mapped(proposal(pdo, described=described), (0x6041, 0, 16)), profile=lenient)
    assert "read-write-object" not in [finding.rule for finding in check_pdo(asked)]
    strict = replace(asked, profile=replace(lenient, **{field: severity}))  # type: ignore[arg-type]
    (finding,) = [finding for finding in check_pdo(strict) if finding.rule == "read-write-object"]
    assert (finding.severity, finding.abort) == (severity, 0x0604_0041 if severity is Severity.ERROR else None)


@pytest.mark.parametrize(
    ("stated", "tells", "found"),
    [(True, True, []), (False, True, ["mappable"]), (None, True, ["mappable"])],
)
def test_only_what_the_file_says_is_mappable(stated: bool | None, tells: bool, found: list[str]) -> None:
    described = described_with(0x6041, pdo_mapping=stated)
    assert described.tells_mappability is tells
    assert rules(mapped(proposal(described=described), (0x6041, 0, 16))) == found


@pytest.mark.parametrize(
    ("word", "found"),
    [
        (0x2000_0040, []),
        (0x606C_0041, [("entry-length", 0x0604_0041)]),
        (0x606C_0000, [("entry-length", 0x0609_0030)]),
        (0x0000_0000, [("entry-length", 0x0604_0041)]),
    ],
)
def test_an_entry_has_1_to_64_bits(word: int, found: list[tuple[str, int]]) -> None:
    asked = replace(mapped(proposal(RPDO1)), dictionary=None)
    entry = PdoMappingEntry.from_raw(word)
    findings = check_pdo(replace(asked, want=replace(asked.want, mapping=(entry,))))
    assert [(finding.rule, finding.abort) for finding in findings if finding.rule == "entry-length"] == found


def test_the_longest_entry_of_a_family() -> None:
    family = replace(GENERIC, max_entry_bits=16)
    assert rules(replace(mapped(proposal(), (0x6041, 0, 16)), profile=family)) == []
    assert rules(replace(mapped(proposal(), (0x606C, 0, 32)), profile=family)) == ["entry-length"]


def test_a_finding_names_the_object_where_its_name_is_known() -> None:
    asked = proposal()
    entry = PdoMappingEntry.from_raw(0x6041_0020)
    asked = replace(asked, want=replace(asked.want, mapping=(entry,)))
    assert '6041:00 "Statusword" has 16 bits, 32 were requested' in [finding.text for finding in check_pdo(asked)]
    nameless = replace(asked, dictionary=None, lengths={(0x6041, 0): 16})
    assert "6041:00 has 16 bits, 32 were requested" in [finding.text for finding in check_pdo(nameless)]
