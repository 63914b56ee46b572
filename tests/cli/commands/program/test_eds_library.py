"""The library of device files: filled from files, folders and families, listed, and the file a node gets, with why."""

from __future__ import annotations

import ctypes
import json
import os
import re
import struct
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import dvtcli
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.ports import CanopenBus
from dvtcli.errors import InputFileError
from dvtcli.files.device_file import read_device_file
from dvtcli.files.device_library import StoredFile, folder, match, stored_files, stored_place
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds
from tests.bus.devices import unknown
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import device
from tests.harness.sample import heavy
from tests.process import run
from tests.real_files import real_files
from tests.small_eds import plain
from tests.virtual_time import VirtualTimeBus

VENDOR, PRODUCT = 0x1234, 0x55


@pytest.fixture(autouse=True)
def _ground(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def text(revision: int | None = 0x10001, product: int = PRODUCT, vendor: int = VENDOR, name: str = "pump") -> str:
    """The EDS of a device of that identity; no *revision*: the file names none."""
    eds = plain()
    eds.info = {"VendorNumber": vendor, "ProductNumber": product, "ProductName": name}
    if revision is not None:
        eds.info["RevisionNumber"] = revision
    parts = enumerate((vendor, product, revision or 0, 7), 1)
    eds.record(0x1018, "Identity", {n: {**eds.objects[0x1018][1][n], "DefaultValue": held} for n, held in parts})
    return eds.text()


def write(name: str, content: str) -> None:
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content, "utf-8")


def pump(node_id: int, revision: int = 0x10001, product: int = PRODUCT) -> StrictDevice:
    """A device of that identity, as it is met on a bus."""
    write("made.eds", text(revision, product))
    return StrictDevice(read_device_file(Path("made.eds")).dictionary, Family(), node_id)


def live(*devices: StrictDevice) -> CanopenBus:
    return VirtualTimeBus(devices, simulated=False)


@pytest.fixture
def offline() -> Iterator[Bench]:
    with Bench(()) as bench:
        yield bench


def outcomes(document: dict[str, object]) -> dict[str, str]:
    return {Path(row["file"]).name: row["outcome"] for row in document["files"]}  # type: ignore[attr-defined]


@heavy
def test_a_folder_is_added_with_all_in_it_and_what_is_wrong_is_named(offline: Bench) -> None:
    write("old/a.eds", text())
    write("old/deep/b.EDS", text(product=2))
    write("old/deep/same.eds", text())
    write("old/broken.eds", "no file of a device\n")
    write("old/nobody.eds", text(vendor=0))
    write("old/read.me", "x")
    write("old/.git/c.eds", text(product=3))
    ran = offline.run("eds add old --json")
    assert ran.code == 4
    assert outcomes(ran.document) == {
        "a.eds": "added", "b.EDS": "added", "same.eds": "already there", "broken.eds": "refused",
        "nobody.eds": "refused",
    }  # fmt: skip
    assert ran.document["count"] == {"added": 2, "replaced": 0, "already_there": 1, "refused": 2}
    assert ran.document["no_device_files"] == 1
    wrong = {Path(row["file"]).name: row for row in ran.document["files"]}
    assert wrong["broken.eds"]["place"].endswith("broken.eds:1")
    assert "--identity vendor=" in wrong["nobody.eds"]["hint"]
    shown = offline.run("eds add old").stdout
    assert "2 already there, " not in shown
    assert "3 already there, 2 refused; 1 other file left out" in shown
    assert shown.count("--identity") == 1
    write("old/a.eds", text(name="changed"))
    assert outcomes(offline.run("eds add old/a.eds old/deep --json").document)["a.eds"] == "replaced"


@given(length=st.integers(0, text().index("[6200]")))
@example(text().index("[1000]"))
def test_a_file_that_is_cut_short_is_not_taken(length: int) -> None:
    write("cut.eds", text()[:length])
    with Bench(()) as bench:
        assert bench.run("eds add cut.eds").code == 4
    assert not folder().exists()


def test_a_file_without_objects_describes_no_node() -> None:
    write("bare.eds", text()[: text().index("[MandatoryObjects]")])
    place = stored_place((VENDOR, PRODUCT, 0x10001), "bare.eds")
    write(str(place), Path("bare.eds").read_text("utf-8"))  # as a release before took it
    with Bench((), {"node": 5}, bus=live(pump(5))) as bench:
        for line in ("backup a.jsonl", "backup a.dcf", "read 1000"):
            ran = bench.run(line)
            assert (ran.code, "bare.eds describes no object" in ran.stderr) == (4, True), line
        assert not Path("a.jsonl").exists()
        assert "describes no object" in bench.run("eds list").stdout
        assert bench.run("eds check bare.eds").code == 4


def test_a_file_of_that_name_and_identity_is_replaced(offline: Bench) -> None:
    write("a.eds", text())
    assert offline.run("eds add a.eds").code == 0
    write("a.eds", text(name="changed"))
    assert outcomes(offline.run("eds add a.eds --dry-run --json").document) == {"a.eds": "replaced"}
    assert offline.run("eds list --json").document["files"][0]["product"] == "pump"
    assert outcomes(offline.run("eds add a.eds --json").document) == {"a.eds": "replaced"}
    assert [row["product"] for row in offline.run("eds list --json").document["files"]] == ["changed"]


