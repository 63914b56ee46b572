"""The fault matrix: a session of real commands on a strict device in virtual time, one fault, and what is left.

A cell is a family, a sequence of lines, the state the device starts in, a step and a fault. What the device holds is
read from the device itself, never through the tool.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from dvtcli.cli.boundary import exit_code_of
from dvtcli.cli.conversation import Conversation
from dvtcli.cli.lexer import split
from dvtcli.cli.main import install
from dvtcli.cli.run_line import run_words
from dvtcli.cli.scripts.script import run_script
from dvtcli.cli.view.output import Output
from dvtcli.device.change.change_guard import ChangeGuard
from dvtcli.device.change.plan_document import Identity
from dvtcli.device.node import Node
from dvtcli.device.read_pdos import present_pdos, read_identity, read_pdo
from dvtcli.domain.hint import Hint
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.ports import Frame
from dvtcli.errors import DvtcliError
from dvtcli.operations.session.device_files import DeviceFiles
from dvtcli.operations.session.open_network import Network
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.faults.recovering import recover
from tests.faults.sequences import AT_READ, FAMILIES, FAULTS, LASTING, MASTERS, SEQUENCES, STARTS, UNHEARD, Start
from tests.laws.bench import NODE, DirectSdo, booted, dictionary, profile
from tests.virtual_time import VirtualTimeBus

install()
#: outcomes of a cell that are as they should be
OLD, NEW, RECOVERED = "old", "new", "7, recovered"
#: the node restarted between two changes, and the user was told what is lost
TOLD = "1, restarted"
#: the node restarted after its last answer, which nobody can have seen
UNNOTICED = "restarted afterwards"
#: counts downloads, and else changes nothing
_NO_FAULT = Fault.parse("slow-store=0")
_HEARTBEAT_MS = 100
#: journals are synced to the disk, which nobody would notice here
_IN_MEMORY = "/dev/shm" if Path("/dev/shm").is_dir() else None  # noqa: S108 - each cell has a folder of its own
Snapshot = dict[Pdo, tuple[bytes | None, ...]]


@dataclass(frozen=True)
class Cell:
    """One place of the matrix; its text is what `fault_matrix.py --only` takes."""

    family: str
    sequence: str
    start: Start
    step: int
    fault: str

    def __str__(self) -> str:
        return f"{self.family}/{self.sequence}/{self.start}/{self.step}/{self.fault}"

    @classmethod
    def parse(cls, text: str) -> Cell:
        family, sequence, start, step, fault = text.split("/")
        return cls(family, sequence, Start.named(start), int(step), fault)

    @property
    def faults(self) -> list[Fault]:
        numbers = {"k": self.step, "k1": self.step + 1, "k2": self.step + 2}
        return [Fault.parse(text.format(**numbers)) for text in FAULTS[self.fault]]


class Record(Output):
    """An output that keeps errors, and how many lines succeeded, instead of printing anything."""

    def __init__(self) -> None:
        super().__init__()
        self.errors: list[DvtcliError] = []
        self.warnings: list[str] = []
        self.lines_done = 0

    def result(self, result: object) -> None:
        self.lines_done += 1

    def error(self, error: DvtcliError, at: str | None = None, *, readable: bool = True) -> None:
        self.errors.append(error)

    def warning(self, text: Hint | str) -> None:
        self.warnings.append(str(text))

    def lines(self, lines: object) -> None:
        """Messages are not looked at."""


@dataclass
class Run:
    """A device with the bus that it is reached by."""

    family: str
    device: StrictDevice
    bus: VirtualTimeBus
    folder: Path
    #: what the node sent since it started over, after a fault: whether somebody could have noticed
    said: list[Frame] = field(default_factory=list)
    #: the uploads since the last download, and the most of them so far
    reads: int = 0
    most_reads: int = 0

    @classmethod
    def of(cls, family: str, start: Start, faults: list[Fault], folder: Path) -> Run:
        master, family = family in MASTERS, family.removesuffix("-master")
        device = booted(family)
        _prepare(device, start, master=master)
        run = cls(family, device, VirtualTimeBus([device], faults=faults), folder)
        run.bus.tap(run._hear)
        if start.operational and not master:
            run.bus.send_nmt(NmtCommand.START, NODE)
        run.bus.sleep(2 * _HEARTBEAT_MS / 1000)
        return run

    def _hear(self, frame: Frame, sent: bool) -> None:
        if sent and frame.can_id == 0x600 + NODE and frame.data[0] >> 5 == 1:
            self.reads = 0
        elif sent and frame.can_id == 0x600 + NODE and frame.data[0] >> 5 == 2:
            self.reads += 1
            self.most_reads = max(self.most_reads, self.reads)
        elif not sent:
            self.said.append(frame)

    def answered_after_its_restart(self) -> bool:
        """Whether the node answered an SDO request in a later life than the one it was found in.

        One that is still starting up answered nothing since: with `restore` it had an earlier restart of its own.
        """
        if self.device.state is NmtState.INITIALISING:
            return False
        boots = [at for at, frame in enumerate(self.said) if frame == frame._replace(can_id=0x700 + NODE, data=b"\0")]
        return any(frame.can_id == 0x580 + NODE for frame in self.said[boots[-1] :]) if boots else False

    def node(self) -> Node:
        """The node as a session that has just started sees it."""
        node = Node(self.bus, NODE, dictionary(self.family), profile(self.family))
        node.guard = ChangeGuard(self.folder, self.folder / "locks", "matrix", NODE)
        if not node.guard._backing_up.folder.exists():  # reading every PDO first would take a third of the time
            node.guard._backing_up.make(*_identity_and_pdos(self.device), ())
        return node

    def session(self, lines: list[str]) -> tuple[int, Record]:
        """Run *lines* as a script file, or a single one as a command; the exit code and what was said."""
        record = Record()
        session = Conversation(record)
        session.start({"yes": True, "node": NODE})
        network = Network(self.bus, DeviceFiles(self.bus, session.options), session.cancellation, session.consent)
        node = network.nodes[NODE] = self.node()
        node.is_last_change = lambda: session.ends_with_line
        node.cancellation, node.consent, node.change_order = session.cancellation, session.consent, network.change_order
        session._network = network
        if len(lines) == 1:
            code = run_words(split(lines[0]), session)
            code = exit_code_of(session, lambda: session.end_line(code, alone=True)) or code
        else:
            code = run_script(session, "\n".join(lines).encode(), "cell", keep_going=False)
        assert node.guard is not None
        node.guard.lock.release()
        return code, record


def _identity_and_pdos(device: StrictDevice) -> tuple[Identity, dict[Pdo, PdoConfig]]:
    sdo = DirectSdo(device)
    names = ("vendor", "product", "revision", "serial")
    pdos = {pdo: read_pdo(sdo, pdo) for pdo in present_pdos(sdo, device.dictionary)}
    return {name: read_identity(sdo, sub_index) for sub_index, name in enumerate(names, 1)}, pdos


def _prepare(device: StrictDevice, start: Start, *, master: bool) -> None:
    """A stored heartbeat, so that the NMT state can be known; and PDOs in RAM that are not what is stored."""
    device.set_value(0x1017, 0, _HEARTBEAT_MS.to_bytes(2, "little"))
    device._memory.save(0x1017, 0x1017)
    if start.modified:
        device.download(0x1800, 5, (33).to_bytes(2, "little"))
        device.download(0x1801, 5, (77).to_bytes(2, "little"))
        device.download(0x1401, 2, b"\x01")
    if master:
        device.set_value(0x5800, 0, b"\x01")
        device._memory.save(0x5800, 0x5800)
    device.boot_up()
    device.take_outbox()
    if master and start.operational:
        device.download(0x2800, 0, b"\x00")


def snapshot(device: StrictDevice) -> Snapshot:
    """Communication sub-indices, count, and entries up to the count, of every PDO."""
    found: Snapshot = {}
    for pdo in (pdo for pdo in map(Pdo.at, device.dictionary) if pdo is not None):
        count = device.value(pdo.mapping_index, 0)[0]
        communication = tuple(_held(device, pdo.communication_index, sub) for sub in (1, 2, 3, 5, 6))
        mapping = tuple(_held(device, pdo.mapping_index, sub) for sub in range(count + 1))
        found[pdo] = communication + mapping
    return found


def stored_pdos(device: StrictDevice) -> dict[tuple[int, int], bytes]:
    """The PDO parameters in the device's non-volatile memory; devices store other objects of their own accord."""
    return {key: data for key, data in device._memory._stored.items() if Pdo.at(key[0]) is not None}


