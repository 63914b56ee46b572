"""A modular device: its connected modules add objects, which every command knows; an EDS has no false error."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.object_dictionary import Access, ObjectType
from dvtcli.files.eds.reader import parse_eds
from tests.cli.commands.bench import Bench
from tests.small_eds import U8, plain, var

IN, OUT, FIXED = 0x6100, 0x6300, 0x2206
MODULES = """
[SupportedModules]
NrOfEntries=2

[M1ModuleInfo]
ProductName=8 DI
ProductVersion=1
ProductRevision=0
OrderCode=DI8

[M1SubExtends]
NrOfEntries=1
1=0x6100

[M1SubExt6100]
ParameterName=Read input
ObjectType=0x7
DataType=0x0005
AccessType=ro
DefaultValue=3
PDOMapping=1
Count=2
ObjExtend=0

[M2ModuleInfo]
ProductName=8 DO
ProductVersion=1
ProductRevision=0
OrderCode=DO8

[M2SubExtends]
NrOfEntries=1
1=0x6300

[M2SubExt6300]
ParameterName=Write output
ObjectType=0x7
DataType=0x0005
AccessType=rww
PDOMapping=1
Count=1
ObjExtend=0

[M2FixedObjects]
NrOfEntries=1
1=0x2206

[M2Fixed2206]
ParameterName=Error mode
ObjectType=0x9
SubNumber=2

[M2Fixed2206sub0]
ParameterName=Highest
ObjectType=0x7
DataType=0x0005
AccessType=ro
DefaultValue=1
PDOMapping=0