def test_a_dry_run_writes_nothing(offline: Bench) -> None:
    write("a.eds", text())
    ran = offline.run("eds add a.eds --dry-run")
    assert (ran.code, "nothing was written" in ran.stdout) == (0, True)
    assert "from now on" not in ran.stdout
    assert not folder().exists()
    assert offline.run("eds add a.eds").code == 0
    for line in ("eds remove a.eds --dry-run", "eds prefer a.eds --dry-run"):
        assert "nothing was changed" in offline.run(line).stdout
    assert len(offline.run("eds list --json").document["files"]) == 1


@pytest.mark.parametrize(
    ("line", "code", "said"),
    [
        ("eds add nothing", 2, "no such file or folder, and no family"),
        ("eds add nobody.eds", 4, "has no vendor number (0 is not assigned)"),
        ("eds add lely", 4, "has no vendor number"),
        ("eds add empty", 2, "no EDS, DCF, XDD or XDC file"),
        ("eds add nobody.eds gen4 --identity vendor=1,product=2", 2, "--identity: one file has it, and these are 2"),
        ("eds add nobody.eds --identity product=1", 2, "--identity: a vendor is needed"),
        ("eds add nobody.eds --identity vendor=0,product=1", 2, "--identity: a vendor is needed"),
        ("eds add nobody.eds --identity maker=1", 2, "write vendor=…"),
        ("eds list --identity vendor=1,product=2", 2, "belongs to eds add"),
        ("eds list a.eds", 2, "takes no file"),
        ("eds remove nothing.eds", 2, "no file of the library"),
        ("eds prefer 1 2", 2, "takes one file"),
        ("eds check", 2, "Missing argument"),
    ],
)
def test_what_cannot_be_is_refused(line: str, code: int, said: str, offline: Bench) -> None:
    write("nobody.eds", text(vendor=0))
    Path("empty").mkdir()
    ran = offline.run(line)
    ran.failed(code, said)


def without_product(node_id: int, product: int | None) -> StrictDevice:
    """A device of VENDOR whose 1018:02 does not exist (None) or holds no product number."""
    write("made.eds", text(0x10001, product or 0))
    described = read_device_file(Path("made.eds")).dictionary
    identity = described[0x1018]
    entries = {sub: entry for sub, entry in identity.entries.items() if product is not None or sub != 2}
    objects = {index: described[index] for index in described} | {0x1018: replace(identity, entries=entries)}
    return StrictDevice(ObjectDictionary(objects, described.info, described.source), Family(), node_id)


@pytest.mark.parametrize("product", [None, 0, 0xFFFFFFFF])
@pytest.mark.parametrize("given", ["", ",product=0", ",product=0xFFFFFFFF"])
def test_a_node_without_a_product_number_gets_the_file_of_its_vendor(product: int | None, given: str) -> None:
    """It does not take away the file of a node that has a number, and never describes such a node."""
    write("bare.eds", text(product=0xFFFFFFFF))
    with Bench((), bus=live(without_product(4, product), pump(5))) as bench:
        refused = bench.run("eds add bare.eds")
        refused.failed(4, "it has no product number")
        assert "eds add FILE --identity vendor=0x1234`; or" in " ".join(refused.stderr.split())
        scanned = bench.run("scan --json").document["nodes"]
        assert [row["eds"] for row in scanned] == ["", ""]
        added = bench.run(f"eds add bare.eds --identity vendor=0x{VENDOR:X}{given}")
        assert (added.code, "without a product number" in " ".join(added.stdout.split())) == (0, True)
        assert "bare.eds" in bench.run("eds list").stdout
    with Bench((), bus=live(without_product(4, product), pump(5))) as bench:
        rows = {row["node"]: row for row in bench.run("scan --json").document["nodes"]}
        assert rows[4]["eds"].endswith("_bare.eds")
        assert rows[4]["eds_why"] == "library: vendor, and neither has a product number; bare.eds names no revision"
        assert rows[5]["eds"] == ""
        assert bench.run("import net.yaml").code == 0
        assert bench.run("plan net.yaml --exit-code").code == 0
    assert "bare.eds" in Path("net.yaml").read_text("utf-8")


def test_a_refused_read_of_the_product_number_is_no_missing_number() -> None:
    """A device that refuses 1018:02 for another reason may have a number: the file of its vendor may be another's."""
    write("bare.eds", text(product=0))
    pump(5)
    described = read_device_file(Path("made.eds")).dictionary
    refusing = StrictDevice(described, Family(absent={(0x1018, 2): 0x0800_0022}), 5)
    with Bench((), {"node": 5}, bus=live(refusing)) as bench:
        assert bench.run(f"eds add bare.eds --identity vendor=0x{VENDOR:X}").code == 0
        assert bench.run("node --json").document["nodes"][0]["eds"] == ""


