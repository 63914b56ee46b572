"""The text of changes, stores and restores."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line, Table, wrapped
from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.pdo import Pdo, PdoMappingEntry
from dvtcli.domain.plan import Change, PdoChange, Step, ValueChange, step_text
from dvtcli.domain.process_data import answers_with_state
from dvtcli.domain.text import join_some, plural
from dvtcli.operations.results.failures import compared_text

if TYPE_CHECKING:
    from dvtcli.domain.store import Proof
    from dvtcli.operations.results import Changed, ChangedNodes, Stored


def changed_nodes_lines(result: ChangedNodes, width: int) -> Iterator[Line]:
    """Show each node's lines, one node after another."""
    for node in result.nodes:
        yield from applied_lines(node, width)


def applied_lines(result: Changed, width: int) -> Iterator[Line]:
    """Show the executed steps and their outcome."""
    count = len(result.plan)
    labels = join_some(_written(result))
    labels += f" of node {result.node}" if result.named else ""
    if not count and result.not_put_back:
        yield f"{labels} NOT undone completely; nothing was written."
        return
    if not count and result.unrestored:
        others = f"; {labels} {_is(result)} already as requested" if result.plan.changes else ""
        yield f"{_unrestored(result)}{others}; nothing was written."
        return
    if not count:
        yield f"{labels or 'everything'} {_is(result)} already as requested; nothing was written."
        return
    table = Table(right=frozenset({0, 2, 4}), shrink=5)
    for number, step in enumerate(result.plan.steps, 1):
        table.add(
            str(number), f"0x{step.object}", _value(result, step, step.before), "->", _value(result, step, step.after),
            Cell(_reason(step, result), "dim"), Cell("ok", "green"),
        )  # fmt: skip
    yield from table.lines(width)
    writes = f"{count} write{'' if count == 1 else 's'}"
    if result.dry_run:
        verb = "would be rolled back" if result.undone else "would be set"
        set_on_twin = f"{_counted(result, labels, verb)}: {writes} on the twin, {_read_back(result)}"
        yield [Cell("dry run: ", "cyan"), Cell(f"{set_on_twin}. Nothing was sent.")]
        return
    yield from _outcome_lines(result, labels, writes)


def _outcome_lines(result: Changed, labels: str, writes: str) -> Iterator[Line]:
    """Show the outcome of *labels* with their number of *writes*, how they are stored, and how to revert them."""
    verb = "rolled back" if result.undone else "set"
    equal = _read_back(result)
    others = (f"{_unrestored(result)}. " if result.unrestored else "") + _others(result)
    if result.not_put_back:
        verb, equal = "NOT undone completely", "which alone were read back equal"
    is_final = result.undone or result.unknown_before or not result.remembered or not result.altered or result.saved
    yield [
        Cell(f"{_counted(result, labels, verb)}: {writes}, {equal}, {result.seconds:.2f} s. {others}"),
        Cell(f"{kept_text(result)}{'' if is_final else ', `undo` reverts it'}.", "dim"),
    ]


def kept_text(result: Changed) -> str:
    """Say whether the device keeps the change without power, and what stores it if not."""
    if result.saved:
        return "This write makes the device store its settings (assumed: not published)"
    if not result.altered:
        return "It had this value before: nothing has changed"
    if not result.volatile:
        return "The device stores it on its own"
    return (
        "As before the change, which dvtcli did not store" if result.as_before else f"In RAM only: {typed(result.keep)}"
    )


def _unrestored(result: Changed) -> str:
    """Name objects that keep a new value despite the roll-back."""
    of_node = f" of node {result.node}" if result.named else ""
    return f"{join_some(result.unrestored)}{of_node} NOT rolled back: the earlier values are not known"


def _read_back(result: Changed) -> str:
    """Say how many writes read back equal, and name the unreadable objects."""
    count = len(result.unreadable)
    if not count:
        return "read back equal"
    states = all(answers_with_state(int(place[:4], 16)) for place in result.unreadable)
    words = any(finding.rule == "write-only" and "control word" in finding.text for finding in result.findings)
    why = "it reads back a state, not the written value" if states or words else "write-only: nothing can be read back"
    read = len(result.plan) - count
    return f"acknowledged; {why}" if not read else f"{read} read back equal, {count} acknowledged; {why}"


def _written(result: Changed) -> list[str]:
    """Return labels for the answer; for an undo those actually written, if any."""
    changes = result.plan.changes
    written = [change for change in changes if change.steps] if result.undone else []
    return _labels(result, written or changes)


def _labels(result: Changed, changes: Sequence[Change]) -> list[str]:
    """Return each label once; entries beyond the count of a restored PDO go by the PDO's name."""
    pdos = {change.pdo for change in result.plan.changes if isinstance(change, PdoChange)}
    names = []
    for change in changes:
        pdo = Pdo.at(change.step.index) if isinstance(change, ValueChange) else None
        names.append(change.label if pdo is None or pdo not in pdos else pdo.label)
    return list(dict.fromkeys(names))


def _is(result: Changed) -> str:
    return "are" if len(_written(result)) > 1 else "is"


def _counted(result: Changed, labels: str, verb: str) -> str:
    """Return the changes with their outcome; many are counted, with a few names."""
    names = _written(result)
    if join_some(names) == ", ".join(names):
        return f"{labels} {verb}"
    noun = "change" if any(":" in name for name in names) else "PDO"
    return f"{plural(len(names), noun)} {verb} ({labels})"


def _others(result: Changed) -> str:
    """Return the number of further PDOs and objects checked during an undo."""
    written = _written(result)
    others = [label for label in _labels(result, result.plan.changes) if label not in written]
    pdos = sum(":" not in label for label in others)
    counted = ((pdos, "more PDO"), (len(others) - pdos, "other object" if pdos else "more object"))
    text = " and ".join(plural(count, noun) for count, noun in counted if count)
    return f"{text} {'is' if len(others) == 1 else 'are'} as before. " if others else ""


def _value(result: Changed, step: Step, data: bytes | None) -> str:
    """Return a step's value with its meaning, if known."""
    return step_text(step, data, result.understood.get(step.object))


def _reason(step: Step, result: Changed) -> str:
    if len(step.after) != 4 or not step.reason.startswith("map "):
        return step.reason
    entry = PdoMappingEntry.from_raw(int.from_bytes(step.after, "little"))
    name = result.names.get(entry.object, "")
    return f"{entry.object}/{entry.bits} {name}".rstrip()


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
        yield [Cell(f"test value in RAM, which the {proof.restart} must discard: {proof.canary}", "dim")]
    if proof.lost and result.word == "store":
        yield [Cell(f"not stored, and lost by the {proof.restart}: {join_some(proof.lost)}", "yellow")]
    yield from _shown_by(result, proof)


def _shown_by(result: Stored, proof: Proof) -> Iterator[Line]:
    """Show the result of the restart; a failed proof's remedy is in the error."""
    what, after = compared_text(proof), f"after the {proof.restart}"
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
