"""Compact storage: CompactSubObj, its tables of names and values, CompactPDO."""

from __future__ import annotations

from dvtcli.domain.object_dictionary import Access, ObjectType
from dvtcli.files.eds.reader import EdsFile, parse_eds

ARRAY = (
    "[6C01]\nParameterName=Input\nObjectType=8\nDataType=3\nAccessType=ro\nPDOMapping=1\nDefaultValue=7\n"
    "CompactSubObj=3\n"
)
MAPPING = "[1A00]\nParameterName=TPDO 1 mapping\nObjectType=9\nDataType=7\nAccessType=rw\nCompactSubObj=4\n"


def eds(text: str) -> EdsFile:
    return parse_eds(text.encode(), "test.eds")


def rules(file: EdsFile) -> list[tuple[int, str]]:
    return [(finding.line, finding.rule) for finding in file.findings]


def test_compact_array() -> None:
    file = eds(ARRAY)
    entries = file.dictionary[0x6C01].entries
    assert list(entries) == [0, 1, 2, 3]
    assert (entries[0].name, entries[0].access, entries[0].pdo_mapping) == ("NrOfObjects", Access.RO, False)
    assert entries[0].default == b"\3"
    assert [entries[n].name for n in (1, 2, 3)] == ["Input1", "Input2", "Input3"]
    assert {(e.access, e.pdo_mapping, e.default, e.bits) for n, e in entries.items() if n} == {
        (Access.RO, True, b"\7\0", 16)
    }
    assert file.findings == ()


def test_sparse_names_and_values() -> None:
    file = eds(ARRAY + "[6C01Name]\nNrOfEntries=1\n2=Pressure; left\n[6c01VALUE]\nNrOfEntries=2\n1=0xFFFF\n3=5\n")
    entries = file.dictionary[0x6C01].entries
    assert [entries[n].name for n in (1, 2, 3)] == ["Input1", "Pressure; left", "Input3"]
    assert [entries[n].value for n in (1, 2, 3)] == [b"\xff\xff", None, b"\5\0"]
    assert (file.understood, file.findings) == (3, ())


def test_tables_that_do_not_fit() -> None:
    file = eds(ARRAY + "[6C01Value]\nNrOfEntries=1\n4=1\nx=1\n1=70000\n")
    assert rules(file) == [(10, "table-count"), (11, "no-sub-index"), (12, "bad-line"), (13, "bad-value")]


def test_a_section_of_its_own_wins_over_the_compact_one() -> None:
    file = eds(ARRAY + "[6C01sub2]\nParameterName=Special\nDataType=5\nAccessType=rw\n")
    assert [e.name for e in file.dictionary[0x6C01].entries.values()] == ["NrOfObjects", "Input1", "Special", "Input3"]


def test_compact_without_object_type_is_an_array() -> None:
    file = eds(ARRAY.replace("ObjectType=8\n", ""))
    assert file.dictionary[0x6C01].object_type == ObjectType.ARRAY
    assert rules(file) == [(1, "no-object-type")]


def test_compact_mapping_is_not_static_and_counts_what_is_mapped() -> None:
    file = eds(MAPPING + "[1A00Value]\nNrOfEntries=2\n1=0x60410010\n2=0x60640020\n")
    first = file.dictionary[0x1A00].entries[0]
    assert (first.access, first.default) == (Access.RW, b"\2")
    assert file.dictionary[0x1A00].entries[1].value == (0x60410010).to_bytes(4, "little")
    assert eds(MAPPING).dictionary[0x1A00].entries[0].default is None
    assert eds(MAPPING + "DefaultValue=0\n").dictionary[0x1A00].entries[0].default == b"\0"
    assert eds(MAPPING.replace("rw", "ro")).dictionary[0x1A00].entries[0].access is Access.RO


def test_compact_pdos_exist_without_sections() -> None:
    file = eds("[DeviceInfo]\nNrOfRXPDO=1\nNrOfTXPDO=5\nCompactPDO=0x13\n")
    dictionary = file.dictionary
    assert list(dictionary) == [0x1400, 0x1600, *range(0x1800, 0x1805), *range(0x1A00, 0x1A05)]
    assert list(dictionary[0x1801].entries) == [0, 1, 2, 5]
    assert dictionary[0x1801].entries[0].default == b"\5"
    assert dictionary[0x1801].entries[1].initial(3) == (0x283).to_bytes(4, "little")
    assert dictionary[0x1400].entries[1].initial(3) == (0x203).to_bytes(4, "little")
    assert dictionary[0x1804].entries[1].initial(3) == (0x80000000).to_bytes(4, "little")
    assert len(dictionary[0x1A00].entries) == 65
    assert (dictionary[0x1A00].entries[64].bits, dictionary[0x1A00].entries[0].default) == (32, None)
    assert {entry.line for entry in dictionary.entries()} == {4}
    assert rules(file) == [(4, "compact-pdo")]


def test_compact_pdos_fill_up_around_described_ones() -> None:
    described = "[1801]\nParameterName=TPDO 2\nObjectType=9\n[1801sub0]\nParameterName=n\nDataType=5\nAccessType=ro\n"
    file = eds("[DeviceInfo]\nNrOfTXPDO=2\nCompactPDO=0xC3\n" + described)
    assert list(file.dictionary) == [0x1800, 0x1801, 0x1A00, 0x1A01]
    assert list(file.dictionary[0x1801].entries) == [0]
    assert rules(file)[:2] == [(3, "compact-pdo-bits"), (3, "compact-pdo")]


def test_no_compact_pdo_makes_nothing() -> None:
    assert list(eds("[DeviceInfo]\nNrOfTXPDO=2\nCompactPDO=0\n").dictionary) == []


def test_compact_storage_does_not_invent_a_pdo_mapping() -> None:
    file = eds(ARRAY.replace("PDOMapping=1\n", ""))
    assert {entry.pdo_mapping for entry in file.dictionary.entries()} == {None}
