"""The modules of a modular EDS are chosen by the user, or read from the device's module list (0x1027)."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.files.device_file import read_device_file
from dvtcli.files.eds.modules import with_modules
from dvtcli.files.eds.reader import parse_eds
from dvtcli.operations.session.simulated_nodes import read_dictionary, simulated_device, simulated_nodes
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.bench import Bench, beside
from tests.files.test_modules import FIXED, IN, MODULES, OUT
from tests.process import dvtcli
from tests.small_eds import U8, U16, plain, var

LIST = 0x1027


def coupler(*, has_list: bool = True, own_inputs: int = 0) -> str:
    """A modular EDS; with a module list, and *own_inputs* of the coupler itself beside those of its modules."""
    eds = plain()
    if has_list:
        eds.record(LIST, "Module list", {0: var("Modules", U8, 0, "ro"), 1: var("Module 1", U16, 0, "ro")})
    if own_inputs:
        eds.record(IN, "Read input", {n: var(f"Own {n}", U8, 0, "ro", 1) for n in range(1, own_inputs + 1)})
    return eds.text() + MODULES


def described(text: str, *modules: int) -> ObjectDictionary:
    """The dictionary of *text* with connected *modules*."""
    return parse_eds(text.encode(), "coupler.eds", modules).dictionary


def device(text: str, *modules: int) -> StrictDevice:
    """A device of the EDS *text* with *modules*, at node-ID 5."""
    made = StrictDevice(described(text, *modules).identified(), Family(), 5)
    made.power_on({})
    return made


def subs(dictionary: ObjectDictionary | None) -> dict[int, list[int]]:
    """The sub-indices of what the modules add."""
    assert dictionary is not None
    return {index: list(dictionary[index].entries) for index in (IN, OUT, FIXED) if index in dictionary}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "coupler.eds"
    path.write_text(coupler())
    return path


def test_a_chosen_module_adds_what_a_connected_one_does(file: Path) -> None:
    dictionary = read_device_file(file, (1, 2, 1)).dictionary
    assert subs(dictionary) == {IN: [0, 1, 2, 3, 4], OUT: [0, 1], FIXED: [0, 1]}
    assert (dictionary.info.modules.supported, dictionary.info.modules.connected) == ({1: "8 DI", 2: "8 DO"}, (1, 2, 1))
    assert subs(read_device_file(file, ()).dictionary) == subs(read_device_file(file).dictionary) == {}


def test_the_module_list_holds_the_modules(file: Path) -> None:
    held = read_dictionary(file, (1, 2, 1))[LIST]
    assert {sub: entry.initial(5) for sub, entry in held.entries.items()} == {
        0: b"\3", 1: b"\1\0", 2: b"\2\0", 3: b"\1\0"
    }  # fmt: skip


def test_modules_follow_the_inputs_of_the_coupler_itself() -> None:
    dictionary = described(coupler(own_inputs=3), 1)
    assert (list(dictionary[IN].entries), dictionary[IN].entries[0].default) == ([0, 1, 2, 3, 4, 5], b"\5")
    assert [entry.name for entry in dictionary[IN].entries.values()][1:] == [
        "Own 1", "Own 2", "Own 3", "Read input 4", "Read input 5"
    ]  # fmt: skip


@pytest.mark.parametrize(("modules", "entries"), [((1,), 1), ((1,) * 4, 1), ((1,) * 5, 2), ((1,) * 9, 3)])
def test_modules_that_share_a_byte_add_a_sub_index_when_it_is_full(modules: tuple[int, ...], entries: int) -> None:
    text = coupler().replace("Count=2\n", "Count=0;2\n")
    assert text != coupler()
    assert list(described(text, *modules)[IN].entries) == list(range(entries + 1))


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "utf-16"])
def test_other_modules_take_the_place_of_a_files_own(end: str, encoding: str) -> None:
    text = coupler().replace("odd.eds", "ödd.eds").replace("\n", end)
    first = with_modules(text.encode(encoding), (1, 1))
    second = with_modules(first, (2,))
    before, *after = (parse_eds(data, "c.eds") for data in (text.encode(encoding), first, second))
    count = len(before.text.sections)
    for file in after:
        assert file.text.sections[: count - 1] == before.text.sections[:-1]
        assert (len(file.text.sections), file.text.encoding) == (count + 1, before.text.encoding)
    assert [subs(file.dictionary) for file in after] == [{IN: [0, 1, 2, 3, 4]}, {OUT: [0, 1], FIXED: [0, 1]}]


@pytest.mark.parametrize(
    ("modules", "code", "said"),
    [
        (("1,9",), 2, "--modules 1,9: coupler.eds has no module 9; it has 1 8 DI, 2 8 DO"),
        (("1,x",), 2, "modules are numbers of the EDS"),
        (("0",), 2, "modules are numbers of the EDS"),
        (("",), 2, "modules are numbers of the EDS"),
        (("7:1",), 2, "no such node here"),
        (("5:1,1,2",), 0, ""),
        (("1", "5:1,1,2"), 0, ""),
    ],
)
def test_wrong_modules_are_said_before_anything_is_sent(
    file: Path, modules: tuple[str, ...], code: int, said: str
) -> None:
    words = [f"--modules={word}" for word in modules]
    ran = dvtcli(f"--sim={file}@5", *words, "read", "6100:02", merge=True)
    assert (ran.returncode, said in ran.stdout) == (code, True), ran.stdout


def test_a_device_without_modules_is_given_none(tmp_path: Path) -> None:
    (tmp_path / "plain.eds").write_text(plain().text())
    for words in (("--sim=plain.eds", "pdo"), ("--eds=plain.eds", "pdo"), ("eds", "show", "plain.eds")):
        ran = dvtcli(*words, "--modules=1", cwd=tmp_path, merge=True)
        assert (ran.returncode, "is of no modular device" in ran.stdout) == (2, True), ran.stdout


def test_simulated_nodes_have_their_own_modules(file: Path) -> None:
    words = (f"{file}@5", f"{file}@6", "generic@7")
    with Bench(words, {"modules": ("5:1,1", "2"), "yes": True}) as bench:
        assert bench.run("read 5:6100:04").code == 0
        assert bench.run("read 6:6300:01").code == 0
        assert bench.run("read 6:6100:01").code == 1
        assert bench.run("map 5:tpdo1 6100:04").code == 0


def test_the_module_list_of_a_device_is_asked(file: Path) -> None:
    with Bench((), {"eds": str(file), "node": 5, "yes": True}, beside([device(coupler(), 1, 1, 2)])) as bench:
        ran = bench.run("map tpdo1 6100:04 6100:01")
        assert (ran.code, "modul" in ran.stderr) == (0, False), ran
        assert subs(bench.session.node(5).dictionary) == {IN: [0, 1, 2, 3, 4], OUT: [0, 1], FIXED: [0, 1]}


def test_a_device_whose_list_cannot_be_read_is_said_once(file: Path) -> None:
    with Bench((), {"eds": str(file), "node": 5}, beside([device(coupler(has_list=False), 1)])) as bench:
        first, second = bench.run("pdo"), bench.run("pdo")
    assert "its modules are unknown: --modules 1,1,2 does" in " ".join(first.stderr.split())
    assert (first.code, second.code, "modules" in second.stderr) == (0, 0, False)


def test_modules_of_a_device_without_that_list_are_chosen(file: Path) -> None:
    options = {"eds": str(file), "node": 5, "modules": ("1,1,2",), "yes": True}
    with Bench((), options, beside([device(coupler(has_list=False), 1, 1, 2)])) as bench:
        ran = bench.run("map tpdo1 6100:04")
        assert (ran.code, "modul" in ran.stderr) == (0, False), ran
    with Bench((), {**options, "modules": ("9",)}, beside([device(coupler(), 1)])) as bench:
        refused = bench.run("pdo")
    assert (refused.code, "has no module 9" in refused.stderr) == (2, True), refused


def test_a_module_that_the_file_does_not_have_is_said(file: Path) -> None:
    other = coupler().replace("[M2", "[M9").replace("NrOfEntries=2\n\n[M1", "NrOfEntries=9\n\n[M1")
    with Bench((), {"eds": str(file), "node": 5}, beside([device(other, 1, 9)])) as bench:
        ran = bench.run("pdo")
        assert subs(bench.session.node(5).dictionary) == {IN: [0, 1, 2]}
    assert "module 9 of its list (0x1027) is not in coupler.eds" in " ".join(ran.stderr.split())


@pytest.mark.parametrize(("listed", "named"), [((1, 9, 1), 2), ((9, 1), 0), ((1, 0, 1), 4), ((0, 0, 1), 2)])
def test_objects_behind_a_module_that_nothing_describes_are_not_named(
    file: Path, listed: tuple[int, ...], named: int
) -> None:
    held = device(coupler(), *[1 for _ in listed])
    for sub_index, number in enumerate(listed, 1):
        held.set_value(LIST, sub_index, number.to_bytes(2, "little"))
    with Bench((), {"eds": str(file), "node": 5}, beside([held])) as bench:
        ran = bench.run("pdo")
        found = subs(bench.session.node(5).dictionary)
    assert found == ({IN: list(range(named + 1))} if named else {})
    assert ("which objects the modules from there on add" in " ".join(ran.stderr.split())) == (9 in listed)


def test_it_is_backed_up_with_its_modules(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(file.parent)
    file.write_text(coupler(own_inputs=2))
    held = device(coupler(own_inputs=2), 1, 2)
    with Bench((), {"eds": str(file), "node": 5, "yes": True}, beside([held])) as bench:
        assert bench.run("write 2206:1 7").code == 0
        for name in ("kept.dcf", "kept.xdc", "kept.jsonl"):
            assert bench.run(f"backup {name}").code == 0
            compared = bench.run(f"compare {name}")
            assert compared.code == 0, compared
    kept = read_device_file(Path("kept.dcf"))
    entry = kept.dictionary.entry(FIXED, 1)
    assert entry is not None
    assert (entry.initial(5), list(kept.dictionary[IN].entries)) == (b"\7\0", [0, 1, 2, 3, 4])
    assert kept.dictionary.info.modules.connected == (1, 2)
    with Bench(("kept.dcf@5",)) as bench:
        assert bench.run("read 6100:04").code == 0


def test_it_is_checked_and_converted_with_chosen_modules(file: Path, tmp_path: Path) -> None:
    shown = dvtcli("eds", "show", str(file), "--modules=1,2")
    assert "connected     1 2" in shown.stdout
    checked = dvtcli("eds", "check", str(file), "--modules=2", "--rule=object-exists", merge=True)
    assert checked.returncode == 0, checked.stdout
    made = tmp_path / "made.dcf"
    ran = dvtcli("eds", "convert", str(file), str(made), "--modules=1,2")
    assert (ran.returncode, "not carried over: object" in ran.stdout) == (0, False), ran
    assert subs(read_device_file(made).dictionary) == {IN: [0, 1, 2], OUT: [0, 1], FIXED: [0, 1]}


NETWORK = """nodes:
  io:
    node_id: 5
    dcf: coupler.eds
    modules: [1, 1, 2]
    tpdo:
      1: {mapping: ["6100:04", "6100:01"]}
    sdo: [{object: "2206:01", value: 6}]
