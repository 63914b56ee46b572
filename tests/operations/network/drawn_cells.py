"""Networks of two to four nodes, a job, and two faults by lot: what the nodes hold judges what was said.

The judge does not use dvtcli's own comparisons: it looks into the simulated devices, and at the frames on the wire.
`python -m tests.operations.network.drawn_cells --cells 3000 --seed 7` prints the cells that went wrong, each with the
line that runs it again; `--only NUMBER -v` shows all that it said.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from dvtcli.simulator.network.station import SimulatedNode
from tests.cli.commands.bench import Bench
from tests.laws.bench import dictionary
from tests.operations.network.wire_record import WireRecord
from tests.surroundings import homes
from tests.virtual_time import VirtualTimeBus

FAMILIES = ("generic", "gen4", "tmcm", "roboteq", "lely", "canopennode", "espac")
#: a run that takes longer than this hangs (s of the computer's time)
_HANGS_S = 300
_IN_MEMORY = "/dev/shm" if Path("/dev/shm").is_dir() else None  # noqa: S108 - each cell has a folder of its own
Place = tuple[int, int, int]
Values = dict[Place, bytes]
#: objects beside the PDOs' that a job may set, or that a device or another master may change
_SETTINGS = ((0x1006, 0), (0x1016, 1), (0x1017, 0))

#: faults that happen once, at a download {k}
AT_DOWNLOAD = (
    *("refuse@{k}=0x08000022", "refuse@{k}=0x06090030", "lose-request@{k}", "lose-response@{k}", "late@{k}=0.3"),
    *("late@{k}=1.5", "duplicate@{k}", "foreign@{k}", "malformed@{k}", "toggle@{k}", "reset@{k}=0.05", "silent@{k}"),
    *("bus-error@{k}", "alters@{k}={alteration}", "alters@{k}={alteration}", "corrects@{k}=0.003", "corrects@{k}=0.2"),
)
AT_UPLOAD = ("refuse-read@{k}=0x08000000", *(["reset-after-read@{k}=0.05"] * 3), *(["reset-at-read@{k}=0.05"] * 2))
ALWAYS = (
    *("store-fails", "stores-nothing", "saves-itself", "keeps-ram", "restores-nothing", "ignores-nmt", "no-boot-up"),
    *("enable-alters={alteration}", "enable-alters={alteration}", "slow-store=3", "emcy=0x3210:0.1"),
)
#: at request {k} of ours on the wire another master writes, or resets the node
OTHER_MASTER = ("other-writes@{k}={alteration}", "other-writes@{k}={alteration}", "other-resets@{k}")


@dataclass(frozen=True)
class Drawn:
    """What a cell is about: its nodes with their families, its job, whether the nodes are OPERATIONAL."""

    nodes: dict[int, str]
    operational: bool
    options: dict[int, dict[str, Any]]
    job: str
    lot_of_faults: int


def wish_for(lot: random.Random, node_id: int, family: str) -> dict[str, Any]:
    """Keys of a network file for one node: of a PDO or two, some of them equal to what the node holds."""
    device = booted(node_id, family)
    config: dict[str, Any] = {}
    pdos = [pdo for pdo in map(Pdo.at, sorted(set(device.dictionary))) if pdo and pdo.number <= 2]
    for pdo in lot.sample(sorted(set(pdos), key=str), lot.choice((1, 1, 2))):
        keys: dict[str, Any] = {}
        cob_id = number(device, pdo.communication_index, 1)
        if lot.random() < 0.5:
            keys["transmission"] = lot.choice((1, 255, number(device, pdo.communication_index, 2)))
        if pdo.is_tpdo and held(device, pdo.communication_index, 5) is not None and lot.random() < 0.6:
            keys["event_timer"] = lot.choice((0, 40, 100, 500))
        if pdo.is_tpdo and held(device, pdo.communication_index, 3) is not None and lot.random() < 0.2:
            keys["inhibit_time"] = lot.choice((0, 10))
        entries = mapping(device, pdo)
        if entries and lot.random() < 0.5:
            chosen = entries[: lot.randint(1, len(entries))]
            lot.shuffle(chosen)
            keys["mapping"] = [f"{entry >> 16:04X}:{entry >> 8 & 0xFF:02X}/{entry & 0xFF}" for entry in chosen]
        if cob_id & 0x7FF and (entries or not cob_id >> 31):
            keys["enabled"] = lot.choice((not cob_id >> 31, True))
        if keys:
            config.setdefault("tpdo" if pdo.is_tpdo else "rpdo", {})[pdo.number] = keys
    return config


def draw(seed: str, job: str | None = None) -> Drawn:
    """The cell of *seed*, with *job* or one by lot."""
    lot = random.Random(seed)
    count = lot.choice((2, 2, 3, 4))
    node_ids = lot.sample(range(1, 100), count)
    families = [lot.choice(FAMILIES) for _ in node_ids]
    chosen = lot.choice(tuple(JOBS))
    job = job or chosen
    if job in ("clone", "link", "unlink", "link-store", "compare"):
        families = [lot.choice(("generic", "gen4", "tmcm"))] * count
    nodes = dict(zip(node_ids, families, strict=True))
    options = {node_id: wish_for(lot, node_id, family) for node_id, family in nodes.items()}
    return Drawn(nodes, lot.random() < 0.6, options, job, lot.randrange(1 << 30))


# -- the devices ------------------------------------------------------------------------------------------------------


def booted(node_id: int, family: str) -> StrictDevice:
    """A device in PRE-OPERATIONAL with a stored heartbeat, and one value in RAM that is not what is stored."""
    made = StrictDevice(dictionary(family), load_family(family), node_id)
    made.boot_up()
    made.set_value(0x1017, 0, (100).to_bytes(2, "little"))
    made._memory.save(0x1017, 0x1017)
    made.boot_up()
    made.take_outbox()
    with suppress(Refusal):
        made.download(0x1800, 5, (33).to_bytes(2, "little"))
    return made


def held(device: StrictDevice, index: int, sub_index: int) -> bytes | None:
    """What *device* holds; None where it has no such object."""
    try:
        return device.value(index, sub_index)
    except Refusal:
        return None


def number(device: StrictDevice, index: int, sub_index: int) -> int:
    return int.from_bytes(held(device, index, sub_index) or b"", "little")


def mapping(device: StrictDevice, pdo: Pdo) -> list[int]:
    """The entries of *pdo* up to its count."""
    count = number(device, pdo.mapping_index, 0)
    return [number(device, pdo.mapping_index, sub) for sub in range(1, count + 1)] if count <= 64 else []


def values(devices: Sequence[StrictDevice]) -> Values:
    """What all *devices* hold in RAM: every PDO, entries up to the count, and the settings that a job may set."""
    found: Values = {}
    for device in devices:
        for pdo in {pdo for pdo in map(Pdo.at, device.dictionary) if pdo is not None}:
            count = number(device, pdo.mapping_index, 0)
            places = [(pdo.communication_index, sub) for sub in (1, 2, 3, 5, 6)]
            places += [(pdo.mapping_index, sub) for sub in range((count if count <= 64 else 0) + 1)]
            found |= _of(device, places)
        found |= _of(device, _SETTINGS)
    return found


def _of(device: StrictDevice, places: Sequence[tuple[int, int]]) -> Values:
    data = {(device.node_id, *place): held(device, *place) for place in places}
    return {place: one for place, one in data.items() if one is not None}


def at_power_on(devices: Sequence[StrictDevice], places: Iterator[Place] | Sequence[Place]) -> Values:
    """What *devices* would hold at *places* after a power cycle: what is stored, else the default."""
    by_id = {device.node_id: device for device in devices}
    found: Values = {}
    for node_id, index, sub in places:
        memory = by_id[node_id]._memory
        stored = memory._stored.get((index, sub))
        found[node_id, index, sub] = stored if stored is not None else memory._initial(index, sub)
    return found


# -- the bus ----------------------------------------------------------------------------------------------------------


class DrawnBus(VirtualTimeBus):
    """A bus of others' nodes, on which another master may write or reset behind request K of ours."""

    def __init__(self, devices: Sequence[StrictDevice], words: Sequence[str]) -> None:
        self.requests = 0
        self._others: dict[int, tuple[int, str]] = {}
        faults = []
        for word in words:
            node, _, what = word.partition(":")
            if what.startswith("other-"):
                kind, _, value = what.partition("=")
                self._others[int(kind.partition("@")[2])] = (int(node), value)
            else:
                faults.append(Fault.parse(word))
        super().__init__(devices, faults=faults, simulated=False)
        self.record = WireRecord(self)

    def send_sdo(self, can_id: int, data: bytes) -> None:
        super().send_sdo(can_id, data)
        self.requests += 1
        if self.requests in self._others:
            node_id, alteration = self._others.pop(self.requests)
            other = next(node for node in self.nodes if node.device.node_id != node_id)
            self._spread(other, [_other_frame(self.nodes, node_id, alteration)])