@pytest.mark.parametrize("line", ["import net.yaml", "export all.cpj", "export all.dbc", "doctor"])
def test_a_node_without_a_vendor_number_is_not_sent_to_the_library(line: str) -> None:
    write("nobody.eds", text(vendor=0))
    nobody = StrictDevice(read_device_file(Path("nobody.eds")).dictionary, Family(), 4)
    with Bench((), {"yes": True, "interface": "virtual", "channel": "0"}, bus=live(nobody, pump(5))) as bench:
        assert bench.run("node 4").code == 0
        ran = bench.run(line)
        said = " ".join((ran.stdout + ran.stderr).split())
        assert "no vendor number (0x1018:01), so no file of the library can be found for node 4" in said
        assert "`dcf: FILE` at it in a network file" in said
        assert "--eds FILE adds it" not in said
        assert "; ;" not in said
        assert said.count("eds add FILE") == (0 if line == "doctor" else 1)


def test_a_file_that_names_nobody_is_bound_by_hand() -> None:
    write("nobody.eds", text(vendor=0, name="bare"))
    with Bench((), {"node": 5}, bus=live(pump(5))) as bench:
        assert bench.run("node --json").document["nodes"][0]["eds"] == ""
        assert bench.run(f"eds add nobody.eds --identity vendor=0x{VENDOR:X},product=0x{PRODUCT:X}").code == 0
        assert bench.run("eds list --json").document["files"][0]["by_hand"] is True
        assert "bound by hand" in bench.run("eds list").stdout
    with Bench((), {"node": 5}, bus=live(pump(5))) as bench:
        row = bench.run("node --json").document["nodes"][0]
        assert row["eds"].endswith("_nobody.eds")
        assert row["eds_why"] == "library: vendor and product; nobody.eds names no revision"


def test_another_revision_is_taken_and_said_once() -> None:
    write("old.eds", text(0x10001))
    with Bench((), bus=live(pump(3, 0x10003), pump(4, 0x10003), pump(5, 0x20000), pump(6, 0x10001))) as bench:
        assert bench.run("eds add old.eds").code == 0
        first = bench.run("read 3:1000")
        assert "note: node 3: revision 0x00010003 on the device, 0x00010001 in old.eds" in first.stderr
        for again in ("read 3:1000", "read 4:1000", "read 6:1000"):
            assert "revision" not in bench.run(again).stderr
        scanned = bench.run("scan")
        assert "nodes 3 and 4: revision 0x00010003 on the device, 0x00010001 in old.eds" in scanned.stdout
        assert "node 5: revision 0x00020000 on the device, 0x00010001 in old.eds" in scanned.stdout
        assert bench.run("read 5:1000").stderr == ""
        rows = {row["node"]: row for row in bench.run("scan --json").document["nodes"]}
        assert rows[6]["eds_why"] == "library: vendor, product and revision 0x00010001"
        assert (rows[6]["eds_note"], rows[5]["eds_note"] != "") == ("", True)
        assert "EDS note" in bench.run("node 3").stdout


def test_another_major_revision_is_warned_of_before_a_change() -> None:
    write("old.eds", text(0x10001))
    with Bench((), {"node": 5}, bus=live(pump(5, 0x20000))) as bench:
        assert bench.run("eds add old.eds").code == 0
        assert "warning: node 5: revision 0x00020000" in bench.run("map tpdo2 6000:01 --dry-run").stderr
        assert bench.run("map tpdo2 6000:01 --dry-run").stderr == ""


@pytest.mark.parametrize("line", ["backup n.dcf", "backup n.xdc", "export n.dcf"])
def test_a_file_of_a_device_says_its_own_revision_not_that_of_its_eds(line: str) -> None:
    write("old.eds", text(0x10001))
    with Bench((), {"node": 5}, bus=live(pump(5, 0x20000))) as bench:
        assert bench.run("eds add old.eds").code == 0
        assert bench.run(line).code == 0
        file = line.split()[1]
        assert read_device_file(Path(file)).dictionary.info.revision_number == 0x20000
        compared = bench.run(f"compare {file} --json")
        assert (compared.code, compared.document["unlike"]) == (0, "")
        found = bench.run(f"eds check {file} --json").document["findings"]
        assert "device-identity" not in {one["rule"] for one in found}


def test_rivals_are_named_and_one_is_chosen() -> None:
    write("a.eds", text())
    write("b.eds", text(name="other"))
    write("b-copy.eds", text(name="other"))
    write("c.dcf", text(name="of one node") + "[DeviceComissioning]\nNodeID=5\n")
    with Bench((), {"node": 5}, bus=live(pump(5))) as bench:
        assert bench.run("eds add a.eds").code == 0
        added = bench.run("eds add b.eds c.dcf b-copy.eds")
        assert "a.eds of the same vendor, product and revision says something else: b.eds is taken" in added.stdout
        assert "it is there as b.eds" in added.stdout
        assert (
            "b.eds is taken, the file added last, but a.eds would also match: choose with eds prefer FILE"
            in bench.run("node").stderr
        )
        assert bench.run("node --json").document["nodes"][0]["eds"].endswith("_b.eds")
        assert "2: b.eds is used before 1, 3 of its identity (the file added last" in bench.run("eds list").stdout
        assert bench.run("eds prefer a.eds").code == 0
        listed = bench.run("eds list --json").document["files"]
        assert [row["name"] for row in listed] == ["a.eds", "b.eds", "c.dcf"]
        assert [(row["taken"], row["preferred"]) for row in listed] == [(True, True), (False, False), (False, False)]
        assert "1: a.eds is used before 2, 3 of its identity (preferred)" in bench.run("eds list").stdout
    with Bench((), {"node": 5, "yes": True}, bus=live(pump(5))) as bench:
        ran = bench.run("node --json")
        assert (ran.document["nodes"][0]["eds"].endswith("_a.eds"), ran.stderr) == (True, ""), "it was decided"
        assert ran.document["nodes"][0]["eds_why"].endswith("; preferred to others that fit as well")
        assert bench.run("eds prefer c.dcf").code == 0
    with Bench((), {"node": 5}, bus=live(pump(5))) as bench:
        assert bench.run("node --json").document["nodes"][0]["eds"].endswith("_c.dcf"), "also before an EDS"
        write("d.eds", text(name="later"))
        assert bench.run("eds add d.eds").code == 0
    with Bench((), {"node": 5, "yes": True}, bus=live(pump(5))) as bench:
        ran = bench.run("node --json")
        assert ran.document["nodes"][0]["eds"].endswith("_d.eds")
        assert "d.eds is taken, the file added last, but a.eds, b.eds would also match" in ran.stderr
        assert bench.run("eds remove 1").code == 0
        assert bench.run(f"eds remove {VENDOR:08x}-{PRODUCT:08x}").code == 0
        assert bench.run("eds list --json").document["files"] == []
        assert list(folder().rglob("*.*")) == []


