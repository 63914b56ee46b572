"""XDD and XDC files: what they say of a device, what is odd in them, and what is none."""

from __future__ import annotations

from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.datatypes import DATA_TYPES
from dvtcli.domain.object_dictionary import Access, ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.object_scalings import ObjectScalings
from dvtcli.domain.scaling import Scaling
from dvtcli.errors import InputFileError
from dvtcli.files.carried_over import differences
from dvtcli.files.device_file import device_file_bytes, parse_device_file
from dvtcli.files.xdd.xdd_parameters import XDD_RULES
from dvtcli.files.xdd.xdd_reader import XddFile, parse_xdd
from tests.cli.commands.bench import Bench
from tests.real_files import real_files
from tests.small_xdd import COMMISSIONING, OBJECTS, record, variable, xdd


def read(text: str) -> XddFile:
    return parse_xdd(text.encode(), "pump.xdd")


def rules(file: XddFile) -> list[str]:
    return [one.rule for one in file.findings]


@pytest.mark.parametrize("version", ["1.0", "1.1"])
def test_what_a_file_says_of_its_device(version: str) -> None:
    file = read(xdd(namespace=f"http://www.canopen.org/xml/{version}"))
    info = file.dictionary.info
    assert (info.vendor_name, info.product_name, info.vendor_id, info.product_code) == ("Vendor", "Pump", 0x286, 0x457)
    assert (info.granularity, info.rpdo_count, info.tpdo_count, info.bit_rates_kbit) == (8, 1, 1, (500,))
    assert (info.dummies, info.node_id, info.lss_supported, info.boot_up_slave) == (frozenset({5}), None, True, True)
    assert file.findings == ()
    assert file.sections == file.understood == 9 + 13


def test_what_a_file_says_of_an_object() -> None:
    dictionary = read(xdd()).dictionary
    output = dictionary.entry(0x6200, 0)
    assert output is not None
    assert (output.name, output.access, output.pdo_mapping) == ("Output", Access.RWW, True)
    assert (output.value, output.denotation, output.bits) == (b"\x11", "main valve", 8)
    cob_id = dictionary.entry(0x1800, 1)
    assert cob_id is not None
    assert cob_id.initial(5) == (0x185).to_bytes(4, "little")
    assert dictionary[0x1018].object_type == ObjectType.RECORD
    line = xdd().split('index="6200"')[0].count("\n") + 1
    assert dictionary.place(output) == f"pump.xdd:{line}"


def test_global_elements_may_be_in_a_namespace_and_local_ones_in_none() -> None:
    plain = xdd()
    for name in ("DeviceIdentity", "ApplicationProcess", "CANopenObjectList"):
        plain = plain.replace(f"<{name}>", f'<q:{name} xmlns:q="urn:q">').replace(f"</{name}>", f"</q:{name}>")
    assert plain != xdd()
    assert dict(read(plain).dictionary) == dict(read(xdd()).dictionary)


def test_the_place_of_a_node_in_an_xdc() -> None:
    info = read(xdd(commissioning=COMMISSIONING)).dictionary.info
    placed = info.commissioning
    assert (info.node_id, placed.node_name, placed.bit_rate_kbit) == (7, "Pump 7", 500)
    assert (placed.network_number, placed.network_name, placed.is_manager) == (2, "Hall", False)


@pytest.mark.parametrize(
    ("word", "access", "mapped", "as_access"),
    [
        ("no", "rw", False, Access.RW), ("default", "rw", True, Access.RW), ("optional", "rw", True, Access.RW),
        ("TPDO", "rw", True, Access.RWR), ("RPDO", "rw", True, Access.RWW), ("TPDO", "ro", True, Access.RO),
        ("optional", "ro", True, Access.RO), ("RPDO", "wo", True, Access.WO), ("RPDO", "ro", False, Access.RO),
        ("TPDO", "wo", False, Access.WO), ("optional", "const", True, Access.CONST),
    ],
)  # fmt: skip
def test_a_mapping_word_is_a_direction(word: str, access: str, mapped: bool, as_access: Access) -> None:
    file = read(xdd(OBJECTS + variable(0x2000, "x", "0005", access, PDOmapping=word)))
    entry = file.dictionary.entry(0x2000, 0)
    assert entry is not None
    assert (entry.pdo_mapping, entry.access) == (mapped, as_access)
    assert ("mapping-direction" in rules(file)) is ((word, access) in (("RPDO", "ro"), ("TPDO", "wo")))


