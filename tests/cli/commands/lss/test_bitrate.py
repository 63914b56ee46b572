"""`bitrate`: the bit rate is named at which frames come without errors; nobody is disturbed, and nothing is guessed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from dvtcli.domain.lss_services import BIT_TIMINGS
from dvtcli.simulator.network.in_process_bus import InProcessBus, simulate
from tests.cli.commands.bench import Bench, Ran
from tests.lss_nodes import unconfigured
from tests.process import dvtcli


@contextmanager
def bench(at: list[int], ours: int = 500_000) -> Iterator[tuple[Bench, InProcessBus]]:
    """Nodes at these bit rates, that send a heartbeat each 5 ms, on a bus that is open at *ours*."""
    nodes = [unconfigured(number, node_id=number) for number, _ in enumerate(at, 1)]
    bus = simulate(nodes, bit_rate=ours)
    for node, bit_rate in zip(nodes, at, strict=True):
        node.set_value(0x1017, 0, (5).to_bytes(2, "little"))
        node.lss.bit_rate = bit_rate
    with Bench((), {}, bus) as desk:
        desk.session.open_network()
        yield desk, bus


def received(ran: Ran) -> list[int]:
    return [one["bit_rate"] for one in ran.document["heard"]]


@pytest.mark.parametrize("bit_rate", BIT_TIMINGS)
def test_the_one_at_which_frames_come_without_errors_is_named(bit_rate: int) -> None:
    with bench([bit_rate, bit_rate]) as (desk, bus):
        ran = desk.run("bitrate --for 20ms --json")
        assert (ran.code, ran.document["bit_rate"], ran.document["listen_only"]) == (0, bit_rate, True)
        assert received(ran)[-1] == bit_rate
        assert all(one["error_frames"] for one in ran.document["heard"][:-1])
        assert bus.runs_at == 500_000
        assert f"-b {bit_rate}" in desk.run("bitrate --for 20ms").stdout


def test_nobody_is_disturbed() -> None:
    """A node that consumes the other's heartbeat would say an emergency where one is destroyed."""
    with bench([125_000, 125_000]) as (desk, bus):
        bus.set_bit_rate(125_000)
        bus.sdo(1).download(0x1016, 1, (2 << 16 | 30).to_bytes(4, "little"))
        assert desk.run("bitrate --for 60ms").code == 0
        bus.sleep(0.02)
        assert bus.emergency(1) is None


def test_force_does_not_let_one_speak_that_can_be_silent() -> None:
    """A node that consumes the other's heartbeat would say an emergency where one is destroyed."""
    with bench([125_000, 125_000]) as (desk, bus):
        bus.set_bit_rate(125_000)
        bus.sdo(1).download(0x1016, 1, (2 << 16 | 30).to_bytes(4, "little"))
        ran = desk.run("bitrate --force --yes --for 60ms --json")
        assert (ran.code, ran.document["listen_only"]) == (0, True)
        assert bus.emergency(1) is None


def test_a_silent_bus_is_said_and_not_guessed() -> None:
    with bench([]) as (desk, _):
        ran = desk.run("bitrate --for 5ms")
        assert (ran.code, "is silent" in ran.stdout) == (1, True)
        told = desk.run("bitrate --for 5ms --json").document
        assert (told["bit_rate"], told["silent"], sorted(one["bit_rate"] for one in told["heard"])) == (
            None,
            True,
            sorted(BIT_TIMINGS),
        )


def test_a_bus_of_two_bit_rates_has_none() -> None:
    with bench([125_000, 250_000]) as (desk, _):
        ran = desk.run("bitrate --for 30ms")
        assert (ran.code, "without error frames" in ran.stdout) == (1, True)


def test_it_says_nothing() -> None:
    with bench([125_000]) as (desk, bus):
        sent: list[object] = []
        bus.tap(lambda frame, ours: sent.append(frame) if ours else None)
        assert desk.run("bitrate --for 10ms").code == 0
        assert sent == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-i", "virtual", "-c", "x"], "cannot be set from here"),
        (["-i", "socketcan", "-c", "can9"], "sudo ip link set can9 down"),
        (["-i", "gs_usb", "-c", "0"], "not known to listen without a word"),
        (["-i", "gs_usb", "-c", "0", "--force"], "--yes"),
        (["-i", "kvaser", "-c", "0", "--bus-kwargs", "fd=true"], "opened with fd"),
        (
            ["-i", "socketcand", "-c", "can0", "--bus-kwargs", "host=127.0.0.1", "--bus-kwargs", "port=1"],
            "cannot be set",
        ),
    ],
)
def test_who_may_disturb_others_does_not_listen(words: list[str], said: str) -> None:
    ran = dvtcli(*words, "bitrate")
    assert (ran.returncode, said in ran.stderr) == (6, True), ran.stderr


def test_without_an_interface_it_is_asked_for() -> None:
    assert dvtcli("bitrate").returncode in (2, 5)
