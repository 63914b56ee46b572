"""A DCF made of an EDS: it says what was held, and every byte that it need not change is the EDS's."""

from __future__ import annotations

import codecs
import random
import re
import struct
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.datatypes import DATA_TYPES, Kind
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.profile import ObjectAddress
from dvtcli.errors import InputFileError
from dvtcli.files.eds.numbers import encode_value, same_value
from dvtcli.files.eds.reader import parse_eds
from dvtcli.files.eds.write_dcf import Commissioned, value_text, write_dcf
from dvtcli.files.profiles import builtin_path
from tests.corpus.oddities import OddFile, odd_files
from tests.files.test_eds_any import LINES
from tests.real_files import real_files

NODE = 5
DEVICE = Commissioned("node.dcf", NODE, datetime(2026, 11, 23, 14, 5), 500, 7)
FAMILIES = sorted(path.stem for path in builtin_path("generic").parent.parent.glob("*/*.eds"))
#: what may differ from the EDS, by key or section
_CHANGED = re.compile(
    r"\s*(parametervalue|filename|lasteds|modificationdate|modificationtime|modifiedby|nodeid|baudrate|lss_serialnumber"
    r"|supportedobjects|nrofentries)\s*=|\[devicecomissioning\]|\s*$",
    re.IGNORECASE,
)
SHORT = """[FileInfo]
FileName=short.eds
CreationDate=01-02-2003
CreatedBy=somebody
[DeviceInfo]
VendorName=Example
[MandatoryObjects]
SupportedObjects=2
1=0x2000
2=0x2001
[2000]
ParameterName=Limits
ObjectType=8
DataType=0x0006
AccessType=rw
DefaultValue=0x10
CompactSubObj=4
[2000Value]
NrOfEntries=1
2=0x20
[2001]
ParameterName=Ramp ; not a comment
DataType=0x0007
AccessType=rw
; what the maker advises
DefaultValue = $NODEID+0x100   ; per node
LowLimit=
[2002]
ParameterName=Title
DataType=0x0009
AccessType=rw
[2003]
ParameterName=Short, too
ObjectType=8
DataType=0x0005
AccessType=rw
CompactSubObj=2
"""


def eds_of(family: str) -> bytes:
    (path,) = (builtin_path("generic").parent.parent / family).glob("*.eds")
    return path.read_bytes()


def held(dictionary: ObjectDictionary, rng: random.Random) -> dict[ObjectAddress, bytes]:
    """Something that each object may hold: its default, or anything of its type."""
    found = {}
    for entry in dictionary.entries():
        kind = entry.data_type
        if kind is None or (rng.random() < 0.1 and entry.value is None):
            continue
        size = kind.size if kind.size is not None else rng.choice((1, 8, 200))
        data = bytes(rng.randrange(256) for _ in range(size))
        if kind.kind is Kind.VISIBLE_STRING:
            data = b"Pump %d" % rng.randrange(99)
        if kind.kind is Kind.BOOLEAN:
            data = bytes([rng.randrange(2)])
        if kind.kind is Kind.UNICODE_STRING:
            data = "Pump".encode("utf-16-le")
        initial = entry.initial(NODE)
        found[entry.index, entry.sub_index] = initial if initial and rng.random() < 0.5 else data
    return found


def unlike(dictionary: ObjectDictionary, values: dict[ObjectAddress, bytes]) -> list[str]:
    """Objects of which a file does not say what it should: their value, or, where none was asked for, no value."""
    found = []
    for entry in dictionary.entries():
        wanted = values.get((entry.index, entry.sub_index))
        if wanted is None and entry.value is not None:
            found.append(entry.object)
        if wanted is not None and not same_value(entry.data_type, entry.initial(NODE), wanted):
            found.append(entry.object)
    return found


def described(dictionary: ObjectDictionary) -> list[object]:
    """All that a file says of its objects but values and lines."""
    return [
        replace(
            entry, value=None, value_relative=False, line=None, default=None if entry.sub_index == 0 else entry.default
        )
        for entry in dictionary.entries()
    ]


