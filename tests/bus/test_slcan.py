"""python-can's slcan driver against a strict adapter on a pseudo-terminal: finding it, jobs over it, and bad lines."""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from importlib.util import find_spec
from itertools import count
from pathlib import Path

import can
import pytest

from dvtcli.bus.discover import serial_ports
from dvtcli.bus.opening import open_bus
from dvtcli.cli.view.typed_hints import typed
from dvtcli.errors import BusUnavailable, NoAnswer
from dvtcli.operations.results.frames import BusEvent
from dvtcli.operations.session.steady_listener import come_back
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.bus.slcan_adapter import Line, SlcanAdapter
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import device
from tests.lss_nodes import unconfigured
from tests.process import PATIENCE_S, dvtcli, start
from tests.served_nodes import ServedNodes
from tests.simulator.serve.served import own_environment, wait_for
from tests.socketcan.recorded import interrupted, seen_by

pytestmark = [
    pytest.mark.skipif(not find_spec("serial"), reason="pyserial is not installed"),
    pytest.mark.skipif(sys.platform == "win32" or not find_spec("pty"), reason="this system has no pseudo-terminals"),
    pytest.mark.drawn(6, "slcan"),
]
_NUMBERS = count(1)
#: python-can waits 2 s for an adapter that starts anew where its port is opened
AT_ONCE = {"sleep_after_open": "0"}
#: an SDO download to 0x1A00 of one byte, as our client begins it
WRITE = bytes.fromhex("2F 00 1A")
Plug = Callable[..., SlcanAdapter]


@pytest.fixture
def plug() -> Iterator[Plug]:
    """An adapter with a Gen4 as node 1 behind it."""
    with ExitStack() as stack:

        def start(**how: object) -> SlcanAdapter:
            channel = f"slcan-{next(_NUMBERS)}"
            theirs = stack.enter_context(can.Bus(channel, interface="virtual", ignore_config=True))
            stack.enter_context(ServedNodes(theirs, [device("gen4")]))
            return stack.enter_context(SlcanAdapter(channel, **how))  # type: ignore[arg-type]

        yield start


@pytest.fixture
def tuned() -> Iterator[tuple[SlcanAdapter, list[StrictDevice]]]:
    """An adapter on a wire on which two nodes run at 125 kbit/s and say so."""
    nodes = [unconfigured(number, node_id=number) for number in (1, 5)]
    for node in nodes:
        node.set_value(0x1017, 0, (20).to_bytes(2, "little"))
    channel = f"slcan-{next(_NUMBERS)}"
    with (
        can.Bus(channel, interface="virtual", ignore_config=True) as theirs,
        ServedNodes(theirs, nodes, bit_rate=125_000) as served,
        SlcanAdapter(channel, tune=lambda rate, listening: served.tune(rate, listening=listening)) as adapter,
    ):
        yield adapter, nodes


def test_the_bit_rate_is_listened_for_without_a_word(tuned: tuple[SlcanAdapter, list[StrictDevice]]) -> None:
    adapter, nodes = tuned
    nodes[0].set_value(0x1016, 1, (5 << 16 | 300).to_bytes(4, "little"))
    words = ["-i", "slcan", "-c", adapter.port, "--bus-kwargs", "sleep_after_open=0"]
    ran = dvtcli(*words, "bitrate", "--for", "300ms", "--json")
    assert ran.returncode == 0, ran.stderr
    told = json.loads(ran.stdout)
    assert (told["bit_rate"], [one["bit_rate"] for one in told["heard"]]) == (125_000, [500_000, 250_000, 125_000])
    assert adapter.opened == {b"L"}
    assert adapter.sent == 0


@pytest.mark.long
def test_all_nodes_behind_an_adapter_get_another_bit_rate(tuned: tuple[SlcanAdapter, list[StrictDevice]]) -> None:
    adapter, nodes = tuned
    with Bench((), {**options(adapter), "bitrate": 125_000, "yes": True}) as bench:
        ran = bench.run("lss bitrate 1M --store --json")
        assert ran.code == 0, ran.stderr
        assert (ran.document["before"], [one["stored"] for one in ran.document["nodes"]]) == (125_000, [True, True])
        assert adapter.bit_rate_kbit == 1000
        assert {node.lss.bit_rate for node in nodes} == {1_000_000}
        assert bench.run("read 5:1018:4").code == 0


def options(adapter: SlcanAdapter, *, timeout_s: float = 20.0) -> dict[str, object]:
    extra = tuple(f"{key}={value}" for key, value in AT_ONCE.items())
    usual = {"interface": "slcan", "channel": adapter.port, "bitrate": 500_000, "node": 1}
    return {**usual, "bus_kwargs": extra, "timeout": timeout_s}


@pytest.mark.parametrize("line", [Line(), Line(pieces=3, late_s=0.0005)], ids=["whole", "in pieces"])
def test_map_and_store_over_an_adapter(plug: Plug, line: Line) -> None:
    adapter = plug(line=line)
    with Bench((), options(adapter)) as bench:
        ran = bench.run("map tpdo1 6041 606C/32 --sync 1")
        assert ran.code == 0, ran.stderr
        ran = bench.run("store --prove --yes")
        assert ran.code == 0, ran.stderr
        assert "proved" in ran.stdout
        assert ran.stderr == ""
    assert adapter.bit_rate_kbit == 500
    assert adapter.complaints == [b"O"], "python-can opens it twice"
    wait_for(lambda: not adapter.is_open, "the channel to be closed again")


