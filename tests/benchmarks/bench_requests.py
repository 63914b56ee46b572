"""How many SDO frames commands send: counts in virtual time, which no machine changes.

python -m tests.benchmarks requests
"""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from dvtcli.domain.can_ids import SDO_REQUEST_BASE
from dvtcli.domain.ports import Frame
from dvtcli.operations.devices.backup_device import backup_device
from dvtcli.operations.nodes.find_nodes import find_nodes
from dvtcli.operations.plans.apply_network import apply_network
from dvtcli.operations.plans.plan_network import plan_network
from dvtcli.operations.session.session import Session
from examples.many_nodes import network
from tests.benchmarks.bench_network import described, wired
from tests.benchmarks.figures import Figure
from tests.wire_timed_bus import WireTimedBus

NODES = 3
#: command specifiers of requests (CiA 301, 7.2.4.3): those of downloads, and of an upload
_DOWNLOADS, _UPLOAD = (0, 1), 2


class Requests:
    """The SDO requests that are sent on *bus* from now on."""

    def __init__(self, bus: WireTimedBus) -> None:
        self.sent: list[bytes] = []
        bus.tap(self._take)

    def _take(self, frame: Frame, sent: bool) -> None:
        if sent and frame.can_id & ~0x7F == SDO_REQUEST_BASE:
            self.sent.append(frame.data)

    @property
    def until_last_write(self) -> int:
        """How many were sent up to the last download: what follows is the final verification."""
        writes = [place for place, data in enumerate(self.sent) if data[0] >> 5 in _DOWNLOADS]
        return max(writes, default=-1) + 1

    @property
    def objects(self) -> Counter[bytes]:
        """How often each object was uploaded."""
        return Counter(data[1:4] for data in self.sent if data[0] >> 5 == _UPLOAD)


@contextmanager
def bench(count: int) -> Iterator[tuple[Session, WireTimedBus, Path]]:
    """A session on a bus of *count* nodes, and a folder."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_STATE_HOME"] = folder
        bus = wired(count, 500_000, 0.002)
        with described(bus, count, folder) as session:
            yield session, bus, Path(folder)


def _scan() -> tuple[float, float]:
    with bench(NODES) as (session, bus, _):
        requests = Requests(bus)
        find_nodes(session)
        return len(requests.sent), 127


def _backup() -> tuple[float, float]:
    with bench(1) as (session, bus, folder):
        requests = Requests(bus)
        backup_device(session, str(folder / "1.dcf"), 1)
        return requests.objects.total(), len(requests.objects)


def _plan_and_apply() -> tuple[float, float]:
    with bench(16) as (session, bus, folder):
        file = folder / "many.yaml"
        file.write_text(network(16).replace("{store: true}", "{dcf: generic}"), "utf-8")
        plan = plan_network(session, str(file))
        requests = Requests(bus)
        apply_network(session, plan)
        return requests.until_last_write / 16, 150


#: name, what it is compared with, goal as a ratio, and how both are counted
ROWS: list[tuple[str, str, float, Callable[[], tuple[float, float]]]] = [
    (f"scan, {NODES} nodes of 127: requests", "node-IDs", 150 / 127, _scan),
    ("backup: uploads", "objects", 1.02, _backup),
    ("apply, a node of 16: requests, last write", "the goal", 1, _plan_and_apply),
]


def figures(_rounds: int) -> Iterator[Figure]:
    """Each of ROWS, counted once."""
    for name, against, most, count in ROWS:
        own, other = count()
        yield Figure(name, "", [own], against, [other], most=most)
