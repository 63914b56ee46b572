"""SDO downloads for one change of a PDO: dvtcli, canopen's `PdoMap.save()`, and the fewest that are possible.

    python tests/benchmarks/bench_writes.py

Both work on the same strict simulated device in the same start state, and a third party on the same virtual bus counts
the downloads. After each change the device is read and must hold the same thing for both. Reads are counted too:
dvtcli looks before it writes, and reads back what it wrote. No times, so that the figures are the same everywhere.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import count

import can
import canopen

from dvtcli.bus.python_can import CanBus
from dvtcli.device.node import Node
from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.served_nodes import ServedNodes

NODE = 1
TPDO1 = Pdo.parse("tpdo1")
EDS = family_eds("generic")
CHANNELS = count(1)

Ours = Callable[[PdoConfig], PdoConfig]
Theirs = Callable[[canopen.pdo.PdoMap], None]


@dataclass(frozen=True)
class Change:
    """One change as each side expresses it, and the fewest downloads that CiA 301 allows for it."""

    name: str
    ours: Ours
    theirs: Theirs
    fewest: int


def entries(*words: int) -> tuple[PdoMappingEntry, ...]:
    return tuple(PdoMappingEntry.from_raw(word) for word in words)


def communication(**changes: object) -> Ours:
    return lambda config: config.with_parameters(**changes)  # type: ignore[arg-type]


def at(can_id: int) -> Ours:
    return lambda now: now.with_parameters(cob_id=replace(now.communication.cob_id, can_id=can_id))


def remap(pdo_map: canopen.pdo.PdoMap) -> None:
    pdo_map.clear()
    for index, sub_index in ((0x6077, 0), (0x606C, 0), (0x6041, 0)):
        pdo_map.add_variable(index, sub_index)


START = entries(0x60410010, 0x60610008, 0x60640020)
CHANGES = [
    Change("event timer only", communication(event_timer=100), lambda pdo: setattr(pdo, "event_timer", 100), 1),
    Change("transmission type only", communication(transmission_type=2), lambda pdo: setattr(pdo, "trans_type", 2), 1),
    Change("disable", lambda now: now.disabled(),
           lambda pdo: setattr(pdo, "enabled", False), 1),
    Change("another COB-ID", at(0x1C1), lambda pdo: setattr(pdo, "cob_id", 0x1C1), 2),
    Change("3 other entries", lambda now: replace(now, mapping=entries(0x60770010, 0x606C0020, 0x60410010)), remap, 7),
    Change("nothing", lambda now: now, lambda _pdo: None, 0),
]  # fmt: skip


@contextmanager
def bench() -> Iterator[tuple[str, can.BusABC]]:
    """A device whose TPDO1 maps START on every SYNC, and a listener; the name of their virtual channel."""
    channel = f"bench-writes-{next(CHANNELS)}"
    listener, theirs = (can.Bus(channel, interface="virtual", ignore_config=True) for _ in range(2))
    device = StrictDevice(read_eds(EDS).dictionary, load_family("generic"), NODE)
    network = ServedNodes(theirs, [device])
    network.start()
    with ours(channel) as node:
        now = node.pdo(TPDO1)
        node.configure({TPDO1: replace(communication(transmission_type=1, event_timer=0)(now), mapping=START)})
    requests(listener)
    yield channel, listener
    network.stop()
    for bus in (theirs, listener):
        bus.shutdown()


def requests(listener: can.BusABC) -> tuple[int, int]:
    """Downloads and uploads that were started since the last call."""
    specifiers = []
    while (message := listener.recv(0.02)) is not None:
        if message.arbitration_id == 0x600 + NODE:
            specifiers.append(message.data[0] >> 5)
    return specifiers.count(1), specifiers.count(2)


@contextmanager
def ours(channel: str) -> Iterator[Node]:
    bus = CanBus(can.Bus(channel, interface="virtual", ignore_config=True), "virtual")
    yield Node(bus, NODE, read_eds(EDS).dictionary)
    bus.close()


def held(channel: str) -> PdoConfig:
    with ours(channel) as node:
        return read_pdo(node.sdo, TPDO1)


def by_dvtcli(change: Change) -> tuple[tuple[int, int], PdoConfig]:
    with bench() as (channel, listener):
        with ours(channel) as node:
            node.configure({TPDO1: change.ours(node.pdo(TPDO1))})
        return requests(listener), held(channel)


def by_canopen(change: Change) -> tuple[tuple[int, int], PdoConfig]:
    with bench() as (channel, listener):
        network = canopen.Network()
        network.NOTIFIER_CYCLE = 0.02
        network.connect(interface="virtual", channel=channel, ignore_config=True)
        node = network.add_node(NODE, str(EDS))
        node.tpdo[1].read()
        change.theirs(node.tpdo[1])
        node.tpdo[1].save()
        network.disconnect()
        return requests(listener), held(channel)


def measure() -> Iterator[tuple[Change, tuple[int, int], tuple[int, int], bool]]:
    """Each change with our downloads and uploads, canopen's, and whether the device holds the same after both."""
    logging.disable(logging.CRITICAL)
    for change in CHANGES:
        own, own_result = by_dvtcli(change)
        their, their_result = by_canopen(change)
        yield change, own, their, own_result == their_result


def main() -> None:
    """Count and print the table."""
    print(f"{'SDO downloads (+ uploads)':28}{'fewest':>8}{'dvtcli':>12}{'canopen':>12}")
    for change, own, their, same in measure():
        remark = "" if same else "   the device holds something else after canopen"
        print(f"{change.name:28}{change.fewest:8}{own[0]:6} ({own[1]:+3d}){their[0]:6} ({their[1]:+3d}){remark}")


if __name__ == "__main__":
    main()
