"""Changes, stores and comparisons as answers. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

from dvtcli.domain.plan import PdoChange, Plan, ValueChange, alters
from dvtcli.domain.ports import Frame
from dvtcli.domain.proof import Proof
from dvtcli.domain.rules import Finding
from dvtcli.operations.results.documents import Answer, Document, finding_document, hex_bytes

if TYPE_CHECKING:
    from dvtcli.errors import DvtcliError


@dataclass(frozen=True, slots=True)
class Changed(Answer):
    """A plan that was carried out and read back."""

    renderer: ClassVar = "change_lines:change_lines"
    remarked: ClassVar = True

    node: int
    plan: Plan
    findings: tuple[Finding, ...]
    dry_run: bool
    seconds: float
    undone: bool = False
    #: whether anything of it is lost at power-off unless it is stored
    volatile: bool = True
    #: what makes it last, in words
    keep: str = "`store` keeps it"
    names: dict[str, str] = field(default_factory=dict)
    #: whether it was the family's way to keep its settings
    saved: bool = False
    #: whether more nodes than this one are known
    named: bool = False
    #: what each PDO is now that was to be put back as it was, and that the device did not take
    not_put_back: tuple[Finding, ...] = ()

    def __bool__(self) -> bool:
        """Whether everything is as it was asked for: false where something was not put back as it was."""
        return self.exit_code == 0

    @property
    def exit_code(self) -> int:
        """1 where something was not put back as it was."""
        return 1 if self.not_put_back else 0

    @property
    def failure(self) -> DvtcliError | None:
        """What is to be said where the exit code is 1."""
        from dvtcli.operations.results.failures import not_as_before

        return not_as_before(self.node, self.not_put_back, dry_run=self.dry_run) if self.not_put_back else None

    @property
    def altered(self) -> bool:
        """Whether anything is other than it was."""
        return any(map(alters, self.plan.changes))

    @property
    def unknown_before(self) -> bool:
        """Whether nobody knows what was there: write-only objects alone were written."""
        return all(isinstance(change, ValueChange) and change.step.before is None for change in self.plan.changes)

    def document(self) -> Document:
        """`dvtcli.change/1`."""
        pdos = [str(change.pdo) for change in self.plan.changes if isinstance(change, PdoChange)]
        steps = [
            {
                "object": step.object,
                "before": hex_bytes(step.before),
                "after": hex_bytes(step.after),
                "reason": step.reason,
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
            "verified": not self.not_put_back,
            "stored": self.saved,
            "dry_run": self.dry_run,
            "findings": [finding_document(finding) for finding in (*self.findings, *self.not_put_back)],
            **_left(self.not_put_back, dry_run=self.dry_run),
        }


def _left(not_put_back: tuple[Finding, ...], *, dry_run: bool) -> Document:
    """What a document says besides where something is not as it was, with the state as an error has it."""
    if not not_put_back:
        return {}
    state = "unchanged" if dry_run else "left_changed"
    return {"state": state, "not_put_back": [finding.text for finding in not_put_back]}


@dataclass(frozen=True, slots=True)
class ChangedNodes(Answer):
    """The same on several nodes; its document has the fields of one node's, with what all of them have in common."""

    renderer: ClassVar = "change_lines:changed_nodes_lines"
    remarked: ClassVar = True

    nodes: tuple[Changed, ...]

    def __bool__(self) -> bool:
        """Whether everything is as it was asked for, on every node."""
        return self.exit_code == 0

    @property
    def exit_code(self) -> int:
        """1 where something of a node was not put back as it was."""
        return max(one.exit_code for one in self.nodes)

    @property
    def not_put_back(self) -> tuple[Finding, ...]:
        """What was not put back as it was, of every node."""
        return tuple(
            replace(finding, text=f"node {one.node}: {finding.text}")
            for one in self.nodes
            for finding in one.not_put_back
        )

    @property
    def failure(self) -> DvtcliError | None:
        """What is to be said where the exit code is 1."""
        from dvtcli.operations.results.failures import not_as_before

        left = self.not_put_back
        return not_as_before(None, left, dry_run=self.nodes[0].dry_run) if left else None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What the rules said, of every node."""
        return tuple(finding for one in self.nodes for finding in one.findings)

    def document(self) -> Document:
        """`dvtcli.change/1` without a node of its own, and with each node's document in `nodes`."""
        documents = [one.document() for one in self.nodes]
        return {
            "schema": "dvtcli.change/1",
            "node": None,
            "pdo": None,
            "pdos": [f"{one['node']}:{pdo}" for one in documents for pdo in one["pdos"]],
            "steps": [{"node": one["node"], **step} for one in documents for step in one["steps"]],
            "writes": sum(one["writes"] for one in documents),
            **{key: all(one[key] for one in documents) for key in ("verified", "stored", "dry_run")},
            "findings": [row for one in documents for row in one["findings"]],
            **_left(self.not_put_back, dry_run=self.nodes[0].dry_run),
            "nodes": documents,
        }


