"""Probe a node under lock, journal and gate, and roll everything back whatever happens."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dvtcli.device.change.failed_change import left_open
from dvtcli.device.change.roll_back import roll_back_patiently
from dvtcli.device.learn.asking import Asking
from dvtcli.device.learn.saving import SignatureAnswers, ask_to_save
from dvtcli.device.stamped import NO_STAMP, held_stamp
from dvtcli.domain.learning.operational import not_while_operational, while_operational
from dvtcli.domain.learning.probe import Probe, ProbeAnswer, ProbeCondition, ProbedPdo
from dvtcli.domain.learning.probe_table import KnownAnswers, next_probes
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.pdo import Direction, Pdo, PdoConfig
from dvtcli.domain.plan import STAMP, Change, PdoChange, Plan, Step, ValueChange
from dvtcli.domain.stamp import DATE, TIME
from dvtcli.domain.text import join_some
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.stamp import Stamp


@dataclass(frozen=True, slots=True)
class Terms:
    """The user's consent: at most *limit* downloads; *isolated* asserts that no other node is on the bus.

    *saves* are the probes of 0x1010 at the end, empty if saving is not allowed.
    """

    limit: int
    isolated: bool = False
    saves: tuple[Probe, ...] = ()


@dataclass(frozen=True, slots=True)
class Asked:
    """The answers about each subject, the number of downloads, and the result of saving."""

    known: tuple[KnownAnswers, ...]
    writes: int
    saved: SignatureAnswers


def roll_back_writes(
    node_id: int, subjects: Sequence[ProbedPdo], pdos: Mapping[Pdo, PdoConfig], stamp: Stamp | None = None
) -> Plan:
    """The plan for the journal: each subject with the entries behind its count, and every other PDO of *pdos*.

    The others are not written, but a device may alter them as a side effect. An incomplete PDO cannot be restored. Last
    the *stamp* is restored, which a device clears after each change (CiA 301, 0x1020).
    """
    own = {subject.pdo for subject in subjects}
    changes: list[Change] = list(_stamp_back(stamp))
    changes += [
        PdoChange(pdo, held, held, ())
        for pdo, held in pdos.items()
        if pdo not in own and held.mpdo is None and not held.inconsistency
    ]
    for subject in subjects:
        changes.append(PdoChange(subject.pdo, subject.held, subject.held, ()))
        for number, word in list(enumerate(subject.entries, 1))[subject.held.count :]:
            data = word.to_bytes(4, "little")
            changes.append(ValueChange(Step(subject.pdo.mapping_index, number, data, data, "old value")))
    return Plan(node_id, tuple(changes))


def _stamp_back(stamp: Stamp | None) -> Iterator[ValueChange]:
    """Restore the stamp, valid again after the complete roll-back; 0 means none."""
    if stamp is None or stamp == NO_STAMP:
        return
    for sub_index in (DATE, TIME):
        data = stamp.data(sub_index)
        yield ValueChange(Step(STAMP, sub_index, data, data, "old value"))


def ask_safely(
    node: Node,
    subjects: Sequence[ProbedPdo],
    pdos: Mapping[Pdo, PdoConfig],
    initial_state: InitialState,
    terms: Terms,
    on_write: Callable[[], None] = lambda: None,
) -> Asked:
    """Probe one of *subjects* per direction, roll everything back, and verify that all *pdos* are as before.

    Takes the first subject of a direction whose mapping accepts its present values; some devices refuse an entry of 0.

    *initial_state* is the initial state of the node. After any failure all *pdos* are rolled back first; raises
    LeftChanged and keeps the journal if the roll-back fails.
    """
    plan = roll_back_writes(node.node_id, subjects, pdos, held_stamp(node))
    with node.cancellation.guard():
        if node.guard is not None:
            asked_about = tuple(subject.pdo.label for subject in subjects)
            node.guard.begin(plan, node.identity(), initial_state.state, node.known_pdos, pdos, asked_about)
        saves = False
        try:
            asked = _ask(node, subjects, initial_state, terms, on_write)
            if terms.saves:  # the device saves its initial values
                if altered := _restore(node, plan, pdos):
                    raise _beside(altered)
                saves = True
                asked = replace(asked, saved=ask_to_save(node, terms.saves))
        except BaseException as fault:
            _roll_back(node, plan, pdos, fault)
            if isinstance(fault, DvtcliError):
                _told(fault, may_have_saved=saves and fault.state == "unknown")
                fault.node = node.node_id
            raise
        _roll_back(node, plan, pdos, None)
    node.cancellation.hold()
    return asked


def _told(fault: DvtcliError, *, may_have_saved: bool) -> None:
    """Add to *fault* that everything is rolled back, and the known result of a save."""
    fault.state = "rolled_back"
    if may_have_saved:
        fault.state = "unknown"
        fault.state_text = "unknown: everything is rolled back, read back equal; its stored values are not known"


def _ask(
    node: Node, subjects: Sequence[ProbedPdo], initial_state: InitialState, terms: Terms, on_write: Callable[[], None]
) -> Asked:
    """Probe one subject per direction: the first whose mapping accepts its present values."""
    askings = [Asking(node, subject, terms.limit, on_write) for subject in subjects]
    by_direction: dict[Direction, list[Asking]] = {}
    for asking in askings:
        by_direction.setdefault(asking.subject.pdo.direction, []).append(asking)
    ways = list(by_direction.values())
    answers: list[dict[str, ProbeAnswer]] = [{} for _ in ways]
    in_operational = terms.isolated and initial_state.state is NmtState.OPERATIONAL
    if in_operational:
        # recorded before probing: a restart must not hide the initial state
        node.gate.found = initial_state.state
        for (asking, *_), own in zip(ways, answers, strict=True):
            _keep_to(terms, askings, asking)
            for probe in while_operational(asking.subject):
                own[probe.name] = asking.ask(probe)
    node.gate.enter_agreed()
    quiet = terms.isolated or node.access.state() is NmtState.PRE_OPERATIONAL
    known = []
    for candidates, own in zip(ways, answers, strict=True):
        asking = _that_goes_back(candidates, lambda candidate: _keep_to(terms, askings, candidate))
        if not quiet:
            asking.subject = replace(asking.subject, spare=())
        known.append(_ask_one(asking, own, terms))
        for name, answer in not_while_operational(asking.subject, would_be=in_operational).items():
            own.setdefault(name, answer)
    return Asked(tuple(known), sum(asking.writes for asking in askings), SignatureAnswers())


def _that_goes_back(candidates: Sequence[Asking], keep_to: Callable[[Asking], None]) -> Asking:
    """The first of *candidates* with a restorable mapping, restricted to restorable objects; else the first."""
    for asking in candidates:
        keep_to(asking)
        asking.keep_to_what_goes_back()
        if asking.subject.entries:
            return asking
    return candidates[0]


def _keep_to(terms: Terms, askings: Sequence[Asking], asking: Asking) -> None:
    """Give *asking* the rest of the agreed number of writes."""
    asking.limit = terms.limit - sum(other.writes for other in askings if other is not asking)


def _ask_one(asking: Asking, answers: dict[str, ProbeAnswer], terms: Terms) -> KnownAnswers:
    """All allowed probes of one subject, and the probes that follow from their answers."""
    known = KnownAnswers(asking.subject, answers)
    while probes := next_probes(known):
        for probe in probes:
            if probe.where is ProbeCondition.ISOLATED and not terms.isolated:
                answers[probe.name] = ProbeAnswer(probe, None, why="only while no other node is on the bus")
                continue
            answers[probe.name] = asking.ask(probe)
        if known.fits:
            asking.fit = known.fits[0].raw
    return known


def _roll_back(node: Node, plan: Plan, pdos: Mapping[Pdo, PdoConfig], fault: BaseException | None) -> None:
    """Roll everything back, verify all *pdos*, and close the journal."""
    own = _own(plan)
    try:
        altered = _restore(node, plan, pdos)
        if altered:
            own = altered
            raise _beside(altered)
    except (DvtcliError, KeyboardInterrupt) as failed:
        left = _left(node, own, fault, failed)
        left_open(node, left)
        raise left from failed
    finally:
        node.forget()
    if node.guard is not None:
        node.guard.own_journal.end()


def _restore(node: Node, plan: Plan, pdos: Mapping[Pdo, PdoConfig]) -> list[Pdo]:
    """Roll everything back, verify all *pdos*, and return the PDOs still different."""
    roll_back_patiently(node.sdo, plan.changes, node.bus, node.gate.renew, node.reboot_monitor)
    own = _own(plan)
    return _altered(node, {pdo: before for pdo, before in pdos.items() if pdo not in own})


def _own(plan: Plan) -> list[Pdo]:
    return [change.pdo for change in plan.changes if isinstance(change, PdoChange)]


def _beside(altered: Sequence[Pdo]) -> DeviceRefused:
    return DeviceRefused(f"the device altered {join_some(pdo.label for pdo in altered)} beside what it was asked")


def _altered(node: ReadableNode, pdos: Mapping[Pdo, PdoConfig]) -> list[Pdo]:
    """The PDOs outside the plan's reach that differ from before."""
    held = node.pdos() if pdos else {}
    return [pdo for pdo, before in pdos.items() if held.get(pdo) != before]


def _left(
    node: NodeDescription, pdos: Sequence[Pdo], fault: BaseException | None, failed: BaseException
) -> LeftChanged:
    why = f"{failed or 'interrupted'}"
    return LeftChanged(
        f"{join_some(pdo.label for pdo in pdos)} of node {node.node_id} could not be rolled back",
        node=node.node_id,
        why=why if fault is None else f"{fault}; then, while it was rolled back: {why}",
        state="left_changed",
    )