"""


def test_a_network_file_says_the_modules_of_a_node(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(file.parent)
    Path("net.yaml").write_text(NETWORK)
    with Bench() as bench:
        checked = bench.run("check net.yaml")
        assert checked.code == 0, checked
        for target in ("io.cdcf", "net.dbc"):
            ran = bench.run(f"eds convert net.yaml {target}")
            assert ran.code == 0, ran
    assert "Read_input_4" in Path("net.dbc").read_text("cp1252")
    held = device(coupler(has_list=False), 1, 1, 2)
    with Bench((), {"node": 5, "yes": True}, beside([held])) as bench:
        applied = bench.run("apply net.yaml")
        assert (applied.code, "module" in applied.stderr) == (0, False), applied
        assert bench.run("plan net.yaml --exit-code").code == 0


def test_modules_that_the_file_lacks_are_complaints_with_their_place(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(file.parent)
    for row, said in (
        ("[1, 4]", "coupler.eds has no module 4"),
        ("1", "a list is expected here"),
        ("[x]", "whole number"),
    ):
        Path("net.yaml").write_text(NETWORK.replace("[1, 1, 2]", row))
        with Bench() as bench:
            ran = bench.run("check net.yaml")
        assert (ran.code, said in ran.stderr, "net.yaml:5:" in ran.stderr) == (4, True, True), ran


def test_an_exported_network_says_the_modules(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(file.parent)
    with Bench((), {"eds": "coupler.eds", "node": 5}, beside([device(coupler(), 1, 2)])) as bench:
        ran = bench.run("export net.yaml")
    assert (ran.code, "modules: [1, 2]" in Path("net.yaml").read_text()) == (0, True), ran
    with Bench() as bench:
        assert bench.run("check net.yaml").code == 0


def test_the_simulated_coupler_has_its_modules() -> None:
    with Bench(("coupler@5",), {"yes": True}) as bench:
        assert bench.run("map tpdo1 6000:01 6000:03 6401:02").code == 0
        assert bench.run("read 1027:04").stdout.split()[-1] == "u16"
    with Bench(("coupler@5",), {"modules": ("2",), "yes": True}) as bench:
        assert bench.run("map rpdo1 6200:02").code == 0
        assert bench.run("read 6000:02").code == 1


def test_a_served_coupler_says_its_modules() -> None:
    with Bench(
        (), {"eds": "coupler", "node": 1, "yes": True}, beside([simulated_device(*simulated_nodes(("coupler",)))])
    ) as bench:
        ran = bench.run("map tpdo1 6000:03 6401:01")
        assert (ran.code, "modul" in ran.stderr) == (0, False), ran


def dcf_of(path: Path, *modules: int) -> Path:
    """A DCF at *path* of the simulated coupler with other *modules*."""
    path.write_bytes(with_modules(path.read_bytes(), modules))
    return path


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """A backup of the simulated coupler, whose modules are 1, 1, 2 and 3."""
    with Bench(("coupler",), {"yes": True}) as bench:
        assert bench.run(f"backup {tmp_path}/kept.dcf").code == 0
    return tmp_path / "kept.dcf"


UNLIKE = "has modules 1, 2, 3; node 1 has 1, 1, 2, 3 (module list, 0x1027)"


@pytest.mark.parametrize("line", ["plan {}", "apply {}", "clone {}", "verify {}"])
def test_a_file_of_other_modules_is_refused_before_anything_is_written(line: str, kept: Path) -> None:
    dcf_of(kept, 1, 2, 3)
    with Bench(("coupler",), {"yes": True}) as bench:
        ran = bench.run(line.format(kept))
        assert (ran.code, UNLIKE in " ".join(ran.stderr.split())) == (6, True), ran
        assert bench.run(f"plan {kept} --force").code == 0
    with Bench(("coupler",), {"yes": True}) as bench:
        assert bench.run(line.format(dcf_of(kept, 1, 1, 2, 3))).code == 0


def test_a_description_of_other_modules_is_warned_of(kept: Path) -> None:
    """`modules:` of a network file says what the node should have; its own list says what it has."""
    net = kept.parent / "net.yaml"
    net.write_text("a: {node_id: 1, dcf: coupler, modules: [1, 2, 3], heartbeat_producer: 500}\n")
    with Bench(("coupler",), {"yes": True}) as bench:
        ran = bench.run(f"plan {net}")
    said = "the chosen modules are 1, 2, 3; node 1 has 1, 1, 2, 3 (module list, 0x1027)"
    assert (ran.code, said in " ".join(ran.stderr.split())) == (0, True), ran
    assert "--modules 1,1,2,3 names its modules" in " ".join(ran.stderr.split()), ran
    net.write_text("a: {node_id: 1, dcf: coupler, modules: [1, 1, 2, 3], heartbeat_producer: 500}\n")
    with Bench(("coupler",), {"yes": True}) as bench:
        assert "module list" not in bench.run(f"plan {net}").stderr
