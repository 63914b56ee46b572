"""A network file for a CANopen manager: one plan, asked about, read back, taken back; it boots nodes with it."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

import dvtcli
from dvtcli.domain.network.concise_dcf import (
    ConciseEntry,
    concise_bytes,
    concise_entries,
    download_lines,
    read_concise_dcf,
)
from dvtcli.errors import RuleError, UsageError
from dvtcli.files.eds.reader import read_eds
from dvtcli.operations.network.concise_network import concise_dcf
from dvtcli.operations.network.network_files import plan_file
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.bus.devices import unknown
from tests.cli.commands.bench import Bench, beside
from tests.harness.sample import heavy
from tests.small_eds import plain, var

FILE = """io:
  dcf: generic
  node_id: 4
  store: true
  stamp: true
  tpdo:
    1: {event_timer: 50}
valve:
  dcf: lely
  node_id: 5
  heartbeat_producer: 250
"""
OTHERS = """spare:
  node_id: 2
  tpdo:
    1: {enabled: false}
boss:
  dcf: generic
  node_id: 10
  heartbeat_producer: 100
"""
EXPECTED = {0x1F26: 1, 0x1F27: 2}


@pytest.fixture(autouse=True)
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("net.yaml").write_text(FILE, "utf-8")


def manager(*, expects: bool = True, nodes: int = 5) -> str:
    eds = plain()
    eds.record(0x1F22, "Concise DCF", {sub: var(f"Node {sub}", 0xF) for sub in range(1, nodes + 1)})
    for index in EXPECTED if expects else ():
        eds.record(index, f"Expected {index:X}", {sub: var(f"Node {sub}", 7, 7) for sub in range(1, nodes + 1)})
    Path("manager.eds").write_text(eds.text(), "utf-8")
    return "manager.eds@10"


def on_bus(word: str) -> StrictDevice:
    """The device that *word* of --sim means, for a bus of others."""
    file, _, node_id = word.partition("@")
    return StrictDevice(read_eds(Path(file)).dictionary, load_family("generic"), int(node_id))


def held(bench: Bench, index: int, node_id: int) -> bytes:
    return bench.session.node(10).sdo.upload(index, node_id)


def test_a_pdo_that_a_file_s_device_lacks_shows_no_plan_of_nodes_that_nobody_asked() -> None:
    Path("net.yaml").write_text(FILE.replace("50}", "50}\n    70: {event_timer: 20}"), "utf-8")
    for nodes in ((manager(),), (manager(), "generic@4", "lely@5")):
        with Bench(nodes) as bench:
            for word in ("plan", "diff"):
                ran = bench.run(f"{word} net.yaml --to-manager 10")
                assert (ran.code, ran.stdout) == (1, ""), word
                assert "error: net.yaml:8:5: node 4 has no TPDO70" in ran.stderr
    with pytest.raises(RuleError, match="node 4 has no TPDO70"):
        concise_dcf("net.yaml", 4)


def test_it_gets_what_each_node_needs_and_a_date_for_those_with_a_stamp() -> None:
    with Bench((manager(),), {"yes": True}) as bench:
        assert bench.run("plan net.yaml --to-manager 10 --exit-code").code == 3
        done = bench.run("apply net.yaml --to-manager 10 --json")
        assert (done.code, done.document["writes"]) == (0, 6), done
        for name in (4, 5):
            assert held(bench, 0x1F22, name) == concise_dcf("net.yaml", name).data
        stamped = read_concise_dcf(held(bench, 0x1F22, 4))
        for index, sub_index in EXPECTED.items():
            assert held(bench, index, 4) == stamped[0x1020, sub_index] != bytes(4)
            assert held(bench, index, 5) == bytes(4)  # one of before would spare the new download
        again = bench.run("apply net.yaml --to-manager 10 --json")
        assert (again.code, again.document["writes"]) == (0, 0), again
        assert bench.run("diff net.yaml --to-manager 10").code == 0


def test_a_node_that_boots_so_is_as_wanted() -> None:
    with Bench((manager(),), {"yes": True}) as bench:
        assert bench.run("apply net.yaml --to-manager 10").code == 0
        data = held(bench, 0x1F22, 4)
    with Bench(("generic@4", "lely@5")) as bench:
        for one in concise_entries(data):
            bench.session.node(4).sdo.download(one.index, one.sub_index, one.data)
        io, valve = bench.run("plan net.yaml --json").document["nodes"]
    assert (io["pdos"], io["objects"]) == ([], [])
    assert [one["object"] for one in valve["objects"]] == ["1017:00"]


def test_a_fault_takes_it_all_back() -> None:
    with Bench((manager(),), {"yes": True, "fault": ("refuse@4=0x06090030",)}) as bench:
        before = [held(bench, index, node) for index in (0x1F22, *EXPECTED) for node in (4, 5)]
        ran = bench.run("apply net.yaml --to-manager 10")
        ran.failed(1, "rolled back")
        assert [held(bench, index, node) for index in (0x1F22, *EXPECTED) for node in (4, 5)] == before


def test_all_of_the_file_is_meant_and_never_some() -> None:
    """What a node downloads is whole, and links to others are in it."""
    with Session(Options(sim=(manager(),), node=(4, 5))) as session:
        with pytest.raises(UsageError, match="only some nodes were named"):
            plan_file(session, "net.yaml", manager=10)
        assert session.node(10).sdo.upload(0x1F22, 4) == b""


def test_it_asks_and_a_dry_run_writes_nothing() -> None:
    with Bench((manager(),)) as bench:
        before = held(bench, 0x1F22, 4)
        asked = bench.run("apply net.yaml --to-manager 10")
        asked.failed(6, "download other values to nodes 4, 5 whenever they boot")
        assert held(bench, 0x1F22, 4) == before
        dry = bench.run("apply net.yaml --to-manager 10 --dry-run --yes")
        assert (dry.code, held(bench, 0x1F22, 4)) == (0, before), dry


@heavy
def test_who_is_left_out_is_said() -> None:
    Path("net.yaml").write_text(FILE + OTHERS, "utf-8")
    with Bench((), {"yes": True}, beside([unknown(2), on_bus(manager(expects=False))])) as bench:
        ran = bench.run("apply net.yaml --to-manager 10")
        assert ran.code == 0
        assert "node 2 spare is left out: it has no EDS" in ran.stderr
        assert "node 10 boss is left out: it is the manager" in ran.stderr
        assert "node 10 has no 0x1F26" in ran.stderr
        assert held(bench, 0x1F22, 4) == concise_dcf("net.yaml", 4).data
        assert "gets no values for node 2: no EDS" in ran.stdout
        left = bench.run("diff net.yaml --to-manager 10")
        assert (left.code, "No difference" in left.stdout) == (3, False)
        assert "node 10 gets no values for node 2: no EDS" in left.stdout
        assert bench.run("plan net.yaml --to-manager 10 --json").document["untold"] == [2]
        assert bench.run("plan net.yaml --to-manager 10").code == 0


def test_who_is_silent_or_another_is_not_left_out() -> None:
    """What a manager gets does not depend on which nodes happen to be on: it ends as `plan` does."""
    Path("net.yaml").write_text(f"{FILE}drive:\n  node_id: 2\n  identity: {{vendor: 0x99}}\n", "utf-8")
    for sim, code, said in (((), 5, "did not answer"), (("gen4@2",), 6, "node 2 has vendor 0x0000001E, not 0x0000")):
        with Bench((manager(), *sim), {"yes": True}) as bench:
            for line in ("plan", "diff", "apply"):
                ran = bench.run(f"{line} net.yaml --to-manager 10")
                ran.failed(code, said)
            assert held(bench, 0x1F22, 4) == b""


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ("plan net.yaml --to-manager 11", 2, "does not return its 0x1F22:04"),
        ("plan net.yaml --to-manager 10", 2, "does not return its 0x1F22:05"),
        ("plan net.yaml --to-manager 10 --trust-stamp", 2, "not its stamps"),
        ("plan net.yaml --to-manager 128", 2, "a node-ID"),
        ("plan alone.yaml --to-manager 10", 2, "no node for node 10"),
        ("apply plan.json --to-manager 10", 2, "a saved plan"),
    ],
)
def test_what_cannot_be(words: str, code: int, said: str) -> None:
    Path("alone.yaml").write_text("m: {node_id: 10, dcf: generic, heartbeat_producer: 100}\n", "utf-8")
    with Bench((manager(nodes=4), "generic@11"), {"yes": True}) as bench:
        assert bench.run("plan alone.yaml -n 11 -o plan.json").code in (0, 2)
        Path("plan.json").write_text('{"schema": "dvtcli.plan/1", "file": "a", "nodes": []}', "utf-8")
        ran = bench.run(words)
        ran.failed(code, said)


def test_a_program_does_the_same() -> None:
    with dvtcli.simulate(manager()) as bus:
        assert not bus.plan("net.yaml", to_manager=10)
        bus.apply("net.yaml", to_manager=10, yes=True)
        assert bus.plan("net.yaml", to_manager=10)
        assert bus.node(10).read((0x1F22, 5)).raw == concise_dcf("net.yaml", 5).data


def test_a_node_that_only_its_device_tells_is_known_as_plan_knows_it() -> None:
    Path("net.yaml").write_text("drive: {node_id: 4, tpdo: {1: {enabled: true, mapping: [statusword]}}}\n", "utf-8")
    with Bench((manager(), "generic@4"), {"yes": True}) as bench:
        ran = bench.run("apply net.yaml --to-manager 10")
        assert (ran.code, "left out" in ran.stderr) == (0, False), ran.stderr
        assert any((one.index, one.data) == (0x1A00, bytes([1])) for one in concise_entries(held(bench, 0x1F22, 4)))
    with Bench((manager(),), {"yes": True}) as bench:
        assert bench.run("apply net.yaml --to-manager 10").code == 5
    with Bench((), {"yes": True}, beside([unknown(4), on_bus(manager())])) as bench:
        ran = bench.run("apply net.yaml --to-manager 10")
        ran.failed(2, "is left out: it has no EDS")


@heavy
def test_a_changed_download_is_shown_object_by_object() -> None:
    with Bench((manager(),), {"yes": True}) as bench:
        new = bench.run("plan net.yaml --to-manager 10").stdout
        assert "      node 5  1017:00  not downloaded -> 250" in new
        assert bench.run("apply net.yaml --to-manager 10 --yes").code == 0
        assert bench.run("backup manager.jsonl").code == 0
        Path("net.yaml").write_text(
            FILE.replace("250", "300").replace("    1: {", "    2: {enabled: false}\n    1: {"), "utf-8"
        )
        for line in ("diff", "plan"):
            shown = bench.run(f"{line} net.yaml --to-manager 10").stdout
            assert "      node 5  1017:00  250 -> 300\n" in shown, line
            assert shown.count("node 5  1") == 1, "what stays is not shown"
        assert bench.run("apply net.yaml --to-manager 10 --yes").code == 0
        for line, text in (("compare", "250 -> 300"), ("diff", "300 -> 250"), ("plan", "300 -> 250")):
            assert f"node 5  1017:00  {text}" in bench.run(f"{line} manager.jsonl").stdout, line


def test_a_download_in_another_order_and_what_is_none() -> None:
    one, other = (ConciseEntry(0x1017, 0, b"\x64\0"), ConciseEntry(0x2000, 1, b"\1"))
    lines = partial(download_lines, "1F22:7F")
    assert list(lines(concise_bytes((one, other)), concise_bytes((other, one)))) == [
        "node 127  the same values, downloaded in another order or in other steps"
    ]
    assert list(lines(b"", concise_bytes((one, other)))) == [
        "node 127  1017:00  not downloaded -> 100", "node 127  2000:01  not downloaded -> 1",
    ]  # fmt: skip
    assert list(lines(concise_bytes((other,)), bytes(4))) == ["node 127  2000:01  1 -> not downloaded"]
    assert list(lines(b"\1", concise_bytes((one,)))) == list(lines(None, b"")) == list(lines(bytes(4), bytes(4))) == []
    assert list(download_lines("1F23:05", b"", concise_bytes((one,)))) == []
    many = concise_bytes([ConciseEntry(0x2000, sub, b"\1") for sub in range(20)])
    assert list(lines(b"", many))[-1] == "node 127  and 8 more objects"
