"""Pending writes to the nodes of a network as a value, to show, save, compare, apply and undo."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.domain.objects import VERIFY_CONFIGURATION
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, Plan, Step, ValueChange, disables, needs_rtr_first, plan_pdo
from dvtcli.domain.rules.finding import Finding
from dvtcli.domain.text import plural

if TYPE_CHECKING:
    from dvtcli.domain.network.network_config import MasterRole
    from dvtcli.domain.object_scalings import ScaledValue
    from dvtcli.domain.rules.finding import FileComplaint

Identity = dict[str, int | None]


@dataclass(frozen=True, slots=True)
class LeftOut:
    """An *object* (or a PDO) in a file that is not written, and the reason *why*.

    *held* is the node's value, *said* the file's; None if unknown. *remains*: a setting that differs.
    """

    object: str
    why: str
    remains: bool = False
    held: bytes | None = None
    said: bytes | None = None


@dataclass(frozen=True, slots=True)
class MissingObject:
    """A PDO (*pdo*) or an *object* (`2999:01`) in a file that device *node_id* lacks: *finding*.

    *complaint* is its place in the file, None without a file; *abort* the device's SDO abort code.
    """

    node_id: int
    pdo: Pdo | None
    object: str
    finding: Finding
    complaint: FileComplaint | None = None
    abort: int | None = None

    @property
    def label(self) -> str:
        """Name of the PDO or object."""
        return self.object if self.pdo is None else self.pdo.label


@dataclass(frozen=True, slots=True)
class NodePlan:
    """A node's part: *plan* leads to the intended values, for a device with this *identity* (0x1018).

    *name* is the node's name in the file, *line* its line (0: none), *title* the device's own name. *wanted* and
    *values* are all PDOs and single objects in the file, also equal ones; *pruned* are PDOs to disable since the file
    does not name them; *store* is the argument of `store` once all nodes are verified, empty for nothing.
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
    #: places of PDOs in the file
    lines: dict[Pdo, int] = field(default_factory=dict)
    #: places of object values in the file, by index and sub-index
    object_lines: dict[tuple[int, int], int] = field(default_factory=dict)
    #: names of objects, by their printed form
    names: dict[str, str] = field(default_factory=dict)
    #: scaling of single objects, by their printed form
    understood: dict[str, ScaledValue] = field(default_factory=dict)
    #: equal values known not to be stored
    unstored: tuple[str, ...] = ()
    #: False if its stamp (0x1020) was trusted instead: all else is unknown
    is_read: bool = True
    #: parts of the file that are not written
    left_out: tuple[LeftOut, ...] = ()
    #: number of settings equal to the file that are never written
    also_equal: int = 0
    #: their values, by index and sub-index
    compared_values: dict[tuple[int, int], bytes] = field(default_factory=dict)
    #: whether the power stage must be off before the first write
    needs_power_off: bool = False
    #: PDOs and objects in the file that the device lacks, as labels
    lacks: tuple[str, ...] = ()
    #: questions before writing, besides the confirmation itself
    doubt: str = ""
    #: boot-ups of the node before it was read; None if not counted
    boot_ups: int | None = None

    def __repr__(self) -> str:
        return f"<NodePlan {self.name or self.node_id}: {self.plan!r}>"

    @property
    def node_id(self) -> int:
        """The node-ID."""
        return self.plan.node_id

    @property
    def is_asked_nothing(self) -> bool:
        """Whether the file names the node without any configuration."""
        said = self.wanted or self.values or self.left_out or self.also_equal or self.lacks
        return self.is_read and not (said or len(self.plan))

    @property
    def stores(self) -> bool:
        """Whether the node stores after all nodes are verified: requested, and with something to store."""
        return bool(self.store) and bool(len(self.plan) or self.unstored)

    @property
    def differs(self) -> bool:
        """Whether the node is known to differ from the plan: write-only objects are not compared."""
        return len(self.plan.changes) > len(self.plan.unreadable) or bool(self.store and self.unstored)

    @property
    def remaining(self) -> tuple[LeftOut, ...]:
        """Settings that differ from the file and are not written."""
        return tuple(left_out for left_out in self.left_out if left_out.remains)

    @property
    def holds(self) -> tuple[Change, ...]:
        """Equal parts of the file, each as a change without effect."""
        held: list[Change] = [ValueChange(Step(*place, data, data, "write")) for place, data in self.values.items()]
        held += [plan_pdo(pdo, config, config) for pdo, config in self.wanted.items()]
        changed = {change.label for change in self.plan.changes}
        return tuple(change for change in held if change.label not in changed)

    @property
    def compared_claims(self) -> tuple[Change, ...]:
        """Equal settings that are never written, each as a change without effect."""
        return tuple(ValueChange(Step(*place, data, data, "compare")) for place, data in self.compared_values.items())

    @property
    def unchanged(self) -> int:
        """Number of PDOs and single objects equal to the file."""
        return len(self.holds)


