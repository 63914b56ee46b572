"""Which PDO of each direction is asked, and with what: nothing that anybody needs, and all that can be read of it."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from dvtcli.device.learn.subjects import subjects
from dvtcli.device.node import Node
from dvtcli.domain.datatypes import DATA_TYPES, U8, U16, U32
from dvtcli.domain.learning.probe import ProbedPdo
from dvtcli.domain.object_dictionary import Access, ObjectDictionary, OdEntry, OdObject
from dvtcli.domain.pdo import Direction, Pdo
from dvtcli.domain.rules.can_id import FREE_POOL
from tests.device.test_reading_and_storing import Table, Values
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary

STATUSWORD = (0x6041_0010).to_bytes(4, "little")
OFF, ON = 0x8000_0000, 0


def device_of(*tpdos: tuple[int, int], values: Values | None = None) -> Table:
    """A device with these TPDOs: whether they are off, by bit 31, and how many entries of theirs count; of two each."""
    held: Values = {(0x6041, 0): bytes(2)}
    for number, (off, count) in enumerate(tpdos):
        held |= {(0x1800 + number, sub): b"\xff" * size for sub, size in ((2, 1), (3, 2), (5, 2), (6, 1))}
        held[0x1800 + number, 1] = (0x181 + 0x100 * number | off).to_bytes(4, "little")
        held |= {(0x1A00 + number, sub): STATUSWORD for sub in (1, 2)} | {(0x1A00 + number, 0): bytes([count])}
    return Table(held | (values or {}))


def asked(
    table: Table,
    described: ObjectDictionary | None = None,
    received: Iterable[int] = (),
    neighbours: tuple[Node, ...] = (),
) -> list[ProbedPdo]:
    node = Node(DirectBus(booted(), table), NODE, described, neighbours=lambda: neighbours)
    return subjects(node, node.pdos(), frozenset(received))


def described(*entries: OdEntry) -> ObjectDictionary:
    """A file with these objects, and TPDO1 and RPDO1 whose parameters can be written."""
    own = [
        OdEntry(index, sub, "it", kind, Access.RW)
        for index in (0x1800, 0x1A00, 0x1400, 0x1600)
        for sub, kind in ((0, U8), (1, U32))
    ]
    told = {(entry.index, entry.sub_index): entry for entry in (*own, *entries)}
    objects = {
        index: OdObject(index, "it", 9, {sub: entry for (other, sub), entry in told.items() if other == index})
        for index in {index for index, _ in told}
    }
    return ObjectDictionary(objects, source="it.eds")


@pytest.mark.parametrize(
    ("tpdos", "number"),
    [
        (((OFF, 0),), 1),
        (((OFF, 0), (OFF, 0)), 2),
        (((OFF, 0), (OFF, 1)), 1),
        (((OFF, 2), (OFF, 1)), 2),
        (((ON, 1), (OFF, 2)), 2),
        (((OFF, 2), (ON, 1)), 1),
        (((ON, 1), (ON, 1)), 2),
        (((OFF, 1), (ON, 0)), 1),
        (((ON, 0),), None),
        (((OFF, 3),), None),
        (((OFF, 3), (OFF, 2)), 2),
        (((ON, 1), (OFF, 0xFE)), 1),
    ],
)
def test_one_that_is_off_and_empty_before_others_and_none_that_might_not_go_back(
    tpdos: tuple[tuple[int, int], ...], number: int | None
) -> None:
    found = asked(device_of(*tpdos))
    assert [subject.pdo for subject in found] == ([] if number is None else [Pdo(Direction.TPDO, number)])


@pytest.mark.parametrize(
    ("place", "is_asked"), [((0x1800, 1), False), ((0x1A00, 0), False), ((0x1800, 2), True), ((0x1A00, 1), True)]
)
def test_one_whose_cob_id_or_count_is_read_only_is_not_asked(place: tuple[int, int], is_asked: bool) -> None:
    fixed = OdEntry(*place, "it", None, Access.RO)
    assert bool(asked(device_of((OFF, 0)), described(fixed))) == is_asked


def test_all_that_can_be_read_of_it_is_what_it_may_be_asked_with() -> None:
    entries = {(0x1A00, number): STATUSWORD for number in range(1, 66)}
    (subject,) = asked(device_of((OFF, 0), values=entries))
    assert subject.parameters == {2: b"\xff", 3: b"\xff\xff", 5: b"\xff\xff", 6: b"\xff"}
    assert subject.entries == (0x6041_0010,) * 64
    (subject,) = asked(device_of((OFF, 0)))
    assert subject.entries == (0x6041_0010,) * 2


def test_sub_index_6_of_an_rpdo_is_not_its_own() -> None:
    rpdo = {(0x1400, sub): b"\xff" * size for sub, size in ((2, 1), (3, 2), (5, 2), (6, 1))}
    rpdo |= {(0x1400, 1): (0x8000_0201).to_bytes(4, "little"), (0x1600, 0): b"\0", (0x1600, 1): bytes(4)}
    (subject,) = asked(Table(rpdo))
    assert subject.parameters.keys() == {2, 3, 5}


LAST = FREE_POOL[-1]


def can_id(number: int) -> bytes:
    return number.to_bytes(4, "little")


def test_what_is_used_for_it_nobody_else_uses() -> None:
    """Neither a PDO of this node or another one, nor SYNC, nor EMCY, nor anybody who was heard."""
    (subject,) = asked(device_of((OFF, 0)))
    assert subject.spare == (LAST - 1, LAST)
    there = booted()
    there.set_value(0x1800, 1, can_id(LAST))
    other = Node(DirectBus(there, DirectSdo(there)), NODE, dictionary("generic"))
    values = {(0x1801, 1): can_id(OFF | LAST - 1), (0x1005, 0): can_id(LAST - 2), (0x1014, 0): can_id(LAST - 3)}
    table = device_of((OFF, 0), (ON, 1), values=values)
    (subject,) = asked(table, None, {LAST - 4}, (other,))
    assert subject.spare == (LAST - 6, LAST - 5)


@pytest.mark.parametrize("left", [0, 1, 2, 3])
def test_fewer_than_two_are_none(left: int) -> None:
    (subject,) = asked(device_of((OFF, 0)), None, FREE_POOL[left:])
    assert subject.spare == (tuple(FREE_POOL[left - 2 : left]) if left > 1 else ())


def mappable(index: int, access: Access, kind: object = U16, *, marked: bool = True) -> OdEntry:
    return OdEntry(index, 0, "it", kind, access, marked)  # type: ignore[arg-type]


def test_three_objects_of_each_length_that_may_go_this_way_are_tried_the_shortest_first() -> None:
    names = described(
        mappable(0x1FFF, Access.RO),
        mappable(0x2000, Access.RO, U32),
        *(mappable(index, Access.RO) for index in range(0x2001, 0x2005)),
        *(mappable(index, Access.WO, U8) for index in (0x2010, 0x2011)),
        mappable(0x2020, Access.RO, U8, marked=False),
        mappable(0x2021, Access.RO, U8),
    )
    rpdo = {(0x1400, 1): can_id(OFF | 0x201), (0x1600, 0): b"\0", (0x1600, 1): bytes(4)}
    tpdo, other = asked(device_of((OFF, 0), values=rpdo), names)
    assert [str(fit) for fit in tpdo.fits] == [
        "2021:00/8", "2001:00/16", "2002:00/16", "2003:00/16", "2000:00/32",
    ]  # fmt: skip
    assert [str(fit) for fit in other.fits] == ["2010:00/8", "2011:00/8"]


def test_what_is_mapped_comes_before_what_the_file_names() -> None:
    names = described(mappable(0x2001, Access.RO), mappable(0x6041, Access.RO))
    (subject,) = asked(device_of((ON, 1)), names)
    assert [str(fit) for fit in subject.fits] == ["6041:00/16", "2001:00/16"]


def test_what_goes_this_way_only_comes_before_what_goes_both_ways() -> None:
    """A device that checks access is asked first with what it maps by all means."""
    both = (mappable(index, Access.RW) for index in (0x2001, 0x2002, 0x2003))
    (subject,) = asked(device_of((OFF, 0)), described(*both, mappable(0x2004, Access.RO)))
    assert [str(fit) for fit in subject.fits] == ["2004:00/16", "2001:00/16", "2002:00/16"]


def test_of_each_length_and_kind_the_first_object_stands_for_all() -> None:
    """By access, of the mappable; of those that are not mappable, if their access is for this direction."""
    kinds = (U16, U16, DATA_TYPES[0x03], U32)
    (subject,) = asked(
        device_of((OFF, 0)),
        described(
            *(mappable(index, Access.RO, kind) for index, kind in enumerate(kinds, 0x2001)),
            *(mappable(index, Access.WO, kind) for index, kind in enumerate(kinds, 0x2101)),
            *(mappable(index, Access.RO, kind, marked=False) for index, kind in enumerate(kinds, 0x2201)),
            *(mappable(index, Access.WO, kind, marked=False) for index, kind in enumerate(kinds, 0x2301)),
        ),
    )
    assert {str(access): [str(entry) for entry in entries] for access, entries in subject.by_access.items()} == {
        "ro": ["2001:00/16", "2003:00/16", "2004:00/32"],
        "wo": ["2101:00/16", "2103:00/16", "2104:00/32"],
    }
    assert [str(entry) for entry in subject.unmappable] == ["2201:00/16", "2203:00/16", "2204:00/32"]


@pytest.mark.parametrize(
    ("in_file", "in_device", "absent"),
    [((), (), 0x5FFE), ((0x5FFE,), (), 0x5FFD), ((), (0x5FFE, 0x5FFD), 0x5FFC), ((0x5FFD,), (0x5FFE,), 0x5FFC)],
)
def test_a_missing_object_is_in_neither_file_nor_device(
    in_file: tuple[int, ...], in_device: tuple[int, ...], absent: int
) -> None:
    table = device_of((OFF, 0), values={(index, 0): bytes(2) for index in in_device})
    (subject,) = asked(table, described(*(mappable(index, Access.RO) for index in in_file)))
    assert subject.absent == absent
    if not in_file:
        (subject,) = asked(table)
        assert subject.absent == absent


def test_without_a_file_what_is_not_mappable_is_so_by_the_standard() -> None:
    """A TPDO does not send the vendor-ID, UNSIGNED32, nor does an RPDO set the heartbeat's time, UNSIGNED16."""
    rpdo = {(0x1400, 1): can_id(OFF | 0x201), (0x1600, 0): b"\0", (0x1600, 1): bytes(4)}
    unmappable = [str(entry) for subject in asked(device_of((OFF, 0), values=rpdo)) for entry in subject.unmappable]
    assert unmappable == ["1018:01/32", "1017:00/16"]
