"""The PDOs outside a plan: their values before the plan, and side effects of the plan on them.

A device may alter the COB-ID of one PDO after a write to another. Reads only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.change.roll_back import altered_cob_ids, first_difference
from dvtcli.device.read_pdos import WHATEVER, read_pdo
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, ValueChange, writes_cob_id
from dvtcli.domain.text import join_some
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.change.changeable import Changeable
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.ports import SdoReader, SdoTransport


@dataclass(slots=True, eq=False, repr=False)
class UntouchedPdos:
    """The PDOs that a plan does not write, to find and roll back the device's side effects on them.

    Read before the plan: *cob_ids*, their COB-IDs, and *configs*, the configurations of those read completely. A
    roll-back asks *present* for all of them, which may read the node, and *unlike_backups* for those of which nothing
    proves that they are as before: they were not read before the plan, and match no backup and no remembered change.
    """

    cob_ids: Mapping[Pdo, CobId] = field(default_factory=dict)
    configs: Mapping[Pdo, PdoConfig] = field(default_factory=dict)
    present: Callable[[], Sequence[Pdo]] = tuple
    #: selects the PDOs that match neither backup nor history
    unlike_backups: Callable[[Mapping[Pdo, PdoConfig]], Sequence[Pdo]] = tuple
    #: the PDOs outside a roll-back, as before the plan or, if not read, at the start of the roll-back
    _before: dict[Pdo, PdoConfig] = field(default_factory=dict)
    #: altered PDOs restored in their COB-ID only
    _in_part: list[Pdo] = field(default_factory=list)

    def altered(self, sdo: SdoTransport) -> dict[Pdo, str]:
        """The PDOs with a changed COB-ID, each with the difference in words."""
        return {
            pdo: f"0x{pdo.communication_index:04X}:01 was 0x{self.cob_ids[pdo].raw:08X}, is 0x{held.raw:08X}"
            for pdo, held in altered_cob_ids(sdo, self.cob_ids).items()
        }

    def begin_roll_back(self, sdo: SdoReader, *, restarted: bool) -> None:
        """Read the untouched PDOs before the first write of a roll-back.

        Values read before the plan take precedence, unless the node *restarted* since.
        """
        held = {}
        self._in_part.clear()
        for pdo in self.present():
            with suppress(SdoAborted):  # listed in the EDS, missing in the node
                held[pdo] = read_pdo(sdo, pdo, WHATEVER)
        self._before = {change.pdo: change.before for change in as_they_are(held)}
        if not restarted:
            self._before = {pdo: self._as_before(pdo, config) for pdo, config in self._before.items()} | {
                **self.configs
            }

    def unread(self) -> dict[Pdo, PdoConfig]:
        """The PDOs read at the start of the roll-back but not before the plan, with these values."""
        return {pdo: config for pdo, config in self._before.items() if pdo not in self.configs}

    def altered_configs(self, sdo: SdoReader) -> dict[Pdo, str]:
        """The PDOs changed since the start of the roll-back, each with the difference in words."""
        altered = altered_of(sdo, (PdoChange(pdo, before, before, ()) for pdo, before in self._before.items()))
        return {change.pdo: difference for change, difference in altered.items()}

    def unchanged(self) -> Iterator[Change]:
        """Each PDO, or its COB-ID if nothing else was read, as a change to its former values."""
        yield from as_they_are(self.configs)
        for pdo, cob_id in self.cob_ids.items():
            if pdo not in self.configs:
                raw = cob_id.raw.to_bytes(4, "little")
                yield ValueChange(Step(pdo.communication_index, 1, raw, raw, "as before"))

    def changes(self, sdo: SdoTransport, pdos: Iterable[Pdo]) -> tuple[PdoChange, ...]:
        """The changes that restore *pdos* to their values before the plan.

        For a PDO not read whole before the plan: the former COB-ID, and the rest as at the start of the roll-back.
        """
        before = {pdo: self._before.get(pdo) or self._as_before(pdo, read_pdo(sdo, pdo)) for pdo in pdos}
        return tuple(PdoChange(pdo, config, config, ()) for pdo, config in before.items())

    def _as_before(self, pdo: Pdo, held: PdoConfig) -> PdoConfig:
        """The configuration of *pdo* before the plan, completed from *held*, read after its start."""
        if pdo in self.configs:
            return self.configs[pdo]
        cob_id = self.cob_ids.get(pdo, held.communication.cob_id)
        if cob_id != held.communication.cob_id:
            self._in_part.append(pdo)
        return held.with_parameters(cob_id=cob_id)

    def rolled_back_in_part(self, plan: Plan) -> str | None:
        """The device's state after the roll-back of *plan*; None if all PDOs were restored whole."""
        if not self._in_part:
            return None
        own, altered = (join_some(item.label for item in group) for group in (plan.changes, self._in_part))
        return (
            f"rolled back: {own} is as it was, and {altered} has its COB-ID again, read back equal; the rest of it "
            "was not read before: check it"
        )


