"""`import`: what was imported reads back, and plans empty; links are found; files are never overwritten unasked."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from dvtcli.files.network.read_network import read_network_file
from dvtcli.simulator.network.family_file import family_eds
from tests.bus.devices import unknown
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.house.source import PACKAGE
from tests.virtual_time import VirtualTimeBus

PAIRS = [("gen4", "tmcm"), ("roboteq", "espac"), ("lely", "gen4"), ("canopennode", "generic")]


@heavy
@pytest.mark.parametrize("pair", PAIRS)
def test_what_was_imported_plans_empty(pair: tuple[str, str], tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    with Bench((f"{pair[0]}@3", f"{pair[1]}@7")) as bench:
        ran = bench.run(f"import {file} --json")
        assert (ran.code, [one["node"] for one in ran.document["nodes"]]) == (0, [3, 7])
        config = read_network_file(file)
        assert [len(node.pdos) for node in config.nodes] == [one["pdos"] for one in ran.document["nodes"]]
        for node in config.nodes:
            told = bench.session.node(node.node_id).identity()
            assert (node.identity.vendor or 0, node.identity.product or 0) == (told["vendor"], told["product"])
        planned = bench.run(f"plan {file} --exit-code --json")
        assert (planned.code, planned.document["writes"]) == (0, 0), planned


@heavy
def test_links_are_found_and_plan_empty(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    with Bench(("gen4@1", "tmcm@5", "generic@6")) as bench:
        for line in ("map 1:tpdo1 6041 606C", "map 5:rpdo2 6040 60FF --off", "map 6:rpdo1 60FF --off",
                     "link 1:tpdo1 5:rpdo2 --no-heartbeat", "link 1:tpdo1 6:rpdo1",
                     "set 6:rpdo2 --cob-id 0x281"):  # fmt: skip
            assert bench.run(line).code == 0, line
        ran = bench.run(f"import {file} --json")
        assert ran.document["links"] == 1
        assert any(
            "6:rpdo2 receives 1:tpdo2, but their layouts differ: no link" in note for note in ran.document["notes"]
        )
        assert bench.run(f"plan {file} --exit-code").code == 0
    (link,) = read_network_file(file).links
    assert [(end.node_id, str(end.pdo)) for end in (link.producer, *link.consumers)] == [
        (1, "tpdo1"), (5, "rpdo2"), (6, "rpdo1"),
    ]  # fmt: skip
    assert link.heartbeat is False  # node 5 does not watch


def test_one_node_of_several(tmp_path: Path) -> None:
    with Bench(("gen4@1", "tmcm@5"), {"node": 5}) as bench:
        ran = bench.run(f"import {tmp_path / 'net.yaml'} --json")
        assert [one["node"] for one in ran.document["nodes"]] == [5]
    with Bench(("gen4@1",), {"node": 9}) as bench:
        assert bench.run(f"import {tmp_path / 'none.yaml'}").code == 5
        assert not (tmp_path / "none.yaml").exists()


SET = (
    "map 1:tpdo1 6041 606C", "map 6:rpdo1 60FF --off", "link 1:tpdo1 6:rpdo1 --heartbeat 250",
    "write 1:1005 0x40000080 --as u32", "write 1:1006 5000 --as u32",
)  # fmt: skip


@heavy
def test_heartbeat_and_sync_are_imported_and_carried_out_elsewhere(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    with Bench(("gen4@1", "generic@6")) as bench:
        for line in SET:
            node, _, word = line.partition(" ")[2].partition(":")
            words = f"write {word}" if line.startswith("write") else line
            assert not line.startswith("write") or bench.run(f"node {node}").code == 0
            assert bench.run(words).code == 0, line
        assert bench.run(f"import {file}").code == 0
        assert bench.run(f"plan {file} --exit-code").code == 0
    drive, other = read_network_file(file).nodes
    said = {one.key: int.from_bytes(one.data, "little") for one in drive.objects}
    assert said == {"heartbeat_producer": 250, "sync_cob_id": 0x40000080, "sync_period": 5000}
    assert [(one.producer, one.time_ms) for one in other.watches] == [(1, 750)]
    assert "    sync_period: 5000\n" in file.read_text("utf-8")
    with Bench(("gen4@1", "generic@6"), {"yes": True}) as fresh:
        assert fresh.run(f"diff {file}").code == 3
        assert fresh.run(f"apply {file}").code == 0
        assert fresh.run(f"diff {file}").code == 0


@heavy
def test_some_nodes_of_a_network(tmp_path: Path) -> None:
    nodes, file = ("gen4@1", "tmcm@5", "generic@6"), tmp_path / "net.yaml"
    with Bench(nodes, {"node": (1, 6)}) as bench:
        ran = bench.run(f"import {file} --json")
        assert [one["node"] for one in ran.document["nodes"]] == [1, 6]
        ran = bench.run("map tpdo1 6041")
        ran.failed(2, "-n 1,6: several nodes")
    links = "links: [{from: a:tpdo1, to: b:rpdo1, heartbeat: false}]\n"
    file.write_text("a: {node_id: 1}\nb: {node_id: 5}\nc: {node_id: 6}\nd: {node_id: 9}\n" + links)
    with Bench(nodes, {"node": (1, 6), "yes": True}) as bench:
        for line in ("plan", "diff", "apply"):
            ran = bench.run(f"{line} {file}")
            assert ran.code == 0, ran.stderr
            assert "1 link of" in ran.stderr
    with Bench(nodes, {"node": (1, 7)}) as bench:
        ran = bench.run(f"plan {file}")
        ran.failed(2, "has no node 7")


def test_the_profile_that_was_chosen_is_in_the_file(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    with Bench(("generic@3",), {"profile": "canopennode"}) as bench:
        assert bench.run(f"import {file}").code == 0
    assert read_network_file(file).nodes[0].profile == "canopennode"


def test_nodes_without_an_eds_are_one_note(tmp_path: Path) -> None:
    bus = VirtualTimeBus([unknown(1), unknown(5)], simulated=False)
    with Bench((), {"node": (1, 5), "journal": str(tmp_path)}, bus) as bench:
        notes = bench.run(f"import {tmp_path / 'net.yaml'} --json").document["notes"]
    assert [note.partition(":")[0] for note in notes] == ["nodes 1 and 5"]


@pytest.mark.parametrize("bit_rate", [None, 125000, 500000, 83333])
def test_a_known_bit_rate_is_a_note_and_no_master_is_written(bit_rate: int | None, tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    bus = VirtualTimeBus([unknown(1), unknown(5)], simulated=False)
    bus.bitrate = bit_rate
    with Bench((), {"node": (1, 5), "journal": str(tmp_path)}, bus) as bench:
        notes = bench.run(f"import {file} --json").document["notes"]
        about = [note for note in notes if "bit rate" in note]
        assert read_network_file(file).master is None
        if bit_rate is None:
            assert about == []
            return
        (note,) = about
        assert f"check {file} --at {bit_rate}`" in note
        assert bench.run(f"load {file} --at {bit_rate} --json").document["bit_rate"] == bit_rate
        if bit_rate % 1000:  # a file has whole kbit/s only
            assert "baudrate" not in note
            return
        key = f"master: {{baudrate: {bit_rate // 1000}}}"
        assert key in note
        file.write_text(file.read_text("utf-8") + f"{key}\n", "utf-8")
        assert bench.run(f"load {file} --json").document["bit_rate"] == bit_rate


@pytest.mark.parametrize(("rates", "note"), [
    ([250, None, 250], "--at 250000`, or, with a master, master: {baudrate: 250}"),
    ([250, 500], "the files have several bit rates: 250, 500 kbit/s; a network has one"),
    ([None, None], None),
    ([0], None),
])  # fmt: skip
def test_the_bit_rate_of_dcfs_is_a_note(rates: list[int | None], note: str | None, tmp_path: Path) -> None:
    folder = tmp_path / "dcf"
    folder.mkdir()
    text = (PACKAGE / "families" / "generic" / "generic.eds").read_text("utf-8")
    for node_id, rate in enumerate(rates, 1):
        own = f"\n[DeviceCommissioning]\nNodeID={node_id}\n" + ("" if rate is None else f"Baudrate={rate}\n")
        (folder / f"{node_id}.dcf").write_text(text + own, "utf-8")
    with Bench(()) as bench:
        notes = bench.run(f"import {tmp_path / 'net.yaml'} {folder} --json").document["notes"]
    about = [text for text in notes if "bit rate" in text]
    assert len(about) == (note is not None)
    assert all(text.endswith(str(note)) for text in about), about


@pytest.mark.parametrize("count", [2, 3, 9])
def test_files_without_node_id_are_one_note_that_names_all(count: int, tmp_path: Path) -> None:
    """The note is the only record of the numbers."""
    folder = tmp_path / "eds"
    folder.mkdir()
    text = (PACKAGE / "families" / "generic" / "generic.eds").read_text("utf-8")
    for number in range(1, count + 1):
        (folder / f"f{number}.eds").write_text(text, "utf-8")
    with Bench(()) as bench:
        notes = bench.run(f"import {tmp_path / 'net.yaml'} {folder} --json").document["notes"]
    given = ", ".join(f"f{number}.eds becomes node {number}" for number in range(1, count + 1))
    assert notes == [f"{count} files have no node-ID: {given}"]


def test_nodes_whose_other_values_are_left_out_are_all_named(tmp_path: Path) -> None:
    folder = tmp_path / "dcf"
    folder.mkdir()
    text = (PACKAGE / "families" / "generic" / "generic.eds").read_text("utf-8")
    name = "ParameterName=Save all parameters\n"
    assert text.count(name) == 1
    text = text.replace(name, f"{name}ParameterValue=1\n")
    for node_id in range(1, 8):
        own = f"\n[DeviceCommissioning]\nNodeID={node_id}\n"
        (folder / f"{node_id}.dcf").write_text(text + own, "utf-8")
    with Bench(()) as bench:
        notes = bench.run(f"import {tmp_path / 'net.yaml'} {folder} --json").document["notes"]
    (note,) = [text for text in notes if "other values of their files left out" in text]
    assert note.startswith("nodes 1, 2, 3, 4, 5, 6 and 7: ")


def test_a_folder_of_files_needs_no_bus(tmp_path: Path) -> None:
    folder, file = tmp_path / "eds", tmp_path / "net.yaml"
    folder.mkdir()
    for family in ("gen4", "tmcm"):
        shutil.copy(PACKAGE / "families" / family / f"{family}.eds", folder)
    text = (folder / "tmcm.eds").read_text("latin-1")
    (folder / "tmcm.eds").unlink()
    (folder / "motor.dcf").write_text(f"{text}\n[DeviceCommissioning]\nNodeID=0x01\n", "latin-1")
    with Bench(()) as bench:
        ran = bench.run(f"import {file} {folder} --json")
        assert ran.code == 0, ran
        assert [(one["node"], one["name"]) for one in ran.document["nodes"]] == [(1, "tmcm_1"), (2, "gen4_2")]
        assert ran.document["notes"] == ["gen4.eds has no node-ID: it becomes node 2"]
        assert not bench.session.is_open
        assert bench.run(f"import {file} {tmp_path / 'none'}").code == 6  # the file is there by now
        assert bench.run(f"import {tmp_path / 'b.yaml'} {tmp_path / 'none'}").code == 2
    config = read_network_file(file)
    assert [node.dcf.text if node.dcf else "" for node in config.nodes] == ["eds/motor.dcf", "eds/gen4.eds"]
    with Bench(("tmcm@1", "gen4@2")) as bench:
        planned = bench.run(f"plan {file} --exit-code --json")
        assert (planned.code, planned.document["writes"]) == (0, 0), planned


def test_a_file_is_overwritten_with_consent_only(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    file.write_text("mine", "utf-8")
    with Bench(("gen4",)) as bench:
        assert bench.run(f"import {file}").code == 6
        assert file.read_text("utf-8") == "mine"
        assert bench.run(f"import {file} --yes").code == 0
        assert bench.run(f"import {tmp_path / 'net.dcf'}").code == 2


def test_a_network_without_nodes_is_no_answer(tmp_path: Path) -> None:
    with Bench((), {"interface": "virtual", "channel": "nobody", "timeout": 0.05}) as bench:
        assert bench.run(f"import {tmp_path / 'net.yaml'}").code == 5
        assert not (tmp_path / "net.yaml").exists()


@heavy
def test_what_check_finds_in_the_new_file_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("eds").mkdir()
    eds = PACKAGE / "families" / "generic" / "generic.eds"
    text = eds.read_text("utf-8")
    enabled = re.sub(r"(?i)=\$NODEID\s*\+\s*0x(40000)?180\b", "=0x181", text)
    assert enabled != text
    for node_id in (1, 2):
        Path(f"eds/{node_id}.eds").write_text(enabled, "utf-8")
    with Bench(()) as bench:
        ran = bench.run("import net.yaml eds")
        checked = bench.run("check net.yaml --json")
        errors = checked.document["files"][0]["count"]["error"]
        assert (ran.code, checked.code, errors > 0) == (0, 4, True), ran
        assert f"{errors} error{'s' * (errors > 1)} to correct first: dvtcli check net.yaml" in ran.stdout
        assert bench.run("import net.yaml eds --json --yes").document["errors"] == errors
    with Bench(("gen4@1",)) as bench:
        assert "Check it: dvtcli check live.yaml" in bench.run("import live.yaml").stdout


@pytest.mark.parametrize("name", ["generic.eds", "generic.dcf"])
def test_a_file_that_is_cut_short_is_not_imported(name: str, tmp_path: Path) -> None:
    """Its own lists name what is missing: a network file of the rest would name a device that has more."""
    whole = (PACKAGE / "families" / "generic" / "generic.eds").read_text("utf-8")
    folder, file = tmp_path / "files", tmp_path / "net.yaml"
    folder.mkdir()
    (folder / name).write_text(whole[: len(whole) // 2], "utf-8")
    with Bench(()) as bench:
        ran = bench.run(f"import {file} {folder}")
        added = bench.run(f"eds add {folder / name}")
    assert (ran.code, file.exists()) == (4, False), ran
    assert "is cut short: " in ran.stderr
    assert [line for line in ran.stderr.splitlines() if "cut short" in line] == [
        line for line in added.stderr.splitlines() if "cut short" in line
    ]


def test_a_mapping_that_an_eds_does_not_tell_is_left_out_and_named(tmp_path: Path) -> None:
    """A file that claims an empty mapping would be refused, or clear the device's own."""
    folder = tmp_path / "eds"
    folder.mkdir()
    text = (PACKAGE / "families" / "generic" / "generic.eds").read_text("utf-8")
    head, count, tail = text.partition("[1A00sub0]")
    assert count
    told, default, rest = tail.partition("DefaultValue=")
    (folder / "a.eds").write_text(head + count + told + rest.partition("\n")[2], "utf-8")
    assert default
    with Bench(()) as bench:
        imported = bench.run(f"import {tmp_path / 'net.yaml'} {folder} --json").document
    assert "node 1: TPDO1 left out: a.eds does not say what the mapping is" in imported["notes"]
    assert "1A00" not in (written := (tmp_path / "net.yaml").read_text("utf-8"))
    assert "tpdo:\n      2:" in written


