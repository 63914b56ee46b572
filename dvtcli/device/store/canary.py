"""A canary: a harmless value changed in RAM after a store, to show whether a reset clears RAM."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.change.apply_plan import apply_plan
from dvtcli.device.change.failed_change import BUS_BACK, Guarded, left_open, name_left
from dvtcli.device.change.roll_back import first_difference, roll_back_patiently
from dvtcli.device.proposal import proposal
from dvtcli.device.raw_write import raw_write_findings
from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.objects import GUARD_TIME, LIFE_TIME_FACTOR, PRODUCER_HEARTBEAT
from dvtcli.domain.pdo import MAX_ENTRIES, Pdo, PdoConfig
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME, TRANSMISSION_TYPE, Change, Plan, Step, ValueChange, plan_pdo
from dvtcli.domain.rules import check_pdo, errors_in
from dvtcli.errors import BusUnavailable, DeviceRefused, DvtcliError, LeftChanged, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode

#: How many places of a kind are tried before a device counts as one that has none of it.
_TRIES = 3
#: How many are tried of all that is left then.
_MOST_BESIDE = 8
#: A heartbeat where there was none is slow, so that it does no harm where it has to stay (ms).
_SLOW_HEARTBEAT_MS = 60_000
#: What may be changed of a PDO that is not on the bus, in order: field, sub-index, values to choose from beside the
#: held one's neighbours. The first is slow, so that it does no harm where it has to stay.
_FIELDS = (
    ("event_timer", EVENT_TIMER, (1000,)),
    ("inhibit_time", INHIBIT_TIME, (100,)),
    ("transmission_type", TRANSMISSION_TYPE, (255, 254, 1)),
)
_NAMES = {
    "event_timer": "event timer",
    "inhibit_time": "inhibit time",
    "transmission_type": "transmission type",
    "cob_id": "COB-ID",
}


class CanaryParameter(NamedTuple):
    """One parameter of a PDO, from *before* to *after*.

    If *is_on* (the PDO is enabled), the change requires PRE-OPERATIONAL, when no PDO is sent.
    """

    pdo: Pdo
    field: str
    sub_index: int
    before: PdoConfig
    after: PdoConfig
    is_on: bool = False

    @property
    def text(self) -> str:
        """The place and the change, for display."""
        held, put = (_shown(config, self.field) for config in (self.before, self.after))
        place = f"0x{self.pdo.communication_index:04X}:{self.sub_index:02X}"
        return f"{place} ({self.name}) {held} -> {put}"

    @property
    def rolled_back_text(self) -> str:
        """The place and the verified old value, for display."""
        place = f"0x{self.pdo.communication_index:04X}:{self.sub_index:02X}"
        return f"{place} ({self.name}) is rolled back to {_shown(self.before, self.field)}, read back equal"

    @property
    def name(self) -> str:
        """The parameter's name with the PDO."""
        return f"{_NAMES[self.field]} of {self.pdo.label}"

    @property
    def change(self) -> Change:
        """The canary as a change."""
        return plan_pdo(self.pdo, self.before, self.after)

    def is_still_there(self, _node: NodeDescription, pdos: Mapping[Pdo, PdoConfig]) -> bool:
        """True if *pdos*, read after a restart, still have the changed value."""
        held = pdos.get(self.pdo)
        return held is not None and _value(held, self.field) == _value(self.after, self.field)

    def without(self, pdos: Mapping[Pdo, PdoConfig]) -> dict[Pdo, PdoConfig]:
        """*pdos* with the canary rolled back to the old value."""
        held = pdos[self.pdo]
        value = getattr(self.before.communication, self.field)
        return {**pdos, self.pdo: held.with_parameters(**{self.field: value})}