@dataclass(frozen=True, slots=True)
class Stored(Answer):
    """A store or restore that the device took, with its *proof* where one was asked for.

    *skipped* says why nothing was sent at all; *because* why it was sent though it might not have been needed;
    *prove_asked* whether it was to be proved, which a dry run cannot do.
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
    #: whether nobody but this dvtcli can have changed the node, so that *changed* is all of it
    all_known: bool = False

    def __bool__(self) -> bool:
        """Whether it is as it should be, and proved if that was asked for: a dry run proves nothing."""
        return self.exit_code == 0 and not (self.prove_asked and self.proof is None)

    @property
    def exit_code(self) -> int:
        """1 where a proof was asked for, and what it should have shown is not so, or not proven."""
        return 0 if self.proof is None or self.proof.holds else 1

    @property
    def failure(self) -> DvtcliError | None:
        """What is to be said where the exit code is 1."""
        from dvtcli.operations.results.failures import not_proved

        return None if self.proof is None or self.proof.holds else not_proved(self.node, self.word, self.proof)

    @property
    def stored(self) -> bool:
        """Whether the node was told to store, and nothing shows that it did not."""
        lost = self.proof is not None and bool(self.proof.differences)
        return self.word == "store" and not (lost or self.dry_run or self.skipped)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is not known, what a proof that holds does not show, and what it left out."""
        proof = self.proof
        if proof is None:
            unknown = self.word == "store" and not (self.changed or self.all_known or self.skipped)
            return ("what changed since the last store is not known",) if unknown else ()
        known, did = "", "the load did it"
        if self.word == "store" and not self.changed:
            known, did = "no change since the last store", "the save wrote it"
        elif proof.already:
            known = "nothing stored that differed from its default before"
        if not known or not proof.holds:
            return proof.notes
        shows = f"dvtcli knows of {known}: this shows what the node comes up with, not that {did}"
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


@dataclass(frozen=True, slots=True)
class Compared(Answer):
    """A read-back against what was wanted: one row a PDO that differs."""

    renderer: ClassVar = "change_lines:compared_lines"

    node: int
    pdos: int
    parameters: int
    differences: tuple[tuple[str, str], ...] = ()
    against: str = "this session's changes"
    frames: tuple[tuple[str, Frame | None, float], ...] = ()
    state_note: str = ""
    #: single objects that were compared besides
    objects: int = 0
    #: whether a frame of every enabled TPDO should have come
    frame_asked: bool = False
    #: whether more nodes than this one are known
    named: bool = False

    @property
    def frame_missing(self) -> bool:
        """Whether a frame was asked for and not seen."""
        return self.frame_asked and (not self.frames or any(frame is None for _, frame, _ in self.frames))

    def __bool__(self) -> bool:
        """Whether it is as it should be: `assert` in a test says the rest."""
        return self.exit_code == 0

    @property
    def exit_code(self) -> int:
        """3 where something differs, 1 where a frame was asked for and none came."""
        return 3 if self.differences else 1 if self.frame_missing else 0

    @property
    def failure_of_line(self) -> DvtcliError | None:
        """What a script says where it ends here: the screen above shows what differs, not in which line."""
        from dvtcli.operations.results.failures import not_as_wanted

        differing = list(dict.fromkeys(label for label, _ in self.differences))
        return not_as_wanted(self.node, self.exit_code, differing, self.against) if self.exit_code else None

    def document(self) -> Document:
        """`dvtcli.verify/1`."""
        return {
            "schema": "dvtcli.verify/1",
            "node": self.node,
            "pdos": self.pdos,
            "objects": self.objects,
            "parameters": self.parameters,
            "equal": not self.differences,
            "differences": [{"node": self.node, **_what(label), "text": text} for label, text in self.differences],
            "frames": [
                {
                    "node": self.node,
                    "pdo": pdo.lower(),
                    "data": None if frame is None else hex_bytes(frame.data),
                    "ms": round(ms, 1),
                }
                for pdo, frame, ms in self.frames
            ],
        }


def _what(label: str) -> Document:
    """What differs: a PDO by its label, or an object."""
    return {"pdo": None, "object": label} if ":" in label else {"pdo": label.lower(), "object": None}


@dataclass(frozen=True, slots=True)
class ComparedNodes(Answer):
    """The same of several nodes; its document has the fields of one node's, with what all of them have in common."""

    renderer: ClassVar = "change_lines:compared_nodes_lines"

    nodes: tuple[Compared, ...]

    @property
    def exit_code(self) -> int:
        """3 where a node differs, else 1 where a frame is missing."""
        return max(one.exit_code for one in self.nodes)

    @property
    def failure_of_line(self) -> DvtcliError | None:
        """As of one node, with the node-ID before each PDO."""
        from dvtcli.operations.results.failures import not_as_wanted

        differing = list(
            dict.fromkeys(f"{label} of node {one.node}" for one in self.nodes for label, _ in one.differences)
        )
        return not_as_wanted(None, self.exit_code, differing, self.nodes[0].against) if self.exit_code else None

    def document(self) -> Document:
        """`dvtcli.verify/1` without a node of its own, and with each node's document in `nodes`."""
        documents = [one.document() for one in self.nodes]
        return {
            "schema": "dvtcli.verify/1",
            "node": None,
            **{key: sum(one[key] for one in documents) for key in ("pdos", "objects", "parameters")},
            "equal": all(one["equal"] for one in documents),
            **{key: [row for one in documents for row in one[key]] for key in ("differences", "frames")},
            "nodes": documents,
        }