def test_nobody_removes_by_mistake(offline: Bench) -> None:
    write("a.eds", text())
    offline.run("eds add a.eds")
    write("a.eds", text(0x20000))
    offline.run("eds add a.eds")
    assert "give a full name" in offline.run("eds remove a.eds").stderr
    ran = offline.run("eds remove 2")
    ran.failed(6, "no terminal to answer on: remove from the library")
    assert len(offline.run("eds list --json").document["files"]) == 2


def test_a_served_family_is_recognised_and_a_device_of_that_make_is_not() -> None:
    with Bench((), bus=live(device("gen4", 5), unknown(6, "gen4"), device("generic", 7), device("lely", 8))) as bench:
        row = bench.run("node 5 --json").document["nodes"][0]
        assert (row["eds"], row["eds_why"].split(":")[0]) == ("gen4.eds", "family gen4")
        scanned = {one["node"]: one["eds"] for one in bench.run("scan --json").document["nodes"]}
        assert scanned == {5: "gen4.eds", 6: "", 7: "generic.eds", 8: ""}
        assert bench.run("read 5:statusword").code == 0
        assert bench.run("node 6 --json").document["nodes"][0]["eds"] == ""
        assert bench.run("node 7 --json").document["nodes"][0]["eds"] == "generic.eds"


def test_a_family_is_shown_and_checked_by_its_name(offline: Bench) -> None:
    shown = offline.run("eds show gen4 --json")
    assert (shown.code, shown.document["file"]) == (0, str(family_eds("gen4")))
    checked = offline.run("eds check gen4 --json")
    assert (checked.code, checked.document["file"]) == (0, str(family_eds("gen4")))
    assert offline.run("eds show gen5").code == 2


def test_the_library_goes_before_a_family() -> None:
    with Bench((), {"node": 5}, bus=live(device("gen4", 5))) as bench:
        write("mine.eds", family_eds("gen4").read_text("utf-8") + "; mine\n")
        assert bench.run("eds add mine.eds").code == 0
        assert bench.run("node --json").document["nodes"][0]["eds"].endswith("_mine.eds")


@pytest.mark.parametrize("revision", ["0x00010001", "0x00030016"])
def test_a_family_s_own_file_goes_before_another_revision_of_the_library(revision: str) -> None:
    family = family_eds("tmcm").read_text("utf-8")
    other = re.sub(r"(?im)^RevisionNumber=.*$", f"RevisionNumber={revision}", family)
    assert other != family
    with Bench((), {"node": 5}, bus=live(device("tmcm", 5))) as bench:
        write("other.eds", other)
        assert bench.run("eds add other.eds").code == 0
        row = bench.run("node --json").document["nodes"][0]
        assert (row["eds"], row["eds_why"].split(":")[0]) == ("tmcm.eds", "family tmcm")


def test_a_network_file_finds_its_nodes_files_by_their_identity(offline: Bench) -> None:
    identity = f"identity: {{vendor: 0x{VENDOR:X}, product: 0x{PRODUCT:X}, revision: 0x10003}}"
    write("net.yaml", f"pump: {{node_id: 5, {identity}, tpdo: {{1: {{mapping: [Input 2]}}}}}}\n")
    before = offline.run("check net.yaml --json").document["files"][0]
    assert "object 'Input 2'" in before["notes"][0]["text"]
    write("old.eds", text())
    offline.run("eds add old.eds")
    after = offline.run("check net.yaml --json").document["files"][0]
    said = [note["text"] for note in after["notes"]]
    assert said == ["node 5: revision 0x00010003 in `identity:`, 0x00010001 in old.eds"]
    write("new.eds", text(0x10003))
    offline.run("eds add new.eds")
    assert offline.run("check net.yaml --json").document["files"][0]["notes"] == []
    assert offline.run("report net.html net.yaml").code == 0
    assert "Input 2" in Path("net.html").read_text("utf-8")


@pytest.fixture
def often_switching() -> Iterator[None]:
    """Threads take turns a thousand times as often: what falls between two steps does, and not once in a hundred."""
    usual_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(usual_s)