def _held(device: StrictDevice, index: int, sub_index: int) -> bytes | None:
    try:
        return device.value(index, sub_index)
    except Refusal:
        return None


@dataclass(frozen=True)
class Ideal:
    """A sequence without a fault: what the device holds before the first line and after each, and its downloads."""

    states: tuple[Snapshot, ...]
    stored: tuple[dict[tuple[int, int], bytes], ...]
    at_power_on: Snapshot
    downloads: int
    reads: int


@lru_cache(maxsize=256)
def ideal(family: str, sequence: str, start: Start) -> Ideal:
    """Run the sequence without a fault."""
    lines = SEQUENCES[family][sequence]
    states, stored, downloads, reads = [], [], 0, 0
    for done in range(len(lines) + 1):
        with tempfile.TemporaryDirectory() as folder:
            run = Run.of(family, start, [_NO_FAULT], Path(folder))
            if done:
                code, record = run.session(lines[:done])
                assert code == 0, (family, lines[:done], [str(error) for error in record.errors])
                assert run.device.state is _state(start)
        states.append(snapshot(run.device))
        stored.append(stored_pdos(run.device))
        faulty = run.bus.nodes[0]._faulty
        assert faulty is not None
        downloads, reads = faulty.downloads, run.most_reads
    run = Run.of(family, start, [], Path())
    run.device.restart()
    return Ideal(tuple(states), tuple(stored), snapshot(run.device), downloads, reads)


