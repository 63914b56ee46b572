"""One node as a command sees it: its PDOs, what was changed, and the way to change it.

Joins reading, rules, plan and transaction. Does not print, ask, or know what a file or an option is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from dvtcli.device.access import Access, Gate
from dvtcli.device.back import plan_back, unknown_before
from dvtcli.device.cancellation import Cancellation
from dvtcli.device.carry_out import carry_out
from dvtcli.device.fixed_count import FixedCount
from dvtcli.device.journal import Identity
from dvtcli.device.keeper import Keeper
from dvtcli.device.lazy import LazyMapping
from dvtcli.device.login import level_finding, level_findings, refuse_passcode
from dvtcli.device.pending import COMMUNICATION, EVERYTHING, Pending
from dvtcli.device.raw_write import held_value, raw_change, raw_write_findings
from dvtcli.device.read import present_pdos, read_optional, read_pdo
from dvtcli.device.reversed_entries import ReversedEntries
from dvtcli.domain.abort import Abort
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, plan_pdo
from dvtcli.domain.ports import CanopenBus, SdoTransport
from dvtcli.domain.profile import GENERIC, DeviceProfile
from dvtcli.domain.rules import Finding, Proposal, check_pdo, errors_in
from dvtcli.domain.rules.mapping import decimal_hint
from dvtcli.domain.several import several
from dvtcli.errors import BusUnavailable, RuleError, SafetyRefusal, SdoAborted, UsageError

Want = PdoConfig | Callable[[Proposal], PdoConfig]


@dataclass(frozen=True, slots=True)
class Applied:
    """A plan that the device took, with what the rules said beforehand."""

    plan: Plan
    findings: tuple[Finding, ...] = ()


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
    #: the wanted state of what this session changed: what `verify` compares with
    wanted: dict[Pdo, PdoConfig] = field(default_factory=dict)
    #: what is in RAM only, and why it must not be stored now
    pending: Pending = field(default_factory=Pending)
    #: lock, backup and journal; None for simulated nodes and twins, which nothing can interrupt half-way
    keeper: Keeper | None = None
    _gate: Gate | None = None
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
        """Every PDO as the device holds it now; a PDO that the EDS lists and the device lacks is left out."""
        found: dict[Pdo, PdoConfig] = {}
        for pdo in self.present():
            try:
                found[pdo] = read_pdo(self.sdo, pdo)
            except SdoAborted as aborted:
                if aborted.index not in (pdo.communication_index, pdo.mapping_index):
                    raise
        self._pdos = found
        return dict(found)

    def pdo(self, pdo: Pdo) -> PdoConfig:
        """One PDO as the device holds it now; UsageError where the node has no such PDO."""
        try:
            config = read_pdo(self.sdo, pdo)
        except SdoAborted as aborted:
            raise self._no_pdo(pdo, aborted) from aborted
        self._pdos[pdo] = config
        return config

    def _no_pdo(self, pdo: Pdo, aborted: SdoAborted) -> Exception:
        same = [other for other in self.present() if other.direction is pdo.direction]
        if pdo in same:
            return aborted
        have = f"it has {same[0]}…{same[-1]}" if same else f"it has no {pdo.direction.upper()}s"
        error = UsageError(f"node {self.node_id} has no {pdo.label}: {have}", node=self.node_id, place=aborted.place)
        error.abort = aborted.abort
        error.hint = "pdo --all lists what it has"
        error.exit_code = 1
        return error

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

    def forget(self) -> None:
        """Drop what was read: the device may hold something else now."""
        self._pdos.clear()

    def proposal(
        self, pdo: Pdo, now: PdoConfig, want: PdoConfig, together: Mapping[Pdo, PdoConfig] | None = None
    ) -> Proposal:
        """What the rules look at before *pdo* may become *want*; *together* are PDOs changed in the same plan."""
        others = LazyMapping(lambda: self._others(pdo, together or {}))
        moves = now.communication.cob_id != want.communication.cob_id
        sync, emcy = self._service_can_ids() if moves else (0x080, None)
        lengths = self._lengths(want) if now.mapping != want.mapping else {}
        return Proposal(self.node_id, pdo, now, want, others, self.profile, self.dictionary, lengths, sync, emcy)

    def _others(self, pdo: Pdo, together: Mapping[Pdo, PdoConfig]) -> dict[Pdo, PdoConfig]:
        return {other: config for other, config in {**self.known_pdos(), **together}.items() if other != pdo}

    def _service_can_ids(self) -> tuple[int, int | None]:
        """CAN-IDs of SYNC and of this node's EMCY as 0x1005 and 0x1014 say, else the defaults."""
        sync = read_optional(self.sdo, 0x1005, 0, 4)
        emcy = read_optional(self.sdo, 0x1014, 0, 4)
        return 0x080 if sync is None else sync & 0x7FF, None if emcy is None else emcy & 0x7FF

    def _lengths(self, want: PdoConfig) -> dict[tuple[int, int], int]:
        """Lengths in bits of mapped objects that no file describes, learnt by reading them."""
        lengths = {}
        for entry in want.mapping:
            if not entry.is_dummy and (self.dictionary is None):
                bits = self.length_of(entry.index, entry.sub_index)
                if bits is not None:
                    lengths[entry.index, entry.sub_index] = bits
        return lengths

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
        now = {pdo: self.pdo(pdo) for pdo in wants}
        wanted = {pdo: self._made(pdo, now[pdo], want) for pdo, want in wants.items()}
        findings: list[Finding] = []
        for pdo, want in wanted.items():
            if now[pdo] != want:
                findings += check_pdo(self.proposal(pdo, now[pdo], want, wanted))
        labels = several(pdo.label for pdo in wanted)
        refuse(tuple(findings), f"{labels} not changed", self.node_id, force=force)
        changes = tuple(plan_pdo(pdo, now[pdo], want) for pdo, want in wanted.items())
        return self.apply(Plan(self.node_id, changes), tuple(findings), force=force)

    def _made(self, pdo: Pdo, now: PdoConfig, want: Want) -> PdoConfig:
        return want if isinstance(want, PdoConfig) else want(self.proposal(pdo, now, now))

    def write(self, index: int, sub_index: int, data: bytes, *, force: bool = False) -> Applied:
        """Write one object as a plan of one step, under the rules of the command that is meant for it."""
        refuse_passcode(self.access, index, sub_index)
        if self.saves((index, sub_index)):
            self.prepare_store(force=force)
        findings = raw_write_findings(self, index, sub_index, data)
        refuse(findings, f"0x{index:04X}:{sub_index:02X} not written", self.node_id, force=force)
        change = raw_change(self, Step(index, sub_index, held_value(self, index, sub_index), data, "write"))
        return self.apply(Plan(self.node_id, (change,)), findings, force=force)

    def upload(self, index: int, sub_index: int) -> bytes:
        """Read one object; an abort for a missing sub-index gets the hint that sub-indices are hexadecimal."""
        try:
            return self.sdo.upload(index, sub_index)
        except SdoAborted as aborted:
            self.access.explain(aborted)
            if aborted.code == Abort.NO_SUB_INDEX and self.dictionary is not None:
                aborted.hint = decimal_hint(self.dictionary, index, sub_index)
            elif aborted.code == Abort.NO_OBJECT:
                aborted.hint = (
                    "objects TEXT searches the dictionary" if self.dictionary else "--eds FILE names its objects"
                )
            raise

    def undo(self, *, everything: bool = False) -> Applied:
        """Put back what the last plan replaced, or all of them, in one transaction."""
        undone = self.history[:] if everything else self.history[-1:]
        kept = self.history[: len(self.history) - len(undone)]
        plan, unknown = plan_back(self, undone), unknown_before(undone)
        if unknown and not plan.changes:
            raise UsageError(unknown[0].text, node=self.node_id)
        applied = self.apply(plan, unknown)
        self.history = kept
        if len(kept) == self.pending.stored_at and not unknown:
            self.pending.unstored.clear()  # the device holds what was stored, or found, again
        return applied

    def is_dynamic(self, pdo: Pdo) -> bool:
        """Whether the EDS lets the mapping of *pdo* be changed; True where there is none."""
        entry = self.dictionary.entry(pdo.mapping_index, 0) if self.dictionary else None
        return entry is None or entry.access.writable

    def prepare_store(self, *, force: bool = False) -> None:
        """Enter the gate where the family stores only pre-operational."""
        for reason in self.pending.suspicions.values():
            raise SafetyRefusal(
                f"node {self.node_id} is not stored: {reason}",
                node=self.node_id,
                hint="set it as it should be and `verify`, or `nmt reset-node` brings back what is stored; then store",
            )
        refuse(level_finding(self.access), "nothing was stored or restored", self.node_id, force=force)
        if self.keeper is not None:
            self.keeper.refuse_while_open()
        if self.profile.store.only_pre_operational:
            self.gate.enter()

    def commanded(self) -> None:
        """An NMT command was sent by hand: the gate no longer knows the state, and what was read may be old."""
        self._gate = None
        self.forget()

    def was_reset(self, *, communication: bool) -> tuple[str, ...]:
        """A reset that was asked for has happened (*communication*: of the communication objects only).

        Returns the labels of what is lost.
        """
        self.forget()
        return self.pending.was_reset(COMMUNICATION if communication else EVERYTHING, self.bus.boot_ups(self.node_id))

    def notice_reboot(self) -> tuple[str, ...]:
        """Labels of unstored changes that a restart nobody asked for has lost; empty where there was none."""
        try:
            boot_ups = self.bus.boot_ups(self.node_id)
        except BusUnavailable:
            return ()  # a dead bus tells nothing, and whoever needs it says so
        lost = self.pending.rebooted(boot_ups)
        if lost:
            self.forget()
        return lost

    def identity(self) -> Identity:
        """The node's identity (0x1018) as it says now: at a prompt another device may have taken its place."""
        names = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}
        return {name: read_optional(self.sdo, 0x1018, sub_index, 4) for name, sub_index in names.items()}

    def apply(self, plan: Plan, findings: tuple[Finding, ...] = (), *, force: bool = False) -> Applied:
        """Run a checked *plan* inside the gate and remember it; on a real bus with lock, backup and journal."""
        if len(plan):
            locked = level_findings(self.access, plan)
            refuse(locked, f"{several(change.label for change in plan.changes)} not changed", self.node_id, force=force)
            findings += locked
            carry_out(self, plan, findings)
            if not any(self.saves((step.index, step.sub_index)) for step in plan.steps):
                self.history.append(plan)
        self._remember(plan.changes)
        return Applied(plan, findings)

    def saves(self, place: tuple[int, int]) -> bool:
        """Whether a write to *place* is how this family keeps its settings: nothing that could be undone."""
        return place == self.profile.store.saved_by

    @property
    def unstored(self) -> dict[str, int]:
        """Labels of what changed since the last store, in order, each with its index."""
        return self.pending.unstored

    def _remember(self, changes: tuple[Change, ...]) -> None:
        for change in changes:
            if isinstance(change, PdoChange):
                self.wanted[change.pdo] = change.after
            if any(self.saves((step.index, step.sub_index)) for step in change.steps):
                self.pending.forget(EVERYTHING)
                self.pending.stored_at = len(self.history)
            elif change.steps and self.profile.store.needed_for(change.steps[0].index):
                self.pending.changed(change.label, change.steps[0].index)


def refuse(findings: tuple[Finding, ...], text: str, node_id: int, *, force: bool) -> None:
    """Raise RuleError where *findings* hold an error and *force* is not given."""
    stopping = errors_in(findings)
    if stopping and not force:
        raise RuleError(f"{text}: {stopping[0].text}", stopping, node=node_id)