def unchanged_lines(text: str) -> list[str]:
    """The lines that must be equal in an EDS and its DCF, with their ends; rows of value tables are values, too."""
    text = re.sub(r"(?is)(?<![^\r\n])\[[0-9a-f]{4}value\].*?(?=[\r\n]\s*\[|\Z)", "", text)
    return [line for line in re.findall(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+", text) if not _CHANGED.match(line)]


def check(data: bytes, source: str, seed: int) -> None:
    eds = parse_eds(data, source)
    values = held(eds.dictionary, random.Random(seed))
    made = write_dcf(data, source, values, DEVICE)
    dcf = parse_eds(made.data, DEVICE.file_name)
    assert set(made.said) == values.keys() - made.left_out.keys()
    assert unlike(dcf.dictionary, {place: values[place] for place in made.said}) == []
    if "compactpdo" not in data.lower().decode("latin-1"):
        assert described(dcf.dictionary) == described(eds.dictionary)
    assert (dcf.node_id, dcf.text.encoding) == (NODE, eds.text.encoding)
    assert write_dcf(made.data, DEVICE.file_name, values, DEVICE).data == made.data  # nothing is left to change


@pytest.mark.parametrize("family", FAMILIES)
def test_a_family_s_file_says_what_was_held_and_all_that_it_said_before(family: str) -> None:
    check(eds_of(family), f"{family}.eds", 1)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "real" in metafunc.fixturenames:
        paths = real_files(metafunc.config)
        metafunc.parametrize("real", paths, ids=[path.name for path in paths])


def test_a_real_file_says_what_was_held_and_all_that_it_said_before(real: Path) -> None:
    check(real.read_bytes(), real.name, 1)


@pytest.mark.drawn(8)
@pytest.mark.parametrize("odd", odd_files(60), ids=lambda odd: odd.name)
def test_so_does_an_odd_file(odd: OddFile) -> None:
    check(odd.text.encode(), odd.name, 2)


ENCODINGS = {
    "utf-8": (b"", "utf-8", "°…é"),
    "utf-8 with its mark": (codecs.BOM_UTF8, "utf-8", "°…é"),
    "utf-16, low byte first": (codecs.BOM_UTF16_LE, "utf-16-le", "°…é"),
    "utf-16, high byte first": (codecs.BOM_UTF16_BE, "utf-16-be", "°…é"),
    "windows-1252": (b"", "cp1252", "°…é"),
    "latin-1": (b"", "latin-1", "°é\x81"),
}


@given(st.sampled_from(sorted(ENCODINGS)), st.integers(0, 1 << 32), st.booleans())
def test_what_need_not_change_is_the_same_byte_for_byte(encoding: str, seed: int, mixed: bool) -> None:
    rng = random.Random(seed)
    mark, codec, strange = ENCODINGS[encoding]
    usual = rng.choice(["\r\n", "\n", "\r"])
    lines = []
    for line in SHORT.splitlines():
        lines += [f"; {strange} {rng.random()}"] if rng.random() < 0.1 else []
        lines += [rng.choice(["", "  ", f"X_{strange[0]}=1", "Private = yes ; no"])] if rng.random() < 0.05 else []
        lines.append(line)
    text = "".join(line + (rng.choice(["\r\n", "\n"]) if mixed else usual) for line in lines)
    text = text + f"; {strange} the end" if rng.random() < 0.5 else text
    data = mark + text.encode(codec)
    eds = parse_eds(data, "a.eds")
    values = held(eds.dictionary, rng)
    made = write_dcf(data, "a.eds", values, DEVICE)
    assert made.data.startswith(mark)
    now = made.data.removeprefix(mark).decode(codec)
    *lines_now, last_now = unchanged_lines(now)
    *lines_then, last_then = unchanged_lines(text)
    assert lines_now == lines_then
    assert last_now.rstrip("\r\n") == last_then.rstrip("\r\n")  # what follows a last line gives it an end
    if not mixed:
        assert set(re.findall(r"\r\n|\r|\n", now)) == {usual}
    assert unlike(parse_eds(made.data, "b.dcf").dictionary, {place: values[place] for place in made.said}) == []


@given(st.lists(LINES, max_size=12), st.integers(0, 200), st.integers(0, 1 << 32))
def test_whatever_the_file_a_dcf_says_what_was_held_or_there_is_none(lines: list[str], at: int, seed: int) -> None:
    given_lines = SHORT.splitlines()
    data = "\n".join([*given_lines[:at], *lines, *given_lines[at:]]).encode("utf-8", "surrogatepass")
    try:
        eds = parse_eds(data, "any.eds")
        values = held(eds.dictionary, random.Random(seed))
        made = write_dcf(data, "any.eds", values, DEVICE)
    except InputFileError:
        return
    dictionary = parse_eds(made.data, "any.dcf").dictionary
    for index, sub_index in made.said:
        entry = dictionary.entry(index, sub_index)
        assert entry is not None
        assert same_value(entry.data_type, entry.initial(NODE), values[index, sub_index])
    assert set(made.said) == values.keys() - made.left_out.keys()
    # what only a list names is left out, too, though nobody read it; then the list names it no more
    only_named = made.left_out.keys() - values.keys()
    assert {made.left_out[place] for place in only_named} <= {"it is in a list, but has no section"}
    assert all(not sub_index and index not in eds.dictionary for index, sub_index in only_named)
    assert write_dcf(made.data, "any.dcf", values, DEVICE).left_out.keys() <= values.keys()


def made_of(text: str, values: dict[ObjectAddress, bytes]) -> str:
    return write_dcf(text.encode(), "short.eds", values, DEVICE).data.decode()


def test_what_becomes_of_a_file() -> None:
    values = {(0x2000, sub): bytes([sub, 0]) for sub in (1, 2, 3)} | {
        (0x2001, 0): b"\x05\x01\0\0",
        (0x2002, 0): b"Lift; 1",
    }
    values |= {(0x2003, 2): b"\x09"}
    made = made_of(SHORT, values)
    assert made.splitlines() == [
        "[FileInfo]", "FileName=node.dcf", "CreationDate=01-02-2003", "CreatedBy=somebody", "ModificationTime=02:05PM",
        "ModificationDate=11-23-2026", "ModifiedBy=dvtcli", "LastEDS=short.eds",
        "[DeviceInfo]", "VendorName=Example",
        "[DeviceComissioning]", "NodeID=5", "Baudrate=500", "LSS_SerialNumber=7", "",
        "[MandatoryObjects]", "SupportedObjects=2", "1=0x2000", "2=0x2001",
        "[2000]", "ParameterName=Limits", "ObjectType=8", "DataType=0x0006", "AccessType=rw", "DefaultValue=0x10",
        "CompactSubObj=4",
        "[2000Value]", "NrOfEntries=3", "1=0x0001", "2=0x0002", "3=0x0003",
        "[2001]", "ParameterName=Ramp ; not a comment", "DataType=0x0007", "AccessType=rw",
        "; what the maker advises", "DefaultValue = $NODEID+0x100   ; per node", "ParameterValue = 0x00000105",
        "LowLimit=",
        "[2002]", "ParameterName=Title", "DataType=0x0009", "AccessType=rw", "ParameterValue=Lift; 1",
        "[2003]", "ParameterName=Short, too", "ObjectType=8", "DataType=0x0005", "AccessType=rw", "CompactSubObj=2",
        "", "[2003Value]", "NrOfEntries=1", "2=9",
    ]  # fmt: skip


def test_a_value_that_means_the_same_stays_as_it_is_written() -> None:
    text = SHORT.replace("LowLimit=\n", "LowLimit=\nParameterValue= $NodeID + 0x100 ; as ordered\n")
    made = made_of(text, {(0x2001, 0): b"\x05\x01\0\0", (0x2000, 2): b"\x20\0"})
    assert "ParameterValue= $NodeID + 0x100 ; as ordered\n" in made
    assert "NrOfEntries=1\n2=0x20\n" in made


def test_a_value_that_nobody_read_is_taken_out() -> None:
    text = SHORT.replace("LowLimit=\n", "LowLimit=\nParameterValue=7\n")
    made = made_of(text, {})
    assert "ParameterValue" not in made
    assert "NrOfEntries=0\n[2001]" in made


def test_a_new_value_keeps_the_comment_behind_it() -> None:
    text = SHORT.replace("LowLimit=\n", "LowLimit=\n  parametervalue =  0x7 \t; as ordered\n")
    assert "  parametervalue =  0x00000009 \t; as ordered\n" in made_of(text, {(0x2001, 0): b"\x09\0\0\0"})


def test_what_no_line_can_say_is_left_out_and_said() -> None:
    values = {(0x2002, 0): b"two\nlines", (0x2001, 0): b"\x01\x02", (0x2000, 1): b""}
    made = write_dcf(SHORT.encode(), "short.eds", values, DEVICE)
    assert made.said == ()
    assert made.left_out == {
        (0x2000, 1): "it is empty",
        (0x2001, 0): "the device holds 2 bytes, and a UNSIGNED32 has 4",
        (0x2002, 0): "no line of a file can say this VISIBLE_STRING",
    }


def test_a_pdo_that_only_compact_pdo_describes_gets_its_sections() -> None:
    text = SHORT.replace("VendorName=Example\n", "NrOfTXPDO=2\nCompactPDO=0x03\n").replace(
        "[2000]\n", "[OptionalObjects]\nSupportedObjects=0\n[2000]\n", 1
    )
    values = {(0x1801, 1): (0xC000_0285).to_bytes(4, "little"), (0x1801, 2): b"\x01", (0x1A01, 0): b"\x00"}
    made = write_dcf(text.encode(), "short.eds", values, DEVICE)
    dcf = parse_eds(made.data, "b.dcf")
    assert set(made.said) == values.keys()
    assert unlike(dcf.dictionary, values) == []
    assert list(dcf.dictionary) == list(parse_eds(text.encode(), "short.eds").dictionary)
    assert b"[OptionalObjects]\nSupportedObjects=2\n1=0x1801\n2=0x1A01\n" in made.data


@pytest.mark.parametrize("name", ["MandatoryObjects", "OptionalObjects", "ManufacturerObjects"])
def test_a_pdo_that_only_compact_pdo_describes_is_named_once(name: str) -> None:
    """Whichever list of the EDS names it already: it was named twice there, or dropped from it as undescribed."""
    others = [one for one in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects") if one != name]
    empty = "".join(f"[{one}]\nSupportedObjects=0\n" for one in others)
    text = SHORT.replace("VendorName=Example\n", "NrOfTXPDO=2\nCompactPDO=0x03\n").replace(
        "[MandatoryObjects]\nSupportedObjects=2\n1=0x2000\n2=0x2001\n",
        f"{empty}[{name}]\nSupportedObjects=3\n1=0x2000\n2=0x2001\n3=0x1801\n",
    )
    values = {(0x1801, 1): (0xC000_0285).to_bytes(4, "little"), (0x1A01, 0): b"\x00"}
    made = write_dcf(text.encode(), "short.eds", values, DEVICE)
    lines = made.data.decode().splitlines()
    assert made.left_out == {}
    assert sum(line.endswith("=0x1801") for line in lines) == 1
    assert sum(line.endswith("=0x1A01") for line in lines) == 1
    assert unlike(parse_eds(made.data, "b.dcf").dictionary, values) == []


def test_odd_blanks_of_the_line_before_are_not_copied() -> None:
    """`CreatedBy=  somebody` is somebody's slip, `Key = value` how a file is written."""
    for before, after in (
        ("CreatedBy=  somebody", "LastEDS=short.eds"),
        ("CreatedBy = somebody", "LastEDS = short.eds"),
    ):
        made = made_of(SHORT.replace("CreatedBy=somebody", before), {})
        assert [line for line in made.splitlines() if "LastEDS" in line] == [after]


def test_an_older_dcf_keeps_the_eds_that_it_came_from() -> None:
    first = made_of(SHORT, {})
    again = write_dcf(first.encode(), "node.dcf", {}, replace(DEVICE, file_name="new.dcf", serial=None))
    text = again.data.decode()
    assert "LastEDS=short.eds\n" in text
    assert "FileName=new.dcf\n" in text
    assert "LSS_SerialNumber" not in text


@given(
    st.sampled_from([one for one in DATA_TYPES.values() if one.size]), st.binary(min_size=8, max_size=8), st.booleans()
)
def test_every_value_of_a_fixed_length_can_be_said(kind: object, data: bytes, is_hex: bool) -> None:
    size = kind.size  # type: ignore[attr-defined]
    held_data = data[:size]
    text = value_text(kind, held_data, "0x1" if is_hex else "1")  # type: ignore[arg-type]
    assert same_value(kind, encode_value(kind, text).data, held_data)  # type: ignore[arg-type]


def test_reals_are_as_short_as_they_can_be() -> None:
    r32, r64 = DATA_TYPES[0x08], DATA_TYPES[0x11]
    assert value_text(r32, struct.pack("<f", 0.1)) == "0.1"
    assert value_text(r64, struct.pack("<d", 0.1 + 0.2)) == "0.30000000000000004"
    assert value_text(r32, b"\x01\x00\xc0\x7f") == "0x7FC00001"