@pytest.mark.parametrize(
    ("word", "access", "as_access"),
    [("TPDO", "readWriteOutput", Access.RWR), ("RPDO", "readWriteInput", Access.RWW)],
)
def test_the_mapping_word_decides_against_the_direction_of_a_parameter(
    word: str, access: str, as_access: Access
) -> None:
    parameter = PARAMETER.replace("readWriteOutput", access)
    objects = OBJECTS + f'<CANopenObject index="2000" objectType="7" PDOmapping="{word}" uniqueIDRef="U1"/>'
    file = read(xdd(objects, parameter))
    entry = file.dictionary.entry(0x2000, 0)
    assert entry is not None
    assert (entry.pdo_mapping, entry.access) == (True, as_access)
    (finding,) = file.findings
    assert (finding.rule, finding.severity) == ("mapping-direction", "warning")
    assert f"PDOmapping={word}" in finding.text


def test_without_a_mapping_word_it_is_not_known() -> None:
    entry = read(xdd(OBJECTS + variable(0x2000, "x"))).dictionary.entry(0x2000, 0)
    assert entry is not None
    assert entry.pdo_mapping is None


PARAMETER = """<parameter uniqueID="U1" access="readWriteOutput"><label lang="de">Druck</label>
 <label lang="en">Pressure</label><INT/><defaultValue value="-5"/><actualValue value="7"/>
 <denotation><label lang="en">inlet</label></denotation><unit multiplier="1"><label lang="en">bar</label></unit>
 <allowedValues><range><minValue value="-10"/><maxValue value="300"/></range></allowedValues></parameter>"""


def test_an_object_has_what_its_parameter_says() -> None:
    objects = OBJECTS + '<CANopenObject index="2000" objectType="7" PDOmapping="RPDO" uniqueIDRef="U1"/>'
    file = read(xdd(objects, PARAMETER))
    entry = file.dictionary.entry(0x2000, 0)
    assert entry is not None
    assert (entry.name, entry.access, entry.unit, entry.denotation) == ("Pressure", Access.RWW, "bar", "inlet")
    assert (entry.default, entry.value, entry.limits(1)) == (b"\xfb\xff", b"\x07\x00", (-10, 300))
    assert file.findings == ()


def test_its_own_attributes_count_before_the_parameters() -> None:
    own = variable(0x2000, "Own", "0003", "ro", defaultValue="1", lowLimit="0", highLimit="9", uniqueIDRef="U1")
    entry = read(xdd(OBJECTS + own, PARAMETER)).dictionary.entry(0x2000, 0)
    assert entry is not None
    assert (entry.name, entry.access, entry.default, entry.limits(1)) == ("Own", Access.RO, b"\x01\x00", (0, 9))


#: Of each rule of its own a fault, and a word of what is said.
FAULTS = {
    "no-parameter": (variable(0x2000, "x", uniqueIDRef="NOWHERE"), "", "NOWHERE"),
    "parameter-twice": ("", PARAMETER + PARAMETER, "U1"),
    "mapping-word": (variable(0x2000, "x", PDOmapping="sometimes"), "", "sometimes"),
    "mapping-direction": (variable(0x2000, "x", PDOmapping="RPDO"), "", "RPDO"),
    "object-twice": (variable(0x6000, "again"), "", "6000"),
    "no-index": ('<CANopenObject index="xyz" name="x" objectType="7"/>', "", "xyz"),
    "object-lists": ("</CANopenObjectList><CANopenObjectList>", "", "list"),
    "other-namespace": ("", "", "urn:other"),
    "commissioned": ("", "", "fast"),
}


@pytest.mark.parametrize("rule", [rule.name for rule in XDD_RULES])
def test_each_rule_finds_its_fault(rule: str, tmp_path: Path) -> None:
    objects, parameters, said = FAULTS[rule]
    text = xdd(
        OBJECTS + objects,
        parameters,
        namespace="urn:other" if rule == "other-namespace" else "http://www.canopen.org/xml/1.1",
        commissioning='<deviceCommissioning actualBaudRate="fast"/>' if rule == "commissioned" else "",
    )
    (found,) = [one for one in read(text).findings if one.rule == rule]
    assert said in found.text
    assert rule not in rules(read(xdd()))
    path = tmp_path / "pump.xdd"
    path.write_text(text)
    with Bench() as bench:
        ran = bench.run(f"eds check {path} --rule {rule} --json")
    (shown,) = ran.document["findings"]
    assert (shown["rule"], shown["line"]) == (rule, found.line)


def test_the_rules_about_a_device_look_at_an_xdd_too(tmp_path: Path) -> None:
    path = tmp_path / "pump.xdd"
    bad = record(0x1A01, "m", (0, "0005", "rw", 1), (1, "0007", "rw", "0x60000120"))
    path.write_text(xdd(OBJECTS + bad))
    with Bench() as bench:
        ran = bench.run(f"eds check {path} --json")
    found = [(one["rule"], one["object"], one["line"]) for one in ran.document["findings"]]
    line = path.read_text().split('index="1A01"')[0].count("\n") + 1
    assert any(at.startswith("1A01") and line <= where <= line + 2 for _, at, where in found if at), found


