"""The traction chain of `examples/` on strict devices in virtual time: what its nodes hold, hear and store.

What a device holds is read from the device itself, never through the tool.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import Frame
from dvtcli.operations.network.network_files import apply_file, plan_file
from dvtcli.operations.results import NetworkApplied, NetworkPlanned
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from dvtcli.simulator.network.station import SimulatedNode
from tests.faults.matrix import Snapshot, snapshot, stored_pdos
from tests.laws.bench import dictionary
from tests.surroundings import ROOT
from tests.virtual_time import VirtualTimeBus

if TYPE_CHECKING:
    from dvtcli.domain.store import ProveBy

CHAIN = {1: "gen4", 5: "generic", 9: "generic"}
FILE = ROOT / "examples" / "traction.yaml"
_HEARTBEAT_MS = 100
#: the layout that a frame has, and the one that it is taken for: the objects' lengths in bits
Layouts = tuple[tuple[int, ...], tuple[int, ...]]


def device(node_id: int, family: str, *, clears_stamp: bool = True) -> StrictDevice:
    """A device in PRE-OPERATIONAL with a stored heartbeat; RAM and what is stored differ in a PDO that changes."""
    behaviour = load_family(family)._replace(clears_stamp=clears_stamp)
    made = StrictDevice(dictionary(family), behaviour, node_id)
    made.boot_up()
    made.set_value(0x1017, 0, _HEARTBEAT_MS.to_bytes(2, "little"))
    made._memory.save(0x1017, 0x1017)
    made.boot_up()
    made.take_outbox()
    made.download(0x1800, 5, (33).to_bytes(2, "little"))
    return made


class Heard(VirtualTimeBus):
    """A bus that keeps, of every frame that an RPDO takes, its layout and the one that it is taken for."""

    def __init__(self, devices: list[StrictDevice], faults: list[Fault]) -> None:
        self.layouts: set[tuple[int, int, int, Layouts]] = set()
        super().__init__(devices, faults=faults)

    def _deliver(self, frame: Frame, sender: SimulatedNode | None) -> None:
        if sender is not None:
            for node in self.nodes:
                if node is not sender:
                    self._note(frame, sender.device, node.device)
        super()._deliver(frame, sender)

    def _note(self, frame: Frame, producer: StrictDevice, consumer: StrictDevice) -> None:
        sent = next((one for one in pdos(producer, tpdo=True) if one[0] == frame.can_id), None)
        for can_id, layout in pdos(consumer, tpdo=False) if consumer.state is NmtState.OPERATIONAL else ():
            if sent is not None and can_id == frame.can_id:
                self.layouts.add((can_id, producer.node_id, consumer.node_id, (sent[1], layout)))


def pdos(held: StrictDevice, *, tpdo: bool) -> list[tuple[int, tuple[int, ...]]]:
    """CAN-ID and layout of each enabled PDO of one direction."""
    found = []
    described = (Pdo.at(index) for index in held.dictionary if 0x1400 <= index <= 0x1BFF)
    for pdo in (pdo for pdo in described if pdo is not None and pdo.is_tpdo is tpdo):
        cob_id = CobId.from_raw(int.from_bytes(held.value(pdo.communication_index, 1), "little"))
        if cob_id.valid:
            count = held.value(pdo.mapping_index, 0)[0]
            found.append((cob_id.can_id, tuple(held.value(pdo.mapping_index, sub)[0] for sub in range(1, count + 1))))
    return sorted(set(found))


def fitting(devices: list[StrictDevice]) -> set[tuple[int, int, int, Layouts]]:
    """Of each enabled TPDO that an enabled RPDO of another one of *devices* hears, the layouts of both."""
    sent = [(one, *pdo) for one in devices for pdo in pdos(one, tpdo=True)]
    received = [(one, *pdo) for one in devices for pdo in pdos(one, tpdo=False)]
    return {
        (can_id, producer.node_id, consumer.node_id, (layout, taken))
        for producer, can_id, layout in sent
        for consumer, can_id_heard, taken in received
        if can_id_heard == can_id and producer is not consumer
    }


class Chain:
    """Three nodes, a bus, a folder for journals; a session for each call, as of a process."""

    def __init__(
        self,
        folder: Path,
        faults: list[str] | None = None,
        *,
        operational: bool = True,
        families: dict[int, str] = CHAIN,
        bus: type[Heard] = Heard,
        clears_stamps: bool = True,
    ) -> None:
        self.folder, self._families = folder, families
        self.devices = {
            node_id: device(node_id, family, clears_stamp=clears_stamps) for node_id, family in families.items()
        }
        self.bus = bus(list(self.devices.values()), [Fault.parse(text) for text in faults or []])
        if operational:
            self.bus.send_nmt(NmtCommand.START, 0)
        self.bus.sleep(2 * _HEARTBEAT_MS / 1000)

    @contextmanager
    def session(self, **options: Any) -> Iterator[Session]:
        """A session as another process would open it."""
        given = Options(yes=True, journal=str(self.folder))._replace(**options)
        self.bus._closed = False
        with Session(given, open_bus=lambda _options: self.bus) as session:
            for node_id, family in self._families.items():
                session.open_network().files.own_eds[node_id] = family_eds(family)
                session.open_network().files.own_profile[node_id] = family
            yield session

    def plan(self, file: Path = FILE, *, trust_stamp: bool = False) -> NetworkPlanned:
        with self.session() as session:
            return plan_file(session, str(file), trust_stamp=trust_stamp)

    def apply(self, file: Path = FILE, *, prove: ProveBy | None = None) -> NetworkApplied:
        with self.session() as session:
            return apply_file(session, str(file), prove=prove)

    def held(self) -> dict[int, Snapshot]:
        """What each device holds."""
        return {node_id: snapshot(one) for node_id, one in self.devices.items()}

    def states(self) -> dict[int, NmtState]:
        return {node_id: one.state for node_id, one in self.devices.items()}

    def stored(self) -> dict[int, dict[tuple[int, int], bytes]]:
        return {node_id: stored_pdos(one) for node_id, one in self.devices.items()}

    def downloads(self) -> dict[int, int]:
        """SDO downloads that each node has seen, where a fault counts them."""
        found = {}
        for node in self.bus.nodes:
            if node._faulty is not None:
                found[node.device.node_id] = node._faulty.downloads
        return found

    def wait(self, seconds: float) -> None:
        """Let virtual time pass, with nobody attached."""
        self.bus._closed = False
        self.bus.sleep(seconds)

    def fitting(self) -> set[tuple[int, int, int, Layouts]]:
        """Of each enabled TPDO that an enabled RPDO of another node hears, the layouts of both, as they are now."""
        return fitting(list(self.devices.values()))

    def journals(self) -> list[Path]:
        return sorted((self.folder / "journals").glob("*.json"))