def _state(start: Start) -> NmtState:
    return NmtState.OPERATIONAL if start.operational else NmtState.PRE_OPERATIONAL


def groups(*, thorough: bool = False) -> list[tuple[str, str, Start]]:
    """Every family with every sequence, in one of the starts by turns; *thorough*: in every one."""
    found = []
    for family_number, family in enumerate(FAMILIES):
        for number, sequence in enumerate(SEQUENCES[family]):
            turn = (family_number + number) % len(STARTS)
            found += [(family, sequence, start) for start in (STARTS if thorough else STARTS[turn : turn + 1])]
    return found + [(master, sequence, STARTS[0]) for master in MASTERS for sequence in SEQUENCES[master]]


def cells_of(family: str, sequence: str, start: Start) -> Iterator[Cell]:
    """Every step of one sequence × every fault.

    A master has no resets: while its state is changed, before the first write or after the last, nobody could put back
    what a reset takes.
    """
    faults = [fault for fault in FAULTS if family not in MASTERS or "reset" not in fault]
    steps = ideal(family, sequence, start)
    for step in range(1, steps.downloads + 1):
        yield from (Cell(family, sequence, start, step, fault) for fault in faults if fault not in AT_READ)
    for step in range(1, steps.reads + 1):
        yield from (Cell(family, sequence, start, step, fault) for fault in faults if fault in AT_READ)


def outcome(cell: Cell) -> str:
    """What becomes of *cell*: `old`, `new`, `7, recovered`, or what is wrong."""
    lines = SEQUENCES[cell.family][cell.sequence]
    with tempfile.TemporaryDirectory(dir=_IN_MEMORY) as folder:
        run = Run.of(cell.family, cell.start, cell.faults, Path(folder))
        code, record = run.session(lines)
        return Judge(cell, run, record).verdict(code)