def test_it_is_found_where_usb_ports_are(plug: Plug, tmp_path: Path) -> None:
    port = plug().plug_into(tmp_path)
    (found,) = serial_ports(str(tmp_path))
    assert (found.interface, found.channel, found.problem) == ("slcan", str(port), None)
    bus = open_bus(found.interface, found.channel, 500_000, AT_ONCE, timeout_s=20)
    assert bus.sdo(1).upload(0x1018, 1) == b"\x1e\0\0\0"
    bus.close()


def test_scan_monitor_and_log_over_an_adapter(plug: Plug, tmp_path: Path) -> None:
    adapter = plug()
    with Bench((), options(adapter)) as bench:
        assert [row["node"] for row in bench.run("scan --json").document["nodes"]] == [1]
    path = tmp_path / "run.log"
    words = ["-i", "slcan", "-c", adapter.port, "-b", "500000", "--bus-kwargs", "sleep_after_open=0"]
    recording = start([*words, "log", str(path)], env=own_environment(tmp_path))
    wait_for(lambda: path.exists() and " 701#" in path.read_text("utf-8"), "a heartbeat in the file")
    interrupted(recording)
    watching = start([*words, "monitor", "--json"], env=own_environment(tmp_path))
    assert seen_by(watching, lambda rows: "heartbeat" in {row.get("kind") for row in rows})


def test_damaged_lines_are_left_out_and_told(plug: Plug) -> None:
    """Each 97th character is missing: some answers are no frames any more, and are asked for again."""
    adapter = plug(line=Line(losing=97))
    bus = open_bus("slcan", adapter.port, 500_000, AT_ONCE, timeout_s=0.2, retries=3)
    read = 0
    for _ in range(60):
        with suppress(NoAnswer):
            assert bus.sdo(1).upload(0x1018, 1) == b"\x1e\0\0\0"
            read += 1
    assert read > 30
    told = [text for text in bus.disturbances() if "damaged" in text]
    assert len(told) == 1
    bus.close()


def test_what_the_adapter_does_not_send_is_no_success(plug: Plug) -> None:
    """Its transmit buffer is full now and then: reads are asked again, a write that was not sent is found out."""
    adapter = plug()
    with Bench((), options(adapter, timeout_s=2.0)) as bench:
        before = bench.run("pdo tpdo1 --json").document
        adapter.refused = WRITE
        ran = bench.run("map tpdo1 6041 606C/32 --sync 1")
        assert ran.code == 5, ran.stderr
        adapter.refused = None
        assert bench.run("pdo tpdo1 --json").document == before
    assert adapter.complaints


def test_an_adapter_that_is_unplugged_is_told(plug: Plug) -> None:
    adapter = plug()
    bus = open_bus("slcan", adapter.port, 500_000, AT_ONCE, timeout_s=20)
    bus.sdo(1).upload(0x1000, 0)
    adapter.unplug()
    with pytest.raises(BusUnavailable) as caught:
        list(bus.receive(PATIENCE_S))
    assert "plugged in" in typed(caught.value.hint)
    bus.close()


def test_an_adapter_that_is_plugged_in_again_is_opened_again(plug: Plug, tmp_path: Path) -> None:
    port = (first := plug()).plug_into(tmp_path)
    given = {**options(first), "channel": str(port), "reconnect": True}
    told: list[BusEvent] = []
    with Bench((), given) as bench:
        assert bench.run("set tpdo1 --timer 70").code == 0
        was = bench.session.wire
        first.unplug()
        with pytest.raises(BusUnavailable) as caught:
            list(was.receive(PATIENCE_S))

        def plugged_in_again(event: BusEvent) -> None:
            told.append(event)
            if event.after_s is None:
                port.unlink()
                threading.Timer(0.3, plug().plug_into, (tmp_path,)).start()

        assert come_back(bench.session, was, caught.value, lambda: False, plugged_in_again)
        ran = bench.run("pdo tpdo1 --json")
        assert ran.document["pdos"][0]["event_timer_ms"] == 0, "another adapter, and another Gen4 after it"
        with pytest.raises(BusUnavailable):
            was.sdo(1).upload(0x1000, 0)
    assert [event.document()["event"] for event in told] == ["gone", "back"]


def test_nobody_waits_for_an_adapter_longer_than_it_is_wanted(plug: Plug, tmp_path: Path) -> None:
    adapter = plug()
    with Bench((), {**options(adapter), "channel": str(adapter.plug_into(tmp_path))}) as bench:
        bench.session.open_network()
        adapter.unplug()
        ends = iter([False] * 5)
        failed = BusUnavailable("it failed")
        assert not come_back(bench.session, bench.session.wire, failed, lambda: next(ends, True), lambda _event: None)
        ran = bench.run("read 1000")
        assert ran.code == 5
        assert "is gone (it failed)" in ran.stderr


def test_no_bit_rate_is_no_bus(plug: Plug) -> None:
    """The adapter has none of its own, refuses to open, and says so."""
    adapter = plug()
    bus = open_bus("slcan", adapter.port, None, AT_ONCE, timeout_s=0.1, retries=0)
    with pytest.raises(NoAnswer):
        bus.sdo(1).upload(0x1000, 0)
    assert any("no bit rate is given" in text for text in bus.disturbances())
    bus.close()