@pytest.mark.parametrize("_again", range(4))
def test_several_that_add_at_once_disturb_nobody(often_switching: None, _again: int) -> None:
    for number in range(1, 9):
        write(f"all/{number}.eds", text(product=number))
    with ThreadPoolExecutor(8) as pool:
        added = list(pool.map(lambda _: dvtcli.add_eds("all"), range(8)))
    assert all(added)
    listed = dvtcli.eds_library()
    assert [row.product_code for row in listed] == list(range(1, 9))
    assert all(Path(row.path).read_text("utf-8") == text(product=row.product_code) for row in listed)
    assert listed.strangers == 0
    assert {path.suffix for path in folder().rglob("*") if path.is_file()} == {".eds", ".json"}


@heavy
def test_the_list_opens_no_file_that_it_knows(offline: Bench) -> None:
    for number in range(1, 61):
        write(f"all/{number}.eds", text(product=number))
    assert offline.run("eds add all").code == 0
    with opened_files(folder()) as opened:
        assert len(offline.run("eds list --json").document["files"]) == 60
    assert not [name for name in opened if name.endswith(".eds")]
    Path(stored_place((VENDOR, 7, 0x10001), "7.eds")).write_text(text(product=7, name="changed"), "utf-8")
    with opened_files(folder()) as opened:
        offline.run("eds list")
    assert {name for name in opened if name.endswith(".eds")} == {stored_place((VENDOR, 7, 0x10001), "7.eds").name}
    with (
        opened_files(folder()) as opened,
        Bench((), bus=live(*(pump(node, product=7) for node in range(1, 11)))) as bench,
    ):
        bench.run("scan")
        assert all(bench.run(f"read {node}:1000").code == 0 for node in range(1, 11))
    assert len([name for name in opened if name.endswith(".eds")]) <= 2  # what it is, then what is in it


def test_the_list_opens_each_note_as_often_however_many_there_are(offline: Bench) -> None:
    most: list[int] = []
    for many in (3, 12):
        for number in range(many):
            write(f"all/{number}.eds", text(name=f"pump {number}"))
        assert offline.run("eds add all").code == 0
        with opened_files(folder()) as opened:
            files = offline.run("eds list --json").document["files"]
        assert [one["taken"] for one in files].count(True) == 1
        notes = Counter(name for name in opened if name.endswith(".json"))
        assert len(notes) == many
        most.append(max(notes.values()))
    assert most[0] == most[1]


@pytest.mark.parametrize(
    "note",
    [
        b"", b"\xff\xfe", b"[]", b"{}", b"[" * 10_000, b'{"from": 5}', b'{"from": "x", "dvtcli": "0", "file": 3}',
        b"x" * 50_000,
        b'{"from": "\\u001b[31mred", "dvtcli": "9.9", "file": [1, 2], "says": {}}',
    ],
    ids=range(9),
)  # fmt: skip
def test_a_note_that_is_wrong_counts_as_none(note: bytes, offline: Bench) -> None:
    write("a.eds", text())
    offline.run("eds add a.eds")
    about = next((folder() / "about").iterdir())
    about.write_bytes(note)
    shown = offline.run("eds list")
    assert (shown.code, "\x1b[31m" in shown.stdout) == (0, False)
    about.write_bytes(note)
    assert offline.run("eds list --json").document["files"][0]["product"] == "pump"
    assert json.loads(about.read_text("utf-8"))["says"]["product_name"] == "pump"


@pytest.mark.parametrize("key", ["vendor_id", "product_name", "objects"])
def test_a_note_with_a_value_of_another_kind_counts_as_none(key: str, offline: Bench) -> None:
    write("a.eds", text())
    offline.run("eds add a.eds")
    about = next((folder() / "about").iterdir())
    said = json.loads(about.read_text("utf-8"))
    said["says"][key] = [1]
    about.write_text(json.dumps(said), "utf-8")
    assert offline.run("eds list --json").document["files"][0]["product"] == "pump"


@pytest.mark.skipif(sys.platform == "win32" or getattr(os, "geteuid", lambda: 1)() == 0, reason="nobody is kept out")
def test_a_library_that_cannot_be_written_is_read_all_the_same(offline: Bench) -> None:
    write("a.eds", text())
    offline.run("eds add a.eds")
    for path in (folder() / "about").iterdir():
        path.unlink()
    (folder() / "about").rmdir()
    folder().chmod(0o500)
    try:
        assert offline.run("eds list --json").document["files"][0]["product"] == "pump"
        write("b.eds", text(product=9))
        assert offline.run("eds add b.eds").code == 2
    finally:
        folder().chmod(0o700)


def test_what_is_broken_in_the_library_is_said_in_the_list(offline: Bench) -> None:
    write("a.eds", text())
    offline.run("eds add a.eds")
    stored_place((VENDOR, PRODUCT, 0x10001), "a.eds").write_text("gone", "utf-8")
    (folder() / "by-hand.eds").write_text(text(), "utf-8")
    ran = offline.run("eds list")
    assert ran.code == 0
    assert "a.eds is not an EDS or DCF file" in ran.stdout
    assert "1 file there not added by `eds add`" in ran.stdout