BILLION = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]><x>&b;</x>'
OUTSIDE = '<?xml version="1.0"?><!DOCTYPE x SYSTEM "file:///etc/passwd"><x/>'
POWERLINK = xdd(namespace="http://www.ethernet-powerlink.org").replace("CANopenObject", "Object")
POWERLINK_TYPE = xdd().replace("ProfileBody_Device_CANopen", "ProfileBody_Device_Powerlink")


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        (BILLION, "1", "document type"), (OUTSIDE, "1", "document type"),
        (POWERLINK, "2", "Ethernet POWERLINK"), (POWERLINK_TYPE, "2", "Ethernet POWERLINK"),
        ("<EtherCATInfo><Vendor/></EtherCATInfo>", "1", "EtherCAT"),
        ("<html/>", "1", "its first element is html"), ("<a>\n<b></a>", "2:6", "not well-formed XML"),
        ("", "1:1", "not well-formed XML"), ("<a>&nbsp;</a>", "1:4", "not well-formed XML"),
        ('<?xml version="1.0" encoding="klingon"?><a/>', "1", "klingon"),
        (xdd().replace("CANopenObjectList", "ObjectList"), "2", "no CANopenObjectList"),
        ("<a>" * 70, "1", "nested"),
    ],
)  # fmt: skip
def test_what_is_none_is_refused_with_its_line(text: str, line: str, said: str) -> None:
    with pytest.raises(InputFileError) as raised:
        read(text)
    assert said in f"{raised.value.text} {raised.value.why}"
    assert (raised.value.place or "").startswith(f"pump.xdd:{line}"), raised.value.place


def test_a_powerlink_file_says_what_would_help() -> None:
    with pytest.raises(InputFileError) as raised:
        read(POWERLINK)
    assert "CANopen variant" in typed(raised.value.hint)


@given(st.binary(max_size=300), st.sampled_from(["", "<a>", "\ufeff", xdd()[:700], xdd()]))
def test_any_bytes_are_read_or_refused(data: bytes, head: str) -> None:
    try:
        dictionary = parse_device_file(head.encode() + data, "pump.xdd").dictionary
    except InputFileError as refused:
        place = refused.place or ""
    else:
        place = f"pump.xdd:{len(dict(dictionary))}"
    assert place.startswith("pump.xdd:")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "iso-8859-1", "windows-1252"])
def test_encodings(encoding: str) -> None:
    named = {"utf-8-sig": "utf-8"}.get(encoding, encoding)
    text = xdd(vendor="Müller").replace('encoding="utf-8"', f'encoding="{named}"')
    assert parse_device_file(text.encode(encoding), "pump.eds").dictionary.info.vendor_name == "Müller"


def test_a_file_is_told_by_its_first_bytes_whatever_it_is_called() -> None:
    assert isinstance(parse_device_file(xdd().encode(), "pump.eds"), XddFile)
    with pytest.raises(InputFileError, match="not well-formed XML"):
        parse_device_file(b"[DeviceInfo]", "pump.xdd")


def test_an_xdd_is_taken_wherever_an_eds_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("pump.xdd").write_text(xdd())
    Path("pump.xdc").write_text(xdd(commissioning=COMMISSIONING))
    Path("net.yaml").write_text(
        "nodes:\n  pump:\n    node_id: 7\n    dcf: pump.xdc\n    tpdo:\n      1: {mapping: [6000]}\n"
    )
    with Bench(("pump.xdd", "pump.xdc")) as bench:
        ran = bench.run("pdo --json")
        assert [row["pdo"] for row in ran.document["pdos"]] == ["tpdo1", "rpdo1"]
        assert ran.document["pdos"][0]["cob_id"] == 0x181
        assert bench.run("read 7:6200 --json").document["value"] == 0x11
        assert bench.run("verify pump.xdd --json").code == 0
        assert bench.run("map rpdo1 6000").code == 1
        assert bench.run("map tpdo1 6000").code == 0
        assert bench.run("plan net.yaml --json").code == 0, "what it holds against its family, and keeps, is no error"
        text = Path("net.yaml").read_text()
        Path("net.yaml").write_text(text + "    rpdo:\n      1: {rtr_allowed: true, transmission: 1}\n")
        ran = bench.run("plan net.yaml --json")
        assert (ran.code, [(one["rule"], one["place"]) for one in ran.document["findings"]]) == (
            1, [("rtr-bit", "0x1400:01")],
        )  # fmt: skip
        Path("net.yaml").write_text(text + "    rpdo:\n      1: {transmission: 1, rtr_allowed: false}\n")
        assert bench.run("plan net.yaml --json").code == 0
    with Bench(("generic@1",), {"eds": "pump.xdd"}) as bench:
        assert bench.run("objects 6200 --json").document["objects"][0]["name"] == "main valve (Output)"
    with Bench() as bench:
        shown = bench.run("eds show pump.xdc --json").document
        assert (shown["objects"], shown["tpdos"], shown["node_id"]) == (9, 1, 7)
        assert bench.run("eds add pump.xdd").code == 0
        assert bench.run("check net.yaml --json").document["schema"].startswith("dvtcli.")
        imported = bench.run("import all.yaml . --json")
        assert [one["node"] for one in imported.document["nodes"]] == [1, 7]