class CanaryObject(NamedTuple):
    """An object outside active PDOs, called *name*, with the old and the new value in *step*."""

    step: Step
    name: str
    is_on: bool = False

    @property
    def text(self) -> str:
        """The place and the change, for display."""
        held, put = self.step.text(self.step.before), self.step.text(self.step.after)
        return f"0x{self.step.object} ({self.name}) {held} -> {put}"

    @property
    def rolled_back_text(self) -> str:
        """The place and the verified old value, for display."""
        before = self.step.text(self.step.before)
        return f"0x{self.step.object} ({self.name}) is rolled back to {before}, read back equal"

    @property
    def change(self) -> Change:
        """The canary as a change."""
        return ValueChange(self.step)

    def is_still_there(self, node: ReadableNode, _pdos: Mapping[Pdo, PdoConfig]) -> bool:
        """True if *node* still holds the changed value after a restart."""
        return node.upload(self.step.index, self.step.sub_index) == self.step.after

    def without(self, pdos: Mapping[Pdo, PdoConfig]) -> dict[Pdo, PdoConfig]:
        """*pdos* unchanged: the object belongs to no PDO configuration."""
        return dict(pdos)


#: What is changed to see whether a restart takes it.
AnyPlace = CanaryParameter | CanaryObject


def _value(config: PdoConfig, field: str) -> int | CobId | None:
    value: int | CobId | None = getattr(config.communication, field)
    return value


def _shown(config: PdoConfig, field: str) -> str:
    """The value of a parameter, for display."""
    value = _value(config, field)
    return f"{value} {'enabled' if value.valid else 'off'}" if isinstance(value, CobId) else str(value)


def harmless_places(node: ReadableNode, pdos: Mapping[Pdo, PdoConfig]) -> Iterator[CanaryParameter]:
    """Parameters of disabled PDOs, not managed by the device, with a new value that passes the rules."""
    off = [(pdo, config) for pdo, config in pdos.items() if _is_off(config)]
    for field, sub_index, values in _FIELDS:
        for pdo, config in off:
            if node.profile.store.needed_for(pdo.communication_index):
                yield from islice(_allowed(node, pdo, config, field, sub_index, values), 1)


def places_beside(node: ReadableNode, pdos: Mapping[Pdo, PdoConfig]) -> Iterator[AnyPlace]:
    """Other places for a canary if no disabled PDO offers any, the most harmless first.

    A heartbeat 1 ms faster, an entry of an empty mapping, a TPDO's event timer, disabling a PDO or changing the
    transmission type (both only while no PDO is sent), and a slow heartbeat if there was none.
    """
    heartbeat = _number(node, PRODUCER_HEARTBEAT)
    if heartbeat:
        yield from _heartbeats(node, heartbeat, heartbeat - 1 if heartbeat > 1 else heartbeat + 1)
    for pdo, config in pdos.items():
        if _is_off(config) and not config.count and node.profile.store.needed_for(pdo.mapping_index):
            yield from _unused_entries(node, pdo, pdos)
    yield from _places_of_enabled(node, pdos)
    if heartbeat == 0 and not (_number(node, GUARD_TIME) and _number(node, LIFE_TIME_FACTOR)):
        yield from _heartbeats(node, 0, _SLOW_HEARTBEAT_MS)


def _places_of_enabled(node: ReadableNode, pdos: Mapping[Pdo, PdoConfig]) -> Iterator[CanaryParameter]:
    """Canary places in enabled PDOs for use while no PDO is sent: an event timer, bit 31, a transmission type."""
    timer, _, kind = _FIELDS
    on = [(pdo, config) for pdo, config in pdos.items() if _is_complete_and_on(node, pdo, config)]
    timers = (islice(_allowed(node, pdo, config, *timer), 1) for pdo, config in on if pdo.is_tpdo)
    off = (_taken_off(node, pdo, config) for pdo, config in on)
    types = (islice(_allowed(node, pdo, config, *kind), 1) for pdo, config in on)
    for place in chain.from_iterable(chain(timers, off, types)):
        yield place._replace(is_on=True)


