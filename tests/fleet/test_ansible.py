"""The Ansible collection, played by ansible-core: hosts with local connections, each with a served bus of its own."""

from __future__ import annotations

import json
import re
import subprocess
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.documentation.pages import text as page
from tests.fleet.ansible import BINARIES, Fleet
from tests.process import PATIENCE_S, environment
from tests.simulator.serve.served import Served, bus_words, own_environment, served

pytestmark = pytest.mark.needs("ansible.release")  # a folder of this project is called ansible, too
#: each of them starts Ansible, which takes two seconds of a processor to begin
by_lot = pytest.mark.drawn(1, "ansible")

NETWORK = """\
nodes:
  drive:
    node_id: 1
    store: true
    heartbeat_producer: 700
    tpdo:
      1: {event_timer: 20, mapping: [6041/16, 606C/32]}
  io:
    node_id: 5
    tpdo:
      2: {event_timer: 30}
"""
NODES = ("gen4@1", "generic@5")
SIM = " ".join(NODES)
MODULES = ("backup", "network", "nodes_facts", "recover", "store", "undo", "verify")


@pytest.fixture
def fleet(tmp_path: Path) -> Fleet:
    (tmp_path / "network.yaml").write_text(NETWORK, "utf-8")
    return Fleet(tmp_path)


def task(fleet: Fleet, module: str = "network", name: str = "set", **more: object) -> dict[str, object]:
    """A task under test."""
    file = {"file": str(fleet.folder / "network.yaml")} if module in ("network", "verify") else {}
    return {"name": name, f"dvtcli.canopen.{module}": {"bus": "{{ canopen_bus }}", **file, **more}}


def documented(fleet: Fleet, heading: str) -> str:
    """The playbook of the documentation under *heading*, for a file that is there, without waiting."""
    part = page("docs/how-to/fleets.md").partition(f"\n### {heading}\n")[2]
    playbook = part.partition("\n```yaml\n")[2].partition("```")[0]
    return playbook.replace("/opt/dvtcli/network.yaml", str(fleet.folder / "network.yaml")).replace(
        "delay: 10", "delay: 0"
    )


def held(one: Served) -> dict[str, object]:
    """What differs on the nodes of a bus from the network file, and how many writes it would take."""
    found = json.loads(one.dvtcli("--json", "plan", str(one.folder / "network.yaml")).stdout)
    return {"changed": found["changed"], "writes": found["writes"]}


def interrupt(one: Served) -> None:
    """Kill a dvtcli that applies the network file, as a power cut would, once node 1 has taken a first write.

    The node's answer to that is lost (`lose-response@1`), so that dvtcli waits.
    """
    bus = one.attach()
    words = [str(BINARIES / "dvtcli"), *bus_words(one.port), "--yes", "apply", str(one.folder / "network.yaml")]
    process = subprocess.Popen(words, env=own_environment(one.folder), stdout=subprocess.DEVNULL)
    try:
        is_write = False
        while not is_write:
            frame = bus.recv(PATIENCE_S)
            assert frame is not None, "node 1 was not written to"
            is_write = frame.arbitration_id == 0x601 and frame.data[0] & 0xE0 == 0x20
    finally:
        process.kill()
        process.wait()


@pytest.mark.long
@pytest.mark.counted
@by_lot
def test_a_fleet_from_the_first_run_to_its_repair(fleet: Fleet, request: pytest.FixtureRequest) -> None:
    count = request.config.getoption("--hosts")
    faults = {
        1: ("--fault", "1:refuse@4=0x06040041"),
        2: ("--fault", "5:refuse@1=0x06090031"),
        3: ("--fault", "1:reset@5=0.1"),
        4: ("--fault", "1:lose-response@1"),
    }
    with ExitStack() as stack:
        buses = {}
        for number in range(1, count + 1):
            name = f"bench-{number:02}"
            buses[name] = stack.enter_context(served(fleet.folder, *NODES, *faults.get(number, ())))
            fleet.host(name, buses[name])
        before = held(buses[f"bench-{count:02}"])
        assert before["changed"]
        interrupt(buses["bench-04"])
        first = fleet.play([task(fleet)])
        assert first.code == 2, first.said
        bad = {f"bench-{number:02}" for number in faults}
        results = first.results("set")
        assert first.hosts("failed") == bad, first.said
        assert first.hosts("changed") == set(buses) - bad
        assert not first.hosts("unreachable")
        assert {name: results[name]["exit_code"] for name in sorted(bad)} == dict(
            zip(sorted(bad), (1, 1, 5, 6), strict=True)
        )
        assert {name for name in bad if results[name]["retry"]} == {"bench-03"}
        assert [results[name]["state"] for name in sorted(bad)] == [*["rolled_back"] * 3, "unchanged"]
        put_back = sorted(bad - {"bench-04"})
        assert {name: held(buses[name]) for name in put_back} == dict.fromkeys(put_back, before)
        repaired = fleet.play_text(documented(fleet, "Finish interrupted changes"))
        assert repaired.code == 0, repaired.said
        assert repaired.hosts("changed") == {"bench-04"}
        second = fleet.play([task(fleet)], "--limit", ",".join(sorted(set(buses) - set(put_back))))
        assert second.code == 0, second.said
        assert not second.hosts("changed")


