"""What a file says of a device comes back from an EDS and from an XDD, and what cannot is said."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.datatypes import DATA_TYPES, DataType, Kind
from dvtcli.domain.object_dictionary import (
    Access,
    Commissioning,
    DeviceInfo,
    ObjectDictionary,
    ObjectType,
    OdEntry,
    OdObject,
)
from dvtcli.files.carried_over import differences
from dvtcli.files.device_file import DEVICE_SUFFIXES, read_device_file
from tests.cli.commands.bench import Bench
from tests.corpus.oddities import ODDITIES, odd_files
from tests.corpus.round_trips import WAYS, round_trip, travelled
from tests.harness.sample import heavy
from tests.house.source import PACKAGE
from tests.real_files import real_files
from tests.small_xdd import COMMISSIONING, OBJECTS, variable, xdd

FAMILIES = sorted(PACKAGE.glob("families/*/*.eds"))


@pytest.mark.parametrize("path", FAMILIES, ids=lambda path: path.stem)
def test_the_files_of_families_lose_nothing(path: Path) -> None:
    trip = round_trip(path)
    assert (trip.wrong, trip.entries > 50) == (0, True), str(trip)


@pytest.mark.drawn(3)
@pytest.mark.parametrize("number", range(len(ODDITIES)))
def test_odd_files_lose_nothing(number: int, tmp_path: Path) -> None:
    file = odd_files(number + 1)[-1]
    trip = round_trip(file.write(tmp_path))
    assert trip.wrong == 0, (str(trip), file.planted)


def test_an_xdc_loses_nothing(tmp_path: Path) -> None:
    path = tmp_path / "pump.xdc"
    path.write_text(xdd(commissioning=COMMISSIONING))
    assert round_trip(path).wrong == 0


def test_real_files_lose_nothing(pytestconfig: pytest.Config) -> None:
    files = real_files(pytestconfig, DEVICE_SUFFIXES)
    if not files:
        pytest.skip("--eds-corpus names no folder")
    assert {path.name: round_trip(path).wrong for path in files} == {path.name: 0 for path in files}


FLAG = st.sampled_from([None, False, True])
TEXT = st.text(
    st.characters(min_codepoint=0x20, max_codepoint=0x2FF, exclude_categories=["C", "Z"], include_characters=" "),
    min_size=1, max_size=12,
).map(str.strip).filter(bool)  # fmt: skip
LATIN = st.text(
    st.characters(min_codepoint=0x21, max_codepoint=0xFF, exclude_categories=["C", "Z"]), min_size=1, max_size=9
)
OF_NUMBERS = (Kind.BOOLEAN, Kind.INTEGER, Kind.UNSIGNED)


@st.composite
def held(draw: st.DrawFn, data_type: DataType) -> tuple[bytes | None, bool]:
    """A value of *data_type*, and whether the node-ID is added; none sometimes."""
    if draw(st.booleans()):
        return None, False
    if data_type.kind in OF_NUMBERS:
        low, high = data_type.limits or (0, 0)
        wanted = draw(st.integers(low, high))
        return data_type.encode(wanted), data_type.kind is not Kind.BOOLEAN and draw(st.booleans())
    if data_type.kind is Kind.REAL:
        size = data_type.size or 4
        return struct.pack("<f" if size == 4 else "<d", draw(st.floats(width=8 * size))), False
    if data_type.kind is Kind.TIME:
        return draw(st.binary(min_size=6, max_size=6)), False
    if data_type.kind is Kind.OCTETS:
        return draw(st.binary(min_size=1, max_size=9)), False
    return data_type.encode(draw(LATIN)), False


@st.composite
def limits(draw: st.DrawFn, data_type: DataType) -> dict[str, Any]:
    if data_type.kind in OF_NUMBERS and data_type.limits is not None:
        numbers: st.SearchStrategy[Any] = st.integers(*data_type.limits)
    elif data_type.kind is Kind.REAL:
        numbers = st.floats(allow_nan=False, allow_infinity=False, width=32)
    else:
        return {}
    low, high = sorted((draw(numbers), draw(numbers)))
    relative = data_type.kind is not Kind.REAL and draw(st.booleans())
    both = {"low": low, "high": high, "low_relative": relative, "high_relative": relative}
    dropped = draw(st.sampled_from(["", "low", "high"]))
    return {key: value for key, value in both.items() if not dropped or not key.startswith(dropped)}


@st.composite
def entries(draw: st.DrawFn, index: int, sub_index: int) -> OdEntry:
    data_type = draw(st.sampled_from(list(DATA_TYPES.values())))
    default, default_relative = draw(held(data_type))
    value, value_relative = draw(held(data_type))
    return OdEntry(
        index, sub_index, draw(TEXT), data_type, draw(st.sampled_from(Access)), draw(FLAG),
        default, default_relative, value, value_relative, unit=draw(TEXT | st.just("")),
        denotation=draw(TEXT | st.just("")), object_flags=draw(st.sampled_from([0, 1, 2, 3, 0x80000000])),
        **draw(limits(data_type)),
    )  # fmt: skip


@st.composite
def objects(draw: st.DrawFn, index: int) -> OdObject:
    if draw(st.booleans()):
        entry = draw(entries(index, 0))
        return OdObject(index, entry.name, ObjectType.VAR, {0: entry})
    subs = sorted(draw(st.sets(st.integers(0, 0xFF), min_size=1, max_size=3)))
    kind = draw(st.sampled_from([ObjectType.ARRAY, ObjectType.RECORD]))
    flags = draw(st.sampled_from([0, 3]))
    return OdObject(index, draw(TEXT), kind, {sub: draw(entries(index, sub)) for sub in subs}, object_flags=flags)


U32 = st.none() | st.integers(0, 0xFFFFFFFF)


@st.composite
def dictionaries(draw: st.DrawFn) -> ObjectDictionary:
    indices = draw(st.sets(st.integers(0x1019, 0xFFFF), min_size=1, max_size=3))
    placed = Commissioning(
        draw(TEXT | st.just("")), draw(st.sampled_from([None, 125, 1000])), draw(U32), draw(TEXT | st.just("")),
        draw(FLAG), draw(U32),
    )  # fmt: skip
    count = st.none() | st.integers(0, 512)
    info = DeviceInfo(
        draw(TEXT | st.just("")), draw(TEXT | st.just("")), draw(U32), draw(U32), draw(U32),
        draw(st.none() | st.integers(0, 255)), draw(count), draw(count), draw(st.none() | st.integers(1, 127)),
        draw(st.sampled_from([(), (10,), (100, 125, 1000)])),
        draw(st.none() | st.frozensets(st.sampled_from([1, 5, 6, 7, 0x1B]))),
        draw(TEXT | st.just("")), draw(FLAG), draw(FLAG), draw(U32), draw(FLAG), draw(FLAG), placed,
    )  # fmt: skip
    return ObjectDictionary({index: draw(objects(index)) for index in indices}, info)


@given(dictionaries(), st.sampled_from(WAYS))
def test_any_dictionary_comes_back(dictionary: ObjectDictionary, way: tuple[str, ...]) -> None:
    assert list(differences(dictionary, travelled(dictionary, way))) == []


def test_what_is_of_one_node_is_named_where_the_format_has_no_place_for_it(tmp_path: Path) -> None:
    source = tmp_path / "pump.xdc"
    source.write_text(xdd(commissioning=COMMISSIONING))
    with Bench() as bench:
        ran = bench.run(f"eds convert {source} {tmp_path}/pump.eds")
        kept = bench.run(f"eds convert {source} {tmp_path}/pump.dcf --json")
    assert ran.code == kept.code == 0
    for what in ("node-ID of the device", "ParameterValue (actualValue) of 6200:00", "denotation of 6200:00"):
        assert f"not carried over: {what}: it is of one node, .dcf holds it" in ran.stdout
    assert kept.document["losses"] == []
    dictionary = read_device_file(tmp_path / "pump.dcf").dictionary
    assert (dictionary.info.node_id, dictionary[0x6200].entries[0].value) == (7, b"\x11")
    assert (tmp_path / "pump.dcf").read_bytes().count(b"\r\n[DeviceComissioning]") == 1


def test_what_no_dictionary_holds_is_named_with_its_number_and_line(tmp_path: Path) -> None:
    eds = tmp_path / "a.eds"
    eds.write_text(
        "; mine\n[DeviceInfo]\nVendorNumber=1\nSpecial=2\n[2000]\nParameterName=x\nDataType=5\nAccessType=rw\n"
        "StorageLocation=RAM\nDefaultValue=300\n[Odd]\na=1\n[Comments]\nLines=1\nLine1=hello\n"
    )
    xml = tmp_path / "b.xdd"
    xml.write_text(
        xdd(OBJECTS + variable(0x2000, "x", PDOmapping="perhaps")).replace("<vendorName>", "<version/><vendorName>")
    )
    with Bench() as bench:
        of_eds = bench.run(f"eds convert {eds} {tmp_path}/c.xdd --json").document["losses"]
        of_xdd = bench.run(f"eds convert {xml} {tmp_path}/d.eds --json").document["losses"]
    assert of_eds[:4] == [
        "2 lines of comment, the first in line 1", "line 11: section [Odd] is not understood",
        "key Special, 1 time, the first in line 4", "key StorageLocation, 1 time, the first in line 9",
    ]  # fmt: skip
    assert any(one.startswith("line 10: DefaultValue=300 is not a valid UNSIGNED8") for one in of_eds)
    assert "element version, 1 time, the first in line 5" in of_xdd
    assert any("PDOmapping=perhaps" in one for one in of_xdd)


@pytest.mark.parametrize(
    ("line", "code", "said"),
    [
        ("eds convert a.xdd", 2, "takes two files"), ("eds convert a.xdd b.txt", 2, "unknown format"),
        ("eds convert none.xdd b.eds", 2, "none.xdd"), ("eds convert a.xdd nowhere/b.eds", 2, "no such folder"),
        ("eds convert bad.xdd b.eds", 4, "not well-formed XML"),
        ("eds convert a.xdd b.eds --strict", 2, "checks no rules"),
        ("eds convert a.xdd there.eds", 6, "overwrite"),
    ],
)  # fmt: skip
def test_what_cannot_be_converted(
    line: str, code: int, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.xdd").write_text(xdd())
    Path("bad.xdd").write_text("<a>")
    Path("there.eds").write_text("mine")
    with Bench() as bench:
        ran = bench.run(line)
    assert (ran.code, said in ran.stderr) == (code, True), ran
    assert Path("there.eds").read_text() == "mine"
    assert not Path("b.eds").exists()


# --- what a file says about itself


def keys_of(path: Path) -> dict[tuple[str, str], str]:
    """Every key of every section of an EDS or DCF, read here: the first value of each, in small letters."""
    said: dict[tuple[str, str], str] = {}
    section = ""
    for line in path.read_bytes().decode("latin-1").splitlines():
        text = line.strip()
        if text.startswith("["):
            section = text[1:].partition("]")[0].strip().lower()
        elif "=" in text and text[0] not in ";#":
            key, _, value = text.partition("=")
            said.setdefault((section, key.strip().lower()), value.strip())
    return said


def is_count(section: str, key: str) -> bool:
    """What is written anew, and says no more than the objects: counts, short forms, and the rows of those."""
    short = section[4:] in ("name", "value") or section.endswith("objects")
    return short or key in ("lines", "compactpdo", "compactsubobj", "subnumber", "nrofentries")


#: what is true of the copy alone, as its name
NEW = {"filename"}


def file_info_of(path: Path) -> dict[str, str]:
    return {key: value for (section, key), value in keys_of(path).items() if section == "fileinfo" and value}


def copies(path: Path, folder: Path) -> tuple[Path, str, Path, str]:
    """*path* as an EDS or DCF, and as one through an XDD or XDC, each with what was said of it."""
    xml = folder / f"b.xd{'c' if path.suffix == '.dcf' else 'd'}"
    direct, back = (folder / f"{name}{path.suffix}" for name in "ac")
    with Bench(()) as bench:
        ran = [bench.run(f"eds convert {one} {other}") for one, other in ((path, direct), (path, xml), (xml, back))]
    assert [one.code for one in ran] == [0, 0, 0], ran
    return direct, ran[0].stdout, back, ran[1].stdout + ran[2].stdout


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "described" in metafunc.fixturenames:
        paths = [one for one in (*FAMILIES, *real_files(metafunc.config)) if one.suffix in (".eds", ".dcf")]
        metafunc.parametrize("described", paths, ids=[one.name for one in paths])


@heavy
def test_what_a_file_says_about_itself_stays_or_is_named(described: Path, tmp_path: Path) -> None:
    before = file_info_of(described)
    direct, of_direct, back, of_way = copies(described, tmp_path)
    for copy, told in ((direct, of_direct), (back, of_way)):
        after = file_info_of(copy)
        gone = [key for key, value in before.items() if key not in NEW and after.get(key) != value]
        named = " ".join(line.lower() for line in told.splitlines() if "FileInfo" in line)
        assert [key for key in gone if key not in named] == [], told
        dates = {"creationdate", "creationtime", "modificationdate", "modificationtime", "modifiedby"}
        assert {key: after[key] for key in dates & after.keys()}.items() <= before.items(), "no clock of ours"
    assert not {"createdby", "creationdate", "filerevision", "fileversion", "description"} & {
        key for key, value in before.items() if file_info_of(direct)[key] != value
    }, of_direct


@heavy
def test_where_nothing_is_said_to_be_lost_every_key_is_there(described: Path, tmp_path: Path) -> None:
    before = keys_of(described)
    direct, of_direct, back, of_way = copies(described, tmp_path)
    for copy, told in ((direct, of_direct), (back, of_way)):
        if "not carried over" in told:
            continue
        after = keys_of(copy)
        gone = [
            place
            for place, value in before.items()
            if value not in ("", "0", "0x0") and place[1] not in NEW and place not in after
            if not is_count(*place) and not before.keys() & {(place[0], "compactsubobj"), (place[0], "subnumber")}
        ]
        assert gone == [], told


EMPTY = """[FileInfo]
FileName=a.eds
[DeviceInfo]
[MandatoryObjects]
SupportedObjects=1
1=0x1000
[1000]
ParameterName=
DataType=0x0007
AccessType=ro
[OptionalObjects]
SupportedObjects=1
1=0x1F81
[1F81]
ParameterName=
ObjectType=0x8
SubNumber=2
[1F81sub0]
ParameterName=
DataType=0x0005
AccessType=ro
DefaultValue=1
[1F81sub1]
ParameterName=
DataType=0x0007
AccessType=rw
"""


def test_a_conversion_has_no_clock_of_its_own_and_no_name_that_nobody_gave(tmp_path: Path) -> None:
    (tmp_path / "a.eds").write_text(EMPTY)
    with Bench((), {"yes": True}) as bench:
        ran = bench.run(f"eds convert {tmp_path}/a.eds {tmp_path}/b.xdd")
        assert bench.run(f"eds convert {tmp_path}/b.xdd {tmp_path}/c.eds").code == 0
    text = (tmp_path / "b.xdd").read_text("utf-8")
    assert "1970-01-01 is written instead, since an XDD must have a date" in ran.stdout
    assert ("1F81" not in text.replace('index="1F81"', ""), "Modif" in text) == (True, False)
    again = (tmp_path / "c.eds").read_text("cp1252")
    assert [line for line in again.splitlines() if "ParameterName" in line] == ["ParameterName="] * 4
    assert [word for word in ("Creation", "Modif", "1970") if word in again] == []


def test_the_dates_of_a_file_go_with_it(tmp_path: Path) -> None:
    dates = (
        "CreationTime=09:30AM\nCreationDate=01-31-2024\nCreatedBy=Me\n"
        "ModificationTime=10:31AM\nModificationDate=02-01-2025\nModifiedBy=You\n"
    )
    (tmp_path / "a.eds").write_text(EMPTY.replace("FileName=a.eds\n", f"FileName=a.eds\n{dates}"))
    with Bench((), {"yes": True}) as bench:
        assert "lost" in bench.run(f"eds convert {tmp_path}/a.eds {tmp_path}/b.xdd").stdout
        assert bench.run(f"eds convert {tmp_path}/b.xdd {tmp_path}/c.eds").code == 0
    assert 'fileModificationDate="2025-02-01"' in (tmp_path / "b.xdd").read_text("utf-8")
    again = (tmp_path / "c.eds").read_text("cp1252").splitlines()
    assert [line for line in dates.splitlines() if line not in again] == []


def test_a_concise_dcf_is_told_to_be_one(tmp_path: Path) -> None:
    (tmp_path / "a.cdcf").write_bytes(bytes.fromhex("01000000171000020000002c01"))
    with Bench(()) as bench:
        ran = bench.run(f"eds convert {tmp_path}/a.cdcf {tmp_path}/a.dcf")
    assert (ran.code, "is a concise DCF" in ran.stderr, "eds show" in ran.stderr) == (2, True, True), ran
