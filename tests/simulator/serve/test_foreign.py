"""Stock programs on the simulated nodes' bus: canopen's RemoteNode, and python-can's viewer in a terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import canopen
import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.cli.prompt.terminal import Terminal
from tests.harness.sample import heavy
from tests.process import documents
from tests.simulator.serve.served import PATIENCE_S, Served, served, wait_for

#: an object of the generic node that takes a text of any length
TEXT = 0x2002


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Served]:
    with served(tmp_path, "generic@1", "gen4@2") as server:
        yield server


@pytest.fixture
def network(server: Served) -> Iterator[canopen.Network]:
    bus = server.attach()
    network = canopen.Network(bus=bus)
    network.notifier = can.Notifier(bus, network.listeners, 0.1)
    yield network
    network.notifier.stop()


@pytest.fixture
def node(network: canopen.Network) -> canopen.RemoteNode:
    """Node 1, as canopen knows it from the family's file."""
    node = network.add_node(canopen.RemoteNode(1, canopen.import_od(str(family_eds("generic")))))
    node.sdo.RESPONSE_TIMEOUT = PATIENCE_S
    return node


def test_every_object_is_read_as_dvtcli_reads_it(node: canopen.RemoteNode, server: Served) -> None:
    lines, wanted = [], {}
    for variable in variables(node.object_dictionary):
        if variable.readable:
            place = f"{variable.index:04X}:{variable.subindex:02X}"
            lines.append(f"read {place}")
            wanted[place] = node.sdo.upload(variable.index, variable.subindex)
    assert len(wanted) > 150
    ran = server.dvtcli("-n", "1", "--json", stdin="\n".join(lines))
    assert ran.returncode == 0, ran.stderr
    read = {one["object"]: bytes.fromhex(one["raw"]) for one in documents(ran.stdout)}
    assert read == wanted


def variables(dictionary: canopen.ObjectDictionary) -> Iterator[Any]:
    """Every variable of *dictionary* but the dummies, which are no objects."""
    for entry in dictionary.values():
        if entry.index < 0x1000:
            continue
        if isinstance(entry, canopen.objectdictionary.ODVariable):
            yield entry
        else:
            yield from entry.subindices.values()


@pytest.mark.parametrize("size", [1, 7, 8, 889, 890, 5000])
def test_a_block_goes_there_and_comes_back(node: canopen.RemoteNode, size: int) -> None:
    """889 bytes are one full block of 127 segments."""
    data = bytes(33 + number % 90 for number in range(size))
    with node.sdo[TEXT].open("wb", size=size, block_transfer=True) as stream:
        stream.write(data)
    with node.sdo[TEXT].open("rb", block_transfer=True) as stream:
        assert stream.read() == data
    assert node.sdo[TEXT].data == data


def test_it_maps_and_both_directions_work(network: canopen.Network, node: canopen.RemoteNode) -> None:
    for pdo, index, number in ((node.rpdo[1], 0x2000, 255), (node.tpdo[1], 0x2000, 1)):
        pdo.read()
        pdo.clear()
        pdo.add_variable(index)
        pdo.trans_type = number
        pdo.enabled = True
        pdo.save()
    node.nmt.state = "OPERATIONAL"
    node.rpdo[1].map[0].raw = 123456
    node.rpdo[1].transmit()
    assert node.sdo[0x2000].raw == 123456
    came: list[Any] = []
    node.tpdo[1].add_callback(came.append)  # wait_for_reception misses a frame that is quicker than it
    network.sync.transmit()
    wait_for(lambda: came, "the TPDO")
    assert node.tpdo[1].map[0].raw == 123456


def test_boot_up_and_heartbeat(node: canopen.RemoteNode) -> None:
    states: list[int] = []
    node.nmt.add_heartbeat_callback(states.append)
    node.nmt.state = "RESET"
    wait_for(lambda: 0 in states, "the boot-up")
    node.sdo[0x1017].raw = 20
    wait_for(lambda: states.count(0x7F) >= 3, "three heartbeats in PRE-OPERATIONAL")
    node.nmt.state = "OPERATIONAL"
    wait_for(lambda: states.count(0x05) >= 3, "three heartbeats in OPERATIONAL")
    node.nmt.state = "STOPPED"
    wait_for(lambda: states.count(0x04) >= 3, "three heartbeats in STOPPED")


def test_emergencies_come_and_go(network: canopen.Network, node: canopen.RemoteNode) -> None:
    """RPDO1 of the generic node is a controlword, 2 bytes, on 0x201."""
    node.nmt.state = "OPERATIONAL"
    network.send_message(0x201, b"\x06")
    wait_for(lambda: len(node.emcy.active) == 1, "the emergency")
    assert (node.emcy.active[0].code, node.emcy.active[0].register) == (0x8210, 0x11)
    network.send_message(0x201, b"\x06\x00")
    wait_for(lambda: not node.emcy.active and len(node.emcy.log) == 2, "the end of the emergency")
    assert node.sdo[0x1001].raw == 0
    assert node.sdo[0x1003][1].raw == 0x8210


def test_what_a_node_refuses_is_an_abort(node: canopen.RemoteNode) -> None:
    for index, sub_index, data, code in (
        (0x5FFF, 0, b"\0", 0x06020000),
        (0x1000, 0, bytes(4), 0x06010002),
        (0x1A00, 0, b"\0", 0x06010000),
    ):
        with pytest.raises(canopen.SdoAbortedError) as caught:
            node.sdo.download(index, sub_index, data)
        assert caught.value.code == code


def shown(viewer: Terminal, can_id: str, count: str, data: str) -> bool:
    """Whether the viewer has a row for *can_id* with this count and these data."""
    return any(line.split()[:1] == [count] and can_id in line and data in line for line in viewer.lines)


@heavy
@pytest.mark.skipif(sys.platform == "win32", reason="a terminal of POSIX")
def test_the_stock_viewer_shows_the_mapped_values(server: Served, tmp_path: Path) -> None:
    words = ["-i", "socketcand", "-c", "can0", "--bus-kwargs", "host=127.0.0.1", f"port={server.port}"]
    ran = server.dvtcli("-n", "2", "run", "scripts/pdo_config.dvt")
    assert ran.returncode == 0, ran.stderr
    assert server.dvtcli("-n", "2", "--yes", "store", "--prove").returncode == 0
    viewer = Terminal(tmp_path, columns=100, command=[sys.executable, "-m", "can.viewer", *words])
    try:
        viewer.wait("Count")
        assert server.dvtcli("-n", "2", "nmt", "start").returncode == 0
        assert server.dvtcli("sync", "--count", "3", "--period", "20").returncode == 0
        for can_id, data in (("0x182", "24 FA FF FF 78 00 50 02"), ("0x282", "00 03 88 FF FE 02 1F")):
            viewer.until(lambda: shown(viewer, can_id, "3", data), f"3 times {can_id} with {data}")  # noqa: B023
        viewer.type("q")
        assert viewer.ended() == 0
    finally:
        viewer.close()