def test_what_an_eds_does_not_say_is_left_out_and_named(tmp_path: Path) -> None:
    """The device has its own values, which a network file would overwrite: TPDO1 keeps its mapping, type and time."""
    text = (PACKAGE / "families" / "generic" / "generic.eds").read_text("utf-8")
    for section in ("1A00sub0", "1800sub2", "1801sub2", "1801sub5"):
        text, count = re.subn(rf"(\[{section}\][^\[]*?)DefaultValue=\S*\n", r"\1", text)
        assert count == 1
    text = re.sub(r"(\[1800sub3\][^\[]*?DefaultValue=)\S*\n", r"\g<1>0\n", text)
    folder, file = tmp_path / "eds", tmp_path / "net.yaml"
    folder.mkdir()
    (folder / "odd.eds").write_text(text, "utf-8")
    with Bench(()) as bench:
        ran = bench.run(f"import {file} {folder} --json")
        assert ran.document["notes"][1:] == [
            "node 1: TPDO1 left out: odd.eds does not say what the mapping is",
            "node 1: transmission and event_timer of TPDO2 left out: odd.eds has no value of it",
        ]
        checked = bench.run(f"check {file}")
        assert checked.code == 0, checked
        assert "maps nothing" not in checked.stdout
        load = bench.run(f"load {file} --at 250000").stdout
        assert "1:tpdo1, 1:tpdo2: the transmission type is not known" in load
    (config,) = read_network_file(file).nodes
    (second,) = (pdo for pdo in config.pdos if str(pdo.pdo) in ("tpdo1", "tpdo2"))
    assert (bool(second.mapping), second.transmission_type, second.event_timer) == (True, None, None)
    assert second.cob_id == 0x281
    whole = PACKAGE / "families" / "generic" / "generic.eds"
    (folder / "odd.eds").write_text(whole.read_text("utf-8"), "utf-8")
    with Bench(("generic@1",)) as bench:
        planned = bench.run(f"plan {file} --exit-code --json")
        assert (planned.code, planned.document["writes"]) == (0, 0), planned