def _other_frame(nodes: Sequence[SimulatedNode], node_id: int, alteration: str) -> Frame:
    """An NMT reset, or an expedited download of INDEX:SUB:VALUE, to *node_id*."""
    if not alteration:
        return Frame(0x000, bytes([NmtCommand.RESET_NODE, node_id]))
    index, sub, value = alteration.split(":")
    device = next(node.device for node in nodes if node.device.node_id == node_id)
    size = device.size_of(int(index, 16), int(sub, 16)) or 4
    head = bytes([0x23 | (4 - size) << 2]) + int(index, 16).to_bytes(2, "little") + bytes([int(sub, 16)])
    return Frame(0x600 + node_id, head + int(value, 0).to_bytes(4, "little"))


@dataclass
class World:
    """The devices of a cell, the bus, and a folder with the job's files."""

    drawn: Drawn
    folder: Path
    words: Sequence[str] = ()
    lines: list[tuple[int, list[dict[str, Any]], str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.devices = [booted(node_id, family) for node_id, family in self.drawn.nodes.items()]

    def start(self) -> None:
        """Put the nodes on a bus, OPERATIONAL if that was drawn."""
        self.bus = DrawnBus(self.devices, self.words)
        if self.drawn.operational:
            self.bus.send_nmt(NmtCommand.START, 0)
        self.bus.sleep(0.25)
        self.before, self.stored_before = values(self.devices), self.power_on()

    def device(self, node_id: int) -> StrictDevice:
        return next(one for one in self.devices if one.node_id == node_id)

    def power_on(self) -> Values:
        return at_power_on(self.devices, list(values(self.devices)))

    def run(self, *lines: str, devices: Sequence[StrictDevice] | None = None) -> int:
        """Run *lines* in one session, each as at the prompt until one fails; the last exit code."""
        bus = self.bus if devices is None else VirtualTimeBus(devices, simulated=False)
        options = {"yes": True, "format": "json", "journal": str(self.folder / "journal")}
        code = 0
        with Bench((), options, bus) as bench:
            network = bench.session.open_network()
            for node_id, family in self.drawn.nodes.items():
                network.files.own_eds[node_id] = family_eds(family)
                network.files.own_profile[node_id] = family if family != "lely" else "generic"
            for line in lines:
                ran = bench.run(line)
                code = ran.code
                documents = [json.loads(one) for one in (ran.stdout + ran.stderr).splitlines() if one[:1] == "{"]
                self.lines.append((code, documents, f"{line}: {ran.code}\n{ran.stdout}{ran.stderr}"))
                if code:
                    break
        return code

    # -- files

    def network_file(self, options: dict[int, dict[str, Any]], *, store: Sequence[int] = ()) -> Path:
        """A network file that says *options*."""
        nodes = {}
        for node_id, config in options.items():
            family = self.drawn.nodes[node_id]
            nodes[f"n{node_id}"] = {
                "node_id": node_id,
                "dcf": str(family_eds(family)),
                **({"store": True} if node_id in store else {}),
                **config,
            }
        path = self.folder / "net.yaml"
        path.write_text("nodes:\n" + "".join(f"  {name}: {_flow(said)}\n" for name, said in nodes.items()))
        return path

    def twins(self) -> list[StrictDevice]:
        """Devices as these, but with what the wishes say."""
        made = [booted(node_id, family) for node_id, family in self.drawn.nodes.items()]
        put_on(made, wanted_of(self.drawn.options, made))
        return made

    def backup(self, node_id: int, suffix: str) -> Path:
        """A backup, with what is wished, of node *node_id*."""
        path = self.folder / f"of{node_id}{suffix}"
        code = self.run(
            f"node {node_id}", f"backup {path}", devices=[one for one in self.twins() if one.node_id == node_id]
        )
        if code:
            raise NotPossible(self.lines[-1][2])
        self.lines.clear()
        return path


def _flow(said: Any) -> str:
    """*said* in YAML's flow style."""
    if isinstance(said, dict):
        return "{" + ", ".join(f"{key}: {_flow(one)}" for key, one in said.items()) + "}"
    return json.dumps(said)


class NotPossible(Exception):
    """A cell whose job cannot be done without a fault either."""


def wanted_of(options: dict[int, dict[str, Any]], devices: Sequence[StrictDevice]) -> Values:
    """What objects hold when *options* are fulfilled, from CiA 301: independent of the product's own tables."""
    by_id = {device.node_id: device for device in devices}
    found: Values = {}
    for node_id, config in options.items():
        device = by_id[node_id]
        for direction, communication in (("rpdo", 0x1400), ("tpdo", 0x1800)):
            for pdo_number, keys in config.get(direction, {}).items():
                at, maps = communication + pdo_number - 1, communication + 0x200 + pdo_number - 1
                cob_id = number(device, at, 1)
                if "enabled" in keys:
                    cob_id = cob_id & 0x7FFF_FFFF | (0 if keys["enabled"] else 0x8000_0000)
                    found[node_id, at, 1] = cob_id.to_bytes(4, "little")
                if "transmission" in keys:
                    found[node_id, at, 2] = bytes([keys["transmission"]])
                if "inhibit_time" in keys:
                    found[node_id, at, 3] = keys["inhibit_time"].to_bytes(2, "little")
                if "event_timer" in keys:
                    found[node_id, at, 5] = keys["event_timer"].to_bytes(2, "little")
                if "mapping" in keys:
                    found[node_id, maps, 0] = bytes([len(keys["mapping"])])
                    for sub, text in enumerate(keys["mapping"], 1):
                        index, rest = text.split(":")
                        sub_index, bits = rest.split("/")
                        entry = int(index, 16) << 16 | int(sub_index, 16) << 8 | int(bits)
                        found[node_id, maps, sub] = entry.to_bytes(4, "little")
    return found


def put_on(devices: Sequence[StrictDevice], wanted: Values) -> None:
    """Let *devices* hold *wanted*, as by their own application."""
    by_id = {device.node_id: device for device in devices}
    for (node_id, index, sub), data in wanted.items():
        by_id[node_id].set_value(index, sub, data)


# -- jobs -------------------------------------------------------------------------------------------------------------


@dataclass
class Job:
    """Lines to run; what they want; nodes that are to store, and whether that is proved."""

    lines: list[str]
    wanted: Values | None = None  # None: what the run without a fault leaves, of the nodes named
    stores: Sequence[int] = ()
    proves: bool = False
    #: reads only, and ends with 0 when all is as wanted
    compares: bool = False
    #: whether its error speaks for the whole job (one command, or an atomic script)
    whole: bool = True
    #: whether its last line claims all that is wanted
    law: bool = True
    #: whether what is wanted is what the nodes held before
    takes_back: bool = False


def _apply(world: World) -> Job:
    return Job([f"apply {world.network_file(world.drawn.options)}"], wanted_of(world.drawn.options, world.devices))


def _apply_store(world: World, *, proves: bool = False) -> Job:
    stores = [node_id for node_id in world.drawn.nodes if world.drawn.nodes[node_id] != "roboteq"]
    file = world.network_file(world.drawn.options, store=stores)
    line = f"apply {file}" + (" --prove" if proves else "")
    return Job([line], wanted_of(world.drawn.options, world.devices), stores, proves)


def _apply_prove(world: World) -> Job:
    return _apply_store(world, proves=True)


def _device_file(suffix: str) -> Callable[[World], Job]:
    def job(world: World) -> Job:
        node_id = next(iter(world.drawn.nodes))
        file = world.backup(node_id, suffix)
        return Job(
            [f"node {node_id}", f"apply {file}"], wanted_of({node_id: world.drawn.options[node_id]}, world.devices)
        )

    return job


def _clone(world: World) -> Job:
    first, second = list(world.drawn.nodes)[:2]
    return Job([f"node {second}", f"clone {world.backup(first, '.dcf')}"])


def _compare(world: World) -> Job:
    first = next(iter(world.drawn.nodes))
    file = world.backup(first, ".jsonl")
    wanted = wanted_of({first: world.drawn.options[first]}, world.devices)
    put_on(world.devices, wanted)
    return Job([f"node {first}", f"compare {file}"], wanted, compares=True)


def _comparing(line: str) -> Callable[[World], Job]:
    def job(world: World) -> Job:
        file = world.network_file(world.drawn.options)
        wanted = wanted_of(world.drawn.options, world.devices)
        put_on(world.devices, wanted)
        return Job([line.format(file)], wanted, compares=True)

    return job


def _link(world: World, *, stores: bool = False) -> Job:
    first, second, *_ = world.drawn.nodes
    lines = [f"link {first}:tpdo1 {second}:rpdo1"]
    if stores:
        return Job(
            [*lines, f"node {first}", "store", f"node {second}", "store"],
            stores=(first, second),
            whole=False,
            law=False,
        )
    return Job(lines)


def _link_store(world: World) -> Job:
    return _link(world, stores=True)


def _unlink(world: World) -> Job:
    first, second, *_ = world.drawn.nodes
    by_id = {device.node_id: device for device in world.devices}
    by_id[second].set_value(0x1400, 1, held(by_id[first], 0x1800, 1) or b"")
    return Job([f"unlink {first}:tpdo1 {second}:rpdo1"])


def _set_lines(world: World) -> tuple[list[str], Values]:
    lines: list[str] = []
    wanted: Values = {}
    for node_id, config in world.drawn.options.items():
        for direction in ("rpdo", "tpdo"):
            for pdo_number, keys in config.get(direction, {}).items():
                words = []
                if "transmission" in keys:
                    words.append(f"--type {keys['transmission']}")
                if "event_timer" in keys:
                    words.append(f"--timer {keys['event_timer']}")
                if words:
                    lines.append(f"set {node_id}:{direction}{pdo_number} {' '.join(words)}")
                    taken = {key: keys[key] for key in ("transmission", "event_timer") if key in keys}
                    wanted |= wanted_of({node_id: {direction: {pdo_number: taken}}}, world.devices)
    if not lines:
        raise NotPossible
    return lines, wanted


def _script(*, atomic: bool, last: str = "verify") -> Callable[[World], Job]:
    def job(world: World) -> Job:
        lines, wanted = _set_lines(world)
        script = world.folder / "job.dvt"
        script.write_text("\n".join([*lines, *([last] if last else [])]) + "\n")
        return Job([f"run {script}" + (" --atomic" if atomic else "")], wanted, whole=atomic)

    return job


def _undo(world: World) -> Job:
    lines, wanted = _set_lines(world)
    before = values(world.devices)
    return Job([*lines, "undo --all"], {place: before[place] for place in wanted}, whole=False, takes_back=True)


def _undo_network(world: World) -> Job:
    wanted = wanted_of(world.drawn.options, world.devices)
    before = values(world.devices)
    wanted = {place: before[place] for place in wanted if place in before}
    lines = [f"apply {world.network_file(world.drawn.options)}", "undo --all"]
    return Job(lines, wanted, whole=False, takes_back=True)


def _store(*, proves: bool) -> Callable[[World], Job]:
    def job(world: World) -> Job:
        lines, wanted = _set_lines(world)
        node_ids = sorted({place[0] for place in wanted})
        store = "store --prove" if proves else "store"
        stores = [line for node_id in node_ids for line in (f"node {node_id}", store)]
        return Job([*lines, *stores], wanted, node_ids, proves, whole=False, law=False)

    return job


def _set(world: World) -> Job:
    node_id = next(iter(world.drawn.nodes))
    lines, wanted = _set_lines(world)
    mine = {place: data for place, data in wanted.items() if place[0] == node_id}
    if not mine or sum(f"set {node_id}:" in line for line in lines) != 1:
        raise NotPossible
    return Job([next(line for line in lines if f"set {node_id}:" in line)], mine)


def _line(text: str, wanted: Callable[[StrictDevice], dict[tuple[int, int], bytes]]) -> Callable[[World], Job]:
    """One line about the first node, and what its TPDO1 or an object of it holds afterwards."""

    def job(world: World) -> Job:
        device = world.devices[0]
        made = {(device.node_id, *place): data for place, data in wanted(device).items()}
        return Job([f"node {device.node_id}", text], made)

    return job


def _switched(device: StrictDevice, *, on: bool) -> dict[tuple[int, int], bytes]:
    cob_id = number(device, 0x1800, 1) & 0x7FFF_FFFF | (0 if on else 0x8000_0000)
    return {(0x1800, 1): cob_id.to_bytes(4, "little")}


def _turned(world: World) -> Job:
    """`map` of what TPDO1 maps, the other way round."""
    device = world.devices[0]
    pdo = Pdo.at(0x1800)
    entries = list(reversed(mapping(device, pdo))) if pdo else []
    words = " ".join(f"{entry >> 16:04X}:{entry >> 8 & 0xFF:X}/{entry & 0xFF}" for entry in entries)
    wanted = {
        (device.node_id, 0x1A00, sub): data.to_bytes(1 if not sub else 4, "little")
        for sub, data in enumerate([len(entries), *entries])
    }
    return Job([f"map {device.node_id}:tpdo1 {words}"], wanted)


def _restore(world: World) -> Job:
    device = world.devices[0]
    places = [place for place in values([device]) if place[1] >= 0x1400]
    defaults = {place: device._memory._initial(*place[1:]) for place in places}
    return Job([f"node {device.node_id}", "restore --prove"], defaults, law=False)


JOBS: dict[str, Callable[[World], Job]] = {
    "set": _set,
    "map": _turned,
    "enable": _line("enable tpdo1", lambda device: _switched(device, on=True)),
    "disable": _line("disable tpdo1", lambda device: _switched(device, on=False)),
    "clear": _line("clear tpdo1", lambda device: {**_switched(device, on=False), (0x1A00, 0): b"\0"}),
    "write": _line("write 1017 200", lambda _device: {(0x1017, 0): (200).to_bytes(2, "little")}),
    "restore-prove": _restore,
    "apply": _apply,
    "apply-store": _apply_store,
    "apply-prove": _apply_prove,
    "apply-dcf": _device_file(".dcf"),
    "apply-xdc": _device_file(".xdc"),
    "apply-backup": _device_file(".jsonl"),
    "clone": _clone,
    "compare": _compare,
    "verify": _comparing("verify {}"),
    "diff": _comparing("diff {}"),
    "plan": _comparing("plan {} --exit-code"),
    "link": _link,
    "link-store": _link_store,
    "unlink": _unlink,
    "script": _script(atomic=False),
    "atomic": _script(atomic=True),
    "undo": _undo,
    "undo-network": _undo_network,
    "store": _store(proves=False),
    "store-prove": _store(proves=True),
}


# -- a cell -----------------------------------------------------------------------------------------------------------


@dataclass
class Ran:
    """A world in which a job has run."""

    world: World
    job: Job
    code: int
    after: Values
    #: what went through the boundary: a crash or a hang
    broke: str = ""


class Hang(BaseException):
    """A run that does not end."""


@contextmanager
def _watched() -> Iterator[None]:
    """Raise Hang in what takes too long, on systems with an alarm."""

    def hang(*_: object) -> None:
        raise Hang

    previous = signal.signal(signal.SIGALRM, hang)
    signal.alarm(_HANGS_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, previous)


def carried_out(drawn: Drawn, folder: Path, words: Sequence[str]) -> Ran:
    """*drawn* with the faults *words*, with a home of its own in *folder*."""
    folder.mkdir(parents=True)
    for name, home in homes(folder / "home").items():
        os.environ[name] = home
    (folder / "home").mkdir()
    world = World(drawn, folder, words)
    job = JOBS[drawn.job](world)
    world.start()
    code, broke = -1, ""
    try:
        with _watched():
            code = world.run(*job.lines)
    except Hang:
        broke = "it hangs: " + traceback.format_exc()
    except Exception:  # noqa: BLE001 - it is what the cell is about
        broke = traceback.format_exc()
    return Ran(world, job, code, values(world.devices), broke)


def faults_of(drawn: Drawn, ideal: Ran) -> list[str]:
    """Two faults by lot, at places that the run without a fault has, or a little behind."""
    lot = random.Random(drawn.lot_of_faults)
    downloads, uploads, requests = ideal.world.bus.record.counts()
    found: list[str] = []
    while len(found) < 2:
        node_id = lot.choice(list(drawn.nodes))
        kinds = lot.choice((AT_DOWNLOAD, AT_DOWNLOAD, AT_UPLOAD, ALWAYS, OTHER_MASTER))
        if kinds is AT_DOWNLOAD:
            at = lot.randint(1, 2 * downloads.get(node_id, 0) + 2)
        elif kinds is AT_UPLOAD:
            at = lot.randint(1, uploads.get(node_id, 0) + 3)
        else:
            at = lot.randint(1, max(1, requests))
        device = next(one for one in ideal.world.devices if one.node_id == node_id)
        places = [(0x1800, 5), (0x1801, 5), (0x1800, 2), (0x1801, 2), (0x1401, 2), (0x1400, 2), (0x1017, 0)]
        index, sub = lot.choice([place for place in places if held(device, *place) is not None])
        value = lot.choice((1, 2, 250, 254, 255) if sub == 2 else (0, 60, 250))
        word = lot.choice(kinds).format(k=at, alteration=f"{index:04X}:{sub}:{value}")
        keys = {_key(one) for one in found}
        if _key(f"{node_id}:{word}") not in keys:
            found.append(f"{node_id}:{word}")
    return found


def _key(word: str) -> str:
    """What two faults may not have in common: the node and the download or upload."""
    node, _, what = word.partition(":")
    kind, _, _ = what.partition("=")
    name, _, at = kind.partition("@")
    if name.startswith("other-"):
        return f"other@{at}"
    return f"{node}:{'read' if 'read' in name else 'write'}@{at}" if at else f"{node}:{name}"


def verdicts(ran: Ran, ideal: Ran) -> list[str]:
    """What is claimed and not so."""
    return Judge(ran, ideal).wrong()


class Judge:
    """Looks at the devices and the wire after a cell has run."""

    def __init__(self, ran: Ran, ideal: Ran) -> None:
        self.ran, self.job, self.world = ran, ran.job, ran.world
        self.record = ran.world.bus.record
        self.wanted: Values = self.job.wanted if self.job.wanted is not None else self._changed(ideal)
        if self.job.takes_back:
            self.wanted = {place: self._before(place) or data for place, data in self.wanted.items()}

    def _before(self, place: Place) -> bytes | None:
        """What *place* held when we wrote it first, as it was read: others may have changed it before that."""
        otherwise = self.record.restarted(place[0]) or self.record.others_wrote(place)
        return (self.record.replaced(place) if otherwise else None) or self.world.before.get(place)

    @staticmethod
    def _changed(ideal: Ran) -> Values:
        return {place: data for place, data in ideal.after.items() if ideal.world.before.get(place) != data}

    @property
    def documents(self) -> list[dict[str, Any]]:
        return [document for _, documents, _ in self.world.lines for document in documents]

    @property
    def error(self) -> dict[str, Any]:
        errors = [one for one in self.documents if str(one.get("schema", "")).startswith("dvtcli.error")]
        return errors[-1] if errors else {}

    @property
    def _is_unproved(self) -> bool:
        """Whether all was done and stored, and the answer says of a node that this is not proved."""
        last = self.documents[-1] if self.documents and not self.error else {}
        stored = last.get("stored")
        return isinstance(stored, list) and any(one.get("proved") is False for one in stored)

    def wrong(self) -> list[str]:
        """What is wrong, each in a sentence."""
        code = self.ran.code
        if self.ran.broke:
            return [self.ran.broke]
        if code in (2, 4, 70) and not (code == 2 and self.world.drawn.job == "unlink"):
            return [f"exit code {code}: {self.error.get('text')}"]
        found = []
        if code == 0:
            found += self._done()
        elif self.job.whole and not self.job.compares and not self._is_unproved:
            found += self._failed(code)
        if code not in (0, 3, 7) and self.job.whole and not self._is_unproved:
            found += self._stored_nevertheless()
        return found

    def _done(self) -> list[str]:
        """What exit code 0 claims: all that is wanted is held, and stored where that is said."""
        if any(one.get("verified") is False for one in self.documents[-1:]):
            return []
        found = []
        for place, data in sorted(self.wanted.items()):
            if self.ran.after.get(place) != data and not self.record.looked(place, data):
                found.append(
                    f"exit code 0, but {_at(place)} is {_hex(self.ran.after.get(place))}, expected {_hex(data)}"
                )
            elif self.job.law and self._is_claimed(place) and not self.record.looked(place, None):
                found.append(f"law: nothing read {_at(place)} behind {self.record.last_change(place[0])}")
        found += self._stores()
        return found

    def _is_claimed(self, place: Place) -> bool:
        """Whether the answer speaks of *place*: taken back is what was changed, on the nodes that are named."""
        last = self.documents[-1] if self.documents else {}
        if not self.job.takes_back:
            return True
        node_id, index, _ = place
        pdo = Pdo.at(index)
        own = {
            one.place for one in self.record.events if one.kind == "download" and one.ours and one.node_id == node_id
        }
        is_changed = any(place[1:] == one or (pdo is not None and Pdo.at(one[0]) == pdo) for one in own)
        return is_changed and node_id in {last.get("node"), *(one["node"] for one in last.get("nodes", ()))}

    def _stores(self) -> list[str]:
        """Nodes that were said to store, and hold other values after a power cycle."""
        if not self.job.stores:
            return []
        lies = any("stores-nothing" in word or "keeps-ram" in word for word in self.world.words)
        said = {
            one["node"]: one
            for document in self.documents
            for one in ([document] if document.get("action") == "store" else document.get("stored", None) or [])
            if isinstance(one, dict)
        }
        now = at_power_on(self.world.devices, list(self.wanted))
        found = []
        for (node_id, index, sub), data in sorted(self.wanted.items()):
            answer = said.get(node_id)
            if answer is None or answer.get("stored") is False:
                continue
            lies = lies or not self.world.device(node_id).family.store_lasts
            if lies and answer.get("proved") is not True:  # it was acknowledged, and nobody asked for a proof
                continue
            if now[node_id, index, sub] != data and self.ran.after.get((node_id, index, sub)) == data:
                what = "proved" if answer.get("proved") is True else "stored"
                found.append(f"{what}, but {_at((node_id, index, sub))} comes up as {_hex(now[node_id, index, sub])}")
        return found

    def _failed(self, code: int) -> list[str]:
        """What `unchanged` and `rolled back` claim: all nodes hold what they held."""
        state = self.error.get("state")
        if code in (3, 7) or state not in ("unchanged", "rolled_back", "as_before"):
            written = {place[0] for place in self._differing()} & set(self.record.written())
            written -= {
                one["node"] for one in self.documents if one.get("proved") is False
            }  # its answer says what is so
            read_back = {
                each["node"]
                for one in self.documents
                if one.get("schema") == "dvtcli.apply/1" and one.get("verified") is True
                for each in one["nodes"]
            }  # the answer says that they hold what is wanted, and the error is about the proof of a store
            found = [
                f"exit code {code}, verified, but {_at(place)} is {_hex(self.ran.after.get(place))}, not {_hex(data)}"
                for place, data in sorted(self.wanted.items())
                if place[0] in read_back and self.ran.after.get(place) != data and not self.record.looked(place, data)
            ]
            if code in (1, 6) and (written := written - read_back):
                found.append(f"exit code {code}, state {state}, but written: {sorted(written)}")
            return found
        return [
            f"exit code {code} {state}, but {_at(place)} is {_hex(self.ran.after.get(place))}, "
            f"before {_hex(self.world.before.get(place))}{' (written by us)' if self.record.wrote(place) else ''}"
            for place in self._differing()
        ]

    def _differing(self) -> list[Place]:
        """Where a node holds something else than before, that could be known."""
        found, written = [], set(self.record.written())
        for place in sorted(set(self.world.before) | set(self.ran.after)):
            if place[0] not in written:  # what changed there is another's
                continue
            before, after = self._before(place), self.ran.after.get(place)
            if after in (before, self.world.before.get(place)) or (
                before is not None and self.record.looked(place, before)
            ):
                continue
            if place[0] in self.record.dead(self.world.words):
                continue
            if not self.record.wrote(place) and (self._by_others(place, after) or place[1:] in _SETTINGS):
                continue
            found.append(place)
        return found

    def _by_others(self, place: Place, after: bytes | None) -> bool:
        """Whether it was not ours to put back: lost by a restart, or written by another master."""
        boot_snapshot = at_power_on(self.world.devices, [place]).get(place)
        restarted = any("reset" in word or "boot" in word for word in self.world.words)
        text = f"{place[1]:04X}:{place[2]}:"
        others = any("other-writes" in word and text in word for word in self.world.words)
        return others or (restarted and after == boot_snapshot)

    def _stored_nevertheless(self) -> list[str]:
        if any("saves-itself" in word for word in self.world.words):
            return []
        now = self.world.power_on()
        changed = {
            place[0]
            for place, data in now.items()
            if place[1:] not in _SETTINGS and self.world.stored_before.get(place, data) != data
        }
        return [f"exit code {self.ran.code}, but stored by {sorted(changed)}"] if changed else []


def _at(place: Place) -> str:
    return f"{place[0]}:{place[1]:04X}:{place[2]:02X}"


def _hex(data: bytes | None) -> str:
    return "-" if data is None else data[::-1].hex()


@dataclass
class Outcome:
    """A cell with its faults and what was wrong; *possible* is False where the job cannot be done without faults."""

    drawn: Drawn
    words: list[str]
    wrong: list[str]
    possible: bool = True
    said: str = ""


def outcome(seed: str, folder: Path, words: Sequence[str] | None = None, job: str | None = None) -> Outcome:
    """Draw the cell of *seed* and run it, first without a fault; *words* and *job* are instead of those drawn."""
    drawn = draw(seed, job)
    try:
        ideal = carried_out(drawn, folder / "ideal", [])
    except NotPossible as why:
        return Outcome(drawn, [], [], possible=False, said=str(why))
    said = "".join(text for _, _, text in ideal.world.lines)
    if ideal.broke or ideal.code == 70:
        return Outcome(drawn, [], [f"without a fault: {ideal.broke or said}"], said=said)
    if ideal.code:
        return Outcome(drawn, [], [], possible=False, said=said)
    good = [f"without a fault: {one}" for one in verdicts(ideal, ideal)]
    words = list(faults_of(drawn, ideal) if words is None else words)
    try:
        ran = carried_out(drawn, folder / "faulty", words)
    except ValueError as why:  # the faults cannot be put together
        return Outcome(drawn, words, good, possible=bool(good), said=str(why))
    found = verdicts(ran, ideal)
    return Outcome(drawn, words, good + found, said="".join(text for _, _, text in ran.world.lines))


@contextmanager
def own_folder() -> Iterator[Path]:
    """A folder in memory, and the environment as it was afterwards."""
    kept = dict(os.environ)
    folder = Path(tempfile.mkdtemp(dir=_IN_MEMORY, prefix="cells"))
    try:
        yield folder
    finally:
        os.environ.clear()
        os.environ.update(kept)
        shutil.rmtree(folder, ignore_errors=True)


def main(words: Sequence[str] | None = None) -> int:
    """Run cells, print those that went wrong; exit code 1 where there are any."""
    parser = argparse.ArgumentParser(prog="python -m tests.operations.network.drawn_cells", description=__doc__)
    parser.add_argument("--cells", type=int, default=100)
    parser.add_argument("--seed", default="1")
    parser.add_argument("--first", type=int, default=0, help="number of the first cell")
    parser.add_argument("--only", type=int, help="this cell alone")
    parser.add_argument("--job", choices=sorted(JOBS), help="instead of the job drawn")
    parser.add_argument("--fault", action="append", help="instead of the faults drawn, NODE:FAULT")
    parser.add_argument("--no-law", action="store_true", help="do not tell what was not read though it is right")
    parser.add_argument("-v", "--verbose", action="store_true", help="with what was said")
    given = parser.parse_args(words)
    numbers = range(given.first, given.first + given.cells) if given.only is None else [given.only]
    wrong = possible = 0
    jobs: dict[str, int] = {}
    for number in numbers:
        seed = f"{given.seed}-{number}"
        with own_folder() as folder:
            found = outcome(seed, folder, given.fault, given.job)
        if given.no_law:
            found.wrong = [one for one in found.wrong if "law: " not in one]
        possible += found.possible
        jobs[found.drawn.job] = jobs.get(found.drawn.job, 0) + found.possible
        if given.verbose:
            print(found.drawn, found.words, found.said, sep="\n")
        if found.wrong:
            wrong += 1
            nodes = " ".join(f"{family}@{node_id}" for node_id, family in found.drawn.nodes.items())
            state = "OPERATIONAL" if found.drawn.operational else "PRE-OPERATIONAL"
            job = f" --job {given.job}" if given.job else ""
            print(
                f"--seed {given.seed} --only {number}{job}: {found.drawn.job} on {nodes}, {state}, faults {found.words}"
            )
            for one in found.wrong[:4]:
                print(f"    {one}")
            sys.stdout.flush()
    print(f"{possible} cells, {wrong} wrong; {jobs}")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