@pytest.mark.long
@by_lot
def test_the_documented_rollout_stops_at_the_first_wave_that_fails(fleet: Fleet) -> None:
    """Of the second wave a node restarts once, and is tried again; others restart whenever they are written to."""
    always = [word for number in range(1, 4) for word in ("--fault", f"1:reset@{number}=0.1")]
    faults = {"bench-02": always[:2], "bench-03": always, "bench-04": always, "bench-05": always}
    with ExitStack() as stack:
        buses = {}
        for number in range(1, 8):
            name = f"bench-{number:02}"
            buses[name] = stack.enter_context(served(fleet.folder, *NODES, *faults.get(name, ())))
            fleet.host(name, buses[name])
        played = fleet.play_text(documented(fleet, "Roll out in waves"))
        assert played.code == 2, played.said
        assert played.hosts("failed") == {"bench-03", "bench-04", "bench-05"}, played.said
        assert played.hosts("changed") == {"bench-01", "bench-02"}
        assert set(played.recap) == {f"bench-{number:02}" for number in range(1, 6)}, "the third wave does not begin"
        results = played.results("Apply the network file")
        assert {(one["exit_code"], one["attempts"]) for one in results.values()} == {(5, 2)}, results
        assert [held(buses[name])["changed"] for name in sorted(buses)] == [False, False, *[True] * 5]


@by_lot
def test_a_check_reads_shows_the_difference_and_writes_nothing(fleet: Fleet) -> None:
    with served(fleet.folder, *NODES) as one:
        fleet.host("bench", one)
        before = held(one)
        checked = fleet.play([task(fleet)], "--check", "--diff")
        assert checked.code == 0, checked.said
        assert checked.hosts("changed") == {"bench"}
        assert "-node 1 tpdo1 event_timer: 0" in checked.said
        assert "+node 1 tpdo1 event_timer: 20" in checked.said
        assert "+node 1 1017:00: BC 02" in checked.said
        assert held(one) == before


@by_lot
def test_an_interrupted_host_is_found_in_check_mode_and_finished(fleet: Fleet) -> None:
    with served(fleet.folder, *NODES, "--fault", "1:lose-response@1") as one:
        fleet.host("bench", one)
        before = held(one)
        interrupt(one)
        found = json.loads(one.dvtcli("--json", "plan", str(fleet.folder / "network.yaml")).stdout)
        interrupted = found["interrupted"]
        assert 1 in interrupted
        checked = fleet.play([task(fleet)], "--check")
        result = checked.results("set")["bench"]
        assert (result["exit_code"], result["state"], result["changed"]) == (6, "unchanged", False)
        nodes = ", ".join(map(str, interrupted))
        assert f"an interrupted change of node {nodes} is not finished yet" in result["msg"]
        assert not result["error"], "of a comparison, which had ended otherwise"
        looked = fleet.play([task(fleet, "recover")], "--check", "-v").results("set")["bench"]
        assert (looked["changed"], looked["nodes"]) == (True, interrupted)
        finished = fleet.play([task(fleet, "recover")], "-v").results("set")["bench"]
        assert (finished["changed"], finished["nodes"]) == (True, interrupted)
        assert held(one) == before
        assert not fleet.play([task(fleet, "recover")]).hosts("changed")


# --- what a task ends with


def table() -> list[tuple[int, str, bool]]:
    """The rows of the documentation's table: exit code, what the task is, and whether to retry."""
    part = page("docs/how-to/fleets.md").partition("### How a task ends")[2].partition("\n### ")[0]
    rows = re.findall(r"^\| (\d+) \| (\w+) \| (\w+) \|", part, re.MULTILINE)
    return [(int(code), end, retry == "true") for code, end, retry in rows]