def test_names_from_files_cannot_bend_the_screen(offline: Bench) -> None:
    write("odd\x1b[2Jname.eds", text(name="red\x1b[31m"))
    assert offline.run("eds add .").code == 0
    assert "\x1b" not in offline.run("eds list").stdout
    assert "\x1b" not in offline.run("eds add .").stdout


@heavy
def test_doctor_says_where_they_are(offline: Bench) -> None:
    write("a.eds", text())
    offline.run("eds add a.eds")
    checks = offline.run("doctor --json").document["checks"]
    assert [one["text"] for one in checks if one["check"] == "EDS files"] == [f"1 in {folder()}: eds list shows them"]


@given(
    st.lists(st.sampled_from([0, 0x10000, 0x10001, 0x10005, 0x20000]), max_size=6), st.integers(0, 0x20001) | st.none()
)
def test_the_file_that_is_taken_fits_best(revisions: list[int], revision: int | None) -> None:
    files = [StoredFile(Path(f"{n}.eds"), VENDOR, PRODUCT, one) for n, one in enumerate(revisions)]
    found = match([*files, StoredFile(Path("x.eds"), VENDOR, PRODUCT + 1, 0)], VENDOR, PRODUCT, revision)
    if not revisions:
        assert found is None
        return
    assert found is not None
    taken = found.file.revision
    if revision in revisions:
        assert taken == revision
    elif revision is not None and any(one and one >> 16 == revision >> 16 for one in revisions):
        assert taken == max(one for one in revisions if one and one >> 16 == revision >> 16)
    elif revision is not None and 0 in revisions:
        assert taken == 0
    else:
        assert taken == max(revisions)
    differs = bool(taken) and revision is not None and taken != revision
    assert ("on the device" in found.note) == differs


def test_every_real_file_is_found_by_its_own_identity_or_named(pytestconfig: pytest.Config, offline: Bench) -> None:
    paths = real_files(pytestconfig, (".eds", ".dcf", ".xdd", ".xdc"))
    if not paths:
        pytest.skip("--eds-corpus names no folder")
    ran = offline.run(f'eds add "{paths[0].parent}" --json')
    rows = {row["file"]: row for row in ran.document["files"]}
    assert set(rows) == {str(path) for path in paths}
    listed = {row["file"] for row in offline.run("eds list --json").document["files"]}
    for path in paths:
        row = rows[str(path)]
        if row["outcome"] == "refused":
            with pytest.raises(InputFileError):
                _own_find(path)
            assert row["hint"]
        else:
            found = _own_find(path)
            assert found.path.read_bytes() == path.read_bytes()
            assert {row["kept"], str(found.path)} <= listed


def _own_find(path: Path) -> StoredFile:
    from dvtcli.files.device_library import match, stored_files

    info = read_device_file(path).dictionary.info
    found = match(stored_files(), info.vendor_id or 0, info.product_code or 0, info.revision_number)
    if found is None or info.product_code is None:
        raise InputFileError(f"{path} is not found by its identity")
    return found.file


def test_what_is_added_is_taken_whatever_the_clock_says() -> None:
    write("a.eds", text())
    write("b.eds", text(name="other"))
    with Bench((), {"node": 5}, bus=live(pump(5))) as bench:
        assert bench.run("eds add a.eds").code == 0
        os.utime(stored_place((VENDOR, PRODUCT, 0x10001), "a.eds"), (4_000_000_000,) * 2)
        assert "b.eds is taken from now on" in bench.run("eds add b.eds").stdout
        assert bench.run("node --json").document["nodes"][0]["eds"].endswith("_b.eds")


LABELS = ["a.eds", "b.eds", "c.dcf", "d.dcf"]
OF_ONE_NODE = "[DeviceComissioning]\nNodeID=5\n"


def _taken() -> str:
    """What a node is given now, whatever anybody said of it."""
    found = match(stored_files(), VENDOR, PRODUCT, 0x10001)
    return "" if found is None else found.file.label


def test_a_preference_holds_until_a_file_goes_first_without_it(offline: Bench) -> None:
    write("mm.eds", text())
    for name in ("m.dcf", "z.dcf"):
        write(name, text(name=name) + OF_ONE_NODE)
    for line in ("eds add mm.eds", "eds add m.dcf", "eds prefer m.dcf"):
        assert offline.run(line).code == 0
    for line in ("eds add z.dcf --dry-run", "eds add z.dcf"):
        added = offline.run(line).stdout
        assert "m.dcf of the same vendor, product and revision stays the one that is taken" in added
        assert "use them from now on" not in added
        assert _taken() == "m.dcf"
    write("m.dcf", text(name="newer") + OF_ONE_NODE)
    assert "m.dcf is taken from now on" in offline.run("eds add m.dcf").stdout
    listed = {row["name"]: row["preferred"] for row in offline.run("eds list --json").document["files"]}
    assert (_taken(), listed) == ("m.dcf", {"m.dcf": True, "mm.eds": False, "z.dcf": False})
    write("n.eds", text(name="n"))
    assert "n.eds is taken from now on" in offline.run("eds add n.eds").stdout
    assert _taken() == "n.eds"


