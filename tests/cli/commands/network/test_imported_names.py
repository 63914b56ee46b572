"""What `import` and `export` write is read without the bus: names only where something the file leads to knows them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dvtcli.files.device_file import read_device_file
from dvtcli.files.network.read_network import read_network_file
from dvtcli.operations.network.described_network import unknown_names
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_names
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import device
from tests.harness.sample import heavy
from tests.small_eds import U8, plain, var
from tests.virtual_time import VirtualTimeBus

VENDOR, PRODUCT = 0x1234, 0x55


@pytest.fixture(autouse=True)
def _ground(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def offline() -> Bench:
    return Bench(())


def write(name: str, content: str) -> None:
    Path(name).write_text(content, "utf-8")


def live(one: StrictDevice) -> VirtualTimeBus:
    return VirtualTimeBus((one,), simulated=False)


def text(revision: int) -> str:
    """The EDS of a pump with an object whose name means it alone."""
    eds = plain()
    eds.info = {"VendorNumber": VENDOR, "ProductNumber": PRODUCT, "RevisionNumber": revision, "ProductName": "pump"}
    eds.variable(0x2100, var("Pressure", U8, 0, "ro", 1))
    held = (VENDOR, PRODUCT, revision, 7)
    eds.record(
        0x1018, "Identity", {n: {**eds.objects[0x1018][1][n], "DefaultValue": one} for n, one in enumerate(held, 1)}
    )
    return eds.text()


def pump(node_id: int) -> StrictDevice:
    """One of revision 0x00010001, as it is met on a bus."""
    write("made.eds", text(0x10001))
    return StrictDevice(read_device_file(Path("made.eds")).dictionary, Family(), node_id)


def frame_of(offline: Bench, frame: str, file: str = "net.yaml") -> str:
    """How the imported *file* decodes one *frame*."""
    write("run.log", f"(0.000000) can0 {frame}\n")
    ran = offline.run(f"decode run.log -d {file}")
    assert (ran.code, ran.stderr) == (0, "")
    return ran.stdout


@heavy
@pytest.mark.parametrize("family", sorted(family_names()))
def test_no_name_of_a_family_is_unknown_without_the_bus(family: str, offline: Bench) -> None:
    """Also of a family without a vendor-ID, which nothing but its name tells."""
    with Bench((), bus=live(device(family, 9))) as bench:
        for line in ("import net.yaml", "node 9", "export one.yaml", "plan net.yaml --exit-code"):
            assert bench.run(line).code == 0
    for file in ("net.yaml", "one.yaml"):
        assert not list(unknown_names(file, read_network_file(Path(file))))
        assert "is unknown: add" not in offline.run(f"check {file}").stdout


def test_a_served_generic_device_is_decoded_by_its_family(offline: Bench) -> None:
    with Bench((), bus=live(device("generic", 9))) as bench:
        assert bench.run("import net.yaml").code == 0
    assert "Statusword" in frame_of(offline, "189#3712")
    write("run.log", "(0.000000) can0 189#3712\n")
    assert "Statusword" in offline.run("decode run.log -d net.yaml --csv").stdout.splitlines()[0]


@heavy
@pytest.mark.parametrize("before", [(0x10001,), (0x10000, 0x10001, 0x20000), (0x0,)])
def test_an_imported_file_means_the_same_whatever_is_added_to_the_library(
    before: tuple[int, ...], offline: Bench
) -> None:
    """Files added later know the object by another name: also those of the device's own revision, the newest of it."""
    _added(offline, "before", before, "Pressure")
    with Bench((), bus=live(pump(5))) as bench:
        for line in ("map 5:tpdo1 2100", "import net.yaml", "node 5", "export one.yaml", "plan net.yaml --exit-code"):
            assert bench.run(line).code == 0, line
        assert re.search("- pressure +# 2100:00/8", Path("net.yaml").read_text("utf-8"))
        _added(offline, "later", (0x0, 0x10000, 0x10001, 0x10002, 0x20000), "Depth")
        for file in ("net.yaml", "one.yaml"):
            assert "Pressure" in frame_of(offline, "185#07", file)
            assert offline.run(f"check {file}").code == 0
    with Bench((), bus=live(pump(5))) as bench:
        assert bench.run("map 5:tpdo1 2100").code == 0
        assert bench.run("plan net.yaml --exit-code").code == 0


@heavy
def test_a_family_that_is_chosen_stays_its_name(offline: Bench) -> None:
    """Another computer has its file elsewhere."""
    with Bench((), {"yes": True, "eds": "generic", "node": 5}, live(device("generic", 5))) as bench:
        assert bench.run("import made.yaml").code == 0
    assert 'dcf: "generic"' in Path("made.yaml").read_text("utf-8")


def test_a_file_of_the_library_that_was_removed_is_said_to_be_missing(offline: Bench) -> None:
    _added(offline, "only", (0x10001,), "Pressure")
    with Bench((), bus=live(pump(5))) as bench:
        for line in ("map 5:tpdo1 2100", "import net.yaml", "eds remove only10001.eds --yes"):
            assert bench.run(line).code == 0, line
    ran = offline.run("check net.yaml")
    ran.failed(4, "error: there is no 00001234-00000055-00010001_only10001.eds")


def _added(offline: Bench, name: str, revisions: tuple[int, ...], pressure: str) -> None:
    for revision in revisions:
        write(f"{name}{revision:X}.eds", text(revision).replace("Pressure", pressure))
        assert offline.run(f"eds add {name}{revision:X}.eds").code == 0


@heavy
def test_a_file_that_is_added_later_does_not_take_an_imported_familys_names(offline: Bench) -> None:
    with Bench((), bus=live(device("tmcm", 5))) as bench:
        assert bench.run("import net.yaml").code == 0
    (node,) = read_network_file(Path("net.yaml")).nodes
    before = frame_of(offline, "185#3712")
    later = re.sub(r"(?m)^VendorNumber=.*", f"VendorNumber={node.identity.vendor}", text(0x7777_0000))
    write("later.eds", re.sub(r"(?m)^ProductNumber=.*", f"ProductNumber={node.identity.product}", later))
    assert offline.run("eds add later.eds").code == 0
    assert "later" in offline.run("eds list").stdout
    assert frame_of(offline, "185#3712") == before
    assert "error" not in offline.run("check net.yaml").stdout


def test_decode_says_why_a_name_is_unknown(offline: Bench) -> None:
    write("net.yaml", "pump: {node_id: 5, tpdo: {1: {enabled: true, mapping: [statusword]}}}\n")
    write("run.log", "(0.000000) can0 185#3712\n")
    for words in ("decode run.log", "decode --csv run.log", "plot run.log statusword"):
        said = offline.run(f"{words} -d net.yaml").stderr
        assert "net.yaml:1:" in said
        assert "object 'statusword' of node 5 is unknown: add `dcf:`" in said
