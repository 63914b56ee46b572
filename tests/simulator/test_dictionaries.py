"""Dictionaries as real files leave them: static mappings, silent about mappability, insane limits, missing types."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.domain.datatypes import DATA_TYPES, U8, U16, U32, DataType
from dvtcli.domain.object_dictionary import Access, DeviceInfo, ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.family import GENERIC, Family
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.simulator.bench import Aborted, Client

I16, REAL32, TEXT = DATA_TYPES[3], DATA_TYPES[8], DATA_TYPES[9]


def var(
    index: int, data_type: DataType | None, sub_index: int = 0, default: int | None = None, **more: object
) -> OdEntry:
    size = data_type.size if data_type else 4
    data = None if default is None or size is None else default.to_bytes(size, "little")
    entry = OdEntry(index, sub_index, f"object {index:04X}", data_type, default=data)
    return replace(entry, **more)  # type: ignore[arg-type]


def dictionary(*entries: OdEntry, info: DeviceInfo | None = None) -> ObjectDictionary:
    indices = {entry.index for entry in entries}
    objects = {
        index: OdObject(index, "", ObjectType.VAR, {each.sub_index: each for each in entries if each.index == index})
        for index in indices
    }
    return ObjectDictionary(objects, info)


def tpdo(entries: int = 4, count: int = 0, access: Access = Access.RW, sub_0: Access = Access.RW) -> list[OdEntry]:
    return [
        var(0x1800, U8, 0, 2, access=Access.RO),
        var(0x1800, U32, 1, 0x80000181),
        var(0x1800, U8, 2, 255),
        var(0x1A00, U8, 0, count, access=sub_0),
        *(var(0x1A00, U32, sub, 0x60000008, access=access) for sub in range(1, entries + 1)),
    ]


def client(*entries: OdEntry, info: DeviceInfo | None = None, family: Family = GENERIC) -> Client:
    device = StrictDevice(dictionary(*entries, info=info), family, 1)
    device.boot_up()
    return Client.on(device)


def code_of(subject: Client, index: int, sub_index: int, value: int, size: int) -> int:
    """Abort code of a download, 0 where it is accepted."""
    try:
        subject.write(index, sub_index, value, size)
    except Aborted as abort:
        return abort.code
    return 0


INPUT = var(0x6000, U8, access=Access.RO, pdo_mapping=True)


@pytest.mark.parametrize("access", [Access.RO, Access.CONST])
def test_static_entries_and_count(access: Access) -> None:
    static = client(*tpdo(count=1, access=access, sub_0=access), INPUT)
    assert code_of(static, 0x1A00, 0, 0, 1) == 0x06010002
    assert code_of(static, 0x1A00, 1, 0x60000008, 4) == 0x06010002
    assert code_of(static, 0x1800, 1, 0x181, 4) == 0
    partly = client(*tpdo(access=access), INPUT)
    assert code_of(partly, 0x1A00, 0, 1, 1) == 0
    assert code_of(partly, 0x1A00, 1, 0x60000008, 4) == 0x06010002


def test_a_file_without_pdo_mapping_refuses_nothing_for_it() -> None:
    silent = client(*tpdo(), var(0x6000, U8, access=Access.RO), var(0x6200, U8, access=Access.WO))
    assert code_of(silent, 0x1A00, 1, 0x60000008, 4) == 0
    assert code_of(silent, 0x1A00, 1, 0x62000008, 4) == 0x06040041  # a write-only object still cannot be sent


def test_a_file_with_some_pdo_mapping_means_no_where_it_is_silent() -> None:
    assert code_of(client(*tpdo(), INPUT, var(0x6001, U8)), 0x1A00, 1, 0x60010008, 4) == 0x06040041


@pytest.mark.parametrize(("stated", "family", "code"), [
    (8, None, 0x06040041), (1, None, 0), (0, None, 0), (64, None, 0), (None, None, 0), (8, 1, 0), (1, 8, 0x06040041),
])  # fmt: skip
def test_granularity(stated: int | None, family: int | None, code: int) -> None:
    subject = client(*tpdo(), INPUT, info=DeviceInfo(granularity=stated), family=GENERIC._replace(granularity=family))
    assert code_of(subject, 0x1A00, 1, 0x60000004, 4) == code


@pytest.mark.parametrize(("dummies", "code"), [(None, 0), (frozenset({5}), 0), (frozenset({6}), 0x06040041)])
def test_dummies_by_the_file(dummies: frozenset[int] | None, code: int) -> None:
    rpdo = [
        replace(each, index=each.index - 0x400, default=each.default)
        for each in tpdo()
    ]  # fmt: skip
    assert code_of(client(*rpdo, INPUT, info=DeviceInfo(dummies=dummies)), 0x1600, 1, 0x00050008, 4) == code


@pytest.mark.parametrize(
    ("low", "high", "value", "code"),
    [
        (10, 20, 9, 0x06090032),
        (10, 20, 21, 0x06090031),
        (10, 20, 10, 0),
        (20, 10, 65535, 0),  # upside down
        (0, 70000, 65535, 0),  # beyond the type
        (-5, 10, 65535, 0),  # below the type
        (10, None, 9, 0x06090032),
        (None, 10, 11, 0x06090031),
    ],
)
def test_limits_count_only_where_they_are_sane(low: int | None, high: int | None, value: int, code: int) -> None:
    assert code_of(client(var(0x2000, U16, low=low, high=high)), 0x2000, 0, value, 2) == code


def test_limits_may_follow_the_node_id() -> None:
    subject = client(var(0x2000, U32, low=0x180, low_relative=True, high=0x180, high_relative=True))
    assert code_of(subject, 0x2000, 0, 0x181, 4) == 0
    assert code_of(subject, 0x2000, 0, 0x180, 4) == 0x06090032


def test_limits_of_signed_and_real_values() -> None:
    subject = client(var(0x2000, I16, low=-5, high=5), var(0x2001, REAL32, low=-1.0, high=1.5))
    assert code_of(subject, 0x2000, 0, 0xFFFB, 2) == 0
    assert code_of(subject, 0x2000, 0, 0xFFFA, 2) == 0x06090032
    assert code_of(subject, 0x2001, 0, 0x3F800000, 4) == 0
    assert code_of(subject, 0x2001, 0, 0x40000000, 4) == 0x06090031


def test_objects_without_a_default_read_as_zeros_of_their_size() -> None:
    subject = client(var(0x2000, U16), var(0x2001, REAL32), var(0x2002, TEXT), var(0x2003, None))
    assert [subject.read(index) for index in (0x2000, 0x2001, 0x2002, 0x2003)] == [bytes(2), bytes(4), b"", b""]


def test_an_object_of_unknown_type_takes_any_length() -> None:
    subject = client(*tpdo(), var(0x2003, None, pdo_mapping=True))
    assert code_of(subject, 0x2003, 0, 1, 3) == 0
    assert code_of(client(*tpdo(), var(0x2003, None, pdo_mapping=True)), 0x1A00, 1, 0x20030040, 4) == 0


def test_entries_end_where_the_file_or_the_family_ends() -> None:
    assert code_of(client(*tpdo(2), INPUT), 0x1A00, 0, 3, 1) == 0x06040042
    narrow = client(*tpdo(4), INPUT, family=GENERIC._replace(max_entries=2))
    assert code_of(narrow, 0x1A00, 0, 3, 1) == 0x06040042
    assert code_of(narrow, 0x1A00, 3, 0x60000008, 4) == 0x06090011


def test_reserved_sub_index_4_is_there_where_the_file_describes_it() -> None:
    assert client(*tpdo(), var(0x1800, U8, 4, 0)).read(0x1800, 4) == b"\0"
    with pytest.raises(Aborted, match="06090011"):
        client(*tpdo()).read(0x1800, 4)


def test_an_rpdo_of_sub_0_and_1_only_acts_at_once() -> None:
    device = StrictDevice(
        dictionary(
            var(0x1400, U8, 0, 1, access=Access.RO),
            var(0x1400, U32, 1, 0x201),
            var(0x1600, U8, 0, 1),
            var(0x1600, U32, 1, 0x62000008),
            var(0x6200, U8, access=Access.RWW, pdo_mapping=True),
        ),
        GENERIC,
        1,
    )
    device.boot_up()
    device.nmt(1)
    device.services.receive(Frame(0x201, b"\x55"))
    assert device.value(0x6200) == b"\x55"


def test_a_dictionary_without_sync_or_emcy_objects_uses_the_usual_can_ids() -> None:
    device = StrictDevice(dictionary(*tpdo()), GENERIC, 5)
    assert device.services.hears_sync(Frame(0x80, b""))
    assert [frame.can_id for frame in device.services.emergency(0x8210)] == [0x85]
