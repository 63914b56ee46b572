"""A ParameterValue that cannot be read is never taken for the DefaultValue: the file is refused, line by line."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.datatypes import DATA_TYPES, DataType, Kind
from dvtcli.errors import InputFileError
from dvtcli.files.device_file import device_file_bytes, parse_device_file
from dvtcli.operations.devices.held_device import held_by
from tests.cli.commands.bench import Bench
from tests.small_eds import U8, U16, U32, Eds, Section, mapping, plain, var

#: takes a file for what a device is to hold
COMMANDS = ("compare", "diff", "verify", "plan", "apply --yes", "clone --yes")
PLACE = (0x2001, 0)
#: two values of each kind, and of neither could a third text be a slip
DEFAULTS = {
    Kind.VISIBLE_STRING: ("A", "B"),
    Kind.UNICODE_STRING: ("A", "B"),
    Kind.OCTETS: ("41", "42"),
    Kind.REAL: ("1.5", "2.5"),
}
TYPES = sorted(DATA_TYPES.values(), key=lambda one: one.code)
WHOLE = [one for one in TYPES if one.kind in (Kind.INTEGER, Kind.UNSIGNED)]
LINE = st.characters(exclude_categories=["C", "Zl", "Zp"])
TEXTS = st.one_of(
    st.text(LINE, min_size=1, max_size=12),
    st.integers(-(1 << 65), 1 << 65).map(str),
    st.integers(0, 1 << 65).map(hex),
    st.sampled_from(
        ["abc", "0x181x", "70000", "1300rpm", "-5", "$NODEID+0x180", "$NODEID+", "1,5", "1e3", "0x", "5 ; rpm"]
    ),
).filter(lambda text: bool(text.strip()))


def described(default: object = None, value: object = None, kind: int = U32) -> Eds:
    """A device of which the file sets one object of the maker, or none."""
    eds = plain()
    eds.info |= {"ProductNumber": 0x77, "VendorNumber": 0x55}
    keys = var("Anything", kind, default)
    eds.variable(PLACE[0], keys if value is None else {**keys, "ParameterValue": value})
    return eds


def outcome(folder: Path, form: str, default: str, text: str, kind: DataType) -> bytes | None:
    """What a DCF or XDC with *text* as its value wants; None where it is refused."""
    file = folder / f"node.{form}"
    if form == "dcf":
        file.write_text(described(default, text, kind.code).text(), "utf-8")
    else:
        dictionary = parse_device_file(described(default, default, kind.code).text().encode(), "node.dcf").dictionary
        xdc = device_file_bytes(dictionary, "node.xdc", "", datetime(2026, 11, 23, tzinfo=UTC)).decode()
        before, _, after = xdc.partition('actualValue="')
        file.write_text(f"{before}actualValue={quoteattr(text)}{after.partition(chr(34))[2]}", "utf-8")
    try:
        kept = held_by(str(file), 5).objects.get(PLACE)
    except InputFileError:
        return None
    assert kept is not None
    assert kept.data is not None
    return kept.data


@pytest.mark.parametrize("form", ["dcf", "xdc"])
@given(kind=st.sampled_from(TYPES), text=TEXTS)
def test_the_default_never_takes_the_place_of_a_value(form: str, kind: DataType, text: str) -> None:
    """Whatever the text is: with another default the file wants the same, or is refused as well."""
    with TemporaryDirectory() as folder:
        one, other = (outcome(Path(folder), form, default, text, kind) for default in DEFAULTS.get(kind.kind, "01"))
    assert one == other


@given(kind=st.sampled_from(WHOLE), data=st.data())
def test_a_number_is_taken_as_it_is_written(kind: DataType, data: st.DataObject) -> None:
    assert kind.limits is not None
    number = data.draw(st.integers(*kind.limits))
    bits = number % (1 << (kind.bits or 0))
    texts = (str(number), f"{bits:#X}".replace("X", "x"), f"0x{bits:08x}", f"{number} ; set by hand")
    with TemporaryDirectory() as folder:
        for text in texts:
            assert outcome(Path(folder), "dcf", "0", text, kind) == kind.encode(number), text


def refused(file: Path, dcf: str, *said: str) -> None:
    """Every command refuses *dcf* with exit code 4, names its lines as *said*, and leaves the node as it was."""
    known = file.with_name("known.eds")
    known.write_text(described(7).text(), "utf-8")
    file.write_text(dcf, "utf-8")
    with Bench((f"{known}@5",), {"eds": str(known)}) as bench:
        before = bench.run("pdo --json").stdout
        for line in COMMANDS:
            ran = bench.run(f"{line} {file}")
            assert ran.code == 4, (line, ran.stdout, ran.stderr)
            assert "Nothing was written." in ran.stderr
            assert "dvtcli eds check" in ran.stderr
            for text in said:
                assert text in ran.stderr, line
        assert bench.run("pdo --json").stdout == before
        assert bench.run(f"eds check {file}").code == 4


def test_values_that_are_none_are_refused_each_with_its_line(tmp_path: Path) -> None:
    dcf, file = described(7), tmp_path / "bad.dcf"
    wrong = (("abc", U32), ("0x181x", U32), ("70000", U16), ("1300rpm", U32), ("-5", U32))
    for index, (text, kind) in enumerate(wrong, 0x3000):
        dcf.variable(index, var("Setting", kind, 7, ParameterValue=text))
    lines = [dcf.text().split(f"={text}\n")[0].count("\n") + 1 for text, _ in wrong]
    names = {U16: "UNSIGNED16", U32: "UNSIGNED32"}
    said = (
        f"{file}:{line}:16: error: {index:04X}:00 {names[kind]}: ParameterValue={text} is not a valid {names[kind]}"
        for line, index, (text, kind) in zip(lines, range(0x3000, 0x3005), wrong, strict=True)
    )
    refused(file, dcf.text(), *said, "5 errors.")


def test_an_entry_a_count_and_a_row_are_refused_too(tmp_path: Path) -> None:
    dcf = described(7)
    subs = mapping("0", [0x60000108])
    subs[0]["ParameterValue"], subs[1]["ParameterValue"] = "x", "0x6041001Z"
    dcf.record(0x1A00, "TPDO1 mapping", subs)
    table = {"ParameterName": "Table", "ObjectType": 8, "DataType": U8, "AccessType": "rw", "CompactSubObj": 2}
    dcf.more += [Section("2100", table), Section("2100Value", {"NrOfEntries": 2, "1": "700", "O2": "7"})]
    refused(
        tmp_path / "bad.dcf", dcf.text(), "1A00:00 UNSIGNED8: ParameterValue=x is not a valid",
        "ParameterValue=0x6041001Z is not a valid", "1=700 is not a valid UNSIGNED8", "O2=7: O2 is not a sub-index",
        "4 errors.",
    )  # fmt: skip


def test_a_line_that_lacks_its_equals_sign_is_no_default(tmp_path: Path) -> None:
    file, dcf = tmp_path / "bad.dcf", described(7, 1300)
    text = dcf.text().replace("ParameterValue=", "ParameterValue: ")
    file.write_text(text, "utf-8")
    with pytest.raises(InputFileError) as raised:
        held_by(str(file))
    assert "ParameterValue: 0x514" in raised.value.complaints[0].text
    assert raised.value.text == f"{file}: 1 value cannot be known; nothing was written"


def test_a_network_is_not_imported_by_it_and_an_eds_may_have_it(tmp_path: Path) -> None:
    file, nodes = tmp_path / "bad.dcf", tmp_path / "line.cpj"
    file.write_text(described(7, "abc").text(), "utf-8")
    nodes.write_text("[Topology]\nNodes=1\nNode5Present=1\nNode5DCFName=bad.dcf\n", "utf-8")
    with Bench((), {"yes": True}) as bench:
        for what in (tmp_path, nodes):
            ran = bench.run(f"import {tmp_path / 'line.yaml'} {what}")
            ran.failed(4, "ParameterValue=abc is not a valid UNSIGNED32")
    assert not (tmp_path / "line.yaml").exists()
    with Bench((f"{file}@5",), {"eds": str(file)}) as bench:
        assert bench.run("read 2001 --json").document["value"] == 7
        assert bench.run("verify").code in (0, 2)


@pytest.mark.parametrize("second", ["NodeID=9\n", "NodeName=Pump\n\n[DeviceCommissioning]\nNodeID = 0x9\n"])
def test_a_file_with_two_node_ids_is_refused(second: str, tmp_path: Path) -> None:
    file = tmp_path / "node.dcf"
    with Bench(("generic@5",)) as bench:
        assert bench.run(f"export {file}").code == 0
        text = file.read_text("utf-8")
        assert text.count("NodeID=5\n") == 1
        file.write_text(text.replace("NodeID=5\n", "NodeID=5\nNodeID=0x05\n"), "utf-8")
        assert bench.run(f"diff {file}").code == 0, "the same number twice"
        file.write_text(text.replace("NodeID=5\n", f"NodeID=5\n{second}"), "utf-8")
        line = text[: text.index("NodeID=5\n")].count("\n") + 1
        for command in COMMANDS:
            ran = bench.run(f"{command} {file}")
            said = f"NodeID is 5 in line {line}, 9 in line "
            ran.failed(4, said)
