"""`apply` of a network on a wire that takes time, in virtual time: `python tests/benchmarks/bench_network.py [NODES…]`.

Four TPDOs and four RPDOs of each node change, and are read back; stores, which go one by one on purpose, are a column
of their own. The peer is canopen's `PdoMap.read()` and `save()` of the same PDOs on that wire, with no reading back.
Beside the time stands the physical limit of the frames that were sent: all their bits on the wire, or the longest chain
of one node's requests and answers, whichever is longer. The ratio says how well the wire or the slowest node is used;
what is sent is another question. The rows are those of docs/reference/measurements.md but for the last column, the
processor's time: that alone needs a quiet machine.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import canopen

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from dvtcli.domain.can_ids import SDO_RESPONSE_BASE
from dvtcli.domain.ports import Frame
from dvtcli.operations.plans.apply_network import apply_network
from dvtcli.operations.plans.plan_network import plan_network
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from examples.many_nodes import PAIRS, can_id, network
from tests.laws.bench import dictionary
from tests.wire_timed_bus import WireTimedBus

HEAD = (
    "| nodes | kbit/s | a server answers after | `apply` | limit | ratio | one node after the other | with stores "
    "| canopen | CPU a node |"
)
COUNTS, BIT_RATES, SERVERS_S = (1, 16, 64, 127), (250_000, 500_000, 1_000_000), (0.002, 0.010)


class OnTheWire(canopen.Network):
    """canopen's network on *bus*: whoever sends a request has its answer when that returns."""

    def __init__(self, bus: WireTimedBus) -> None:
        super().__init__()
        self._wire = bus
        self._answers = 0
        bus.tap(self._received)

    def _received(self, frame: Frame, sent: bool) -> None:
        if not sent:
            self._answers += frame.can_id & ~0x7F == SDO_RESPONSE_BASE  # heartbeats pass as well
            self.notify(frame.can_id, bytearray(frame.data), frame.timestamp_s)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send, and wait for the answer."""
        seen = self._answers
        self._wire.send_sdo(can_id, bytes(data))
        self._wire._until(lambda: self._answers > seen, self._wire.now_s() + 1.0)


def wired(count: int, bitrate: int, server_s: float) -> WireTimedBus:
    """A bus of *count* generic nodes, none of which is OPERATIONAL."""
    devices = [StrictDevice(dictionary("generic"), load_family("generic"), node_id) for node_id in range(1, count + 1)]
    for one in devices:
        one.boot_up()
        one.take_outbox()
    return WireTimedBus(devices, bitrate, server_s)


def set_with_canopen(network: canopen.Network, count: int) -> None:
    """Let canopen read all eight PDOs of each of *count* nodes, set them, and save them."""
    for node_id in range(1, count + 1):
        node = canopen.RemoteNode(node_id, str(family_eds("generic")))
        network.add_node(node)
        before = node_id - 1 or count
        for number, (sends, takes) in enumerate(PAIRS):
            for pdo, entry, sender in (
                (node.tpdo[number + 1], sends, node_id),
                (node.rpdo[number + 1], takes, before),
            ):
                pdo.read()
                pdo.clear()
                pdo.add_variable(int(entry, 16))
                pdo.cob_id, pdo.enabled, pdo.trans_type = can_id(sender, number), True, 254
                if pdo is node.tpdo[number + 1]:
                    pdo.event_timer = 100 + number
                pdo.save()


def run_canopen(count: int, bitrate: int, server_s: float) -> float:
    """Seconds of virtual time in which canopen sets all eight PDOs of each node."""
    bus = wired(count, bitrate, server_s)
    set_with_canopen(OnTheWire(bus), count)
    return bus.now_s()


@contextmanager
def described(bus: WireTimedBus, count: int, folder: str) -> Iterator[Session]:
    """A session on *bus* that knows the EDS and the profile of each of *count* nodes, with its files in *folder*."""
    with Session(Options(yes=True, journal=folder), open_bus=lambda _options: bus) as session:
        for node_id in range(1, count + 1):
            session.open_network().files.own_eds[node_id] = family_eds("generic")
            session.open_network().files.own_profile[node_id] = "generic"
        yield session


def run(
    count: int, bitrate: int, server_s: float, *, width: int = 64, store: bool = False
) -> tuple[float, float, float]:
    """Seconds of virtual time, the limit in seconds, and seconds of CPU, of an `apply` of *count* nodes."""
    bus = wired(count, bitrate, server_s)
    bus.most_at_once = width
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "many.yaml"
        file.write_text(network(count) if store else network(count).replace("{store: true}", "{}"))
        with described(bus, count, folder) as session:
            plan = plan_network(session, str(file))
            bus.begin()
            began_s, cpu_s = bus.now_s(), time.process_time()
            apply_network(session, plan)
            done = bus.now_s() - began_s, bus.limit_s(), time.process_time() - cpu_s
            assert not plan_network(session, str(file)).changed
    return done


def row(count: int, bitrate: int, server_s: float) -> str:
    """One line of the table; one node after the other only where that ends soon."""
    took_s, limit_s, cpu_s = run(count, bitrate, server_s)
    alone = f"{run(count, bitrate, server_s, width=1)[0]:.2f} s" if count <= 16 else "-"
    stored_s = run(count, bitrate, server_s, store=True)[0]
    return (
        f"| {count} | {bitrate // 1000} | {1000 * server_s:.0f} ms | {took_s:.2f} s | {limit_s:.2f} s "
        f"| {took_s / limit_s:.2f} | {alone} | {stored_s:.2f} s | {run_canopen(count, bitrate, server_s):.2f} s "
        f"| {1000 * cpu_s / count:.0f} ms |"
    )


def main(counts: tuple[int, ...]) -> None:
    os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp()
    print(HEAD)
    print("|---" * HEAD.count(" | ") + "|---|")
    for count in counts:
        for bitrate in BIT_RATES:
            for server_s in SERVERS_S:
                print(row(count, bitrate, server_s), flush=True)
    for count in counts:
        subprocess.run([sys.executable, __file__, "--peak", str(count)], check=True)


def peak(count: int) -> None:
    """Print the most memory of a process that does no more than one `apply` of *count* nodes."""
    run(count, 1_000_000, 0.010)
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak of {count} nodes: {used:.0f} MB, simulated nodes, Python and canopen among it", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--peak"]:
        os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp()
        peak(int(sys.argv[2]))
    else:
        main(tuple(map(int, sys.argv[1:])) or COUNTS)
