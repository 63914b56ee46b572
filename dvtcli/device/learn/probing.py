"""Probe a node under lock, journal and gate, and roll everything back whatever happens."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from typing import TYPE_CHECKING

from dvtcli.device.change.failed_change import TRY_AGAIN, left_open
from dvtcli.device.change.roll_back import roll_back_patiently
from dvtcli.device.learn.saving import SignatureAnswers, ask_to_save
from dvtcli.device.stamped import NO_STAMP, held_stamp
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.learning.probe import (
    ACCEPTED,
    Probe,
    ProbeAnswer,
    ProbeCondition,
    ProbedPdo,
    ProbeWrite,
    Stand,
    not_while_operational,
    while_operational,
)
from dvtcli.domain.learning.probe_table import KnownAnswers, next_probes
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.objects import VERIFY_CONFIGURATION
from dvtcli.domain.pdo import Direction, Pdo, PdoConfig
from dvtcli.domain.plan import (
    EVENT_TIMER,
    INHIBIT_TIME,
    SYNC_START,
    TRANSMISSION_TYPE,
    Change,
    PdoChange,
    Plan,
    Step,
    ValueChange,
)
from dvtcli.domain.store import DATE, TIME
from dvtcli.domain.text import join_some
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, SafetyRefusal, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.store import Stamp


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
        yield ValueChange(Step(VERIFY_CONFIGURATION, sub_index, data, data, "old value"))


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
    with node.cancellation.deferred():
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


#: How often a refusal is asked for again where two answers differ.
_PAIRS = 2
#: Sub-indices of the communication parameter, in the order in which they are rolled back, besides the COB-ID.
_PARAMETERS = (TRANSMISSION_TYPE, INHIBIT_TIME, EVENT_TIMER, SYNC_START)


@dataclass(slots=True)
class Asking:
    """Probes *subject* of *node* with at most *limit* downloads; *on_write* is called for each.

    *fit* is the entry to map if a probe needs a mapping, None until an accepted entry is known. An object that refused
    its present value is not probed: it could not be rolled back.
    """

    node: Node
    subject: ProbedPdo
    limit: int
    on_write: Callable[[], None] = lambda: None
    fit: int | None = None
    writes: int = 0
    _now: dict[tuple[int, int], bytes] = field(default_factory=dict)
    _found: dict[tuple[int, int], bytes] = field(default_factory=dict)
    _stuck: set[tuple[int, int]] = field(default_factory=set)
    _boot_ups: int = 0

    def __post_init__(self) -> None:
        pdo, held = self.subject.pdo, self.subject
        self._now = {(pdo.communication_index, sub): data for sub, data in held.parameters.items()}
        self._now[pdo.communication_index, 1] = held.held.communication.cob_id.raw.to_bytes(4, "little")
        self._now[pdo.mapping_index, 0] = bytes([held.held.count])
        self._now |= {(pdo.mapping_index, n): word.to_bytes(4, "little") for n, word in enumerate(held.entries, 1)}
        self._found = dict(self._now)
        self._boot_ups = self.node.bus.boot_ups(self.node.node_id)

    def keep_to_what_goes_back(self) -> None:
        """Restrict the subject to restorable parameters and entries: those that accept their present value."""
        self._stand(Stand.EMPTY)
        pdo, subject = self.subject.pdo, self.subject
        parameters = {
            sub: data for sub, data in subject.parameters.items() if self._takes(pdo.communication_index, sub, data)
        }
        words = list(
            takewhile(
                lambda numbered: self._takes(pdo.mapping_index, numbered[0], numbered[1].to_bytes(4, "little")),
                enumerate(subject.entries, 1),
            )
        )
        entries = tuple(word for _, word in words)
        self._stuck |= {(pdo.mapping_index, number) for number in range(len(entries) + 1, len(subject.entries) + 1)}
        self.subject = replace(
            subject, parameters=parameters, entries=entries, more=len(entries) < len(subject.entries)
        )

    def _takes(self, index: int, sub_index: int, data: bytes) -> bool:
        """True if an object accepts its present value."""
        write = ProbeWrite(index, sub_index, data)
        taken = self._write(write) == ACCEPTED or self._write(write) == ACCEPTED
        self._note_way_back(write, taken=taken)
        return taken

    def _note_way_back(self, write: ProbeWrite, *, taken: bool) -> None:
        if taken:
            self._stuck.discard(write.place)
        else:
            self._stuck.add(write.place)

    def ask(self, probe: Probe) -> ProbeAnswer:
        """The device's answer to *probe*. A refusal counts if given twice."""
        if why := self._no_way_back(probe):
            return ProbeAnswer(probe, None, why=why)
        answer = self._answer(probe)
        if probe.where is ProbeCondition.OPERATIONAL and probe.asked.data == self._found.get(probe.asked.place):
            self._note_way_back(probe.asked, taken=answer.accepted)
        return answer

    def _answer(self, probe: Probe) -> ProbeAnswer:
        code = ACCEPTED
        for _ in range(_PAIRS):
            why = self._stand(probe.stand) or self._write_all(probe.writes[:-1])
            if why:
                return ProbeAnswer(probe, None, why=why)
            code = self._once(probe.asked)
            if code == ACCEPTED or self._once(probe.asked) == code:
                return ProbeAnswer(probe, code, self._now.get(probe.asked.place))
        return ProbeAnswer(probe, None, why=f"it was refused with 0x{code:08X}, and then not, or with another code")

    def _no_way_back(self, probe: Probe) -> str:
        """Why *probe* is forbidden (it alters an object that refuses its present value); empty if allowed."""
        for write in probe.writes:
            held = self._found.get(write.place)
            if held != write.data and write.place in self._stuck:
                return f"0x{write.label} refuses its own value (0x{(held or b'')[::-1].hex().upper()})"
        return ""

    def _once(self, write: ProbeWrite) -> int:
        code = self._write(write)
        if self.node.bus.boot_ups(self.node.node_id) != self._boot_ups:
            raise DeviceRefused(
                f"node {self.node.node_id} restarted when {write} was written",
                node=self.node.node_id,
                place=write.label,
                hint=TRY_AGAIN,
            )
        return code

    def _write_all(self, writes: Iterable[ProbeWrite]) -> str:
        """Make the prerequisite *writes* of a probe; the reason for a failure, else empty."""
        return next((why for write in writes if (why := self._must(write))), "")

    def _stand(self, stand: Stand) -> str:
        """Bring the PDO to *stand*; the reason for a failure, else empty."""
        if stand is Stand.FOUND:
            return ""
        if stand is not Stand.EMPTY and self.fit is None:
            return "its mappable objects are unknown"
        wanted = self._wanted(stand)
        if all(self._now.get(place) == data for place, data in wanted.items()):
            return ""
        pdo = self.subject.pdo
        places = [*((pdo.communication_index, sub) for sub in _PARAMETERS), (pdo.mapping_index, 1)]
        places += [(pdo.mapping_index, 0), (pdo.communication_index, 1)]
        return self._open() or next((why for place in places if (why := self._bring(place, wanted))), "")

    def _wanted(self, stand: Stand) -> dict[tuple[int, int], bytes]:
        pdo, subject = self.subject.pdo, self.subject
        wanted = {(pdo.communication_index, sub): data for sub, data in subject.parameters.items()}
        wanted[pdo.communication_index, 1] = subject.off.raw.to_bytes(4, "little")
        wanted[pdo.mapping_index, 0] = b"\0"
        if stand is not Stand.EMPTY and self.fit is not None:
            wanted[pdo.mapping_index, 0] = b"\1"
            wanted[pdo.mapping_index, 1] = self.fit.to_bytes(4, "little")
        if stand is Stand.ON:
            off = subject.off
            on = CobId(subject.spare[0], rtr_allowed=off.rtr_allowed)
            wanted[pdo.communication_index, 1] = on.raw.to_bytes(4, "little")
        return wanted

    def _open(self) -> str:
        """Disable the PDO with its former COB-ID and set count 0; the reason for a failure, else empty."""
        pdo = self.subject.pdo
        wanted = {
            (pdo.communication_index, 1): self.subject.off.raw.to_bytes(4, "little"),
            (pdo.mapping_index, 0): b"\0",
        }
        return next((why for place in wanted if (why := self._bring(place, wanted))), "")

    def _bring(self, place: tuple[int, int], wanted: Mapping[tuple[int, int], bytes]) -> str:
        if place not in wanted or self._now.get(place) == wanted[place]:
            return ""
        return self._must(ProbeWrite(*place, wanted[place]))

    def _must(self, write: ProbeWrite) -> str:
        """Write with a second try; the reason for a failure, else empty."""
        code = self._write(write)
        if code == ACCEPTED or self._write(write) == ACCEPTED:
            return ""
        return f"{write} before it was refused with 0x{code:08X}"

    def _write(self, write: ProbeWrite) -> int:
        """Send *write*, read the object back, and return the abort code, 0 if accepted."""
        if self.node.cancellation.requested:
            raise self.node.cancellation.interrupted(f"stopped after {self.writes} writes", node=self.node.node_id)
        if self.writes >= self.limit:
            raise SafetyRefusal(
                f"node {self.node.node_id} was written {self.limit} times, the announced maximum",
                node=self.node.node_id,
            )
        self.writes += 1
        self.on_write()
        code = ACCEPTED
        try:
            self.node.sdo.download(write.index, write.sub_index, write.data)
        except SdoAborted as aborted:
            code = aborted.code
        try:
            self._now[write.place] = self.node.sdo.upload(write.index, write.sub_index)
        except SdoAborted:
            self._now.pop(write.place, None)
        return code
