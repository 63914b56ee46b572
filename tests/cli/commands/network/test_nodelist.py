"""Nodelists (CiA 306-3): written with a DCF of each node; a network file made of one is as of the nodes themselves."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.errors import InputFileError
from dvtcli.files.network.read_network import read_network_file
from dvtcli.files.nodelist import ListedNode, Nodelist, nodelist_text, read_nodelist
from tests.bus.devices import unknown
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.small_eds import U8, U16, U32, Eds, Section, plain, var
from tests.virtual_time import VirtualTimeBus


@pytest.fixture(autouse=True)
def _ground(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@heavy
def test_a_network_comes_back_from_its_nodelist() -> None:
    Path("line").mkdir()
    with Bench(("gen4@1", "tmcm@5")) as bench:
        assert bench.run("map 1:tpdo1 6041 606C --cob-id 0x190").code == 0
        ran = bench.run("export line/nodelist.cpj --json")
        assert (ran.code, [one["dcf"] for one in ran.document["nodes"]]) == (0, ["node1.dcf", "node5.dcf"])
        assert bench.run("import live.yaml").code == 0
    with Bench(()) as bench:
        ran = bench.run("import listed.yaml line --json")
        assert (ran.code, [one["node"] for one in ran.document["nodes"]]) == (0, [1, 5])
        assert bench.run("import again.yaml line/nodelist.cpj --json").document["nodes"] == ran.document["nodes"]
        assert not bench.session.is_open
    live, listed = read_network_file(Path("live.yaml")), read_network_file(Path("listed.yaml"))
    assert [node.pdos for node in listed.nodes] == [node.pdos for node in live.nodes]
    assert [node.dcf.text for node in listed.nodes if node.dcf] == ["line/node1.dcf", "line/node5.dcf"]


def written_for_node_5(eds: Eds, values: dict[int, str]) -> None:
    """A DCF of node 5, and a nodelist of it, where objects of *eds* have *values*, sub-index 1 of what is a record."""
    for index, value in values.items():
        subs = eds.objects[index][1]
        subs[1 if 1 in subs else None]["ParameterValue"] = value
    eds.more.append(Section("DeviceComissioning", {"NodeID": "5"}))
    Path("five.dcf").write_text(eds.text(), "utf-8")
    Path("nl.cpj").write_text("[Topology]\nNodes=0x1\nNode5Present=0x01\nNode5DCFName=five.dcf\n", "utf-8")


def with_communication() -> Eds:
    """A device with SYNC, EMCY, heartbeats, error behaviour and a few objects of its maker."""
    eds = plain()
    eds.variable(0x1005, var("COB-ID SYNC", U32, 0x80))
    eds.variable(0x1014, var("COB-ID EMCY", U32, "$NODEID+0x80"))
    eds.record(0x1016, "Consumer heartbeat time", {1: var("Entry 1", U32, 0)})
    eds.record(0x1029, "Error behaviour", {1: var("Communication error", U8, 0)})
    for index in (0x2000, 0x2001, 0x2002):
        eds.variable(index, var(f"Setting {index:X}", U16, 7))
    return eds


@heavy
def test_what_a_dcf_says_of_communication_is_taken_also_where_it_is_as_usual() -> None:
    """A COB-ID of EMCY, entries of 0x1016, and what 0x1005 holds anyway: `diff` sees them altered later."""
    eds = with_communication()
    written_for_node_5(eds, {0x1005: "0x80", 0x1014: "0x91", 0x1016: "0", 0x1029: "1"})
    with Bench(()) as bench:
        ran = bench.run("import net.yaml nl.cpj --json")
        assert (ran.code, ran.document["notes"]) == (0, [])
    text = Path("net.yaml").read_text("utf-8").replace('"', "")
    for said in (
        "object: 1014:00, value: 0x91",
        "sync_cob_id: 0x80",
        "error_behavior: {1: 1",
        "object: 1016:01, value: 0x0",
    ):
        assert said in text
    Path("made.eds").write_text(with_communication().text(), "utf-8")
    with Bench(("made.eds@5",), {"yes": True}) as bench:
        assert bench.run("apply net.yaml").code == 0
        assert bench.run("diff net.yaml").code == 0
        for change in ("write 1014 0x92", "write 1005 0x81", "write 1029:1 0", "write 1016:1 0x70100"):
            assert bench.run(change).code == 0, change
            assert bench.run("diff net.yaml").code == 3, change
            assert bench.run("apply net.yaml").code == 0, change


def test_values_of_a_dcf_that_no_network_file_says_are_named() -> None:
    written_for_node_5(with_communication(), {0x2000: "7", 0x2002: "9"})
    with Bench(()) as bench:
        (note,) = bench.run("import net.yaml nl.cpj --json").document["notes"]
    assert note == (
        "node 5: 2 other values of five.dcf left out, 1 differs from the defaults (2002:00): apply that file itself "
        "to write its configuration objects"
    )
    assert "1014" not in Path("net.yaml").read_text("utf-8"), "the file has no value of it: the default counts"


def device_of(tpdos: int) -> bytes:
    """The EDS of a device with so many TPDOs."""
    eds = plain()
    for number in range(3, tpdos + 1):
        for base in (0x1800, 0x1A00):
            eds.objects[base + number - 1] = eds.objects[base]
    return eds.text().encode()


def test_what_the_device_has_not_does_not_come_back() -> None:
    """The EDS is of another revision, with TPDOs that the device lacks."""
    Path("made.eds").write_bytes(device_of(2))
    Path("wide.eds").write_bytes(device_of(4))
    with Bench(("made.eds@5",), {"eds": "wide.eds", "node": 5}) as bench:
        exported = bench.run("export nl.cpj")
        assert exported.code == 0
        (line,) = (one for one in exported.stdout.splitlines() if "left out" in one)  # all of a node in one
        assert line.startswith("note: node 5: 1802:01 left out: object does not exist")
        assert line.endswith(" more")
        ran = bench.run("import again.yaml nl.cpj")
        assert (ran.code, "node 5: TPDO3, TPDO4 left out" in ran.stdout) == (0, True), ran
        (node,) = read_network_file(Path("again.yaml")).nodes
        assert [str(one.pdo) for one in node.pdos if one.pdo.is_tpdo] == ["tpdo1", "tpdo2"]
        assert bench.run("diff again.yaml").code == 0
        Path("own.yaml").write_text(
            "nodes:\n  five:\n    node_id: 5\n    dcf: wide.eds\n    tpdo:\n      3: {event_timer: 100}\n"
        )
        ran = bench.run("diff own.yaml")
        assert ran.code != 0
        assert "node 5 has no TPDO3" in ran.stderr
        assert "another revision" in ran.stderr


def test_a_nodelist_without_any_dcf_is_refused(tmp_path: Path) -> None:
    bus = VirtualTimeBus([unknown(1), unknown(5)], simulated=False)
    with Bench((), {"node": (1, 5), "journal": str(tmp_path)}, bus) as bench:
        ran = bench.run("export a.cpj")
        ran.failed(2, "none of the nodes has an EDS (1, 5)")
        assert not Path("a.cpj").exists()
        Path("a.cpj").write_text("")
        assert bench.run("export a.cpj").code == 6  # nobody says that it may be overwritten


def test_a_name_that_no_file_can_have_is_one_that_is_not_there() -> None:
    for dcf in ("1" * 300 + ".dcf", "1" * 300 + "/a.dcf"):
        Path("long.cpj").write_text(f"[Topology]\nNodes=1\nNode1Present=1\nNode1DCFName={dcf}\n")
        with Bench(()) as bench:
            ran = bench.run("import out.yaml long.cpj")
            ran.failed(4, "the DCF of node 1 does not exist")


OWN = """; a comment
[TOPOLOGY]
NetName=Hall
Nodes=0x03
Node2Present=0x01
Node2Name=Left valve
Node2DCFName=Dcf\\LEFT.DCF
Node7Present=0
Node7Name=spare
Node9Present=1
EDSBaseName=C:\\EDS
[Topology2]
NetName=Other
Node2Present=1
"""


def test_names_node_ids_and_what_is_left_out_come_from_the_list() -> None:
    Path("dcf").mkdir()
    Path("Dcf").mkdir(exist_ok=True)
    with Bench(("generic@4",)) as bench:
        assert bench.run("export Dcf/left.dcf").code == 0
    Path("net.cpj").write_bytes(OWN.replace("\n", "\r\n").encode())
    with Bench(()) as bench:
        ran = bench.run("import net.yaml . --json")
    assert ran.code == 0, ran
    assert [(one["node"], one["name"]) for one in ran.document["nodes"]] == [(2, "left_valve_2")]
    assert ran.document["notes"] == [
        "net.cpj: network Other is left out: one file, one bus", "net.cpj: not present: node 7",
        "node 9 is left out: net.cpj has no DCF for it",
        "no bit rate in the file: for load and deadlines, `dvtcli check net.yaml --at 500000`, or, with a master, "
        "master: {baudrate: 500}",
        "node 2: other values of its file left out, all equal to the defaults: apply a file itself to write its "
        "configuration objects",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "code", "said"),
    [
        ("[Nodes]\n", 4, "[Topology]"), ("[Topology]\nNode1Present=1\n", 2, "lists no DCF"),
        ("[Topology]\nNode1Present=1\nNode1DCFName=none.dcf\n", 4, "net.cpj:3"),
        ("[Topology]\nNode1Present=1\nNode1DCFName=net.cpj\n", 4, "not an EDS or DCF"),
    ],
)  # fmt: skip
def test_what_is_none_is_refused(text: str, code: int, said: str) -> None:
    Path("net.cpj").write_text(text)
    with Bench(()) as bench:
        ran = bench.run("import net.yaml net.cpj")
        ran.failed(code, said)
        Path("second.cpj").write_text(text)
        assert "several nodelists" in bench.run("import net.yaml .").stderr
    assert not Path("net.yaml").exists()


TEXT = st.text(st.characters(min_codepoint=0x21, max_codepoint=0xFF, exclude_categories=["C", "Z"]), max_size=9)
NODES = st.builds(ListedNode, st.integers(1, 127), TEXT, TEXT)


@given(TEXT, st.lists(NODES, unique_by=lambda node: node.node_id, max_size=4), TEXT)
def test_what_was_written_reads_the_same(name: str, nodes: list[ListedNode], folder: str) -> None:
    wanted = Nodelist(name, tuple(sorted(nodes, key=lambda node: node.node_id)), (), folder)
    (found,) = read_nodelist(nodelist_text(wanted).encode(), "nodelist.cpj")
    assert [(one.node_id, one.name, one.dcf) for one in found.nodes] == [
        (one.node_id, one.name, one.dcf) for one in wanted.nodes
    ]
    assert (found.name, found.absent, found.eds_folder) == (name, (), folder)


@given(st.binary(max_size=80), st.sampled_from([b"", b"[Topology]\nNode1Present=1\n"]))
def test_any_bytes_are_read_or_refused(data: bytes, head: bytes) -> None:
    try:
        found = read_nodelist(head + data, "x.cpj")
    except InputFileError:
        found = ()
    assert len(found) <= 40
