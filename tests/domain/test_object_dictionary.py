from __future__ import annotations

import pytest

from dvtcli.domain.datatypes import U8, U16, U32
from dvtcli.domain.object_dictionary import (
    Access,
    DeviceInfo,
    ObjectDictionary,
    ObjectType,
    OdEntry,
    OdObject,
    normalised,
    standard_default,
)


def variable(index: int, name: str, **more: object) -> OdObject:
    return OdObject(index, name, ObjectType.VAR, {0: OdEntry(index, 0, name, U16, **more)})  # type: ignore[arg-type]


def record(index: int, name: str, *names: str) -> OdObject:
    entries = {sub: OdEntry(index, sub, entry, U8 if sub == 0 else U16) for sub, entry in enumerate(names)}
    return OdObject(index, name, ObjectType.RECORD, entries)


ANALOGUE = record(0x6C01, "Analogue input", "Highest sub-index", "Channel 1", "Channel 2")
COUNTER = record(0x2000, "Counter", "Highest sub-index", "Channel 1")
STATUS = variable(0x6041, "Statusword", line=812)
VELOCITY = variable(0x606C, "Velocity actual value (rpm)")


@pytest.fixture
def dictionary() -> ObjectDictionary:
    objects = {item.index: item for item in (ANALOGUE, STATUS, COUNTER)}
    return ObjectDictionary({**objects, 0x606C: lambda: VELOCITY}, source="drive.eds")


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("Statusword", ["6041:00"]),
        ("statusword", ["6041:00"]),
        ("STATUS word", []),
        ("velocity_actual_value_rpm", ["606C:00"]),
        ("Velocity actual value (rpm)", ["606C:00"]),
        ("velocity-ACTUAL-value--rpm", ["606C:00"]),
        ("Analogue input.Channel 1", ["6C01:01"]),
        ("analogue_input.channel_2", ["6C01:02"]),
        ("channel 1", ["2000:01", "6C01:01"]),
        ("Analogue input", []),
        ("", []),
        ("()", []),
    ],
)
def test_names_are_found_in_any_spelling(dictionary: ObjectDictionary, name: str, found: list[str]) -> None:
    assert [entry.object for entry in dictionary.find(name)] == found


def test_objects_come_in_order_and_are_built_when_looked_at() -> None:
    built: list[int] = []

    def build() -> OdObject:
        built.append(0x606C)
        return VELOCITY

    dictionary = ObjectDictionary({0x606C: build, 0x6041: STATUS})
    assert (list(dictionary), len(dictionary), built) == ([0x6041, 0x606C], 2, [])
    assert dictionary.entry(0x606C, 0) is dictionary[0x606C].entries[0]
    assert built == [0x606C]
    assert dictionary.entry(0x606C, 1) is None
    assert dictionary.entry(0x1234, 0) is None


def test_places_and_shown_names(dictionary: ObjectDictionary) -> None:
    assert dictionary.place(STATUS.entries[0]) == "drive.eds:812"
    assert dictionary.place(VELOCITY.entries[0]) == "drive.eds"
    assert dictionary.display_name(0x6041, 0) == "Statusword"
    assert dictionary.display_name(0x6C01, 1) == "Analogue input.Channel 1"
    assert dictionary.display_name(0x6C01, 9) == ""


def test_what_an_object_is_called_in_this_device_stands_before_its_name_and_finds_it() -> None:
    level = OdEntry(0x2001, 1, "Level", U16, denotation="  Tank\tleft  ")
    tanks = OdObject(0x2001, "Tanks", ObjectType.RECORD, {0: OdEntry(0x2001, 0, "Highest", U8), 1: level})
    again = variable(0x2002, "Level", denotation="Level")
    dictionary = ObjectDictionary({0x2001: tanks, 0x2002: again})
    shown = dictionary.display_name(0x2001, 1)
    assert shown == "Tank left (Tanks.Level)"
    for name in ("tank_left", "Tank left", "tanks.level", shown):
        assert [entry.object for entry in dictionary.find(name)] == ["2001:01"], name
    assert dictionary.display_name(0x2002, 0) == "Level"
    assert [entry.object for entry in dictionary.find("level")] == ["2001:01", "2002:00"]


def test_the_value_of_a_dcf_wins_and_node_ids_are_added() -> None:
    entry = OdEntry(0x1800, 1, "COB-ID", U32, default=bytes.fromhex("80010040"), default_relative=True)
    assert entry.initial(5) == bytes.fromhex("85010040")
    configured = OdEntry(0x1800, 1, "COB-ID", U32, default=bytes(4), value=bytes.fromhex("01020000"))
    assert configured.initial(5) == bytes.fromhex("01020000")
    assert OdEntry(0x1800, 1, "COB-ID", U32).initial(5) is None


def test_access() -> None:
    assert [access for access in Access if not access.readable] == [Access.WO]
    assert [access for access in Access if not access.writable] == [Access.RO, Access.CONST]


def test_names_keep_letters_with_accents() -> None:
    assert normalised("  Température (°C) ") == "température_c"


@pytest.mark.parametrize(
    ("place", "cob_id"),
    [
        ((0x1005, 0), 0x080), ((0x1012, 0), 0x100), ((0x1014, 0), 0x089), ((0x1200, 1), 0x609), ((0x1200, 2), 0x589),
        ((0x1201, 1), 1 << 31), ((0x12FF, 2), 1 << 31), ((0x1201, 3), None), ((0x1004, 0), None), ((0x1300, 1), None),
    ],
)  # fmt: skip
def test_cob_ids_of_services_are_the_standard_s_where_a_file_tells_none(
    place: tuple[int, int], cob_id: int | None
) -> None:
    assert standard_default(*place, 9) == cob_id
    data = OdEntry(*place, "COB-ID", U32).at_power_on(9)
    assert data == (None if cob_id is None else cob_id.to_bytes(4, "little"))


@pytest.mark.parametrize(("held", "known"), [(0, None), (1, 1), (0xFFFF_FFFE, 0xFFFF_FFFE), (0xFFFF_FFFF, None)])
def test_a_number_of_the_identity_that_nobody_set_is_none(held: int, known: int | None) -> None:
    info = DeviceInfo(vendor_id=held, product_code=held, revision_number=held)
    assert info.identity == dict.fromkeys(("vendor", "product", "revision"), known)