def test_real_files(pytestconfig: pytest.Config) -> None:
    files = real_files(pytestconfig, (".xdd", ".xdc"))
    if not files:
        pytest.skip("--eds-corpus names no XDD or XDC")
    for path in files:
        file = parse_device_file(path.read_bytes(), path.name)
        assert isinstance(file, XddFile)
        assert file.sections == file.understood
        assert [entry for entry in file.dictionary.entries() if entry.data_type is None] == []


def scaled(unit: str = "", more: str = "") -> Scaling:
    """What an object means whose parameter has *more* attributes and *unit*."""
    parameter = f'<parameter uniqueID="U1" access="read"{more}><label lang="en">x</label><INT/>{unit}</parameter>'
    file = read(xdd(OBJECTS + variable(0x2000, "x", "0003", uniqueIDRef="U1"), parameter))
    return ObjectScalings((), dictionary=file.dictionary).of(0x2000, 0)


def unit(multiplier: str, label: str = "V") -> str:
    return f'<unit multiplier="{multiplier}"><label lang="en">{label}</label></unit>'


def test_multiplier_and_offset_are_the_scale() -> None:
    """The engineering value is (value + offset) x multiplier (CiA 311, parameter element)."""
    assert scaled(unit("1")) == Scaling("V")
    assert scaled(unit("0.1")) == scaled(unit("1"), ' multiplier="1e-1"') == Scaling("V", Fraction(1, 10))
    assert scaled(unit("1", "1/256 V")) == Scaling("V", Fraction(1, 256))
    kelvin = scaled(unit("1", "degC"), ' multiplier="0.5" offset="-40"')
    assert kelvin == Scaling("\u00b0C", Fraction(1, 2), Fraction(-20))
    assert kelvin.to_physical(100) == 30
    assert scaled(unit("0.5"), ' offset="3"') == Scaling("V", Fraction(1, 2), Fraction(3, 2))
    assert scaled("", ' multiplier="0.01"') == Scaling("", Fraction(1, 100))


@pytest.mark.parametrize(
    ("unit", "more"),
    [
        (unit("0.1"), ' multiplier="0.1"'),
        (unit("0.1", "0.1 V"), ""),
        (unit("1", "0.1 V"), ' offset="5"'),
        (unit("0,1"), ""),
        (unit("0"), ""),
        (unit("1"), ' offset="five"'),
    ],
)
def test_a_scale_that_may_be_meant_twice_or_is_no_number_stands_behind_the_unit(unit: str, more: str) -> None:
    found = scaled(unit, more)
    assert found.offset == 0
    assert "V (" in found.unit
    assert "multiplier" in found.unit or "offset" in found.unit


@given(st.sampled_from(["", "1/256", "0.1", "-2", "3/8"]), st.sampled_from(["", "-40", "0.5"]), st.booleans())
def test_a_scale_is_the_same_in_the_file_that_is_written(factor: str, offset: str, has_unit: bool) -> None:
    entry = OdEntry(0x2000, 0, "x", DATA_TYPES[3], unit="V" if has_unit else "", factor=factor, offset=offset)
    before = ObjectDictionary({0x2000: OdObject(0x2000, "x", ObjectType.VAR, {0: entry})})
    lost = {name: of_entry(before, name) for name in ("x.xdd", "x.eds")}
    assert lost == {"x.xdd": [], "x.eds": ["offset"] if offset else []}


def of_entry(before: ObjectDictionary, name: str) -> list[str]:
    """What the one object is otherwise once *before* was written to a file called *name*."""
    data = device_file_bytes(before, name, "test", datetime(2026, 1, 1, tzinfo=UTC))
    return [
        one.what for one in differences(before, parse_device_file(data, name).dictionary) if one.place[:4] == "2000"
    ]
