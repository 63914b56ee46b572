"""The results of `store` and `restore`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from dvtcli.domain.store import Proof
from dvtcli.operations.results.documents import Answer, Document

if TYPE_CHECKING:
    from dvtcli.errors import DvtcliError


@dataclass(frozen=True, slots=True)
class Stored(Answer):
    """An acknowledged store or restore, with its *proof* if requested.

    *skipped* says why nothing was sent; *because* why it was sent though perhaps unnecessary; *prove_asked*: a proof
    was requested, which a dry run cannot do.
    """

    renderer: ClassVar = "store_lines:stored_lines"

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
