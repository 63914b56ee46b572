"""Changes, stores and restores as answers. Knows no terminal and no session."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.plan import PdoChange, Plan, Step, ValueChange, alters
from dvtcli.domain.rules.finding import Finding
from dvtcli.operations.results.documents import Answer, Document, finding_document, hex_bytes, physical_document

if TYPE_CHECKING:
    from dvtcli.domain.object_scalings import ScaledValue
    from dvtcli.domain.store import Proof
    from dvtcli.errors import DvtcliError


@dataclass(frozen=True, slots=True)
class Changed(Answer):
    """A plan that was carried out and verified."""

    renderer: ClassVar = "change_lines:applied_lines"
    show_findings: ClassVar = True

    node: int
    plan: Plan
    findings: tuple[Finding, ...]
    dry_run: bool
    seconds: float
    undone: bool = False
    #: whether any of it is lost at power-off without a store
    volatile: bool = True
    #: what makes it permanent, in words
    keep: Hint | str = Hint(Action.STORE, why="keeps it")  # noqa: RUF009 - it is frozen
    names: dict[str, str] = field(default_factory=dict)
    #: whether it was stored in the family's own way
    saved: bool = False
    #: whether more nodes are known
    named: bool = False
    #: PDOs that differ after the roll-back, as the device did not take their old values
    not_put_back: tuple[Finding, ...] = ()
    #: whether it was rolled back, and no store of dvtcli took the new values
    as_before: bool = False
    #: acknowledged objects that cannot be read back, as `2050:00`
    unreadable: tuple[str, ...] = ()
    #: objects of unknown old value that keep the written value, as `2050:00`
    unrestored: tuple[str, ...] = ()
    #: scaled values of single objects
    understood: Mapping[str, ScaledValue] = field(default_factory=dict)
    #: whether a later `undo` can undo it
    remembered: bool = True

    def __bool__(self) -> bool:
        """Tell whether all is as requested: false if an old value was not restored."""
        return self.exit_code == 0

    @property
    def exit_code(self) -> int:
        """1 if an old value was not restored."""
        return 1 if self.not_put_back else 0

    @property
    def failure(self) -> DvtcliError | None:
        """The error for exit code 1."""
        from dvtcli.operations.results.failures import not_as_before

        return not_as_before(self.node, self.not_put_back, dry_run=self.dry_run) if self.not_put_back else None

    @property
    def altered(self) -> bool:
        """Tell whether any value changed."""
        return any(map(alters, self.plan.changes))

    @property
    def unknown_before(self) -> bool:
        """Tell whether all old values are unknown: only write-only objects were written."""
        return all(isinstance(change, ValueChange) and change.step.before is None for change in self.plan.changes)

    def _shown(self) -> Iterable[object]:
        return [f"{step.object} {step.reason}" for step in self.plan.steps]

    def document(self) -> Document:
        """`dvtcli.change/1`."""
        pdos = [str(change.pdo) for change in self.plan.changes if isinstance(change, PdoChange)]
        steps = [
            {
                "object": step.object,
                "before": hex_bytes(step.before),
                "after": hex_bytes(step.after),
                "reason": step.reason,
                "physical": self._physical(step),
            }
            for step in self.plan.steps
        ]
        return {
            "schema": "dvtcli.change/1",
            "node": self.node,
            "pdo": pdos[0] if len(pdos) == 1 else None,
            "pdos": pdos,
            "steps": steps,
            "writes": len(steps),
            "verified": not (self.not_put_back or self.unreadable or self.unrestored),
            "readable": not (self.unreadable or self.unrestored),
            "stored": self.saved,
            "dry_run": self.dry_run,
            "findings": [finding_document(finding) for finding in (*self.findings, *self.not_put_back)],
            **_left(self.not_put_back, dry_run=self.dry_run),
        }

    def _physical(self, step: Step) -> Document | None:
        known = self.understood.get(step.object)
        return None if known is None else physical_document(known.value(step.after), known.meaning)


def _left(not_put_back: tuple[Finding, ...], *, dry_run: bool) -> Document:
    """Return the additional fields if an old value was not restored, with the state as in an error."""
    if not not_put_back:
        return {}
    state = "unchanged" if dry_run else "left_changed"
    return {"state": state, "not_put_back": [finding.text for finding in not_put_back]}


@dataclass(frozen=True, slots=True)
class ChangedNodes(Answer):
    """A change of several nodes; its document has common fields, and each node's."""

    renderer: ClassVar = "change_lines:changed_nodes_lines"
    show_findings: ClassVar = True

    nodes: tuple[Changed, ...]

    def __bool__(self) -> bool:
        """Tell whether all is as requested on every node."""
        return self.exit_code == 0

    @property
    def exit_code(self) -> int:
        """1 if an old value of a node was not restored."""
        return max(node.exit_code for node in self.nodes)

    @property
    def not_put_back(self) -> tuple[Finding, ...]:
        """The old values not restored, of every node."""
        return tuple(
            replace(finding, text=f"node {node.node}: {finding.text}")
            for node in self.nodes
            for finding in node.not_put_back
        )

    @property
    def failure(self) -> DvtcliError | None:
        """The error for exit code 1."""
        from dvtcli.operations.results.failures import not_as_before

        left = self.not_put_back
        return not_as_before(None, left, dry_run=self.nodes[0].dry_run) if left else None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings of the rules, of every node."""
        return tuple(finding for node in self.nodes for finding in node.findings)

    def document(self) -> Document:
        """`dvtcli.change/1` without a node, and with each node's document in `nodes`."""
        documents = [node.document() for node in self.nodes]
        return {
            "schema": "dvtcli.change/1",
            "node": None,
            "pdo": None,
            "pdos": [f"{document['node']}:{pdo}" for document in documents for pdo in document["pdos"]],
            "steps": [{"node": document["node"], **step} for document in documents for step in document["steps"]],
            "writes": sum(document["writes"] for document in documents),
            **{
                key: all(document[key] for document in documents)
                for key in ("verified", "readable", "stored", "dry_run")
            },
            "findings": [row for document in documents for row in document["findings"]],
            **_left(self.not_put_back, dry_run=self.nodes[0].dry_run),
            "nodes": documents,
        }