[M2Fixed2206sub1]
ParameterName=Mode
ObjectType=0x7
DataType=0x0006
AccessType=rw
DefaultValue=5
PDOMapping=0
"""


def coupler(*connected: int) -> str:
    """A coupler whose TPDO1 sends the second byte of the input modules; a DCF with *connected* modules, else an EDS."""
    text = plain().text()
    assert text.count("DefaultValue=0x60000108\n") == 1
    text = text.replace("DefaultValue=0x60000108\n", "DefaultValue=0x61000208\n") + MODULES
    if not connected:
        return text
    rows = "".join(f"{number}={module}\n" for number, module in enumerate(connected, 1))
    return f"{text}\n[ConnectedModules]\nNrOfEntries={len(connected)}\n{rows}\n[DeviceComissioning]\nNodeID=5\n"


def objects(text: str, name: str = "coupler.dcf") -> dict[int, list[int]]:
    """The sub-indices of what the modules add."""
    dictionary = parse_eds(text.encode(), name).dictionary
    return {index: list(dictionary[index].entries) for index in (IN, OUT, FIXED) if index in dictionary}


@pytest.mark.parametrize(
    ("connected", "found"),
    [
        ((1,), {IN: [0, 1, 2]}),
        ((1, 1, 2), {IN: [0, 1, 2, 3, 4], OUT: [0, 1], FIXED: [0, 1]}),
        ((2, 1, 2), {IN: [0, 1, 2], OUT: [0, 1, 2], FIXED: [0, 1]}),
        ((3,), {}),
        ((), {}),
        ((1,) * 200, {IN: list(range(255))}),
    ],
)
def test_each_connected_module_adds_its_objects(connected: tuple[int, ...], found: dict[int, list[int]]) -> None:
    assert objects(coupler(*connected)) == found


def test_they_are_as_the_module_describes_them() -> None:
    text = coupler(1, 2)
    dictionary = parse_eds(text.encode(), "coupler.dcf").dictionary
    whole, entry, fixed = dictionary[IN], dictionary.entry(IN, 2), dictionary.entry(FIXED, 1)
    assert entry is not None
    assert fixed is not None
    assert (whole.object_type, whole.entries[0].default) == (ObjectType.ARRAY, b"\2")
    assert (entry.name, entry.access, entry.pdo_mapping, entry.default) == ("Read input 2", Access.RO, True, b"\3")
    assert (fixed.name, fixed.default) == ("Mode", b"\5\0")
    assert text.splitlines()[(entry.line or 0) - 1] == "[M1SubExt6100]"


def test_an_object_with_sections_of_its_own_is_as_they_say() -> None:
    own = "\n[6100]\nParameterName=Own\nObjectType=0x7\nDataType=0x0006\nAccessType=ro\nPDOMapping=1\n"
    assert objects(coupler(1, 1) + own) == {IN: [0]}


@pytest.mark.parametrize(("connected", "wrong"), [((1,), []), ((2,), ["object-exists"]), ((), [])])
def test_check_knows_what_is_connected(connected: tuple[int, ...], wrong: list[str], tmp_path: Path) -> None:
    path = tmp_path / ("coupler.dcf" if connected else "coupler.eds")
    path.write_text(coupler(*connected))
    with Bench() as bench:
        found = bench.run(f"eds check {path} --json").document["findings"]
    assert [one["rule"] for one in found if one["severity"] == "error" and "object" in one["rule"]] == wrong


def test_it_is_mapped_backed_up_and_converted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("coupler.dcf").write_text(coupler(1, 1, 2))
    with Bench(("coupler.dcf@5",), {"yes": True}) as bench:
        assert bench.run("map tpdo1 6100:04 6100:01").code == 0
        assert bench.run("map rpdo1 6300:01").code == 0
        assert bench.run("write 2206:1 7").code == 0
        assert bench.run("backup kept.dcf").code == 0
        assert bench.run("compare kept.dcf").code == 0
    kept = parse_eds(Path("kept.dcf").read_bytes(), "kept.dcf").dictionary
    held = kept.entry(FIXED, 1)
    assert held is not None
    assert (list(kept[IN].entries), held.initial(5)) == ([0, 1, 2, 3, 4], b"\7\0")
    with Bench() as bench:
        for target in ("made.dcf", "made.xdc"):
            ran = bench.run(f"eds convert coupler.dcf {target}")
            assert ran.code == 0, ran
            assert "not carried over: object" not in ran.stdout, ran
    made = parse_eds(Path("made.dcf").read_bytes(), "made.dcf").dictionary
    assert list(made[IN].entries) == [0, 1, 2, 3, 4]


def test_show_lists_the_modules(tmp_path: Path) -> None:
    (tmp_path / "coupler.dcf").write_text(coupler(1, 1, 2))
    (tmp_path / "plain.eds").write_text(plain().text())
    with Bench() as bench:
        shown = bench.run(f"eds show {tmp_path}/coupler.dcf").stdout
        document = bench.run(f"eds show {tmp_path}/coupler.dcf --json").document
        assert "\n  modules" not in bench.run(f"eds show {tmp_path}/plain.eds").stdout
    assert ("modules       1 8 DI, 2 8 DO" in shown, "connected     1 1 2" in shown) == (True, True), shown
    assert (document["modules"], document["connected"]) == (["1 8 DI", "2 8 DO"], ["1", "1", "2"])


@pytest.mark.parametrize(
    ("modules", "last", "found"),
    [
        ((1,), 3, {IN: 2}),
        ((1, 1), 3, {IN: 3, IN + 1: 1}),
        ((1,) * 4, 3, {IN: 3, IN + 1: 3, IN + 2: 2}),
        ((1,) * 3, 3, {IN: 3, IN + 1: 3}),
        ((1,) * 200, 254, {IN: 254, IN + 1: 146}),
    ],
)
def test_a_full_object_goes_on_in_the_next_one(modules: tuple[int, ...], last: int, found: dict[int, int]) -> None:
    """ObjExtend is the sub-index after which the next object is used (CiA 306)."""
    text = coupler(*modules).replace("ObjExtend=0", f"ObjExtend={last}", 1)
    dictionary = parse_eds(text.encode(), "coupler.dcf").dictionary
    subs = {index: list(dictionary[index].entries) for index in range(IN, IN + 5) if index in dictionary}
    assert subs == {index: list(range(count + 1)) for index, count in found.items()}
    assert {index: dictionary[index].entries[0].default for index in subs} == {
        index: bytes([count]) for index, count in found.items()
    }
    last_index = max(subs)
    entry = dictionary.entry(last_index, found[last_index])
    assert entry is not None
    assert (entry.index, entry.sub_index, entry.default) == (last_index, found[last_index], b"\3")


def test_an_object_of_the_files_own_is_not_gone_on_in() -> None:
    eds = plain()
    eds.record(IN + 1, "Own", {0: var("n", U8, 1, "ro"), 1: var("Mine", U8, 9, "ro")})
    text = (
        eds.text()
        + MODULES.replace("ObjExtend=0", "ObjExtend=3", 1)
        + "\n[ConnectedModules]\nNrOfEntries=2\n1=1\n2=1\n"
    )
    dictionary = parse_eds(text.encode(), "coupler.dcf").dictionary
    entry = dictionary.entry(IN + 1, 1)
    assert entry is not None
    assert (entry.name, list(dictionary[IN].entries)) == ("Mine", [0, 1, 2, 3])
