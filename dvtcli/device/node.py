"""One node as a command sees it: its PDOs, what was changed, and the way to change it.

Joins reading, rules, plan and transaction. Does not print, ask, or know what a file or an option is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache

from dvtcli.device.access_level import level_finding, level_findings, refuse_passcode
from dvtcli.device.applied import Applied, refuse
from dvtcli.device.came_up import CameUp
from dvtcli.device.change.cancellation import Cancellation
from dvtcli.device.change.carry_out import carry_out
from dvtcli.device.change.expected import Expected
from dvtcli.device.change.journal import Identity
from dvtcli.device.change.pending import COMMUNICATION, EVERYTHING, Pending
from dvtcli.device.change.safekeeping import Keeper
from dvtcli.device.change.way_back import plan_back, refuse_unless_left, unknown_before
from dvtcli.device.lazy_pdos import LazyMapping
from dvtcli.device.missing import hint_for_missing, no_pdo
from dvtcli.device.neighbours import producers
from dvtcli.device.nmt_gate import Access, Gate
from dvtcli.device.observe import BusWitness, Found, observed
from dvtcli.device.quirks.fixed_count import FixedCount
from dvtcli.device.quirks.reversed_entries import ReversedEntries
from dvtcli.device.raw_write_check import held_value, raw_change, raw_write_findings
from dvtcli.device.read_pdos import learnt_lengths, present_pdos, read_optional, read_pdo, service_can_ids
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, plan_pdo
from dvtcli.domain.ports import CanopenBus, SdoTransport
from dvtcli.domain.profile import GENERIC, DeviceProfile
from dvtcli.domain.rules import Finding, Proposal, check_pdo
from dvtcli.domain.several import several
from dvtcli.errors import BusUnavailable, SafetyRefusal, SdoAborted, UsageError

Want = PdoConfig | Callable[[Proposal], PdoConfig]


@dataclass(slots=True)
class Node:
    """A node on a bus, with its dictionary (None without an EDS) and profile.

    *cancellation* stops a change at a safe point; *consent* is asked before the node leaves OPERATIONAL.
    """

    bus: CanopenBus
    node_id: int
    dictionary: ObjectDictionary | None = None
    profile: DeviceProfile = GENERIC
    cancellation: Cancellation = field(default_factory=Cancellation)
    consent: Callable[[str], None] = lambda _question: None
    #: plans that were applied, oldest first: what `undo` puts back
    history: list[Plan] = field(default_factory=list)
    #: node-IDs of this session's changes on all its nodes, oldest first
    order: list[int] = field(default_factory=list)
    #: the wanted state of what this session changed: what `verify` compares with
    wanted: dict[Pdo, PdoConfig] = field(default_factory=dict)
    #: the same of single objects that are no part of a PDO and can be read back
    wanted_values: dict[tuple[int, int], bytes] = field(default_factory=dict)
    #: what is in RAM only, and why it must not be stored now
    pending: Pending = field(default_factory=Pending)
    #: lock, backup and journal; None for simulated nodes and twins, which nothing can interrupt half-way
    keeper: Keeper | None = None
    #: what this session knows that the node's RAM must hold before it is stored: changed here, or seen beside a change
    expected: Expected = field(default_factory=Expected)
    #: what it came up with, for `store --if-changed`
    came_up: CameUp = field(default_factory=CameUp)
    #: the other nodes that this session knows
    neighbours: Callable[[], Iterable[Node]] = tuple
    _gate: Gate | None = None
    #: how many changes were put back that were none of this session's
    unkept: int = 0
    _pdos: dict[Pdo, PdoConfig] = field(default_factory=dict)
    _present: list[Pdo] | None = None
    _boot_ups: int = 0

    @property
    def sdo(self) -> SdoTransport:
        """The node's SDO channel."""
        channel: SdoTransport = self.bus.sdo(self.node_id)
        if self.profile.reversed_entries:
            channel = ReversedEntries(channel)
        return channel if self.profile.filler is None else FixedCount(channel, self.profile.filler)

    @property
    def witness(self) -> BusWitness:
        """Who tells whether the node restarted."""
        return BusWitness(self.bus, self.node_id)

    @property
    def access(self) -> Access:
        """The node's state and reasons."""
        return Access(self.bus, self.node_id, self.profile)

    @property
    def gate(self) -> Gate:
        """The node's pre-operational gate; one for as long as the caller keeps it open."""
        if self._gate is None:
            self._gate = Gate(self.access, self._ask)
        return self._gate

    def _ask(self, question: str) -> None:
        """Ask through whatever *consent* is by then: a script's lines may carry their own --yes."""
        self.consent(question)

    @property
    def title(self) -> str:
        """What the device calls itself in its file, or its family's name."""
        return (self.dictionary.info.product_name if self.dictionary else "") or self.profile.title

    def present(self) -> list[Pdo]:
        """The PDOs the node has, TPDOs first."""
        if self._present is None:
            self._present = present_pdos(self.sdo, self.dictionary)
        return self._present

    def pdos(self) -> dict[Pdo, PdoConfig]:
        """Every PDO as the device holds it now, in one life of it; one that the EDS lists and it lacks is left out."""
        boot_ups = self.bus.boot_ups(self.node_id)
        self._pdos = observed(self.witness, self._read_pdos)
        if self.bus.boot_ups(self.node_id) == boot_ups:
            self.came_up.read(boot_ups, self._pdos)
        return dict(self._pdos)

    def _read_pdos(self) -> dict[Pdo, PdoConfig]:
        found: dict[Pdo, PdoConfig] = {}
        for pdo in self.present():
            try:
                found[pdo] = read_pdo(self.sdo, pdo)
            except SdoAborted as aborted:
                if aborted.index not in (pdo.communication_index, pdo.mapping_index):
                    raise
        return found

    def pdo(self, pdo: Pdo) -> PdoConfig:
        """One PDO as the device holds it now; UsageError where the node has no such PDO."""
        try:
            config = observed(self.witness, lambda: read_pdo(self.sdo, pdo))
        except SdoAborted as aborted:
            raise no_pdo(self.node_id, pdo, self.present(), aborted) from aborted
        self._pdos[pdo] = config
        return config

    def known_pdos(self) -> Mapping[Pdo, PdoConfig]:
        """The node's PDOs as last read; read anew once a boot-up was seen, since a reset changes them."""
        boot_ups = self.bus.boot_ups(self.node_id)
        if boot_ups != self._boot_ups or not self._pdos.keys() >= set(self.present()):
            self._boot_ups = boot_ups
            self.pdos()
        return self._pdos

    @property
    def last_read(self) -> Mapping[Pdo, PdoConfig]:
        """What was last read of the PDOs; reads nothing."""
        return self._pdos

    def present_known(self) -> list[Pdo]:
        """The PDOs that are known without asking the node: those of the EDS, or those that were read."""
        return self._present or list(self._pdos)

    def tpdos_known(self) -> list[PdoConfig]:
        """The TPDOs as this session set or last read them; reads nothing."""
        return [config for pdo, config in {**self._pdos, **self.wanted}.items() if pdo.is_tpdo]

    def claim(self) -> Found:
        """Before the first read of a change: let no other dvtcli write to the node until this process ends.

        What was read before counts no longer. Returns how the node is found. SafetyRefusal where another one holds it,
        or was interrupted.
        """
        if self.keeper is not None:
            self.keeper.refuse_while_open()
        self._pdos.clear()
        return Found(self.access.state(), self.bus.boot_ups(self.node_id), self.bus.upsets(self.node_id))

    def forget(self) -> None:
        """Drop what was read: the device was written, or may hold something else now."""
        self._pdos.clear()
        with suppress(BusUnavailable):  # a dead bus stays dead: nothing will be stored over it
            self.came_up.wrote(self.bus.boot_ups(self.node_id))

    def proposal(
        self, pdo: Pdo, now: PdoConfig, want: PdoConfig, together: Mapping[Pdo, PdoConfig] | None = None
    ) -> Proposal:
        """What the rules look at before *pdo* may become *want*; *together* are PDOs changed in the same plan."""
        others = LazyMapping(lambda: self._others(pdo, together or {}))
        moves = now.communication.cob_id != want.communication.cob_id
        sync, emcy = service_can_ids(self.sdo) if moves else (0x080, None)
        learn = self.dictionary is None and now.mapping != want.mapping
        lengths = learnt_lengths(want.mapping, self.length_of) if learn else {}
        elsewhere = cache(lambda: producers(self.neighbours()))
        return Proposal(
            self.node_id, pdo, now, want, others, self.profile, self.dictionary, lengths, sync, emcy, elsewhere
        )

    def _others(self, pdo: Pdo, together: Mapping[Pdo, PdoConfig]) -> dict[Pdo, PdoConfig]:
        return {other: config for other, config in {**self.known_pdos(), **together}.items() if other != pdo}

    def length_of(self, index: int, sub_index: int) -> int | None:
        """An object's length in bits: the EDS's, else eight times what an upload brings; None if neither tells."""
        entry = self.dictionary.entry(index, sub_index) if self.dictionary else None
        if entry is not None and entry.bits is not None:
            return entry.bits
        try:
            return 8 * len(self.sdo.upload(index, sub_index))
        except SdoAborted:
            return None

    def configure(self, wants: Mapping[Pdo, Want], *, force: bool = False) -> Applied:
        """Make each PDO what *wants* says, all or none: check, write the least, read back, else put the old back.

        A want is a configuration, or a function that makes one from the PDO as it is.
        """
        found = self.claim()
        now = {pdo: self.pdo(pdo) for pdo in wants}
        wanted = {pdo: self._made(pdo, now[pdo], want) for pdo, want in wants.items()}
        findings: list[Finding] = []
        for pdo, want in wanted.items():
            if now[pdo] != want:
                findings += check_pdo(self.proposal(pdo, now[pdo], want, wanted))
        labels = several(pdo.label for pdo in wanted)
        refuse(tuple(findings), f"{labels} not changed", self.node_id, force=force)
        changes = tuple(plan_pdo(pdo, now[pdo], want) for pdo, want in wanted.items())
        return self.apply(Plan(self.node_id, changes), tuple(findings), force=force, found=found)

    def _made(self, pdo: Pdo, now: PdoConfig, want: Want) -> PdoConfig:
        return want if isinstance(want, PdoConfig) else want(self.proposal(pdo, now, now))

    def write(self, index: int, sub_index: int, data: bytes, *, force: bool = False) -> Applied:
        """Write one object as a plan of one step, under the rules of the command that is meant for it."""
        refuse_passcode(self.access, index, sub_index)
        found = self.claim()
        if self.saves((index, sub_index)):
            self.prepare_store(force=force)
        findings = raw_write_findings(self, index, sub_index, data)
        refuse(findings, f"0x{index:04X}:{sub_index:02X} not written", self.node_id, force=force)
        change = raw_change(self, Step(index, sub_index, held_value(self, index, sub_index), data, "write"))
        return self.apply(Plan(self.node_id, (change,)), findings, force=force, found=found)

    def upload(self, index: int, sub_index: int) -> bytes:
        """Read one object; an abort for a missing sub-index gets the hint that sub-indices are hexadecimal."""
        try:
            return self.sdo.upload(index, sub_index)
        except SdoAborted as aborted:
            self.access.explain(aborted)
            aborted.hint = hint_for_missing(aborted, self.dictionary) or aborted.hint
            raise

    def undo(self, *, everything: bool = False, force: bool = False) -> Applied:
        """Put back what the last plan replaced, or all of them, in one transaction."""
        undone = self.history[:] if everything else self.history[-1:]
        kept = self.history[: len(self.history) - len(undone)]
        applied = self.put_back(undone, force=force, own=True)
        self.history = kept
        for _ in undone:
            del self.order[max(number for number, node_id in enumerate(self.order) if node_id == self.node_id)]
        if self.keeper is not None:
            self.keeper.past.forget_own(len(undone))
        if self.pending.is_as_stored(len(kept)) and not applied.findings:
            self.pending.unstored.clear()  # the device holds what was stored, or found, again
        return applied

    def put_back(self, plans: Sequence[Plan], *, force: bool = False, own: bool = False) -> Applied:
        """Put back what *plans* (oldest first) replaced; SafetyRefusal where the device holds something else by now.

        *own* says that they are of this session's history.
        """
        found = self.claim()
        if not force:
            refuse_unless_left(self, plans)
        plan, unknown = plan_back(self, plans), unknown_before(plans)
        if unknown and not plan.changes:
            raise UsageError(unknown[0].text, node=self.node_id)
        applied = self.apply(plan, unknown, kept=False, found=found)
        self.unkept += not own
        return applied

    def is_dynamic(self, pdo: Pdo) -> bool:
        """Whether the EDS lets the mapping of *pdo* be changed; True where there is none."""
        entry = self.dictionary.entry(pdo.mapping_index, 0) if self.dictionary else None
        return entry is None or entry.access.writable

    def prepare_store(self, *, force: bool = False, confirm: bool = True) -> None:
        """Before a store: let nothing be stored that is not as it should be; enter the gate where the family needs it.

        What this session changed is read again, and the PDOs whole, since a device may have lost or altered them;
        *confirm* says whether: not where all of it is about to be given up.
        """
        self.claim()
        for reason in self.pending.suspicions.values():
            raise SafetyRefusal(
                f"node {self.node_id} is not stored: {reason}",
                node=self.node_id,
                hint="set it as it should be and `verify`, or `nmt reset-node` brings back what is stored; then store",
            )
        refuse(level_finding(self.access), "nothing was stored or restored", self.node_id, force=force)
        if confirm and not force:
            self.expected.require(self)
        if self.profile.store.only_pre_operational:
            self.gate.enter()

    def commanded(self) -> None:
        """An NMT command was sent by hand: the gate no longer knows the state, and what was read may be old."""
        self._gate = None
        self._pdos.clear()

    def was_reset(self, *, communication: bool) -> tuple[str, ...]:
        """A reset that was asked for has happened (*communication*: of the communication objects only).

        Returns the labels of what is lost.
        """
        self._pdos.clear()
        self.expected.clear()
        self.pending.lost_until = len(self.history)
        return self.pending.was_reset(COMMUNICATION if communication else EVERYTHING, self.bus.boot_ups(self.node_id))

    def notice_reboot(self) -> tuple[str, ...]:
        """Labels of unstored changes that a restart nobody asked for has lost; empty where there was none."""
        try:
            boot_ups = self.bus.boot_ups(self.node_id)
        except BusUnavailable:
            return ()  # a dead bus tells nothing, and whoever needs it says so
        lost = self.pending.rebooted(boot_ups)
        if lost:
            self._pdos.clear()
            self.pending.lost_until = len(self.history)
        return lost

    def identity(self) -> Identity:
        """The node's identity (0x1018) as it says now: at a prompt another device may have taken its place."""
        names = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}
        return {name: read_optional(self.sdo, 0x1018, sub_index, 4) for name, sub_index in names.items()}

    def apply(
        self,
        plan: Plan,
        findings: tuple[Finding, ...] = (),
        *,
        force: bool = False,
        kept: bool = True,
        found: Found | None = None,
    ) -> Applied:
        """Run a checked *plan* inside the gate; on a real bus with lock, backup and journal.

        With *kept* it is remembered, so that `undo` can put it back. *found* is what `claim` answered before the reads
        that the plan was made from.
        """
        if len(plan):
            locked = level_findings(self.access, plan)
            refuse(locked, f"{several(change.label for change in plan.changes)} not changed", self.node_id, force=force)
            findings += locked
            carry_out(self, plan, findings, found=found, done=lambda: self._done(plan, kept=kept))
        else:
            self._remember(plan.changes)
        return Applied(plan, findings)

    def _done(self, plan: Plan, *, kept: bool) -> None:
        """*plan* was carried out and read back: whatever fails from here on, it is so."""
        if kept and not any(self.saves((step.index, step.sub_index)) for step in plan.steps):
            self._keep(plan)
        self._remember(plan.changes)

    def _keep(self, plan: Plan) -> None:
        """What can be undone, by this session and on a real bus by a later one."""
        self.history.append(plan)
        self.order.append(self.node_id)
        if self.keeper is not None:
            self.keeper.remember(plan)

    def saves(self, place: tuple[int, int]) -> bool:
        """Whether a write to *place* is how this family keeps its settings: nothing that could be undone."""
        return place == self.profile.store.saved_by

    @property
    def unstored(self) -> dict[str, int]:
        """Labels of what changed since the last store, in order, each with its index."""
        return self.pending.unstored

    def _remember(self, changes: tuple[Change, ...]) -> None:
        for change in changes:
            self.expected.changed(change)
            if isinstance(change, PdoChange):
                self.wanted[change.pdo] = change.after
            elif self._is_kept(change.step):
                self.wanted_values[change.step.index, change.step.sub_index] = change.step.after
            if any(self.saves((step.index, step.sub_index)) for step in change.steps):
                self.pending.was_stored(EVERYTHING, len(self.history))
            elif change.steps and self.profile.store.needed_for(change.steps[0].index):
                self.pending.changed(change.label, change.steps[0].index)

    def _is_kept(self, step: Step) -> bool:
        """Whether what a single write left can be compared: not write-only, no way to save, no part of a PDO."""
        return step.before is not None and Pdo.at(step.index) is None and not self.saves((step.index, step.sub_index))
