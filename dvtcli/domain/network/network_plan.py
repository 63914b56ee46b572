"""What is to be written to the nodes of a network, as one value: shown, saved, compared, carried out and undone.

Knows no file format, and reads no node.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from dvtcli.domain.file_complaint import FileComplaint
from dvtcli.domain.meanings import ScaledValue
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, Plan, Step, ValueChange, plan_pdo
from dvtcli.domain.rules.finding import Finding

Identity = dict[str, int | None]


@dataclass(frozen=True, slots=True)
class LeftOut:
    """An *object* (or a PDO) that a file says something of and that is not written, with *why*.

    *held* is what the node holds of it, *said* what the file says; None where that is not known. With *remains* it is a
    setting in which the two differ.
    """

    object: str
    why: str
    remains: bool = False
    held: bytes | None = None
    said: bytes | None = None


@dataclass(frozen=True, slots=True)
class Lacked:
    """A PDO (*pdo*), or a single *object* (`2999:01`), that a file sets and the device *node_id* has not: *finding*.

    *complaint* is where the file says it, None where no file does; *abort* the SDO abort code that the device gave.
    """

    node_id: int
    pdo: Pdo | None
    object: str
    finding: Finding
    complaint: FileComplaint | None = None
    abort: int | None = None

    @property
    def label(self) -> str:
        """What it is called."""
        return self.object if self.pdo is None else self.pdo.label


@dataclass(frozen=True, slots=True)
class NodePlan:
    """One node's part: *plan* goes from what was read of the device of this *identity* (0x1018) to what is wanted.

    *name* is the node's in the file, *line* where it stands (0: nowhere), *title* what the device calls itself.
    *wanted* and *values* are everything that the file says of PDOs and single objects, also what is so already;
    *pruned* are PDOs that go off since the file does not name them; *store* is what is stored once all nodes are
    verified, as `store` takes it, empty for nothing.
    """

    name: str
    plan: Plan
    identity: Identity
    title: str = ""
    line: int = 0
    store: str = ""
    wanted: dict[Pdo, PdoConfig] = field(default_factory=dict)
    values: dict[tuple[int, int], bytes] = field(default_factory=dict)
    pruned: frozenset[Pdo] = frozenset()
    findings: tuple[Finding, ...] = ()
    #: where the file says something of a PDO
    lines: dict[Pdo, int] = field(default_factory=dict)
    #: where it says what an object holds, by index and sub-index
    object_lines: dict[tuple[int, int], int] = field(default_factory=dict)
    #: names of objects, by their printed form
    names: dict[str, str] = field(default_factory=dict)
    #: what values of single objects mean, by their printed form
    understood: dict[str, ScaledValue] = field(default_factory=dict)
    #: what it holds as wanted and is known not to have stored
    unstored: tuple[str, ...] = ()
    #: False where its stamp (0x1020) was trusted instead: nothing else is known of it
    is_read: bool = True
    #: what the file says something of and that is not written
    left_out: tuple[LeftOut, ...] = ()
    #: how many settings it holds as the file says, that are not written for a file's sake
    also_equal: int = 0
    #: their values, by index and sub-index
    also_held: dict[tuple[int, int], bytes] = field(default_factory=dict)
    #: whether its power stage must be off before anything is written
    needs_power_off: bool = False
    #: what the file sets and the device has not: PDOs and objects, as labels
    lacks: tuple[str, ...] = ()
    #: what is to be asked first, beside whether to write at all
    doubt: str = ""
    #: boot-ups that had been heard of it before it was read; None where nobody counted
    boot_ups: int | None = None

    @property
    def node_id(self) -> int:
        """The node-ID."""
        return self.plan.node_id

    @property
    def is_asked_nothing(self) -> bool:
        """Whether the file names the node, and nothing that it should hold."""
        said = self.wanted or self.values or self.left_out or self.also_equal or self.lacks
        return self.is_read and not (said or len(self.plan))

    @property
    def stores(self) -> bool:
        """Whether it stores once all nodes are verified: where it should, and there is something to store."""
        return bool(self.store) and bool(len(self.plan) or self.unstored)

    @property
    def remaining(self) -> tuple[LeftOut, ...]:
        """Settings that differ from the file and are not written."""
        return tuple(left_out for left_out in self.left_out if left_out.remains)

    @property
    def holds(self) -> tuple[Change, ...]:
        """What the file says and is so already, each as a change to what it is."""
        held: list[Change] = [ValueChange(Step(*place, data, data, "write")) for place, data in self.values.items()]
        held += [plan_pdo(pdo, config, config) for pdo, config in self.wanted.items()]
        changed = {change.label for change in self.plan.changes}
        return tuple(change for change in held if change.label not in changed)

    @property
    def also_holds(self) -> tuple[Change, ...]:
        """The settings that it holds as the file says and that are not written, each as a change to what it is."""
        return tuple(ValueChange(Step(*place, data, data, "compare")) for place, data in self.also_held.items())

    @property
    def unchanged(self) -> int:
        """How many PDOs and single objects of the file are as wanted."""
        return len(self.holds)


@dataclass(frozen=True, slots=True)
class NetworkPlan:
    """Every node of a network, in order of node-ID; *file* is what says what is wanted."""

    file: str
    nodes: tuple[NodePlan, ...]
    #: whether the file says that a master sends SYNC
    has_sync_master: bool = False
    #: CAN-IDs of SYNC that was heard and that no node sends
    unknown_syncs: tuple[int, ...] = ()
    #: the node-ID of the manager that is to download it to the others, where it is planned for that one
    manager: int | None = None
    #: node-IDs of the file that this manager gets nothing for, since no EDS is known of them
    untold: tuple[int, ...] = ()
    #: what of the file devices have not: then it has what else differs, and cannot be carried out
    lacking: tuple[Lacked, ...] = ()
    #: PDOs that the file only links with such: what they should hold is not known
    torn: tuple[tuple[int, Pdo], ...] = ()

    @property
    def changed(self) -> bool:
        """Whether anything is to be written, stores aside."""
        return any(len(node.plan) for node in self.nodes)

    @property
    def to_do(self) -> bool:
        """Whether anything is to be written or stored."""
        return any(len(node.plan) or node.stores for node in self.nodes)

    @property
    def remains(self) -> int:
        """How many settings differ from the file and are not written."""
        return sum(len(node.remaining) for node in self.nodes)

    @property
    def unread(self) -> tuple[int, ...]:
        """Node-IDs of those that were not read, since their stamps were trusted."""
        return tuple(node.node_id for node in self.nodes if not node.is_read)

    @property
    def writes(self) -> int:
        """How many SDO downloads it takes."""
        return sum(len(node.plan) for node in self.nodes)
