"""A foreign LSS master, canopen's, gives simulated nodes their node-IDs: over the link and in one process."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import canopen
import pytest
from canopen.lss import LssError

from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.process import dvtcli
from tests.served_nodes import ServedNodes
from tests.simulator.serve.served import PATIENCE_S, served, wait_for

#: what canopen waits first for each 1 in an address, since nobody answers then (s)
SCAN_S = 0.2


def address(family: str) -> tuple[int, ...]:
    """The identity (0x1018:1..4) in the file of *family*."""
    dictionary = read_eds(family_eds(family)).dictionary
    entries = [dictionary.entry(0x1018, sub_index) for sub_index in range(1, 5)]
    return tuple(int.from_bytes((entry and entry.initial(1)) or b"", "little") for entry in entries)


GEN4, TMCM = address("gen4"), address("tmcm")


@contextmanager
def master(bus: can.BusABC) -> Iterator[canopen.Network]:
    """canopen on *bus*."""
    network = canopen.Network(bus=bus)
    network.notifier = can.Notifier(bus, network.listeners, 0.1)
    network.lss.RESPONSE_TIMEOUT = PATIENCE_S
    try:
        yield network
    finally:
        network.notifier.stop()


def identity(network: canopen.Network) -> tuple[int, ...]:
    """The LSS address of the node that is being configured."""
    return tuple(network.lss.inquire_lss_address(service) for service in range(0x5A, 0x5E))


def reads(network: canopen.Network, node_id: int) -> int:
    """The vendor-ID of *node_id*, by SDO."""
    node = canopen.RemoteNode(node_id, canopen.ObjectDictionary())
    network.add_node(node)
    node.sdo.RESPONSE_TIMEOUT = PATIENCE_S
    return int.from_bytes(node.sdo.upload(0x1018, 1), "little")


def is_silent(network: canopen.Network, node_id: int) -> bool:
    """Whether nobody answers SDO requests as *node_id*."""
    network[node_id].sdo.RESPONSE_TIMEOUT = 0.3
    network[node_id].sdo.MAX_RETRIES = 1
    try:
        network[node_id].sdo.upload(0x1018, 1)
    except canopen.SdoCommunicationError:
        return True
    return False


def fast_scan(network: canopen.Network) -> list[int]:
    """The address of the lowest node without a node-ID; scans more slowly where an answer came too late for canopen."""
    for doubled in range(6):
        found, address = scan(network, SCAN_S * 2**doubled)
        if found:
            return list(address)
    raise AssertionError("no scan found a node")


def scan(network: canopen.Network, answer_s: float) -> tuple[bool, list[int] | None]:
    """What one scan finds that gives each answer *answer_s*."""
    patience_s, network.lss.RESPONSE_TIMEOUT = network.lss.RESPONSE_TIMEOUT, answer_s
    try:
        found, address = network.lss.fast_scan()
        return found, address
    finally:
        network.lss.RESPONSE_TIMEOUT = patience_s


def boot_ups(network: canopen.Network, node_id: int) -> list[float]:
    """Where the times of the boot-ups of *node_id* will be."""
    found: list[float] = []
    network.subscribe(0x700 + node_id, lambda _id, data, at_s: None if any(data) else found.append(at_s))
    return found


def test_a_node_id_is_set_stored_and_kept(tmp_path: Path) -> None:
    words = ("gen4@1", "tmcm@5", "--state", str(tmp_path / "kept"), "-b", "500000")
    with served(tmp_path, *words) as server, master(server.attach()) as network:
        assert network.lss.send_switch_state_selective(*GEN4)
        assert network.lss.inquire_node_id() == 1
        assert identity(network) == GEN4
        with pytest.raises(LssError, match="LSS Error: 1"):
            network.lss.configure_node_id(128)
        with pytest.raises(LssError, match="LSS Error: 1"):
            network.lss.configure_bit_timing(4)
        network.lss.configure_bit_timing(2)
        network.lss.configure_node_id(9)
        network.lss.store_configuration()
        network.lss.send_switch_state_global(network.lss.WAITING_STATE)
        assert reads(network, 1) == GEN4[0]
        booted = boot_ups(network, 9)
        network.send_message(0, [0x82, 1])
        wait_for(lambda: len(booted) == 1, "the boot-up of node 9")
        assert (reads(network, 9), reads(network, 5)) == (GEN4[0], TMCM[0])
        assert is_silent(network, 1)
        network.send_message(0, [0x81, 9])
        wait_for(lambda: len(booted) == 2, "the boot-up of node 9 after a reset")
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["gen4@1.json"]
    with served(tmp_path, *words) as server:
        assert server.dvtcli("-n", "9", "read", "1018:1").stdout.startswith("0x1018:01  Identity object.Vendor-ID = 30")
        server.end()
        assert ": node 9 gen4, node 5 tmcm; attach" in server.said


@pytest.mark.long
def test_fast_scan_finds_the_nodes_without_a_node_id_and_configures_them(tmp_path: Path) -> None:
    with served(tmp_path, "gen4@255", "tmcm@255", "generic@3") as server:
        with master(server.attach()) as network:
            for node_id, wanted in ((11, GEN4), (12, TMCM)):
                booted = boot_ups(network, node_id)
                assert fast_scan(network) == list(wanted)
                network.lss.configure_node_id(node_id)
                network.lss.send_switch_state_global(network.lss.WAITING_STATE)
                wait_for(lambda booted=booted: len(booted) == 1, f"the boot-up of node {node_id}")
                assert reads(network, node_id) == wanted[0]
            assert scan(network, SCAN_S) == (False, None)
        assert server.dvtcli("-n", "11", "map", "tpdo1", "6041", "--sync", "1").returncode == 0
        server.end()
        assert "gen4 without a node-ID, tmcm without a node-ID, node 3 generic" in server.said


@pytest.mark.long
def test_one_process_on_a_virtual_bus() -> None:
    device = StrictDevice(read_eds(family_eds("gen4")).dictionary, load_family("gen4"), 255)
    with (
        can.Bus("lss", interface="virtual", ignore_config=True) as theirs,
        can.Bus("lss", interface="virtual", ignore_config=True) as ours,
        ServedNodes(theirs, [device]),
        master(ours) as network,
    ):
        network.lss.send_switch_state_global(network.lss.CONFIGURATION_STATE)
        assert network.lss.inquire_node_id() == 255
        assert identity(network) == GEN4
        network.lss.send_switch_state_global(network.lss.WAITING_STATE)
        assert fast_scan(network) == list(GEN4)
        network.lss.configure_node_id(7)
        network.lss.send_switch_state_global(network.lss.WAITING_STATE)
        until = time.monotonic() + PATIENCE_S
        while device.node_id != 7:
            assert time.monotonic() < until
            time.sleep(0.01)
        assert reads(network, 7) == GEN4[0]


def test_identical_nodes_without_a_node_id_are_refused() -> None:
    ran = dvtcli("sim", "gen4@255", "gen4@255", "--listen", "0")
    assert ran.returncode == 2
    assert "they could not be distinguished" in ran.stderr
    assert dvtcli("--sim", "gen4@255", "pdo").returncode == 2
