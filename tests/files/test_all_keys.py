"""Every section and key of CiA 306 and EN 50325-5 is known, and is kept where an EDS or DCF is written."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.standard_objects import standard_name
from dvtcli.files.eds.reader import parse_eds, read_eds
from tests.cli.commands.bench import Bench
from tests.files.lint.sample import COMMISSIONED, SOUND, found

#: What a file may have beside its dictionary.
SECTIONS = """
[1014ObjectLinks]
ObjectLinks=1
1=0x1001

[StandardDataTypes]
0x0005=1

[DynamicChannels]
NrOfSeg=1
Type1=0x0005
Dir1=rww
Range1=0xA080-0xA0BF
PPOffset1=0

[Tools]
Items=1

[Tool1]
Name=Reader
Command=reader $NODEID

[SupportedModules]
NrOfEntries=1

[M1ModuleInfo]
ProductName=8 DI
ProductVersion=1
ProductRevision=0
OrderCode=DI8

[M1Comments]
Lines=1
Line1=eight inputs

[M1FixedObjects]
NrOfEntries=1
1=0x6206

[M1Fixed6206]
ParameterName=Error mode
ObjectType=0x7
DataType=0x0005
AccessType=rw
PDOMapping=0

[M1SubExtends]
NrOfEntries=1
1=0x6000

[M1SubExt6000]
ParameterName=Read input
ObjectType=0x7
DataType=0x0005
AccessType=ro
PDOMapping=1
Count=1
ObjExtend=0
"""
OF_A_NODE = "\n[ConnectedModules]\nNrOfEntries=1\n1=1\n"
KEYS = {
    "DeviceInfo": "CANopenSafetySupported=1",
    "6000": "SRDOMapping=1\nInvertedSRAD=0x600101",
}
KEYS_OF_A_NODE = {
    "2000": "UploadFile=up.bin\nDownloadFile=down.bin\nParamRefd=Ref.1",
    "DeviceComissioning": "NodeRefd=Ref.2\nNetRefd=Ref.3",
}


def with_keys(text: str, keys: dict[str, str]) -> str:
    """*text* with *keys* first in their sections."""
    for name, lines in keys.items():
        assert text.count(f"[{name}]\n") == 1, name
        text = text.replace(f"[{name}]\n", f"[{name}]\n{lines}\n")
    return text


EDS = with_keys(SOUND, KEYS) + SECTIONS
DCF = with_keys(SOUND + COMMISSIONED, KEYS | KEYS_OF_A_NODE) + SECTIONS + OF_A_NODE


@pytest.mark.parametrize(("text", "name"), [(EDS, "pump.eds"), (DCF, "pump.dcf")])
def test_no_key_and_no_section_is_unknown(text: str, name: str) -> None:
    about_keys = ("key", "section", "stray", "understood")
    wrong = [one for one in found(text, name) if any(word in one.rule for word in about_keys)]
    assert wrong == []
    file = parse_eds(text.encode(), name)
    assert file.understood == file.sections


@pytest.mark.parametrize(
    ("text", "name", "target", "kept"),
    [
        (EDS, "pump.eds", "made.eds", SECTIONS),
        (EDS, "pump.eds", "made.dcf", SECTIONS),
        (DCF, "pump.dcf", "made.dcf", SECTIONS + OF_A_NODE),
        (DCF, "pump.dcf", "made.eds", SECTIONS),
    ],
)
def test_all_are_kept_from_eds_to_eds(text: str, name: str, target: str, kept: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with Bench() as bench:
        ran = bench.run(f"eds convert {tmp_path / name} {tmp_path / target}")
    assert ran.code == 0, ran
    before, after = read_eds(tmp_path / name), read_eds(tmp_path / target)
    assert after.sections == after.understood
    sections = [line[1:-1] for line in kept.splitlines() if line.startswith("[")]
    assert len(sections) > 10
    for section in sections:
        values = [{key: one.value for key, one in file.values(section).items()} for file in (before, after)]
        assert values[0], section
        assert values[0] == values[1], section
    keys = KEYS | (KEYS_OF_A_NODE if target.endswith(".dcf") and name.endswith(".dcf") else {})
    for section, lines in keys.items():
        for key in (line.partition("=")[0].lower() for line in lines.splitlines()):
            assert after.values(section)[key].value == before.values(section)[key].value, key
    lost = "ConnectedModules" in ran.stdout, "UploadFile" in ran.stdout
    assert lost == ((True, True) if (name, target) == ("pump.dcf", "made.eds") else (False, False)), ran


def test_what_an_xdd_has_no_place_for_is_named(tmp_path: Path) -> None:
    (tmp_path / "pump.eds").write_text(EDS)
    with Bench() as bench:
        ran = bench.run(f"eds convert {tmp_path}/pump.eds {tmp_path}/made.xdd")
    assert "not carried over: 12 sections [1014ObjectLinks], [StandardDataTypes], [DynamicChannels] and 9 more" in (
        ran.stdout
    ), ran
    assert "not carried over: key SRDOMapping, 1 time" in ran.stdout


def test_a_table_of_denotations_belongs_to_its_short_form() -> None:
    text = SOUND.replace("[2004Name]", "[2004Denotation]\nNrOfEntries=1\n3=inlet\n\n[2004Name]")
    dictionary = parse_eds(text.encode(), "pump.eds").dictionary
    assert [entry.denotation for entry in dictionary[0x2004].entries.values()] == ["", "", "", "inlet"]
    assert [one for one in found(text) if one.rule != "denotation"] == []


def test_a_table_without_its_object_is_not_understood() -> None:
    for table in ("Name", "Value", "Denotation", "ObjectLinks"):
        file = parse_eds((SOUND + f"[3000{table}]\nNrOfEntries=0\n").encode(), "pump.eds")
        assert [section.name for section in file.layout.stray] == [f"3000{table}"]


@pytest.mark.parametrize(
    ("index", "sub_index", "name"),
    [
        (0x1301, 1, "information direction"), (0x1340, 6, "COB-ID 2 (inverted)"), (0x1341, 1, ""),
        (0x1381, 2, "mapped object 2"), (0x13C0, 16, "mapped object 16"), (0x13FF, 3, "signature of SRDO 3"),
    ],
)  # fmt: skip
def test_objects_of_srdos_have_names(index: int, sub_index: int, name: str) -> None:
    assert standard_name(index, sub_index) == name