@dataclass(frozen=True, slots=True)
class Stored(Answer):
    """An acknowledged store or restore, with its *proof* if requested.

    *skipped* says why nothing was sent; *because* why it was sent though perhaps unnecessary; *prove_asked*: a proof
    was requested, which a dry run cannot do.
    """

    renderer: ClassVar = "change_lines:stored_lines"

    node: int
    object: str
    word: str
    seconds: float
    limit_s: float
    changed: tuple[str, ...]
    dry_run: bool
    proof: Proof | None = None
    skipped: str = ""
    because: str = ""
    prove_asked: bool = False
    #: whether only this dvtcli can have changed the node, so that *changed* is complete
    all_known: bool = False

    @property
    def changed_nothing(self) -> bool:
        """Tell whether nothing was sent."""
        return bool(self.skipped)

    def __bool__(self) -> bool:
        """Tell whether it succeeded, and was proved if requested: a dry run proves nothing."""
        return self.exit_code == 0 and not (self.prove_asked and self.proof is None)

    @property
    def exit_code(self) -> int:
        """1 if a requested proof failed, or is missing."""
        return 0 if self.proof is None or self.proof.holds else 1

    @property
    def failure(self) -> DvtcliError | None:
        """The error for exit code 1."""
        from dvtcli.operations.results.failures import not_proved

        return None if self.proof is None or self.proof.holds else not_proved(self.node, self.word, self.proof)

    @property
    def stored(self) -> bool:
        """Tell whether the node was told to store, and nothing contradicts it."""
        lost = self.proof is not None and bool(self.proof.differences)
        return self.word == "store" and not (lost or self.dry_run or self.skipped)

    @property
    def notes(self) -> tuple[str, ...]:
        """Limits of the result: unknown facts, and what a proof does not cover."""
        proof = self.proof
        if proof is None:
            unknown = self.word == "store" and not (self.changed or self.all_known or self.skipped)
            return ("the changes since the last store are unknown",) if unknown else ()
        known, did = "", "the load did it"
        if self.word == "store" and not self.changed:
            known, did = "no change since the last store", "the save wrote it"
        elif proof.already:
            known = "nothing stored that differed from its default before"
        if not known or not proof.holds:
            return proof.notes
        shows = f"dvtcli knows of {known}: this shows what the node boots with, not that {did}"
        return (shows, *proof.notes)

    def document(self) -> Document:
        """`dvtcli.store/1`."""
        proof = self.proof
        return {
            "schema": "dvtcli.store/1",
            "node": self.node,
            "object": self.object,
            "action": self.word,
            "seconds": round(self.seconds, 3),
            "changed": list(self.changed),
            "stored": self.stored,
            "skipped": bool(self.skipped),
            "reason": self.skipped or self.because or None,
            "proved": None if proof is None else proof.holds,
            "by": None if proof is None else proof.by,
            "compared": None if proof is None else proof.compared,
            "objects": None if proof is None else proof.objects,
            "against": None if proof is None else proof.against,
            "differences": [] if proof is None else list(proof.differences),
            "unproved": (proof and proof.unproved) or None,
            "canary": (proof and proof.canary) or None,
            "lost": [] if proof is None else list(proof.lost),
            "notes": list(self.notes),
            "dry_run": self.dry_run,
        }
