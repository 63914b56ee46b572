"""Every oddity of EDS and DCF files that is known to us, each with a small file of our own."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.object_dictionary import Access, ObjectType, OdEntry
from dvtcli.errors import InputFileError
from dvtcli.files.eds.reader import EdsFile, EdsFinding, parse_eds, read_eds

VAR = "[{0}]\nParameterName=Name\nObjectType=7\nDataType={1}\nAccessType=rw\n{2}\n"


def eds(text: str) -> EdsFile:
    return parse_eds(text.encode(), "test.eds")


def one(data_type: int, *lines: str) -> EdsFile:
    """A file of one object 2000 of *data_type*, with *lines* from line 6 on."""
    return eds(VAR.format("2000", data_type, "\n".join(lines)))


def entry(file: EdsFile, index: int = 0x2000, sub_index: int = 0) -> OdEntry:
    found = file.dictionary.entry(index, sub_index)
    assert found is not None
    return found


def found(file: EdsFile, rule: str) -> list[EdsFinding]:
    return [finding for finding in file.findings if finding.rule == rule]


def lines(file: EdsFile, rule: str) -> list[int]:
    return [finding.line for finding in found(file, rule)]


def test_a_plain_file_has_no_findings(tmp_path: Path) -> None:
    path = tmp_path / "plain.eds"
    path.write_text(
        "[DeviceInfo]\nVendorName=Example\nVendorNumber=0x1E\nProductNumber=7\nRevisionNumber=0x10000\nGranularity=8\n"
        "NrOfRXPDO=1\nNrOfTXPDO=2\nBaudRate_125=1\nBaudRate_250=0\nBaudRate_1000=1\n"
        "[DummyUsage]\nDummy0001=0\nDummy0005=1\n[MandatoryObjects]\nSupportedObjects=1\n1=0x2000\n"
        + VAR.format("2000", "0x0006", "PDOMapping=1\nDefaultValue=5\nLowLimit=1\nHighLimit=10\nObjFlags=1\nUnit=mm")
    )
    file = read_eds(path)
    info = file.dictionary.info
    assert file.findings == ()
    assert (info.vendor_name, info.vendor_id, info.product_code, info.revision_number) == ("Example", 0x1E, 7, 0x10000)
    assert (info.granularity, info.rpdo_count, info.tpdo_count, info.node_id) == (8, 1, 2, None)
    assert (info.bit_rates_kbit, info.dummies) == ((125, 1000), frozenset({5}))
    only = entry(file)
    assert (only.name, only.access, only.pdo_mapping, only.default) == ("Name", Access.RW, True, b"\5\0")
    assert (only.low, only.high, only.object_flags, only.unit, only.line) == (1, 10, 1, "mm", 18)
    assert file.dictionary.place(only) == "plain.eds:18"
    assert (file.sections, file.understood) == (4, 4)


# Not an EDS ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "empty"),
        (b"hello\n", "no section"),
        (b"[http]\nport=80\n", "no section"),
        (b"\x7fELF\0\0\0", "binary"),
        (b"<?xml version='1.0'?>", "XML"),
    ],
)
def test_what_is_no_eds_is_refused(data: bytes, why: str) -> None:
    with pytest.raises(InputFileError) as caught:
        parse_eds(data, "x.eds")
    assert caught.value.place == "x.eds:1"
    assert why in (caught.value.why or "")


def test_absurd_size_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "huge.eds"
    with path.open("wb") as file:
        file.truncate((16 << 20) + 1)
    with pytest.raises(InputFileError, match="larger than 16 MiB"):
        read_eds(path)


def test_a_missing_file_is_the_callers_business(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_eds(tmp_path / "none.eds")


# Sections -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["2201sub0A", "2201SUB0A", "2201subA", "2201Suba"])
def test_sub_index_sections_in_any_spelling(name: str) -> None:
    file = eds(f"[2201]\nParameterName=R\nObjectType=9\n[{name}]\nParameterName=S\nDataType=5\nAccessType=ro\n")
    assert entry(file, 0x2201, 10).name == "S"
    assert file.understood == file.sections == 2


def test_sections_and_keys_in_any_case() -> None:
    file = eds("[DEVICEINFO]\nvendorname=V\n[6C01]\nPARAMETERNAME=P\ndatatype=0X0006\nACCESSTYPE=RO\n")
    assert file.dictionary.info.vendor_name == "V"
    assert (entry(file, 0x6C01).name, entry(file, 0x6C01).access) == ("P", Access.RO)


def test_unknown_sections_are_kept_and_reported_with_their_line() -> None:
    file = eds(
        VAR.format("2000", 5, "") + "[ToolInfos]\nVersion = 1\n[9Name]\n[3000Value]\n1=2\n[2000sub100]\n[2000ſub1]\n"
    )
    assert (file.sections, file.understood) == (6, 1)
    assert lines(file, "section-not-understood") == [7, 9, 10, 12, 13]
    assert {finding.severity for finding in found(file, "section-not-understood")} == {"note"}
    assert file.values("toolinfos")["version"][:3] == ("Version", "1", 8)
    assert file.values("absent") == {}


def test_a_section_that_occurs_twice_is_merged_and_reported() -> None:
    file = eds(VAR.format("2000", 5, "DefaultValue=1") + "[2000]\nDefaultValue=2\nPDOMapping=1\n")
    assert (entry(file).default, entry(file).pdo_mapping) == (b"\2", True)
    assert lines(file, "duplicate-section") == [7]
    assert file.understood == 2


def test_a_device_section_that_occurs_twice_is_reported() -> None:
    file = eds("[DeviceInfo]\nVendorName=a\n[deviceinfo]\nVendorName=b\n")
    assert file.dictionary.info.vendor_name == "b"
    assert lines(file, "duplicate-section") == [3]


def test_sub_index_before_its_object() -> None:
    file = eds(
        "[2000sub1]\nParameterName=S\nDataType=5\nAccessType=rw\n[2000]\nParameterName=R\nObjectType=9\nSubNumber=1\n"
    )
    assert (file.dictionary[0x2000].name, entry(file, 0x2000, 1).line) == ("R", 1)
    assert lines(file, "sub-before-parent") == [1]


def test_sub_index_without_its_object() -> None:
    file = eds("[2000sub1]\nParameterName=S\nDataType=5\nAccessType=rw\n")
    assert (file.dictionary[0x2000].object_type, entry(file, 0x2000, 1).name) == (ObjectType.RECORD, "S")
    assert lines(file, "no-parent") == [1]
    assert file.understood == 1


def test_lists_and_objects_that_do_not_agree() -> None:
    file = eds(
        "[MandatoryObjects]\nSupportedObjects=5\n1=0x2000\n2=0x2001\n3=zzz\n4=0x2000\n" + VAR.format("3000", 5, "")
    )
    assert list(file.dictionary) == [0x3000]
    assert lines(file, "no-section") == [3, 4]
    assert lines(file, "bad-number") == [5]
    assert lines(file, "listed-twice") == [6]
    assert lines(file, "not-listed") == [7]
    assert lines(file, "list-count") == [2]


def test_a_blank_in_supported_objects() -> None:
    file = eds("[MandatoryObjects]\nSupported Objects=1\n1=0x2000\n" + VAR.format("2000", 5, ""))
    assert file.findings == ()


# Device sections ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["DeviceComissioning", "DeviceCommissioning", "devicecomissioning"])
def test_commissioning_in_both_spellings(name: str) -> None:
    file = eds(f"[{name}]\nNodeID=0x10\n[1000]\n")
    assert file.node_id == file.dictionary.info.node_id == 16
    assert file.understood == 2


@pytest.mark.parametrize("node_id", ["0", "128", "255"])
def test_senseless_node_ids(node_id: str) -> None:
    file = eds(f"[DeviceComissioning]\nNodeID={node_id}\n")
    found_by = "no-node-id" if node_id == "255" else "node-id"
    assert (file.node_id, lines(file, found_by)) == (None, [2])


@pytest.mark.parametrize(
    ("section", "dummies"),
    [("", None), ("[DummyUsage]\n", frozenset()), ("[DummyUsage]\nDummy0005=0x1\nDUMMY0001=0;\n", frozenset({5}))],
)
def test_dummy_usage_absent_and_partial(section: str, dummies: frozenset[int] | None) -> None:
    assert eds(f"[DeviceInfo]\n{section}").dictionary.info.dummies == dummies


def test_identity_comes_from_1018_where_device_info_is_silent() -> None:
    file = eds(
        "[DeviceInfo]\nVendorNumber=\nProductNumber=5\n[1018]\nParameterName=Identity\nObjectType=9\n"
        "[1018sub1]\nDefaultValue=0x1E\n[1018sub2]\nDefaultValue=6\n[1018sub3]\nDefaultValue=1\nParameterValue=2\n"
    )
    info = file.dictionary.info
    assert (info.vendor_id, info.product_code, info.revision_number) == (0x1E, 5, 2)
    assert lines(file, "device-identity") == [3]


def test_malformed_device_numbers_are_reported() -> None:
    file = eds("[DeviceInfo]\nGranularity=eight\nNrOfRXPDO=600\nVendorNumber=010\n")
    assert (file.dictionary.info.granularity, file.dictionary.info.rpdo_count) == (None, None)
    assert file.dictionary.info.vendor_id == 8
    assert (lines(file, "bad-number"), lines(file, "leading-zero")) == ([2, 3], [4])


# Keys of an object --------------------------------------------------------------------------------------------------


def test_missing_keys_are_reported_and_stay_unknown() -> None:
    file = eds("[2000]\n")
    only = entry(file)
    assert (only.name, only.data_type, only.access, only.pdo_mapping) == ("2000", None, Access.RW, None)
    assert {finding.rule for finding in file.findings} == {"no-name", "no-data-type", "access-type"}
    assert {finding.line for finding in file.findings} == {1}


@pytest.mark.parametrize(
    ("place", "name", "access"),
    [
        ("1005", "UNSIGNED32", Access.RW),
        ("1006", "UNSIGNED32", Access.RW),
        ("1008", "VISIBLE_STRING", Access.CONST),
        ("1010sub1", "UNSIGNED32", Access.RW),
        ("1016sub0", "UNSIGNED8", Access.CONST),
        ("1017", "UNSIGNED16", Access.RW),
        ("1018sub4", "UNSIGNED32", Access.RO),
        ("1019", "UNSIGNED8", Access.RW),
        ("1200sub1", "UNSIGNED32", Access.RW),
        ("1400sub1", "UNSIGNED32", Access.RW),
        ("1800sub3", "UNSIGNED16", Access.RW),
        ("1600sub0", "UNSIGNED8", Access.RW),
        ("1A00sub40", "UNSIGNED32", Access.RW),
    ],
)
def test_what_cia_301_says_where_the_file_is_silent(place: str, name: str, access: Access) -> None:
    index, _, sub_index = place.partition("sub")
    file = eds(f"[{index}]\nParameterName=P\n" + (f"[{place}]\nParameterName=S\n" if sub_index else ""))
    only = entry(file, int(index, 16), int(sub_index or "0", 16))
    assert only.data_type is not None
    assert (only.data_type.name, only.access) == (name, access)
    assert found(file, "implied-data-type")
    assert found(file, "access-type")


def test_sub_index_0_is_unsigned8_where_the_file_is_silent() -> None:
    file = eds("[2000]\nParameterName=A\nObjectType=8\n[2000sub0]\nParameterName=n\nAccessType=ro\nDefaultValue=2\n")
    assert entry(file).default == b"\2"
    assert lines(file, "implied-data-type") == [4]


@pytest.mark.parametrize(("given", "access"), [("RO", "ro"), ("Const", "const"), ("rw ; both", "rw"), ("RWR", "rwr")])
def test_access_types(given: str, access: str) -> None:
    file = eds(f"[2000]\nParameterName=A\nDataType=5\nAccessType={given}\n")
    assert entry(file).access == access
    assert file.findings == ()


@pytest.mark.parametrize(("given", "access"), [("R", "ro"), ("W", "wo"), ("maybe", "rw"), ("", "rw")])
def test_odd_access_types_are_reported(given: str, access: str) -> None:
    file = eds(f"[2000]\nParameterName=A\nDataType=5\nAccessType={given}\n")
    assert (entry(file).access, lines(file, "access-type")) == (access, [4])


@pytest.mark.parametrize(
    ("given", "mapping"), [("0", False), ("1", True), ("0x1", True), ("0;", False), ("1 ; t", True)]
)
def test_pdo_mapping(given: str, mapping: bool) -> None:
    file = one(5, f"PDOMapping={given}")
    assert (entry(file).pdo_mapping, file.findings) == (mapping, ())


def test_malformed_pdo_mapping_is_unknown() -> None:
    file = one(5, "PDOMapping=yes")
    assert (entry(file).pdo_mapping, lines(file, "bad-number")) == (None, [6])


def test_an_unknown_data_type_has_no_length() -> None:
    file = one(0x40, "DefaultValue=1")
    assert (entry(file).data_type, entry(file).bits, entry(file).default) == (None, None, None)
    assert (lines(file, "unknown-data-type"), lines(file, "untyped-value")) == ([4], [6])


def test_a_domain_needs_no_data_type() -> None:
    file = eds("[2000]\nParameterName=Firmware\nObjectType=2\nAccessType=wo\n")
    only = entry(file)
    assert only.data_type is not None
    assert (only.data_type.name, file.dictionary[0x2000].object_type) == ("DOMAIN", ObjectType.DOMAIN)


def test_object_type_is_inferred_from_sub_indices() -> None:
    sub = "[2000sub1]\nParameterName=S\nDataType=5\nAccessType=rw\n"
    silent, wrong = eds("[2000]\nParameterName=R\n" + sub), eds("[2000]\nParameterName=R\nObjectType=7\n" + sub)
    for file, rule, line in ((silent, "no-object-type", 1), (wrong, "sub-indices-of-var", 3)):
        assert file.dictionary[0x2000].object_type == ObjectType.RECORD
        assert list(file.dictionary[0x2000].entries) == [1]
        assert lines(file, rule) == [line]


def test_a_record_without_sub_indices() -> None:
    file = eds("[2000]\nParameterName=R\nObjectType=9\n")
    assert (dict(file.dictionary[0x2000].entries), lines(file, "no-sub-indices")) == ({}, [1])


def test_sub_number_that_does_not_agree() -> None:
    file = eds("[2000]\nParameterName=R\nObjectType=9\nSubNumber=3\n[2000sub1]\nParameterName=S\nDataType=5\n")
    assert lines(file, "sub-number") == [4]


# Values -------------------------------------------------------------------------------------------------------------


def test_values_relative_to_the_node_id() -> None:
    file = one(7, "DefaultValue=0x180+$NODEID", "ParameterValue=$NodeID", "LowLimit=$NODEID+1", "HighLimit=0xFF")
    only = entry(file)
    assert (only.default, only.default_relative) == ((0x180).to_bytes(4, "little"), True)
    assert (only.value, only.value_relative) == (bytes(4), True)
    assert only.initial(5) == b"\5\0\0\0"
    assert only.limits(5) == (6, 255)
    assert file.findings == ()


def test_private_spelling_of_the_node_id_is_remarked() -> None:
    file = one(7, "DefaultValue=$MY_NODE_ID+0x200")
    assert (entry(file).initial(5), lines(file, "odd-value")) == (b"\5\2\0\0", [6])


def test_empty_values_are_one_note() -> None:
    file = eds(VAR.format("2000", 5, "DefaultValue=") + VAR.format("2001", 5, "DefaultValue="))
    assert (entry(file).default, entry(file, 0x2001).default) == (None, None)
    (note,) = file.findings
    assert (note.line, note.severity, note.text[:20]) == (6, "note", "2 empty DefaultValue")


def test_malformed_values_are_reported_one_by_one() -> None:
    file = one(5, "DefaultValue=256", "ParameterValue=many", "LowLimit=-1", "HighLimit=x")
    only = entry(file)
    assert (only.default, only.value, only.low, only.high) == (None, None, None, None)
    assert (lines(file, "bad-value"), lines(file, "limit-type")) == ([6, 7], [8, 9])


def test_signed_values_written_as_unsigned() -> None:
    only = entry(one(3, "DefaultValue=0xFFFF", "LowLimit=0x8000", "HighLimit=0x7FFF"))
    assert (only.default, only.low, only.high) == (b"\xff\xff", -32768, 32767)


def test_limits_that_exclude_everything_are_ignored() -> None:
    for limits, rule in (
        (("LowLimit=0", "HighLimit=0xFFFF"), "limits-wrapped"),
        (("LowLimit=6", "HighLimit=5"), "limits-crossed"),
        (("LowLimit=$NODEID+6", "HighLimit=$NODEID+5"), "limits-crossed"),
    ):
        file = one(3, *limits)
        assert (entry(file).low, entry(file).high, lines(file, rule)) == (None, None, [7])


@pytest.mark.parametrize(
    ("code", "low", "high", "bounds", "ignored"),
    [
        (3, "-32768", "32768", (-32768, None), [7]),
        (3, "", "65535", (None, None), [7]),
        (3, "-5", "65534", (-5, None), [7]),
        (3, "0x8000", "32768", (-32768, None), [7]),
        (3, "32768", "32767", (None, 32767), [6]),
        (3, "0x8000", "0x8000", (-32768, None), [7]),
        (3, "0x8000", "0xFFFF", (-32768, -1), []),
        (3, "0xFF9C", "100", (-100, 100), []),
        (3, "", "0xFFFF", (None, None), [7]),
        (3, "-32768", "0", (-32768, 0), []),
        (4, "-2147483648", "4294967295", (-2147483648, None), [7]),
        (2, "0x00", "0x7F", (0, 127), []),
        (5, "0", "256", (0, None), [7]),
        (5, "-1", "255", (None, 255), [6]),
    ],
)
def test_a_limit_that_its_type_cannot_hold_bounds_nothing(
    code: int, low: str, high: str, bounds: tuple[int | None, int | None], ignored: list[int]
) -> None:
    file = one(code, f"LowLimit={low}", f"HighLimit={high}")
    assert ((entry(file).low, entry(file).high), lines(file, "limit-type")) == (bounds, ignored)


@pytest.mark.parametrize("key", ["DefaultValue", "ParameterValue"])
def test_a_value_beyond_its_type_is_told(key: str) -> None:
    file = one(3, f"{key}=32768")
    assert (entry(file).initial(1), lines(file, "odd-value")) == (b"\x00\x80", [6])
    assert any("32768 is beyond INTEGER16 (-32768..32767); taken as -32768" in one.text for one in file.findings)
    assert lines(one(3, f"{key}=0x8000"), "odd-value") == []
    assert lines(one(3, f"{key}=70000"), "bad-value") == [6]


def test_a_semicolon_belongs_to_a_text() -> None:
    file = one(9, "DefaultValue=a;b", "LowLimit=1")
    assert (entry(file).default, lines(file, "limit-without-sense")) == (b"a;b", [7])
    assert entry(one(5, "DefaultValue=3;b")).default == b"\3"


def test_octal() -> None:
    file = one(5, "DefaultValue=010")
    assert (entry(file).default, lines(file, "leading-zero"), lines(file, "odd-value")) == (b"\x08", [6], [])


def test_octal_beside_the_node_id() -> None:
    file = one(7, "DefaultValue=$NODEID+0200")
    assert (entry(file).initial(5), lines(file, "leading-zero")) == (b"\x85\0\0\0", [6])


def test_a_leading_zero_that_makes_no_octal_number_is_only_odd() -> None:
    file = one(5, "DefaultValue=09", "ObjFlags=08")
    assert (entry(file).default, lines(file, "leading-zero"), lines(file, "odd-value")) == (b"\x09", [], [6, 7])


def test_a_text_that_its_type_cannot_hold_is_reported() -> None:
    file = one(9, "DefaultValue=5 Ω")
    assert lines(file, "bad-value") == [6]
    assert entry(file).default is None