def _number(node: ReadableNode, index: int) -> int | None:
    try:
        return read_optional(node.read_cache, index, 0, 2)
    except SdoAborted:
        return None


def _heartbeats(node: ReadableNode, held: int, put: int) -> Iterator[CanaryObject]:
    before, after = (value.to_bytes(2, "little") for value in (held, put))
    if node.profile.store.needed_for(PRODUCER_HEARTBEAT) and not errors_in(
        raw_write_findings(node, PRODUCER_HEARTBEAT, 0, after)
    ):
        yield CanaryObject(Step(PRODUCER_HEARTBEAT, 0, before, after, "test the reset"), "heartbeat time in ms")


def _unused_entries(node: ReadableNode, pdo: Pdo, pdos: Mapping[Pdo, PdoConfig]) -> Iterator[CanaryObject]:
    """The first entry of the empty mapping of *pdo*, filled as in another PDO of the same direction."""
    entries = (entry for other, config in pdos.items() if other.is_tpdo is pdo.is_tpdo for entry in config.mapping)
    held = read_optional(node.read_cache, pdo.mapping_index, 1, 4)
    if held is None:
        return
    for entry in islice((entry for entry in entries if entry.raw != held), MAX_ENTRIES):
        after = entry.raw.to_bytes(4, "little")
        if not errors_in(raw_write_findings(node, pdo.mapping_index, 1, after)):
            step = Step(pdo.mapping_index, 1, held.to_bytes(4, "little"), after, "test the reset")
            yield CanaryObject(step, f"unused entry of {pdo.label}")
            return


def _is_complete_and_on(node: NodeDescription, pdo: Pdo, config: PdoConfig) -> bool:
    is_complete = config.has_cob_id and config.mpdo is None and not config.inconsistency
    return is_complete and config.enabled and node.profile.store.needed_for(pdo.communication_index)


def _taken_off(node: ReadableNode, pdo: Pdo, config: PdoConfig) -> Iterator[CanaryParameter]:
    """*pdo* disabled, if the rules allow both the change and the roll-back."""
    off = config.disabled()
    ways = ((config, off), (off, config))
    if not any(errors_in(check_pdo(proposal(node, pdo, now, want))) for now, want in ways):
        yield CanaryParameter(pdo, "cob_id", 1, config, off)


def _is_off(config: PdoConfig) -> bool:
    """True if the PDO was read as disabled; an unreadable COB-ID counts as enabled."""
    return config.has_cob_id and not config.enabled and config.mpdo is None


def _allowed(
    node: ReadableNode, pdo: Pdo, config: PdoConfig, field: str, sub_index: int, values: tuple[int, ...]
) -> Iterator[CanaryParameter]:
    held = _value(config, field)
    if not isinstance(held, int):
        return
    neighbours = () if field == "transmission_type" else (held + 1, held - 1)
    for value in (*(() if held and neighbours else values), *neighbours):
        if value == held or value < 0:
            continue
        want = config.with_parameters(**{field: value})
        if not errors_in(check_pdo(proposal(node, pdo, config, want))):
            yield CanaryParameter(pdo, field, sub_index, config, want)


def choose_canary(node: Node, pdos: Mapping[Pdo, PdoConfig]) -> AnyPlace | None:
    """The first harmless place that *node* accepts, tried and rolled back; None if there is none.

    Asks before a node leaves OPERATIONAL. Raises LeftChanged if the roll-back of a trial fails.
    """
    beside = (place for place in places_beside(node, pdos) if not _is_default(node, place))
    off = (place for place in harmless_places(node, pdos) if not _is_default(node, place))
    for place in chain(islice(off, _TRIES), islice(beside, _MOST_BESIDE)):
        if place.is_on:
            node.gate.enter_to_test()
        canary = Canary(node, place)
        if canary.write():
            canary.roll_back()
            return place
    return None