@dataclass(frozen=True, slots=True)
class NetworkPlan:
    """All nodes of a network, in order of node-ID; *file* is the source of the configuration."""

    file: str
    nodes: tuple[NodePlan, ...]
    #: whether a master sends SYNC according to the file
    has_sync_master: bool = False
    #: CAN-IDs of received SYNC without a producer
    unknown_syncs: tuple[int, ...] = ()
    #: node-ID of the manager that is to download the configuration to the others, if planned so
    manager: int | None = None
    #: node-IDs in the file without download by the manager, as they have no known EDS
    untold: tuple[int, ...] = ()

    def __repr__(self) -> str:
        return f"<NetworkPlan {self.file}: {plural(len(self.nodes), 'node')}, {plural(self.writes, 'write')}>"

    #: parts of the file that devices lack: the plan then has only the other differences, and cannot be applied
    lacking: tuple[MissingObject, ...] = ()
    #: PDOs that the file only links with missing PDOs: their intended configuration is unknown
    unlinked: tuple[tuple[int, Pdo], ...] = ()
    #: the master that the network file describes; None if it describes none, and for a saved plan
    master: MasterRole | None = None

    @property
    def changed(self) -> bool:
        """Whether the plan has writes, apart from stores."""
        return any(len(node.plan) for node in self.nodes)

    @property
    def to_do(self) -> bool:
        """Whether the plan has writes or stores."""
        return any(len(node.plan) or node.stores for node in self.nodes)

    @property
    def differs(self) -> bool:
        """Whether any node is known to differ from the plan or to lack a store."""
        return any(node.differs for node in self.nodes)

    @property
    def remains(self) -> int:
        """Number of settings that differ from the file and are not written."""
        return sum(len(node.remaining) for node in self.nodes)

    @property
    def unread(self) -> tuple[int, ...]:
        """Node-IDs that were not read because their stamps were trusted."""
        return tuple(node.node_id for node in self.nodes if not node.is_read)

    @property
    def writes(self) -> int:
        """Number of SDO downloads."""
        return sum(len(node.plan) for node in self.nodes)


def phases(plans: Iterable[Plan]) -> tuple[tuple[Plan, ...], ...]:
    """Split *plans*, one per node, into five phases; each is complete on every node before the next phase begins.

    First every changing TPDO is disabled, then every RPDO; then everything is written; then RPDOs are enabled, and
    finally TPDOs. The writes are the same as in *plans*. Backwards, phase by phase, the order holds as well.

    A stamp is cleared before all other writes of its node, and the new stamp set last: a device may clear it meanwhile.
    """
    split = [(plan.node_id, [part for change in _ordered(plan) for part in _parts(change)]) for plan in plans]
    found = []
    for phase in range(5):
        parts = ((node_id, tuple(change for number, change in parts if number == phase)) for node_id, parts in split)
        found.append(tuple(Plan(node_id, changes) for node_id, changes in parts if changes))
    return tuple(found)


_FIRST, _WRITE, _LAST = 0, 2, 4


def _ordered(plan: Plan) -> Iterator[Change]:
    """The changes of *plan*: clear stamps first, set stamps last."""
    yield from (part for change in plan.changes for part in _stamps(change) if not any(part.step.after))
    yield from (change for change in plan.changes if not _is_stamp(change))
    yield from (part for change in plan.changes for part in _stamps(change) if any(part.step.after))


def _is_stamp(change: Change) -> bool:
    return isinstance(change, ValueChange) and change.step.index == VERIFY_CONFIGURATION


def _stamps(change: Change) -> tuple[ValueChange, ...]:
    return tuple(map(ValueChange, change.steps)) if _is_stamp(change) else ()


def _parts(change: Change) -> Iterator[tuple[int, Change]]:
    """The parts of *change* with writes, each with its phase number."""
    if isinstance(change, ValueChange):
        yield (_LAST if any(change.step.after) else _FIRST) if _is_stamp(change) else _WRITE, change
        return
    off, on = (0, 4) if change.pdo.is_tpdo else (1, 3)
    now, want = change.before, change.after
    held = now.disabled() if disables(now, want) else now
    first = want.communication.cob_id.disabled() if needs_rtr_first(now, want) else held.communication.cob_id
    written = want.with_parameters(cob_id=first)
    for number, before, after in ((off, now, held), (_WRITE, held, written), (on, written, want)):
        part = plan_pdo(change.pdo, before, after)
        if part.steps:
            yield number, part
