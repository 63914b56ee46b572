"""Whatever the bytes: a dictionary with findings, or InputFileError."""

from __future__ import annotations

from hypothesis import example, given
from hypothesis import strategies as st

from dvtcli.errors import InputFileError
from dvtcli.files.eds.reader import parse_eds

SAMPLE = b"""[FileInfo]
FileName=sample.eds
[DeviceInfo]
VendorName=Example
VendorNumber=0x1
NrOfTXPDO=3
CompactPDO=0x1F
[DeviceComissioning]
NodeID=5
[DummyUsage]
Dummy0005=1
[MandatoryObjects]
SupportedObjects=2
1=0x1000
2=0x1018
[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x20192
[1018]
ParameterName=Identity
ObjectType=0x9
SubNumber=2
[1018sub0]
ParameterName=Highest sub-index
DataType=0x0005
AccessType=const
DefaultValue=1
[1018sub1]
ParameterName=Vendor-ID
DataType=0x0007
AccessType=ro
DefaultValue=$NODEID+0x1E
LowLimit=0
HighLimit=0xFFFFFFFF
[2000]
ParameterName=Real
DataType=0x0008
AccessType=rww
DefaultValue=1.5
LowLimit=-2.0
[1A00]
ParameterName=Mapping
ObjectType=8
DataType=7
AccessType=rw
CompactSubObj=4
[1A00Name]
NrOfEntries=1
2=Second
[1A00Value]
NrOfEntries=1
1=0x20000020
"""

KEYS = [
    "ParameterName",
    "ObjectType",
    "DataType",
    "AccessType",
    "DefaultValue",
    "ParameterValue",
    "LowLimit",
    "HighLimit",
    "PDOMapping",
    "SubNumber",
    "CompactSubObj",
    "ObjFlags",
    "NrOfEntries",
    "1",
    "NrOfRXPDO",
    "CompactPDO",
    "NodeID",
    "VendorNumber",
    "Dummy0001",
    "SupportedObjects",
]
SECTIONS = [
    "1000",
    "1018",
    "1018sub1",
    "1018SUB0a",
    "1400",
    "1600",
    "1A00",
    "1A00Value",
    "1A00Name",
    "2000",
    "2000sub0",
    "DeviceInfo",
    "DummyUsage",
    "DeviceCommissioning",
    "OptionalObjects",
    "Else",
]
VALUES = st.one_of(
    st.integers(-(1 << 70), 1 << 70).map(str),
    st.integers(0, 1 << 70).map(hex),
    st.sampled_from(
        ["", "$NODEID", "$NODEID+0x180", "1e999", "nan", "0x", "08", "ro", "1;2", "true", "0xFFFFFFFF", "1:2"]
    ),
    st.text(max_size=12),
)
LINES = st.one_of(
    st.sampled_from(SECTIONS).map(lambda name: f"[{name}]"),
    st.builds(lambda key, value: f"{key}={value}", st.sampled_from(KEYS), VALUES),
    st.text(max_size=20),
)


def look_at_everything(data: bytes) -> None:
    try:
        file = parse_eds(data, "any.eds")
    except InputFileError:
        return
    for entry in file.dictionary.entries():
        assert entry.line is None or entry.line >= 1
        for held in (entry.default, entry.value):
            if held is not None:
                assert entry.data_type is not None
                entry.data_type.decode(held)
        entry.initial(127)
        low, high = entry.limits(1)
        assert low is None or high is None or entry.low_relative or entry.high_relative or low <= high
    not_understood = [finding for finding in file.findings if finding.rule == "section-not-understood"]
    assert file.sections == file.understood + len(not_understood)
    last_line = 1 + data.count(b"\n") + data.count(b"\r")
    assert all(1 <= finding.line <= last_line and finding.text for finding in file.findings)


@given(st.binary(max_size=300))
@example(b"\xff\xfe[\0")
@example(b"\xef\xbb\xbf\xff[1000]")
def test_any_bytes(data: bytes) -> None:
    look_at_everything(data)


@given(st.binary(max_size=300))
def test_any_bytes_in_an_object(data: bytes) -> None:
    look_at_everything(b"[2000]\n" + data)


@given(st.lists(LINES, max_size=25), st.sampled_from(["\n", "\r\n", "\r"]))
def test_any_lines(lines: list[str], newline: str) -> None:
    look_at_everything(newline.join(["[1000]", *lines]).encode("utf-8", "surrogatepass"))


@given(st.data())
def test_mutated_file(data: st.DataObject) -> None:
    mutated = bytearray(SAMPLE)
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, len(mutated)))
        length = data.draw(st.integers(0, 12))
        mutated[at : at + length] = data.draw(st.binary(max_size=6))
    look_at_everything(bytes(mutated))


def test_the_sample_itself() -> None:
    look_at_everything(SAMPLE)
    assert parse_eds(SAMPLE, "sample.eds").node_id == 5
