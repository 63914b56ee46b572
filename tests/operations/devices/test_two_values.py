"""Two values of one object in a file: nobody knows which is meant, so it is refused with both lines."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest

from dvtcli.errors import InputFileError
from dvtcli.files.device_file import device_file_bytes, parse_device_file
from dvtcli.operations.devices.held_device import held_by
from tests.operations.devices.test_apply_file import made
from tests.operations.devices.test_lost_values import described, refused
from tests.small_eds import U16, Section, var

VALUE = "ParameterValue=0x514\n"
#: what is put beside it in its section, or behind the file, and whether it means the same
BESIDE = (
    ("ParameterValue=900\n", False), ("PARAMETERVALUE = 0x514\n", True), ("ParameterValue=1300 ; rpm\n", True),
    ("ParameterValue=900\nParameterValue=1300\n", False), ("ParameterValue=\n", False),
    ("ParameterValue=$NODEID+0x514\n", False),
)  # fmt: skip
BEHIND = (
    ("[2001]\nParameterValue=900\n", False), ("[2001]\nParameterValue=1300\n", True),
    ("[2001]\nDenotation=Fan\n", True),
)  # fmt: skip


def line_of(text: str, words: str) -> int:
    """The first line that is *words*."""
    return text.split("\n").index(words.strip()) + 1


@pytest.mark.parametrize(("more", "is_same"), BESIDE)
def test_a_value_that_stands_twice_in_a_section(more: str, is_same: bool, tmp_path: Path) -> None:
    text = described(7, 1300).text().replace(VALUE, VALUE + more)
    said(text, is_same, more.strip().split("\n")[-1].replace(" = ", "="), "2001:00", tmp_path)


@pytest.mark.parametrize(("more", "is_same"), BEHIND)
def test_a_section_that_stands_twice(more: str, is_same: bool, tmp_path: Path) -> None:
    said(f"{described(7, 1300).text()}\n{more}", is_same, more.strip().split("\n")[-1], "2001:00", tmp_path)


def said(text: str, is_same: bool, last: str, place: str, folder: Path) -> None:
    """See that *text* is refused for its *last* line, or is read where it says twice the same."""
    file = folder / "twice.dcf"
    if is_same:
        file.write_text(text, "utf-8")
        kept = held_by(str(file)).objects[0x2001, 0]
        assert kept.data == (1300).to_bytes(4, "little")
    else:
        refused(
            file,
            text,
            f" {place} UNSIGNED32: {last}, but ParameterValue=",
            " in line ",
            "it is unknown which is right",
        )


def table(rows: dict[str, object], *more: Section) -> str:
    """A file with an array in short form of which a list says values."""
    dcf = described(7)
    keys = {"ParameterName": "Table", "ObjectType": 8, "DataType": U16, "AccessType": "rw", "CompactSubObj": 3}
    dcf.more += [Section("2100", keys), Section("2100Value", {"NrOfEntries": len(rows), **rows}), *more]
    return dcf.text()


def test_a_row_and_a_section_or_two_rows(tmp_path: Path) -> None:
    own = Section("2100sub2", var("Own", U16, 0, ParameterValue=8))
    file = tmp_path / "twice.dcf"
    refused(file, table({"2": "7"}, own), "2100: 2=7, but ParameterValue=0x8 in line ")
    refused(file, table({"2": "7", "0x02": "8"}), "2100: 0x02=8, but 2=7 in line ")
    for right in (table({"2": "8"}, own), table({"2": "7", "0x2": "0x07"})):
        file.write_text(right, "utf-8")
        assert held_by(str(file)).objects[0x2100, 2].data in (b"\7\0", b"\x08\0")


def test_an_object_of_an_xdc_that_stands_twice(tmp_path: Path) -> None:
    file = tmp_path / "twice.xdc"
    dictionary = parse_device_file(described(7, 1300).text().encode(), "a.dcf").dictionary
    text = device_file_bytes(dictionary, "twice.xdc", "", datetime(2026, 11, 23, tzinfo=UTC)).decode()
    before, _, after = text.partition('<CANopenObject index="2001"')
    own, _, rest = after.partition("/>")
    one = f'<CANopenObject index="2001"{own}/>'
    for second, is_same in ((one, True), (one.replace("0x00000514", "0x384"), False)):
        assert is_same or second != one
        file.write_text(f"{before}{one}\n{second}{rest}", "utf-8")
        if is_same:
            assert held_by(str(file)).objects[0x2001, 0].data == (1300).to_bytes(4, "little")
            continue
        with pytest.raises(InputFileError) as raised:
            held_by(str(file))
        assert "2001 is in line " in raised.value.complaints[0].text


def test_an_object_of_a_backup_that_stands_twice(tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "jsonl")
    lines = file.read_text("utf-8").splitlines()
    first = json.loads(lines[1])
    file.write_text("\n".join([*lines, json.dumps(first | {"raw": "FF"})]) + "\n", "utf-8")
    with pytest.raises(InputFileError) as raised:
        held_by(str(file))
    assert f"{first['object']} is in line 2 too" in (raised.value.why or "")
