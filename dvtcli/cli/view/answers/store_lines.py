"""The text of stores and restores, and of a store's proof."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line
from dvtcli.cli.view.paint import wrapped
from dvtcli.domain.store import RESTART_NAMES, Proof
from dvtcli.domain.text import join_some
from dvtcli.operations.results.failures import compared_text

if TYPE_CHECKING:
    from dvtcli.operations.results import Stored

#: width of sentences, also without a terminal
_WIDTH = 98


def stored_lines(result: Stored, _width: int) -> Iterator[Line]:
    """Show the object of the signature, the stored values, and the result of the proof."""
    word = "save" if result.word == "store" else "load"
    if result.skipped:
        yield f"not stored, since {result.skipped}"
        return
    if result.because:
        yield [Cell(f"stored nevertheless: {result.because}", "dim")]
    if result.word == "store":
        changed = ", ".join(result.changed) or ("nothing by dvtcli" if result.all_known else "not known")
        yield f'0x{result.object} <- "{word}"     changed since the last store: {changed}'
    else:
        yield f'0x{result.object} <- "{word}"'
    if result.dry_run:
        yield [Cell("dry run: ", "cyan"), Cell("on the twin only, nothing was sent")]
        return
    yield from _outcome(result)


def _outcome(result: Stored) -> Iterator[Line]:
    took = f"acknowledged after {result.seconds:.2f} s (limit {result.limit_s:.0f} s)"
    proof = result.proof
    if proof is None:
        check = (
            "To check: store --prove"
            if result.word == "store"
            else "The defaults take effect at the next reset: nmt reset-node"
        )
        yield f"{result.word}d, {took}. {check}"
        return
    yield took
    if proof.canary:
        yield [Cell(f"test value in RAM, which the {RESTART_NAMES[proof.by]} must discard: {proof.canary}", "dim")]
    if proof.lost and result.word == "store":
        yield [Cell(f"not stored, and lost by the {RESTART_NAMES[proof.by]}: {join_some(proof.lost)}", "yellow")]
    yield from _shown_by(result, proof)


def _shown_by(result: Stored, proof: Proof) -> Iterator[Line]:
    """Show the result of the restart; a failed proof's remedy is in the error."""
    what, after = compared_text(proof), f"after the {RESTART_NAMES[proof.by]}"
    stored = result.word == "store"
    if proof.differences:
        yield [
            Cell("NOT STORED: " if stored else "NOT RESTORED: ", "red"),
            Cell(f"{after} the node differs from {proof.against}:"),
        ]
        yield from (f"  {text}" for text in proof.differences)
    elif proof.unproved:
        yield [Cell("NOT PROVED: ", "red"), Cell(f"{proof.unproved}.")]
    elif stored:
        gone = ", and the test value was gone" if proof.canary else ""
        yield [Cell("proved: ", "green"), Cell(f"{after} {what} read back equal{gone}")]
    elif proof.against == "what was stored before":
        yield [Cell("proved: ", "green"), Cell(f"{after} {what} no longer hold {proof.against}")]
    else:
        yield [Cell("proved: ", "green"), Cell(f"{after} {what} hold {proof.against}")]
    for note in result.notes:
        yield from wrapped([Cell(f"  {note}")], _WIDTH)