@dataclass
class Judge:
    """Looks at a device after a cell has run."""

    cell: Cell
    run: Run
    record: Record

    def __post_init__(self) -> None:
        self.ideal = ideal(self.cell.family, self.cell.sequence, self.cell.start)

    def verdict(self, code: int) -> str:
        """`old`, `new`, `7, recovered`, or what is wrong."""
        done = self.record.lines_done
        if code == 0:
            return self._held(done) or NEW if not self._restarted_at_last() else UNNOTICED
        error = self.record.errors[-1]
        if code in (2, 4, 70):
            return f"exit code {code}: {error}"
        if code == 7:
            return self._recovered(done)
        if error.slug == "restarted":
            return "something is stored" if self._stored_wrongly(0) and self._stored_wrongly(done) else TOLD
        wrong, all_done = self._held(done), done == len(self.ideal.states) - 1
        if wrong is None:
            return NEW if all_done else OLD
        if error.state == "unknown" and not all_done and self._held(done + 1) is None:
            return NEW
        return f"exit code {code}, {error.state}, but {wrong} ({error})"

    def _restarted_at_last(self) -> bool:
        """Whether the node restarted once everything was read: nobody asked it anything after that."""
        return (
            self.cell.fault in AT_READ
            and not self.run.answered_after_its_restart()
            and bool(self._held(len(self.ideal.states) - 1))
        )

    def _recovered(self, boundary: int) -> str:
        if self.cell.fault not in LASTING:
            return "exit code 7 though the node could be reached"
        if self._stored_wrongly(boundary):
            return "exit code 7, and something was stored"
        if self.cell.fault == "power-loss":
            self.run.device.restart()
            self.run.device.boot_up()
            self.run.device.take_outbox()
        self.run.bus = VirtualTimeBus([self.run.device])
        self.run.bus.sleep(2 * _HEARTBEAT_MS / 1000)
        fresh = self.run.node()
        assert fresh.guard is not None
        journal = fresh.guard.interrupted_journal()
        if journal is None:
            return "exit code 7 without a journal"
        try:
            recover(fresh, journal)
            fresh.gate.leave()
        except DvtcliError as failed:
            return f"recover failed: {failed}"
        finally:
            fresh.guard.lock.release()
        left = fresh.guard.interrupted_journal()
        self.record.errors.clear()
        return self._held(boundary) or ("the journal is left" if left else RECOVERED)

    def _held(self, boundary: int) -> str | None:
        """What is not as after line *boundary* (0: as found), the NMT state included; None where all is."""
        wanted, now = self.ideal.states[boundary], snapshot(self.run.device)
        for pdo, config in now.items():
            if config != wanted[pdo] and not (self._lost(pdo, boundary) and self._since_power_on(pdo, config, wanted)):
                return f"{pdo} is {_text(config)}, not {_text(wanted[pdo])}"
        if self._stored_wrongly(boundary):
            return "something else is stored"
        state = self.run.device.state
        if state is not _state(self.cell.start) and not self._told_to_be_pre_operational(state):
            return f"the node is {state.label}, not {_state(self.cell.start).label}"
        return None

    def _since_power_on(self, pdo: Pdo, config: tuple[bytes | None, ...], wanted: Snapshot) -> bool:
        """Whether *pdo* holds what it came up with; or, restarted unheard, that with what a line set after it."""
        up = self.ideal.at_power_on[pdo]
        if self.cell.fault != UNHEARD:
            return config == up
        parameters = all(held in pair for held, *pair in zip(config[:5], up[:5], wanted[pdo][:5], strict=True))
        return parameters and config[5:] in (up[5:], wanted[pdo][5:])

    def _told_to_be_pre_operational(self, state: NmtState) -> bool:
        """Whether the node stays PRE-OPERATIONAL, and its user was told.

        Allowed where a script failed, since what it sets up is then neither old nor new as a whole; and where nothing
        but the NMT state was changed yet of a node that cannot be reached any more.
        """
        told = any(label == "nmt" for error in self.record.errors for label, _ in error.details)
        words = ("was OPERATIONAL and is PRE-OPERATIONAL now", "was OPERATIONAL, but does not answer now")
        told = told or any(said in text for text in self.record.warnings for said in words)
        if self.cell.fault in AT_READ and self._only_read_then():
            return state is NmtState.PRE_OPERATIONAL
        allowed = len(self.ideal.states) > 2 or self.cell.fault in LASTING
        return told and allowed and state is NmtState.PRE_OPERATIONAL

    def _only_read_then(self) -> bool:
        """Whether the node restarted between two changes: nobody took its state or its RAM, and nothing is claimed."""
        failed = self.record.errors[-1] if self.record.errors else None
        told = any("restarted" in text for text in self.record.warnings)
        return told or (failed is not None and failed.state in ("unchanged", "unknown"))

    def _lost(self, pdo: Pdo, boundary: int) -> bool:
        """Whether a reset took what was in RAM only, of a PDO that the failing line did not touch."""
        if "reset" not in self.cell.fault and self.cell.fault != "power-loss":
            return False
        if self.cell.sequence == "restore":
            return True  # it is what the user agreed to
        if self.cell.fault in AT_READ and self._only_read_then():
            return True
        following = min(boundary + 1, len(self.ideal.states) - 1)
        return self.ideal.states[boundary][pdo] == self.ideal.states[following][pdo]

    def _stored_wrongly(self, boundary: int) -> bool:
        return stored_pdos(self.run.device) != self.ideal.stored[boundary]


def _text(config: tuple[bytes | None, ...]) -> str:
    return " ".join("-" if part is None else part[::-1].hex() for part in config)
