"""Compare a device with the journal of an interrupted change made on the same device. Writes nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.device.target_config import differences
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.plan import PdoChange, Step
from dvtcli.domain.script_line import value_line, whole_line
from dvtcli.domain.text import value_text
from dvtcli.errors import SafetyRefusal, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.change.journal import Journal
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.node_parts import ReadableNode


def refuse_other_device(node: ReadableNode, journal: Journal) -> None:
    """Raise SafetyRefusal if *journal* was made on another device than *node*."""
    if journal.plan.node_id != node.node_id or journal.identity != node.identity():
        raise SafetyRefusal(
            f"the journal was made on another device than node {node.node_id}",
            node=node.node_id,
            place=str(journal.path),
            why=f"it names {_text(journal.identity)}; this one is {_text(node.identity())}",
            hint=Hint(
                Action.RECOVER,
                {"discard": True},
                "attach that device; if it is gone for good, {} sets the journal aside",
            ),
        )


@dataclass(frozen=True, slots=True)
class AcceptedState:
    """The present and the former values of an interrupted change as script lines, and the differences.

    Unreadable values are not *is_known* and count as equal.
    """

    label: str
    held: str
    before: str
    differences: tuple[str, ...]
    is_known: bool = True

    def document(self) -> dict[str, object]:
        """The state as JSON."""
        what = {"object": self.label} if ":" in self.label else {"pdo": self.label.lower()}
        return {
            **what,
            "held": self.held,
            "before": self.before,
            "differs_from_before": list(self.differences),
            "known": self.is_known,
        }


def accepted_states(node: ReadableNode, journal: Journal) -> list[AcceptedState]:
    """The present values of everything in the interrupted change, as far as *node* can be read."""
    states = []
    for change in journal.plan.changes:
        if isinstance(change, PdoChange):
            before = whole_line(change.pdo, change.before)
            try:
                held = node.pdo(change.pdo)
            except SdoAborted as refused:
                states.append(AcceptedState(change.label, _unknown(change.label, refused), before, (), is_known=False))
                continue
            now = whole_line(change.pdo, held)
            unlike_before = tuple(differences(change.pdo, change.before, held))
            states.append(AcceptedState(change.label, now, before, unlike_before))
        else:
            states.append(_accepted_value(node, change.step))
    return states


def _accepted_value(node: ReadableNode, step: Step) -> AcceptedState:
    if step.before is None:
        return AcceptedState(
            step.object, f"# {step.object} is write-only", f"# {step.object} was not known", (), is_known=False
        )
    before = value_line(step, step.before)
    try:
        held = node.upload(step.index, step.sub_index)
    except SdoAborted as refused:
        return AcceptedState(step.object, _unknown(step.object, refused), before, (), is_known=False)
    found = () if held == step.before else (f"is {value_text(held)}, was {value_text(step.before)}",)
    return AcceptedState(step.object, value_line(step, held), before, found)


def _unknown(label: str, refused: SdoAborted) -> str:
    """A script comment for a value that the device does not return."""
    return f"# {label} is unknown: it cannot be read now ({refused})"


def _text(identity: Identity) -> str:
    return " ".join(f"{name} 0x{value:X}" for name, value in identity.items() if value is not None) or "no identity"