@pytest.mark.long
@by_lot
def test_each_exit_code_is_the_result_that_the_documentation_says(fleet: Fleet) -> None:
    files = {
        "network": NETWORK,
        "nothing": "nodes: {drive: {node_id: 1, tpdo: {1: {}}}}\n",
        "wrong": "nodes: {drive: {node_id: 1, tpdo: {1: {enabled: 'false'}}}}\n",
        "other": "nodes: {drive: {node_id: 1, identity: {vendor: 5}, tpdo: {1: {event_timer: 20}}}}\n",
        "stores": "nodes: {drive: {node_id: 1, store: true, tpdo: {1: {event_timer: 20}}}}\n",
    }
    for name, text in files.items():
        (fleet.folder / f"{name}.yaml").write_text(text, "utf-8")
    network, verify = "dvtcli.canopen.network", "dvtcli.canopen.verify"
    cases: list[tuple[str, dict[str, object], dict[str, str]]] = [
        (network, {"file": "nothing.yaml"}, {}),
        (network, {"file": "network.yaml"}, {}),
        (network, {"file": "network.yaml"}, {"DVTCLI_FAULT": "1:refuse@4=0x06040041"}),
        (network, {"file": "none.yaml"}, {}),
        (verify, {"file": "network.yaml"}, {}),
        (network, {"file": "wrong.yaml"}, {}),
        (network, {"file": "network.yaml", "timeout": 0.2}, {"DVTCLI_SIM": "gen4@1"}),
        (network, {"file": "other.yaml"}, {}),
        (network, {"file": "stores.yaml", "prove": True}, {"DVTCLI_FAULT": "1:stores-nothing"}),
        (network, {"file": "network.yaml", "executable": "/none/dvtcli"}, {}),
    ]
    for number, (kind, words, settings) in enumerate(cases):
        given = {**words, "file": str(fleet.folder / str(words["file"]))}
        fleet.host(f"host-{number}", None, kind=kind, words=given, settings={"DVTCLI_SIM": SIM, **settings})
    asked = [
        {"name": kind, kind: "{{ words }}", "when": f"kind == '{kind}'", "environment": "{{ settings }}"}
        for kind in (network, verify)
    ]
    played = fleet.play(asked, "-v")
    ends = [played.results(kind)[f"host-{number}"] for number, (kind, _, _) in enumerate(cases)]
    failed = dict.fromkeys(played.hosts("failed"), "failed")
    observed = [
        (one["exit_code"], failed.get(f"host-{number}", "changed" if one["changed"] else "ok"), one["retry"])
        for number, one in enumerate(ends)
    ]
    assert observed == table()
    assert not played.hosts("unreachable")
    refused, absent, unproved = ends[2], ends[-1], ends[8]
    assert (refused["state"], refused["changed"]) == ("rolled_back", True)
    assert (absent["state"], absent["changed"]) == ("unchanged", False)
    assert (unproved["state"], unproved["changed"]) == ("left_changed", True)
    lines = [line.split()[0] for line in refused["msg"].splitlines()]
    assert lines[0] == "error:"
    assert {"step", "abort", "state"} <= set(lines), refused["msg"]


@by_lot
def test_a_file_that_is_wrong_fails_with_its_place_and_a_note_becomes_a_warning(fleet: Fleet) -> None:
    text = "nodes: {drive: {node_id: 1, tpdo: {1: {enabled: 'false'}}}}\n"
    (fleet.folder / "network.yaml").write_text(text, "utf-8")
    (fleet.folder / "kept.yaml").write_text("nodes: {drive: {node_id: 1, store: true, tpdo: {1: {}}}}\n", "utf-8")
    fleet.host("bench", None, canopen_bus={"sim": ["gen4@1"]})
    kept = task(fleet, file=str(fleet.folder / "kept.yaml"), name="kept", prove=True)
    played = fleet.play([kept, task(fleet)], "-v")
    assert played.hosts("failed") == {"bench"}
    result = played.results("set")["bench"]
    assert f"network.yaml:1:{text.index(chr(39) + 'false') + 1}: " in result["msg"]
    assert "note: node 1 stored nothing now" in " ".join(played.said.split()), played.said


