"""The Ansible collection, played by ansible-core: hosts with local connections, each with a served bus of its own."""

from __future__ import annotations

import json
import subprocess
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.fleet.ansible import BINARIES, Fleet
from tests.process import PATIENCE_S, environment
from tests.serve.served import Served, served

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


@pytest.fixture
def fleet(tmp_path: Path) -> Fleet:
    (tmp_path / "network.yaml").write_text(NETWORK, "utf-8")
    return Fleet(tmp_path)


def network(fleet: Fleet, **more: object) -> dict[str, object]:
    """The task under test."""
    words = {"file": str(fleet.folder / "network.yaml"), "bus": "{{ bus }}", "executable": "{{ dvtcli }}", **more}
    return {"name": "set", "dvtcli.canopen.network": words}


def held(one: Served) -> dict[str, object]:
    """What differs on the nodes of a bus from the network file, and how many writes it would take."""
    ran = one.dvtcli("--json", "plan", str(one.folder / "network.yaml"))
    found = json.loads(ran.stdout)
    return {"changed": found["changed"], "writes": found["writes"]}


@pytest.mark.long
@pytest.mark.counted
@by_lot
def test_a_fleet_is_set_once_and_what_fails_is_put_back_while_the_rest_goes_on(
    fleet: Fleet, request: pytest.FixtureRequest
) -> None:
    count = request.config.getoption("--hosts")
    faulty = dict(zip((1, 2, 3), ("1:refuse@4=0x06040041", "5:refuse@1=0x06090031", "1:reset@5=0.1"), strict=True))
    with ExitStack() as stack:
        buses = {}
        for number in range(1, count + 1):
            fault = ("--fault", faulty[number]) if number in faulty else ()
            name = f"bench-{number:02}"
            buses[name] = stack.enter_context(served(fleet.folder, *NODES, *fault))
            fleet.host(name, buses[name])
        before = held(buses[f"bench-{count:02}"])
        assert before["changed"]
        first = fleet.play([network(fleet)])
        bad = {f"bench-{number:02}" for number in faulty}
        assert first.code != 0
        assert first.hosts("failed") == {"bench-01", "bench-02"}, first.said
        assert first.hosts("unreachable") == {"bench-03"}, first.said  # its node restarted: worth another try
        assert first.hosts("changed") == set(buses) - bad
        assert {name: held(buses[name]) for name in bad} == dict.fromkeys(bad, before)
        assert first.said.count('"exit_code": ') == 2 * first.said.count('"msg": ') == 2 * len(bad), first.said
        assert first.said.count('"state": "rolled_back"') == 2 * len(bad), first.said  # the error's, and the task's
        good = sorted(set(buses) - bad)
        second = fleet.play([network(fleet)], "--limit", ",".join(good))
        assert second.code == 0, second.said
        assert second.hosts("ok") == set(good)
        assert not second.hosts("changed")


@by_lot
def test_a_check_reads_shows_the_difference_and_writes_nothing(fleet: Fleet) -> None:
    with served(fleet.folder, *NODES) as one:
        fleet.host("bench", one)
        before = held(one)
        checked = fleet.play([network(fleet)], "--check", "--diff")
        assert checked.code == 0, checked.said
        assert checked.hosts("changed") == {"bench"}
        assert "-node 1 tpdo1 event_timer: 0" in checked.said
        assert "+node 1 tpdo1 event_timer: 20" in checked.said
        assert "+node 1 1017:00: BC 02" in checked.said
        assert held(one) == before


@by_lot
def test_a_bus_that_cannot_be_opened_makes_its_host_unreachable(fleet: Fleet) -> None:
    fleet.host("bench", None)
    played = fleet.play([network(fleet)])
    assert played.code == 4, played.said
    assert played.hosts("unreachable") == {"bench"}
    assert "nothing listens there" in played.said


@by_lot
def test_a_file_that_is_wrong_fails_with_dvtclis_own_words(fleet: Fleet) -> None:
    text = "nodes: {drive: {node_id: 1, tpdo: {1: {enabled: 'false'}}}}\n"
    (fleet.folder / "network.yaml").write_text(text, "utf-8")
    fleet.host("bench", None, bus={"sim": ["gen4@1"]})
    played = fleet.play([network(fleet)])
    assert played.code == 2, played.said
    assert played.hosts("failed") == {"bench"}
    assert '"exit_code": 4' in played.said
    place = text.index("'false'") + 1
    assert f"network.yaml:1:{place}: " in played.said


@by_lot
def test_scan_gives_facts(fleet: Fleet) -> None:
    fleet.host("bench", None, bus={"sim": list(NODES)})
    scan = {"dvtcli.canopen.nodes_facts": {"bus": "{{ bus }}", "executable": "{{ dvtcli }}"}}
    said = {"ansible.builtin.debug": {"msg": "{{ canopen_nodes | map(attribute='node') | join(' and ') }} are there"}}
    played = fleet.play([scan, said])
    assert played.code == 0, played.said
    assert "1 and 5 are there" in played.said


@pytest.mark.long
@by_lot
def test_the_role_of_a_bench(fleet: Fleet) -> None:
    home = fleet.folder / "home"
    (home / "venv" / "bin").mkdir(parents=True)
    (home / "venv" / "bin" / "dvtcli").symlink_to(BINARIES / "dvtcli")
    words = {"bench_home": str(home), "bench_package": "", "bench_file": str(fleet.folder / "network.yaml")}
    with served(fleet.folder, *NODES) as one:
        fleet.host("bench", one, **words, bench_bus="{{ bus }}", bench_prove=True)
        played = fleet.play([], roles=("dvtcli.canopen.bench",))
        assert played.code == 0, played.said
        assert not held(one)["changed"]
        again = fleet.play([], roles=("dvtcli.canopen.bench",))
        assert not again.hosts("changed"), again.said


@pytest.mark.long
@by_lot
def test_the_role_of_a_gateway_writes_what_networkd_and_python_can_read(fleet: Fleet) -> None:
    (fleet.folder / "etc" / "systemd" / "network").mkdir(parents=True)
    etc = str(fleet.folder / "etc")
    fleet.host("gateway", None, gateway_etc=etc, gateway_bitrate=250000, gateway_restart_ms=100)
    played = fleet.play([], roles=("dvtcli.canopen.gateway",))
    assert played.code == 0, played.said
    link = (fleet.folder / "etc" / "systemd" / "network" / "80-can0.network").read_text("utf-8")
    assert "BitRate=250000\nRestartSec=100ms\n" in link
    assert "channel = can0\nbitrate = 250000\n" in (fleet.folder / "etc" / "can.conf").read_text("utf-8")
    assert not fleet.play([], roles=("dvtcli.canopen.gateway",)).hosts("changed")


@by_lot
@pytest.mark.parametrize("name", ["network", "nodes_facts"])
def test_each_module_documents_every_argument(fleet: Fleet, name: str) -> None:
    ran = subprocess.run(
        [str(BINARIES / "ansible-doc"), "--json", f"dvtcli.canopen.{name}"],
        env=environment() | fleet.settings(),
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=True,
    )
    documented = json.loads(ran.stdout)[f"dvtcli.canopen.{name}"]["doc"]["options"]
    wanted = {"bus", "executable", "timeout"} | ({"file", "prove", "force"} if name == "network" else set())
    assert set(documented) == wanted
    assert set(documented["bus"]["suboptions"]) == {"interface", "channel", "bitrate", "kwargs", "sim"}
