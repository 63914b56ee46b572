"""Finishing an interrupted change: back to what its journal says was held before, or taking what is held as it is.

Does not find journals, and does not know who else may have written to the device meanwhile.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.device.change.pending import CHANGE
from dvtcli.device.change.put_back import restore_patiently
from dvtcli.device.change.taken_back import put_back_findings
from dvtcli.device.change.way_back import plan_back
from dvtcli.device.compare import differences
from dvtcli.device.observe import MOST_LOOKS, BusWitness
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.plan import PdoChange, Plan, Step
from dvtcli.domain.script_line import value_line, whole_line
from dvtcli.domain.several import several
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, SafetyRefusal, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.change.changeable import Changeable
    from dvtcli.device.change.journal import Journal
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.known_pdos import KnownPdos
    from dvtcli.domain.rules import Finding


def refuse_other_device(node: KnownPdos, journal: Journal) -> None:
    """Raise SafetyRefusal where *journal* was made on another device than *node*."""
    if journal.plan.node_id != node.node_id or journal.identity != node.identity():
        raise SafetyRefusal(
            f"the journal was made on another device than node {node.node_id}",
            node=node.node_id,
            place=str(journal.path),
            why=f"it names {_text(journal.identity)}; this one is {_text(node.identity())}",
            hint="attach that device; where it is gone for good, recover --discard sets the journal aside",
        )


@dataclass(frozen=True, slots=True)
class AcceptedState:
    """What a device holds of an interrupted change, and what it held before, both as script lines; what differs."""

    label: str
    held: str
    before: str
    differences: tuple[str, ...]

    def document(self) -> dict[str, object]:
        """As JSON."""
        what = {"object": self.label} if ":" in self.label else {"pdo": self.label.lower()}
        return {**what, "held": self.held, "before": self.before, "differs_from_before": list(self.differences)}


def accepted_states(node: KnownPdos, journal: Journal) -> list[AcceptedState]:
    """What *node* holds now of everything that the interrupted change was about."""
    states = []
    for change in journal.plan.changes:
        if isinstance(change, PdoChange):
            held = node.pdo(change.pdo)
            now, before = whole_line(change.pdo, held), whole_line(change.pdo, change.before)
            unlike_before = tuple(differences(change.pdo, change.before, held))
            states.append(AcceptedState(change.label, now, before, unlike_before))
        else:
            states.append(_accepted_value(node, change.step))
    return states


def _accepted_value(node: KnownPdos, step: Step) -> AcceptedState:
    if step.before is None:
        return AcceptedState(step.object, f"# {step.object} is write-only", f"# {step.object} was not known", ())
    held = node.upload(step.index, step.sub_index)
    found = () if held == step.before else (f"is {held.hex(' ')}, was {step.before.hex(' ')}",)
    return AcceptedState(step.object, value_line(step, held), value_line(step, step.before), found)


def recover(node: Changeable, journal: Journal) -> tuple[Plan, tuple[Finding, ...]]:
    """Finish an interrupted change: put back what it replaced, verify that, restore the NMT state, forget the journal.

    Only forwards, towards what was: a failure leaves the journal for the next try (LeftChanged). Returns the plan
    of what was to be written, and warnings of what the device did not take back. SafetyRefusal where the journal was
    made on another device.
    """
    refuse_other_device(node, journal)
    if node.keeper is not None:
        node.keeper.lock.take()
    node.read_anew()
    plan, as_taken = plan_back(node, [journal.plan]), plan_back(node, [journal.plan], as_taken=True)
    otherwise = _put_back_for_good(node, journal)
    if node.keeper is not None:
        node.keeper.forget(journal)
    node.pending.suspicions.pop(CHANGE, None)
    return as_taken if otherwise else plan, put_back_findings(otherwise)


def _put_back_for_good(node: Changeable, journal: Journal) -> tuple[PdoChange, ...]:
    """Put back, and start the node where it was found OPERATIONAL; again where it restarted after it was verified.

    What it held in RAM only is lost with a restart, also with one that the start brings about.
    """
    for _ in range(MOST_LOOKS):
        boot_ups = node.bus.boot_ups(node.node_id)
        otherwise = _put_back(node, journal)
        if journal.nmt_state == NmtState.OPERATIONAL and node.access.state() is NmtState.PRE_OPERATIONAL:
            node.access.insist(NmtState.OPERATIONAL)
        if node.bus.boot_ups(node.node_id) == boot_ups:
            node.pending.boot_ups = boot_ups
            return otherwise
    raise LeftChanged(
        f"node {node.node_id} restarted each of {MOST_LOOKS} times that it was put back",
        node=node.node_id,
        place=str(journal.path),
        hint=f"look at its supply and its wiring; recover tries again, from {journal.path}",
        state="left_changed",
    )


def _put_back(node: Changeable, journal: Journal) -> tuple[PdoChange, ...]:
    node.gate.enter()
    try:
        with node.cancellation.guard():
            node.gate.renew()  # a try before this one may have started it
            witness = BusWitness(node.bus, node.node_id)
            return restore_patiently(node.sdo, journal.plan.changes, node.bus, node.gate.renew, witness)
    except (DvtcliError, KeyboardInterrupt) as fault:
        labels = several(change.label for change in journal.plan.changes)
        raise LeftChanged(
            f"{labels} of node {node.node_id} could not be put back",
            node=node.node_id,
            place=str(journal.path),
            why=_reason(fault),
            hint=_next_step(node, fault, journal),
            state="left_changed",
        ) from fault
    finally:
        node.forget()


def _reason(fault: BaseException) -> str:
    """What went wrong, with the device's own reason where it is known."""
    why = fault.why if isinstance(fault, DvtcliError) else None
    return ": ".join(text for text in (str(fault), why) if text) or "interrupted"


def _next_step(node: KnownPdos, fault: BaseException, journal: Journal) -> str:
    again = f"recover tries again, from {journal.path}"
    if isinstance(fault, SdoAborted | DeviceRefused):  # the same again would be refused, or corrected, again
        return (
            f"nmt reset-node {node.node_id} brings back what it has stored, then recover checks that; or "
            f"recover --accept takes what the device holds as the new state; {again}"
        )
    return again


def _text(identity: Identity) -> str:
    return " ".join(f"{name} 0x{value:X}" for name, value in identity.items() if value is not None) or "no identity"
