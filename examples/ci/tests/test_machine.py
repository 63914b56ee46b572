"""Scenarios of the machine: what its nodes do once network.yaml was applied, and when something goes wrong."""

from collections.abc import Callable
from pathlib import Path

import pytest

import dvtcli

NETWORK = Path(__file__).parents[1] / "network.yaml"
NODES = ("gen4@1", "generic@5")


def test_the_drive_hears_what_the_io_node_sends(dvtcli_simulate: Callable[..., dvtcli.Bus]) -> None:
    bus = dvtcli_simulate(*NODES)
    bus.apply(NETWORK, yes=True)
    sent, received = bus.node(5).pdo("tpdo1").config, bus.node(1).pdo("rpdo1").config
    assert sent.communication.cob_id.can_id == received.communication.cob_id.can_id
    assert sent.bits == received.bits
    assert not bus.plan(NETWORK).document()["changed"]


def test_a_node_that_refuses_leaves_both_as_they_were(dvtcli_simulate: Callable[..., dvtcli.Bus]) -> None:
    bus = dvtcli_simulate(*NODES, faults=["5:refuse@6=0x06040041"])
    before = [bus.node(number).pdos().document() for number in (1, 5)]
    with pytest.raises(dvtcli.errors.DvtcliError) as caught:
        bus.apply(NETWORK, yes=True)
    assert caught.value.state == "rolled_back"
    assert [bus.node(number).pdos().document() for number in (1, 5)] == before