def altered_too(plan: Plan, altered: Mapping[Pdo, str]) -> DeviceRefused:
    """The error: the device carried out *plan* and *altered* other PDOs as well, as described."""
    own, first = join_some(change.label for change in plan.changes), next(iter(altered))
    return DeviceRefused(
        f"node {plan.node_id} took {own}, but changed {join_some(pdo.label for pdo in altered)} as a side effect",
        node=plan.node_id,
        place=f"{first.communication_index:04X}:01",
        why="; ".join(altered.values()),
        hint="these PDOs depend on each other in this device: see its manual",
    )


def untouched_cob_ids(node: ReadableNode, plan: Plan) -> dict[Pdo, CobId]:
    """The COB-IDs outside *plan*, to compare directly afterwards; empty if *plan* writes no COB-ID.

    Without PDOs that are compared whole after the complete change.
    """
    own = {*_own(plan), *plan.looked_at}
    if not writes_cob_id(plan) or own.issuperset(node.present()):
        return {}
    return {pdo: cob_id for pdo, cob_id in node.known_cob_ids().items() if pdo not in own}


def untouched_configs(node: ReadableNode, plan: Plan, initial_state: InitialState) -> dict[Pdo, PdoConfig]:
    """The PDOs outside *plan* read whole since *initial_state*, to compare before a store."""
    if not changes_a_pdo(plan) or node.bus.boot_ups(node.node_id) != initial_state.boot_ups:
        return {}
    own = set(_own(plan))
    return {pdo: config for pdo, config in movable(node.last_read).items() if pdo not in own}


def unlike_backups(node: Changeable, held: Mapping[Pdo, PdoConfig]) -> Sequence[Pdo]:
    """The PDOs *held* that match neither this session's reads, nor a backup, nor a remembered change."""
    unlike = {pdo: config for pdo, config in held.items() if node.expected.pdos.get(pdo) != config}
    if not unlike or node.guard is None:
        return tuple(unlike)
    return node.guard.unlike_backups(node.identity(), unlike)


def movable(pdos: Mapping[Pdo, PdoConfig]) -> dict[Pdo, PdoConfig]:
    """The PDOs read completely enough to be restored."""
    return {pdo: config for pdo, config in pdos.items() if config.has_cob_id and not config.untold}


def as_they_are(pdos: Mapping[Pdo, PdoConfig]) -> tuple[PdoChange, ...]:
    """Each PDO read whole, as a change to its present values."""
    return tuple(
        PdoChange(pdo, config, config, ()) for pdo, config in pdos.items() if config.has_cob_id and not config.lacking
    )


def altered_of(sdo: SdoReader, changes: Iterable[PdoChange]) -> dict[PdoChange, str]:
    """The changes whose PDO differs from their result, each with the difference in words."""
    found = {change: first_difference(sdo, change) for change in changes}
    return {change: difference for change, difference in found.items() if difference}


def others_left(plan: Plan, altered: Mapping[PdoChange, str], failed: DvtcliError | None = None) -> LeftChanged:
    """The error: the roll-back *plan* succeeded, but its side effects on *altered* PDOs could not be rolled back."""
    own, labels = join_some(change.label for change in plan.changes), join_some(change.label for change in altered)
    left = LeftChanged(
        f"node {plan.node_id} altered {labels} when {own} was rolled back, and {labels} could not be rolled back",
        node=plan.node_id,
        why="; ".join(altered.values()) if failed is None else f"{'; '.join(altered.values())}; then: {failed}",
        hint=Hint(
            Action.SHOW_PDOS,
            why="these PDOs depend on each other in this device: see its manual; check them with {}",
        ),
        state="left_changed",
    )
    left.state_text = f"{own} is as it was before that change, read back equal; {labels} is not; nothing was stored"
    return left


def untouched_pdos(node: ReadableNode, plan: Plan) -> list[Pdo]:
    """The PDOs not written by *plan*."""
    own = {*_own(plan), *(Pdo.at(change.step.index) for change in plan.changes if isinstance(change, ValueChange))}
    return [pdo for pdo in node.present() if pdo not in own]


def changes_a_pdo(plan: Plan) -> bool:
    """True if *plan* writes an object of a PDO."""
    return any(Pdo.at(step.index) for step in plan.steps)


def _own(plan: Plan) -> Iterator[Pdo]:
    """The PDOs in *plan*."""
    return (change.pdo for change in plan.changes if isinstance(change, PdoChange))
