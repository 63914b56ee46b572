"""`apply` of a network on a wire that takes time, in virtual time: `python tests/benchmarks/bench_network.py [NODES…]`.

Four TPDOs and four RPDOs of each node change, and are read back; stores, which go one by one on purpose, are a column
of their own. The peer is canopen's `PdoMap.read()` and `save()` of the same PDOs on that wire, with no reading back.
Beside the time stands the physical limit of the frames that were sent: all their bits on the wire, or the longest chain
of one node's requests and answers, whichever is longer. The ratio says how well the wire or the slowest node is used;
what is sent is another question.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from heapq import heappop, heappush
from pathlib import Path

import canopen

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from dvtcli.bus.sdo.sdo_link import REQUEST_ID
from dvtcli.domain.bus_load import frame_bits
from dvtcli.domain.ports import Frame
from dvtcli.operations.plans.apply_network import apply_network
from dvtcli.operations.plans.plan_network import plan_network
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from dvtcli.simulator.network.station import SimulatedNode
from dvtcli.simulator.network.wire import Wire
from examples.many_nodes import PAIRS, can_id, network
from tests.laws.bench import dictionary
from tests.virtual_time import VirtualTimeBus

COUNTS, BIT_RATES, SERVERS_S = (1, 16, 64, 127), (250_000, 500_000, 1_000_000), (0.002, 0.010)


class WireTimedBus(VirtualTimeBus):
    """A bus of *bitrate* bit/s whose nodes answer an SDO request *server_s* after its last bit."""

    def __init__(self, devices: list[StrictDevice], bitrate: int, server_s: float) -> None:
        self.wire, self.bitrate_, self.server_s = Wire(bitrate), bitrate, server_s
        self._answers: list[tuple[float, int, SimulatedNode, Frame]] = []
        self._order = 0
        self.bits = 0
        self.chains_s: dict[int, float] = {}
        super().__init__(devices)
        self._stations = {node.device.node_id: node for node in self.nodes}

    def _send(self, frame: Frame) -> None:
        self._traffic.sent(frame)
        self.wire.offer(None, frame, self._now_s)

    def _step(self, until_s: float) -> bool:
        times = [self._answers[0][0]] if self._answers else []
        if (wire_s := self.wire.next_s()) is not None:
            times.append(wire_s)
        next_s = max(self._now_s, min(times, default=float("inf")))
        if next_s > until_s:
            self._now_s = max(self._now_s, until_s)
            return False
        self._now_s = next_s
        while self._answers and self._answers[0][0] <= next_s:
            _, _, node, frame = heappop(self._answers)
            self.wire.offer(node, frame, next_s)
        arrived = self.wire.take(next_s)
        if arrived is not None:
            self._arrived(*arrived)
        return True

    def _arrived(self, at_s: float, source: object, frame: Frame) -> None:
        bits = frame_bits(frame.can_id, frame.data)
        self.bits += bits
        node_id = frame.can_id & 0x7F
        self.chains_s[node_id] = self.chains_s.get(node_id, 0.0) + bits / self.bitrate_
        if source is not None:
            self._hear(frame)
        elif frame.can_id & ~0x7F == REQUEST_ID:
            node = self._stations[node_id]
            for answer in node.handle(frame, at_s):
                self._order += 1
                self.chains_s[node_id] += self.server_s
                heappush(self._answers, (at_s + self.server_s, self._order, node, answer))

    def begin(self) -> None:
        """Count from here on."""
        self.bits, self.chains_s = 0, {}

    def limit_s(self) -> float:
        """The least time that what was sent since then could take."""
        return max(self.bits / self.bitrate_, max(self.chains_s.values(), default=0.0))


class OnTheWire(canopen.Network):
    """canopen's network on *bus*: whoever sends a request has its answer when that returns."""

    def __init__(self, bus: WireTimedBus) -> None:
        super().__init__()
        self._wire = bus
        self._answers = 0
        bus.tap(self._heard)

    def _heard(self, frame: Frame, sent: bool) -> None:
        if not sent:
            self._answers += 1
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


def run_canopen(count: int, bitrate: int, server_s: float) -> float:
    """Seconds of virtual time in which canopen reads all eight PDOs of each node, sets them, and saves them."""
    bus = wired(count, bitrate, server_s)
    network = OnTheWire(bus)
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
    return bus.now_s()


def run(
    count: int, bitrate: int, server_s: float, *, width: int = 64, store: bool = False
) -> tuple[float, float, float]:
    """Seconds of virtual time, the limit in seconds, and seconds of CPU, of an `apply` of *count* nodes."""
    bus = wired(count, bitrate, server_s)
    bus.most_at_once = width
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "many.yaml"
        file.write_text(network(count) if store else network(count).replace("{store: true}", "{}"))
        with Session(Options(yes=True, journal=folder), open_bus=lambda _options: bus) as session:
            for node_id in range(1, count + 1):
                session.open_network().files.own_eds[node_id] = family_eds("generic")
                session.open_network().files.own_profile[node_id] = "generic"
            plan = plan_network(session, str(file))
            bus.begin()
            began_s, cpu_s = bus.now_s(), time.process_time()
            apply_network(session, plan)
            done = bus.now_s() - began_s, bus.limit_s(), time.process_time() - cpu_s
            assert not plan_network(session, str(file)).changed
    return done


def main(counts: tuple[int, ...]) -> None:
    os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp()
    print("nodes kbit/s server   apply     limit  ratio one by one with stores   canopen  CPU/node")
    for count in counts:
        for bitrate in BIT_RATES:
            for server_s in SERVERS_S:
                took_s, limit_s, cpu_s = run(count, bitrate, server_s)
                alone = f"{run(count, bitrate, server_s, width=1)[0]:8.2f} s" if count <= 16 else "-"
                stored = f"{run(count, bitrate, server_s, store=True)[0]:8.2f} s"
                print(
                    f"{count:5} {bitrate // 1000:6} {1000 * server_s:3.0f} ms {took_s:7.2f} s {limit_s:7.2f} s "
                    f"{took_s / limit_s:5.2f} {alone:>10} {stored:>11} "
                    f"{run_canopen(count, bitrate, server_s):8.2f} s {1000 * cpu_s / count:6.1f} ms",
                    flush=True,
                )
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