def test_what_the_file_says_counts_where_the_eds_says_nothing(tmp_path: Path) -> None:
    """Transmission type 0 waits for SYNC, and an empty mapping is empty: in `check` and `load` as in `plan`."""
    text = (PACKAGE / "families" / "generic" / "generic.eds").read_text("utf-8")
    for section in ("1A00sub0", "1800sub2"):
        text = re.sub(rf"(\[{section}\][^\[]*?)DefaultValue=\S*\n", r"\1", text)
    (tmp_path / "odd.eds").write_text(text, "utf-8")
    file = tmp_path / "net.yaml"
    file.write_text("a: {node_id: 1, dcf: odd.eds, tpdo: {1: {enabled: true, transmission: 0, mapping: []}}}\n")
    with Bench(()) as bench:
        found = {one["rule"] for one in bench.run(f"check {file} --json").document["files"][0]["findings"]}
        assert {"sync-from-elsewhere", "sends-nothing"} <= found
        load = bench.run(f"load {file} --at 250000").stdout
        assert "1:tpdo1: synchronous, but no known node produces SYNC" in load
        assert "not known" not in load


def test_one_eds_does_not_describe_nodes_of_other_identities(tmp_path: Path) -> None:
    file, eds = tmp_path / "net.yaml", family_eds("tmcm")

    def bus() -> VirtualTimeBus:
        return VirtualTimeBus([unknown(3), unknown(4, "tmcm")], simulated=False)

    with Bench((), {"eds": str(eds), "yes": True, "journal": str(tmp_path)}, bus()) as bench:
        ran = bench.run(f"import {file}")
        ran.failed(6, "the EDS is another device's")
        assert f"eds add {eds}` describes the nodes of its identity only" in " ".join(ran.stderr.split())
        assert not file.exists()
    with Bench((), {"eds": str(eds), "node": 4, "yes": True, "journal": str(tmp_path)}, bus()) as bench:
        assert bench.run(f"import {file}").code == 0
    with Bench((), {"eds": str(eds), "force": True, "yes": True, "journal": str(tmp_path)}, bus()) as bench:
        assert bench.run(f"import {file}").code == 0
    assert file.read_text("utf-8").count("dcf:") == 2


def test_an_eds_without_identity_is_said_to_describe_different_nodes(tmp_path: Path) -> None:
    file, eds = tmp_path / "net.yaml", family_eds("lely")
    bus = VirtualTimeBus([unknown(3), unknown(4, "tmcm")], simulated=False)
    with Bench((), {"eds": str(eds), "yes": True, "journal": str(tmp_path)}, bus) as bench:
        notes = bench.run(f"import {file} --json").document["notes"]
    assert f"{eds.name} describes nodes 3 and 4, whose identities (0x1018) differ" in notes
