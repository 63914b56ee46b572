"""Laws of the linter: a sound file of any size has no finding, and no file whatever breaks it."""

from __future__ import annotations

from hypothesis import example, given
from hypothesis import strategies as st

from dvtcli.errors import InputFileError
from dvtcli.files.device_lint import RULES, lint
from dvtcli.files.eds.reader import parse_eds
from tests.files.lint.sample import HEAD, NAME, STANDARD, found, listed, pdo, record, var

#: data type, its length in bits, and its limits
TYPES = {2: (8, -128, 127), 3: (16, -32768, 32767), 4: (32, -(1 << 31), (1 << 31) - 1),
         5: (8, 0, 255), 6: (16, 0, 65535), 7: (32, 0, (1 << 32) - 1)}  # fmt: skip
STANDARD_INDICES = ("1003", "1005", "1008", "1010", "1011", "1014", "1017", "1200")


@st.composite
def values(draw: st.DrawFn) -> tuple[int, str, tuple[str, str]]:
    """A data type, a default of it, and limits around that."""
    kind = draw(st.sampled_from(sorted(TYPES)))
    _, low, high = TYPES[kind]
    least, default, most = sorted(draw(st.lists(st.integers(low, high), min_size=3, max_size=3)))
    if least == most:
        least, most = low, high
    return kind, str(default), (f"LowLimit={least}", f"HighLimit={most}")


@st.composite
def sound_files(draw: st.DrawFn) -> str:
    """A file with objects, arrays, records and PDOs of several sizes, all of which agree."""
    own = [(f"{0x2000 + n:04X}", *draw(values())) for n in range(draw(st.integers(1, 8)))]
    text = "".join(var(index, f"Own {index}", kind, "rw", default, *limits) for index, kind, default, limits in own)
    arrays = [f"{0x3000 + n:04X}" for n in range(draw(st.integers(0, 3)))]
    for index in arrays:
        kind, default, _ = draw(values())
        count = draw(st.integers(1, 12))
        rows = [(f"Element {n}", kind, "rw", default) for n in range(1, count + 1)]
        text += record(index, f"Array {index}", ("Highest sub-index", 5, "const", str(count)), *rows, kind=8)
    process = [(f"{0x6000 + n:04X}", *draw(values())) for n in range(draw(st.integers(1, 6)))]
    for index, kind, default, limits in process:
        text += var(index, f"Process {index}", kind, "ro", default, *limits).replace("PDOMapping=0", "PDOMapping=1")
    pdos = draw(st.integers(1, 4))
    for number in range(1, pdos + 1):
        room, words = 64, []
        for index, kind, *_ in draw(st.permutations(process)):
            if TYPES[kind][0] <= room and len(words) < 4:
                room -= TYPES[kind][0]
                words.append(f"0x{index}00{TYPES[kind][0]:02X}")
        default = f"$NODEID+0x{0x180 + 0x100 * (number - 1):X}"
        text += pdo(number, "TPDO", default, words, draw(st.sampled_from([0, 1, 240, 254, 255])))
    parameters = [f"{base + n:04X}" for base in (0x1800, 0x1A00) for n in range(pdos)]
    lists = (
        listed("MandatoryObjects", "1000", "1001", "1018")
        + listed("OptionalObjects", *STANDARD_INDICES, *parameters, *(index for index, *_ in process))
        + listed("ManufacturerObjects", *(index for index, *_ in own), *arrays)
    )
    head = HEAD.replace("NrOfRXPDO=1", "NrOfRXPDO=0").replace("NrOfTXPDO=2", f"NrOfTXPDO={pdos}")
    return head + lists + STANDARD + text


@given(sound_files())
def test_a_sound_file_has_no_finding(text: str) -> None:
    assert found(text) == ()


def linted(data: bytes, name: str) -> None:
    try:
        file = parse_eds(data, name)
    except InputFileError:
        return
    lines = data.decode("latin-1").count("\n") + data.count(b"\r") + 1
    severities = {rule.name: rule.severity for rule in RULES}
    for finding in lint(file, name, severities):
        assert 1 <= finding.line <= lines
        assert finding.severity is severities[finding.rule]
        assert finding.text


PIECES = [
    *("[1A00]", "[1A00sub0]", "[1A00sub1]", "[1800sub1]", "[2000]", "[2000Name]", "[DeviceInfo]", "[FileInfo]"),
    *("[DummyUsage]", "[DeviceComissioning]", "DataType=7", "DataType=0x40", "DataType=9", "AccessType=rwr"),
    *("AccessType=const", "ObjectType=8", "ObjectType=9", "DefaultValue=$NODEID+0xFFFFFFFF", "DefaultValue=2"),
    *("DefaultValue=254", "DefaultValue=", "DefaultValue=0xFFFFFFFF", "ParameterValue=-1", "LowLimit=5"),
    *("HighLimit=2", "PDOMapping=1", "CompactSubObj=3", "SubNumber=9", "NodeID=255", "Baudrate=x", "Granularity=0"),
    *("CompactPDO=0x3F", "NrOfTXPDO=512", "Dummy0040=1", "CreationDate=99-99-9999", "ModificationDate=01-01-2000"),
    *("ObjFlags=0xFFFFFFFF", "LowLimt=1", "LSS_Supported=1", "GroupMessaging=0", "[1018sub0]", "[1019]", "[1005]"),
]


@given(st.lists(st.sampled_from(PIECES), max_size=40), st.sampled_from([NAME, "pump.dcf", "pump"]))
def test_any_lines_are_linted(pieces: list[str], name: str) -> None:
    linted("\n".join(pieces).encode(), name)


@given(st.binary(max_size=400), st.sampled_from(["[1A00sub0]\n", "[DeviceInfo]\n", "[FileInfo]\n", "[2000]\n"]))
@example(b"DataType=0x0008\nDefaultValue=0x7F800001\nLowLimit=1\nHighLimit=2", "[2000]\n")
@example(b"DataType=1\nDefaultValue=1\nHighLimit=0", "[2000]\n")
def test_any_bytes_are_linted(data: bytes, head: str) -> None:
    linted(head.encode() + data, NAME)