@settings(max_examples=max(2, settings().max_examples // 20))
@given(st.lists(st.tuples(st.sampled_from(["add", "add", "prefer"]), st.sampled_from(LABELS)), max_size=8))
def test_what_is_said_to_be_taken_is_taken(steps: list[tuple[str, str]]) -> None:
    for one in stored_files():
        one.path.unlink()
    with Bench() as bench:
        for number, (what, label) in enumerate(steps):
            if what == "add":
                write(label, text(name=f"pump {number}") + (OF_ONE_NODE if label.endswith("dcf") else ""))
            before = len(stored_files())
            ran = bench.run(f"eds {what} {label} --json")
            if what == "prefer":
                assert ran.code == 2 or _taken() == label
                continue
            note = ran.document["files"][0]["note"]
            assert _taken() == (note.split()[0] if "stays the one" in note else label), note
            assert bool(note) is (before > 0 and len(stored_files()) > 1)


def test_who_prefers_is_told_where_it_cannot_be_noted(offline: Bench) -> None:
    write("m.eds", text())
    write("m.dcf", text(name="of one node") + OF_ONE_NODE)
    for line in ("eds add m.dcf", "eds add m.eds"):
        assert offline.run(line).code == 0
    about = folder() / "about"
    for note in about.iterdir():
        note.unlink()
    about.rmdir()
    about.write_text("no folder", "utf-8")
    ran = offline.run("eds prefer m.dcf")
    assert (ran.code, str(about) in ran.stderr, ran.stdout) == (2, True, "")
    assert _taken() == "m.eds"
    about.unlink()
    assert offline.run("eds prefer m.dcf").code == 0
    assert _taken() == "m.dcf"


def test_files_of_one_name_from_two_folders_are_both_kept_and_said(offline: Bench) -> None:
    for version in ("v1", "v2"):
        write(f"all/{version}/drive.eds", text(name=version))
    first = offline.run("eds add all --json").document
    assert first["count"]["added"] == 2
    assert "says something else: drive-2.eds is taken from now on" in first["files"][1]["note"]
    assert offline.run("eds add all --json").document["count"]["already_there"] == 2
    write("all/v2/drive.eds", text(name="newer"))
    assert offline.run("eds add all --json").document["count"]["replaced"] == 1
    listed = offline.run("eds list --json").document["files"]
    assert {(row["name"], row["product"]) for row in listed} == {("drive.eds", "v1"), ("drive-2.eds", "newer")}


NET = "nodes:\n  a: {{node_id: 5, dcf: {}}}\n"


@pytest.mark.parametrize("short", [True, False])
@pytest.mark.parametrize(
    "words",
    [
        "check net.yaml",
        "--sim generic --eds {} objects 2000",
        "--sim {} objects 2000",
        "--sim {}@5 objects 2000",
        "eds show {}",
        "eds check {}",
        "eds convert {} out.xdd",
        "--eds {} decode run.log",
    ],
)
def test_the_name_that_the_list_shows_is_taken_wherever_a_file_is_named(
    words: str, short: bool, offline: Bench
) -> None:
    write("from/pump.eds", text())
    write("run.log", "(0.000000) can0 705#05\n")
    offline.run("eds add from/pump.eds")
    row = offline.run("eds list --json").document["files"][0]
    name = row["name"] if short else Path(row["file"]).name
    write("net.yaml", NET.format(name))
    ran = run(words.format(name).split())
    assert ran.returncode == 0, ran.stderr


@pytest.mark.parametrize(
    "words", ["--sim generic --eds {} objects", "--sim {} pdo", "eds show {}", "eds check {}", "eds remove {}"]
)
def test_a_name_of_several_files_of_the_library_lists_their_full_names(words: str, offline: Bench) -> None:
    for product in (1, 2):
        write(f"{product}/pump.eds", text(product=product))
    offline.run("eds add 1 2")
    full = [Path(row["file"]).name for row in offline.run("eds list --json").document["files"]]
    ran = run(words.format("pump.eds").split())
    said = ran.stderr
    assert ran.returncode == 2, said
    assert "error: pump.eds names 2 files of the library\n" in said
    assert f"give a full name: {', '.join(full)}" in said
    write("net.yaml", NET.format("pump.eds"))
    checked = offline.run("check net.yaml")
    assert checked.code == 4
    assert f"pump.eds names 2 files of the library: write one of {', '.join(full)}" in checked.stderr
    for name in full:
        write("net.yaml", NET.format(name))
        assert offline.run("check net.yaml").code == 0


def test_a_slip_in_the_name_of_a_library_file_is_suggested(offline: Bench) -> None:
    write("from/pump.eds", text())
    offline.run("eds add from/pump.eds")
    write("net.yaml", NET.format("pmup.eds"))
    assert "did you mean 'pump.eds'?" in offline.run("check net.yaml").stderr


@pytest.mark.parametrize("line", ["import net.yaml", "export all.cpj", "export all.dbc", "doctor"])
def test_the_hint_to_add_an_eds_runs_with_a_file_without_identity(line: str) -> None:
    """It names each kind of node by what the node says: `eds add FILE` alone refuses such a file."""
    write("bare.eds", text(product=0, vendor=0).replace("ProductNumber=0x0\n", ""))
    bus = live(pump(4), pump(5), pump(6, product=0x56), device("gen4", 7))
    with Bench((), {"yes": True, "interface": "virtual", "channel": "0"}, bus=bus) as bench:
        assert bench.run("node 4").code == 0
        assert bench.run("eds add bare.eds").code == 4
        ran = bench.run(line)
        said = " ".join((ran.stdout + ran.stderr).split())
        hints = re.findall(r"eds add FILE --identity \S+[0-9A-F]", said)
        kinds = ("0x55",) if line.startswith("doctor") else ("0x55", "0x56")
        assert hints == [f"eds add FILE --identity vendor=0x1234,product={kind}" for kind in kinds], said
        for hint in hints:
            assert bench.run(hint.replace("FILE", "bare.eds")).code == 0
        listed = bench.run("eds list --json").document["files"]
        assert len(listed) == len(kinds)


def test_all_bits_are_nobodys_number(offline: Bench) -> None:
    write("a.eds", text(product=0xFFFFFFFF))
    ran = offline.run("eds add a.eds")
    ran.failed(4, "no product number (0xFFFFFFFF is not assigned)")
    write("b.eds", text(revision=0xFFFFFFFF))
    assert offline.run("eds add b.eds --json").document["files"][0]["revision"] in (0, None)
    assert offline.run("eds list --json").document["files"][0]["by_hand"] is False


def test_who_prefers_the_only_file_of_its_identity_is_told_so(offline: Bench) -> None:
    write("a.eds", text())
    offline.run("eds add a.eds")
    assert "no other file has its identity" in offline.run("eds prefer a.eds").stdout
    write("b.eds", text(name="other"))
    offline.run("eds add b.eds")
    assert "no other file" not in offline.run("eds prefer a.eds").stdout


@pytest.mark.parametrize("form", ["dcf", "xdc", "jsonl"])
def test_a_backup_is_of_the_device_and_not_of_its_files_revision(form: str) -> None:
    write("old.eds", text(0x10001))
    with Bench((), {"node": 5}, bus=live(pump(5, 0x10003))) as bench:
        assert bench.run("eds add old.eds").code == 0
        assert bench.run(f"backup kept.{form}").code == 0
        assert bench.run(f"compare kept.{form} --json").document["unlike"] == ""


def test_a_frame_is_explained_by_a_familys_eds_and_a_wrong_name_is_said() -> None:
    for eds, code, said in (("generic", 0, "TPDO1"), ("nothere.eds", 2, "nothere.eds: ")):
        with Bench((), {"eds": eds}) as bench:
            ran = bench.run("explain 181#0000")
            assert (ran.code, said in ran.stdout + ran.stderr) == (code, True), ran


def test_what_is_no_file_is_none_of_the_library(offline: Bench) -> None:
    write("a.eds", text())
    offline.run("eds add a.eds")
    stored_place((1, 2, 3), "folder.eds").mkdir()
    listed = offline.run("eds list --json").document
    assert ([row["name"] for row in listed["files"]], listed["strangers"]) == (["a.eds"], 0)


def test_a_file_of_the_library_that_was_damaged_says_what_to_do() -> None:
    bus = VirtualTimeBus([pump(5)], simulated=False)
    with Bench((), {"node": 5}, bus=bus) as bench:
        assert bench.run("eds add made.eds").code == 0
        (stored,) = folder().glob("*made.eds")
        stored.write_text("no EDS any more", "ascii")
        ran = bench.run("read 1017")
        assert (ran.code, "`dvtcli eds remove FILE`" in ran.stderr, "--eds FILE" in ran.stderr) == (4, True, True), (
            ran.stderr
        )
        scanned = bench.run("scan")
        assert scanned.code == 0
        assert "made.eds is not an EDS or DCF file" in scanned.stdout
        assert "; add the file again, or remove it from the library" in scanned.stdout
        assert "made.eds is not an EDS or DCF file" in bench.run("scan --json").document["nodes"][0]["eds_note"]


#: inotify(7): a file was opened (of a folder another bit is set too), it was closed, something is lost. What is told
#: twice in a row is told once: between two openings the closing has to be told
_OPENED, _CLOSED, _LOST = 0x0020, 0x0018, 0x4000
#: the head of what is told
_HEAD = struct.Struct("iIII")


@contextmanager
def opened_files(below: Path) -> Iterator[list[str]]:
    """The files below a folder that are opened in the block, by their names, each as often as it is opened.

    The kernel tells it: an audit hook would stay in the process for good, and while a line of it runs between two
    steps of `sys.settrace` no other thread can begin to be measured.
    Those in folders that are made in the block are not told.
    """
    if sys.platform != "linux":
        pytest.skip("only Linux tells which files are opened")
    library, found = ctypes.CDLL(None, use_errno=True), list[str]()
    told = library.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        for folder in (below, *(path for path in below.rglob("*") if path.is_dir())):
            watched = library.inotify_add_watch(told, os.fsencode(folder), _OPENED | _CLOSED)
            assert watched >= 0, os.strerror(ctypes.get_errno())
        yield found
        found += _names(told)
    finally:
        os.close(told)


def _names(told: int) -> Iterator[str]:
    while True:
        try:
            events = os.read(told, 1 << 16)
        except BlockingIOError:
            return
        while events:
            _folder, mask, _cookie, length = _HEAD.unpack_from(events)
            assert mask != _LOST, "the kernel could not keep them all"
            name, events = events[_HEAD.size : _HEAD.size + length], events[_HEAD.size + length :]
            if mask == _OPENED:
                yield os.fsdecode(name.rstrip(b"\0"))
