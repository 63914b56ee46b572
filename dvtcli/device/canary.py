"""A canary: one harmless value that is changed in RAM after a store, so that a reset can show what it takes.

Knows what is harmless to change and how it is put back. Does not reset anything, and judges no store.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import TYPE_CHECKING

from dvtcli.device.change.after_change import left_open
from dvtcli.device.change.carry_out import carry_out
from dvtcli.device.change.failed_change import BUS_BACK
from dvtcli.device.change.put_back import first_difference, restore_patiently
from dvtcli.device.proposal import proposal
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME, TRANSMISSION_TYPE, Change, Plan, plan_pdo
from dvtcli.domain.rules import check_pdo, errors_in
from dvtcli.errors import BusUnavailable, DeviceRefused, DvtcliError, LeftChanged

if TYPE_CHECKING:
    from dvtcli.device.node import Node

#: How many places are tried before a device counts as one that has none.
_TRIES = 3
#: What may be changed of a PDO that is not on the bus, in order: field, sub-index, values to choose from beside the
#: held one's neighbours. The first is slow, so that it does no harm where it has to stay.
_FIELDS = (
    ("event_timer", EVENT_TIMER, (1000,)),
    ("inhibit_time", INHIBIT_TIME, (100,)),
    ("transmission_type", TRANSMISSION_TYPE, (255, 254, 1)),
)
_NAMES = {"event_timer": "event timer", "inhibit_time": "inhibit time", "transmission_type": "transmission type"}


@dataclass(frozen=True, slots=True)
class Place:
    """One parameter of a PDO that is disabled, from *before* to *after*."""

    pdo: Pdo
    field: str
    sub_index: int
    before: PdoConfig
    after: PdoConfig

    @property
    def text(self) -> str:
        """The place and what happens there, for a person."""
        held, put = (_value(config, self.field) for config in (self.before, self.after))
        place = f"0x{self.pdo.communication_index:04X}:{self.sub_index:02X}"
        return f"{place} ({self.name}) {held} -> {put}"

    @property
    def put_back_text(self) -> str:
        """The same after it was put back, and read back."""
        place = f"0x{self.pdo.communication_index:04X}:{self.sub_index:02X}"
        return f"{place} ({self.name}) is put back to {_value(self.before, self.field)}, read back equal"

    @property
    def name(self) -> str:
        """What the parameter is called, and of which PDO it is."""
        return f"{_NAMES[self.field]} of {self.pdo.label}"


def _value(config: PdoConfig, field: str) -> int | None:
    value: int | None = getattr(config.communication, field)
    return value


def harmless_places(node: Node, pdos: Mapping[Pdo, PdoConfig]) -> Iterator[Place]:
    """Parameters of PDOs that are disabled and not kept by the device itself, with a value that the rules allow."""
    off = [(pdo, config) for pdo, config in pdos.items() if _is_off(config)]
    for field, sub_index, values in _FIELDS:
        for pdo, config in off:
            if node.profile.store.needed_for(pdo.communication_index):
                yield from islice(_allowed(node, pdo, config, field, sub_index, values), 1)


def _is_off(config: PdoConfig) -> bool:
    """Whether it was read that it sends nothing; one whose COB-ID cannot be read may be sending."""
    return config.has_cob_id and not config.enabled and config.mpdo is None


def _allowed(
    node: Node, pdo: Pdo, config: PdoConfig, field: str, sub_index: int, values: tuple[int, ...]
) -> Iterator[Place]:
    held = _value(config, field)
    if held is None:
        return
    neighbours = () if field == "transmission_type" else (held + 1, held - 1)
    for value in (*(() if held and neighbours else values), *neighbours):
        if value == held or value < 0:
            continue
        want = replace(config, communication=replace(config.communication, **{field: value}))
        if not errors_in(check_pdo(proposal(node, pdo, config, want))):
            yield Place(pdo, field, sub_index, config, want)


@dataclass(slots=True)
class Canary:
    """A value at *place* of *node* that was changed and read back; the journal stays until `gone` or `put_back`."""

    node: Node
    place: Place

    @classmethod
    def planted(cls, node: Node, pdos: Mapping[Pdo, PdoConfig]) -> Canary | None:
        """Change the first harmless place among *pdos* that the device lets be changed; None where there is none."""
        for place in islice(harmless_places(node, pdos), _TRIES):
            canary = cls(node, place)
            try:
                carry_out(node, canary.plan, keep_journal=True)
            except DvtcliError as failed:
                if failed.state == "unknown":  # it was changed, and what came after that failed
                    canary.put_back_after(failed)
                elif isinstance(failed, DeviceRefused):
                    continue  # it was put back; another place may be free
                raise
            return canary
        return None

    @property
    def plan(self) -> Plan:
        """The change as a plan of its own."""
        place = self.place
        return Plan(self.node.node_id, (plan_pdo(place.pdo, place.before, place.after),))

    def survived(self, pdos: Mapping[Pdo, PdoConfig]) -> bool:
        """Whether *pdos*, read after the reset, still have the changed value."""
        held = pdos.get(self.place.pdo)
        return held is not None and _value(held, self.place.field) == _value(self.place.after, self.place.field)

    def gone(self) -> None:
        """The reset took the changed value: there is nothing to put back."""
        if self.node.keeper is not None:
            self.node.keeper.own_journal.end()

    def put_back(self) -> None:
        """Put the value back and verify that; LeftChanged, with the journal kept, where that fails."""
        put_test_back(self.node, self.plan.changes, self.place.text)
        self.gone()

    def put_back_after(self, fault: BaseException) -> None:
        """The proof did not come to its end: the value may be there still; LeftChanged where that stays unknown."""
        try:
            self.put_back()
        except LeftChanged as left:
            if isinstance(fault, DvtcliError):
                left.why, left.details = f"{fault}; then {left.why}", [*fault.details, *left.details]
            raise left from fault
        else:
            if isinstance(fault, DvtcliError):
                fault.details.append(("changed", f"{self.place.text}: put back, read back equal"))


def holds_test(node: Node, changes: Sequence[Change]) -> bool:
    """Whether *node* still holds what *changes* of a proof left on it: no restart has taken it then."""
    return bool(changes) and node.observed(lambda: all(first_difference(node.sdo, one) is None for one in changes))


def put_test_back(node: Node, changes: Sequence[Change], text: str) -> None:
    """Put back what *changes* of a proof left on *node*, in words *text*, and verify that.

    LeftChanged, with the journal kept, where that fails.
    """
    try:
        with node.cancellation.guard():
            restore_patiently(node.sdo, changes, node.bus, node.gate.renew, node.witness)
    except (DvtcliError, KeyboardInterrupt) as failed:
        first = f"{BUS_BACK}; then " if isinstance(failed, BusUnavailable) else ""
        left = LeftChanged(
            f"node {node.node_id} was changed to prove the store, and that could not be put back",
            node=node.node_id,
            why=f"{text}: {failed or 'interrupted'}",
            hint=f"{first}nmt reset-node {node.node_id}, or a power cycle; `pdo` shows what it holds",
            state="left_changed",
        )
        left_open(node, left)
        raise left from failed
    finally:
        node.forget()
