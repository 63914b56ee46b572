"""A dry run ends where its block ends, whatever happens meanwhile: no later call takes a twin for the device."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import dvtcli
from dvtcli import errors
from dvtcli.simulator.network.family_file import family_eds
from tests.harness.sample import heavy
from tests.posix import needs_signals
from tests.process import PATIENCE_S


@pytest.fixture(autouse=True)
def pythons_own_handler() -> Iterator[None]:
    """A worker of a parallel run has none."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def event_timer(bus: dvtcli.Bus) -> int | None:
    return bus.node(5).pdo("tpdo1").config.communication.event_timer


@needs_signals
def test_it_ends_though_another_thread_is_at_work_on_the_bus() -> None:
    with dvtcli.simulate("gen4@5") as bus:
        node, at_work, done = bus.node(5), threading.Event(), threading.Event()
        before = event_timer(bus)

        def work() -> None:
            with bus._calls.alone():  # as canopen's SDO does
                at_work.set()
                done.wait(PATIENCE_S)

        other = threading.Thread(target=work)
        stop = threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT))
        with bus.dry_run():
            node.set("tpdo1", timer_ms=111)
            other.start()
            at_work.wait(PATIENCE_S)
            stop.start()
        stop.cancel()
        assert not bus.is_dry_run
        done.set()
        other.join()
        assert event_timer(bus) == before
        assert not node.set("tpdo1", timer_ms=222).dry_run
        assert event_timer(bus) == 222


def test_a_bus_may_be_closed_in_it() -> None:
    bus = dvtcli.simulate("gen4")
    with bus.dry_run():
        bus.close()
    assert not bus.is_dry_run
    with pytest.raises(errors.BusUnavailable):
        bus.node()


def test_what_a_program_raises_in_it_comes_out_though_the_bus_was_closed() -> None:
    bus = dvtcli.simulate("gen4")

    def rehearse() -> None:
        with bus.dry_run():
            bus.close()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        rehearse()


def test_another_one_in_it_is_refused_and_ends_nothing() -> None:
    with dvtcli.simulate("gen4@5") as bus:
        before = event_timer(bus)
        with bus.dry_run():
            with pytest.raises(errors.UsageError, match="a dry run is already in progress"), bus.dry_run():
                pass
            assert bus.is_dry_run
            assert bus.node(5).set("tpdo1", timer_ms=111).dry_run
        assert event_timer(bus) == before


def test_what_another_bus_raises_in_it_says_how_that_ones_device_is() -> None:
    with dvtcli.simulate("gen4") as bus, dvtcli.simulate("gen4", faults=["refuse@3=0x06040041"]) as other:
        with pytest.raises(errors.DeviceRefused) as refused, bus.dry_run():
            other.node().map("tpdo1", "606C", "6041")
        assert refused.value.state == "rolled_back"
        assert not any("twin" in said for _, said in refused.value.details)


@heavy
def test_buses_of_several_threads_are_independent() -> None:
    failed: list[BaseException] = []

    def work() -> None:
        try:
            for _ in range(30):
                with dvtcli.simulate("generic") as bus:
                    bus.node().read(0x1000)
        except BaseException as raised:  # noqa: BLE001 - told by the main thread
            failed.append(raised)

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        threads = [threading.Thread(target=work) for _ in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(before)
    assert not failed


def test_a_closed_bus_is_entered_no_more() -> None:
    bus = dvtcli.simulate("gen4")
    bus.close()
    with pytest.raises(errors.BusUnavailable, match="the bus is closed"), bus:
        pass


def test_a_bus_is_left_though_canopens_network_does_not_end() -> None:
    bus = dvtcli.simulate("gen4")
    bus.node().canopen()
    network = bus._canopen
    assert network is not None
    end = network.disconnect

    def fails() -> None:
        end()
        raise ZeroDivisionError

    network.disconnect = fails  # type: ignore[method-assign]
    with pytest.raises(ZeroDivisionError):
        bus.close()
    assert bus._calls.closed


def test_a_node_keeps_the_file_and_the_family_that_it_was_given_first(tmp_path: Path) -> None:
    for name in ("a.eds", "b.eds"):
        (tmp_path / name).write_bytes(family_eds("gen4").read_bytes())
    with dvtcli.simulate("gen4") as bus:
        node = bus.node(eds=tmp_path / "a.eds", profile="gen4")
        assert bus.node(eds=tmp_path / "a.eds", profile="gen4") is node
        with pytest.raises(errors.UsageError, match=r"node 1 already uses .*a\.eds, not .*b\.eds"):
            bus.node(eds=tmp_path / "b.eds")
        with pytest.raises(errors.UsageError, match="node 1 already uses gen4, not generic"):
            bus.node(profile="generic")
        with pytest.raises(errors.UsageError, match="nope"):
            bus.node(2, profile="nope")
        assert node.pdos()