@by_lot
def test_a_store_that_is_not_proved_is_a_failure_that_changed_something(fleet: Fleet) -> None:
    fleet.host("bench", None, canopen_bus={})
    settings = {"DVTCLI_SIM": SIM, "DVTCLI_FAULT": "1:keeps-ram"}
    prove = {**task(fleet, prove=True), "environment": settings}
    result = fleet.play([prove]).results("set")["bench"]
    assert (result["exit_code"], result["changed"], result["state"]) == (1, True, "unknown")
    assert "acknowledged the store, and that it keeps it is not proved" in result["msg"]


@by_lot
def test_scan_gives_facts(fleet: Fleet) -> None:
    fleet.host("bench", None, canopen_bus={"sim": list(NODES)})
    said = {"ansible.builtin.debug": {"msg": "{{ canopen_nodes | map(attribute='node') | join(' and ') }} are there"}}
    played = fleet.play([task(fleet, "nodes_facts"), said])
    assert played.code == 0, played.said
    assert "1 and 5 are there" in played.said


@pytest.mark.long
@by_lot
def test_verify_store_backup_and_undo_say_what_they_changed(fleet: Fleet) -> None:
    kept = str(fleet.folder / "drive.dcf")
    steps = {"verify": {}, "backup": {"node": 1, "dest": kept}, "store": {"nodes": [1, 5]}}
    names = [(module, f"{module} {turn}") for turn in ("first", "again") for module in steps]
    with served(fleet.folder, *NODES) as one:
        fleet.host("bench", one)
        before = held(one)
        assert fleet.play([task(fleet)]).code == 0
        undo, look = task(fleet, "undo", all=True), task(fleet, "verify", "look")
        checked = fleet.play([undo, task(fleet, "backup", **steps["backup"])], "--check")
        assert (checked.code, checked.recap["bench"]["changed"]) == (0, 2), checked.said
        assert not held(one)["changed"]
        assert not Path(kept).exists()
        played = fleet.play([task(fleet, module, name, **steps[module]) for module, name in names], "-v")
        assert played.code == 0, played.said
        changed = {name for _, name in names if played.results(name)["bench"]["changed"]}
        assert changed == {"backup first", "store first", "store again"}
        undone = fleet.play([undo, look], "-v")
        assert undone.results("set")["bench"]["changed"], undone.said
        assert held(one)["changed"] == before["changed"]
        result = undone.results("look")["bench"]
        assert (result["exit_code"], result["changed"], result["retry"]) == (3, False, False)
        assert "differ from" in result["msg"]


@by_lot
def test_a_backup_that_cannot_be_kept_is_wrong_arguments_and_names_the_file_that_was_asked_for(fleet: Fleet) -> None:
    wrong = {"folder": "none/x.dcf", "suffix": "x.txt", "itself": "."}
    for name, file in wrong.items():
        fleet.host(name, None, canopen_bus={"sim": ["gen4@1"]}, kept=str(fleet.folder / file))
    results = fleet.play([task(fleet, "backup", node=1, dest="{{ kept }}")]).results("set")
    assert {(one["exit_code"], one["state"], one["retry"]) for one in results.values()} == {(2, "unchanged", False)}
    for name, file in wrong.items():
        assert str(fleet.folder / file) in results[name]["msg"], results[name]


@by_lot
@pytest.mark.parametrize("name", MODULES)
def test_each_module_documents_every_argument_and_result(fleet: Fleet, name: str) -> None:
    documented = json.loads(doc(fleet, f"dvtcli.canopen.{name}"))[f"dvtcli.canopen.{name}"]
    source = (Path(__file__).parents[2] / "ansible" / "plugins" / "modules" / f"{name}.py").read_text("utf-8")
    own = set(re.findall(r"^        (\w+)={", source.partition("dvtcli_module(")[2], re.MULTILINE))
    assert set(documented["doc"]["options"]) == {"bus", "executable", "timeout"} | own
    bus = documented["doc"]["options"]["bus"]["suboptions"]
    assert set(bus) == {"interface", "channel", "bitrate", "kwargs", "sim"}
    assert {"exit_code", "retry", "state"} < set(documented["return"])
    assert f"dvtcli.canopen.{name}:" in documented["examples"]


def doc(fleet: Fleet, *words: str) -> str:
    """What ansible-doc prints."""
    return subprocess.run(
        [str(BINARIES / "ansible-doc"), "--json", *words],
        env=environment() | fleet.settings(),
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=True,
    ).stdout