def _is_default(node: NodeDescription, place: AnyPlace) -> bool:
    """True if the new value of *place* may equal the node's boot value without a store."""
    step = place.change.steps[-1]
    entry = node.dictionary.entry(step.index, step.sub_index) if node.dictionary else None
    default = None if entry is None else entry.initial(node.node_id)
    if default is None:
        return False
    is_cob_id = isinstance(place, CanaryParameter) and place.field == "cob_id"
    return not CobId.from_raw(int.from_bytes(default, "little")).valid if is_cob_id else default == step.after


@dataclass(slots=True)
class Canary:
    """A changed and verified value at *place* of *node*; the journal stays until `close_journal` or `roll_back`."""

    node: Node
    place: AnyPlace

    def write(self) -> bool:
        """Change the value; false if the device refuses and keeps the old value."""
        try:
            apply_plan(self.node, self.plan, keep_journal=True)
        except DvtcliError as failed:
            if failed.state == "unknown":  # the value was changed, and a later step failed
                self.roll_back_after(failed)
            elif isinstance(failed, DeviceRefused):
                return False  # it was rolled back; another place may be free
            raise
        return True

    @property
    def plan(self) -> Plan:
        """The change as a separate plan."""
        return Plan(self.node.node_id, (self.place.change,))

    def is_still_there(self, pdos: Mapping[Pdo, PdoConfig]) -> bool:
        """True if the changed value is still there; *pdos* were read after the restart."""
        return self.place.is_still_there(self.node, pdos)

    def close_journal(self) -> None:
        """Close the journal: the reset took the changed value, nothing to roll back."""
        if self.node.guard is not None:
            self.node.guard.own_journal.end()

    def roll_back(self) -> None:
        """Roll back and verify. Raises LeftChanged and keeps the journal if the roll-back fails."""
        roll_back_test(self.node, self.plan.changes, self.place.text)
        self.close_journal()

    def roll_back_after(self, fault: BaseException) -> None:
        """Roll back after a failed proof, if the value may still be there. Raises LeftChanged if the state stays
        unknown.
        """
        try:
            self.roll_back()
        except LeftChanged as left:
            if isinstance(fault, DvtcliError):
                left.why, left.details = f"{fault}; then {left.why}", [*fault.details, *left.details]
            raise left from fault
        else:
            if isinstance(fault, DvtcliError):
                fault.details.append(("changed", f"{self.place.text}: rolled back, read back equal"))


def holds_test(node: ReadableNode, changes: Sequence[Change]) -> bool:
    """True if *node* still holds the test values in *changes*: no restart has cleared RAM."""
    return bool(changes) and node.observed(
        lambda: all(first_difference(node.sdo, change) is None for change in changes)
    )


def roll_back_test(node: Node, changes: Sequence[Change], text: str) -> None:
    """Roll back and verify the test *changes* of a proof, described by *text*.

    Raises LeftChanged and keeps the journal if the roll-back fails.
    """
    try:
        with node.cancellation.deferred():
            roll_back_patiently(node.sdo, changes, node.bus, node.gate.renew, node.reboot_monitor)
    except (DvtcliError, KeyboardInterrupt) as failed:
        reset = Hint(Action.RESET_NODE, {"node": node.node_id}, "{}, or a power cycle")
        reset += Hint(Action.SHOW_PDOS, why="shows its present values")
        left = LeftChanged(
            f"node {node.node_id} was changed to prove the store, and that could not be rolled back",
            node=node.node_id,
            why=f"{text}: {failed or 'interrupted'}",
            hint=reset.after(BUS_BACK if isinstance(failed, BusUnavailable) else None),
            state="left_changed",
        )
        guarded = Guarded(node.node_id, node.sdo, node.reboot_monitor, changes)
        name_left(left, [guarded], stopped=isinstance(failed, KeyboardInterrupt))
        left_open(node, left)
        raise left from failed
    finally:
        node.forget()
