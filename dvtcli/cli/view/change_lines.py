"""The text of changes, stores and comparisons."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.cli.view.wrap import wrapped
from dvtcli.domain.mapping import PdoMappingEntry
from dvtcli.domain.plan import PdoChange, Step
from dvtcli.domain.proof import RESTART_NAMES, Proof
from dvtcli.domain.several import plural, several
from dvtcli.operations.results.changes import Changed, ChangedNodes, Compared, ComparedNodes, Stored
from dvtcli.operations.results.failures import compared_text

#: characters that a sentence takes of a line, also where no terminal says how wide it is
_WIDTH = 98


def changed_nodes_lines(result: ChangedNodes, width: int) -> Iterator[Line]:
    """Each node's lines, one node after the other."""
    for one in result.nodes:
        yield from change_lines(one, width)


def change_lines(result: Changed, width: int) -> Iterator[Line]:
    """The steps as they were taken, and what became of them."""
    count = len(result.plan)
    labels = several(change.label for change in result.plan.changes)
    labels += f" of node {result.node}" if result.named else ""
    if not count and result.not_put_back:
        yield f"{labels} NOT put back as it was; nothing was written."
        return
    if not count:
        yield f"{labels or 'everything'} is as wanted already; nothing was written."
        return
    table = Table(right=frozenset({0, 2, 4}), shrink=5)
    for number, step in enumerate(result.plan.steps, 1):
        table.add(
            str(number), f"0x{step.object}", _value(step, step.before), "->", _value(step, step.after),
            Cell(_reason(step, result), "dim"), Cell("ok", "green"),
        )  # fmt: skip
    yield from table.lines(width)
    writes = f"{count} write{'' if count == 1 else 's'}"
    if result.dry_run:
        yield [
            Cell("dry run: ", "cyan"),
            Cell(
                f"{_counted(result, labels, 'would be set')}: {writes} on the twin, read back equal. Nothing was sent."
            ),
        ]
        return
    verb = "put back" if result.undone else "set"
    equal = "read back equal"
    if result.not_put_back:
        verb, equal = "NOT put back as it was", "which alone were read back equal"
    keeps = f"In RAM only: {result.keep}" if result.volatile else "The device keeps it by itself"
    next_step = "" if result.undone or result.unknown_before else ", `undo` reverts it"
    if not result.altered:
        keeps, next_step = "It held that before: nothing has changed", ""
    if result.saved:
        keeps, next_step = "By this the device keeps what is set (assumed: nobody published it)", ""
    yield [
        Cell(f"{_counted(result, labels, verb)}: {writes}, {equal}, {result.seconds:.2f} s. "),
        Cell(f"{keeps}{next_step}.", "dim"),
    ]


def _counted(result: Changed, labels: str, verb: str) -> str:
    """What was changed with what became of it; many are counted before some of them are named."""
    changes = result.plan.changes
    if several(change.label for change in changes) == ", ".join(change.label for change in changes):
        return f"{labels} {verb}"
    noun = "PDO" if all(isinstance(change, PdoChange) for change in changes) else "change"
    return f"{plural(len(changes), noun)} {verb} ({labels})"


def _value(step: Step, data: bytes | None) -> str:
    """A step's value; one that is an object's index in hexadecimal, as the field writes it."""
    if data is None:
        return "-"
    return f"0x{int.from_bytes(data, 'little'):04X}" if step.names_object else shown(data)


def shown(data: bytes) -> str:
    """A step's value as the field writes it: words in hex, counts and times decimal."""
    value = int.from_bytes(data, "little")
    return f"0x{value:08X}" if len(data) == 4 else str(value) if len(data) <= 2 else data.hex(" ").upper()


def _reason(step: Step, result: Changed) -> str:
    if len(step.after) != 4 or not step.reason.startswith("map "):
        return step.reason
    entry = PdoMappingEntry.from_raw(int.from_bytes(step.after, "little"))
    name = result.names.get(entry.object, "")
    return f"{entry.object}/{entry.bits} {name}".rstrip()


def stored_lines(result: Stored, _width: int) -> Iterator[Line]:
    """Where the signature went, what it keeps, and what the proof showed."""
    word = "save" if result.word == "store" else "load"
    if result.skipped:
        yield f"not stored, since {result.skipped}"
        return
    if result.because:
        yield [Cell(f"stored all the same: {result.because}", "dim")]
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
            "To check: store --prove" if result.word == "store" else "Defaults come with the next reset: nmt reset-node"
        )
        yield f"{result.word}d, {took}. {check}"
        return
    yield took
    if proof.canary:
        yield [Cell(f"changed in RAM after that, to see what a {RESTART_NAMES[proof.by]} takes: {proof.canary}", "dim")]
    if proof.lost and result.word == "store":
        yield [Cell(f"not stored, and lost by the {RESTART_NAMES[proof.by]}: {several(proof.lost)}", "yellow")]
    yield from _shown_by(result, proof)


def _shown_by(result: Stored, proof: Proof) -> Iterator[Line]:
    """What the restart showed; what to do where that is nothing is said by the answer's failure."""
    what, after = compared_text(proof), f"after the {RESTART_NAMES[proof.by]}"
    stored = result.word == "store"
    if proof.differences:
        yield [
            Cell("NOT KEPT: " if stored else "NOT RESTORED: ", "red"),
            Cell(f"{after} the node differs from {proof.against}:"),
        ]
        yield from (f"  {text}" for text in proof.differences)
    elif proof.unproved:
        yield [Cell("NOT PROVED: ", "red"), Cell(f"{proof.unproved}.")]
    elif stored:
        gone = ", and what was changed for the test was gone" if proof.canary else ""
        yield [Cell("proved: ", "green"), Cell(f"{after} {what} read back equal{gone}")]
    elif proof.against == "what was stored before":
        yield [Cell("proved: ", "green"), Cell(f"{after} {what} no longer hold {proof.against}")]
    else:
        yield [Cell("proved: ", "green"), Cell(f"{after} {what} hold {proof.against}")]
    for note in result.notes:
        yield from wrapped([Cell(f"  {note}")], _WIDTH)


def compared_nodes_lines(result: ComparedNodes, width: int) -> Iterator[Line]:
    """Each node's lines, one node after the other."""
    for one in result.nodes:
        yield from compared_lines(one, width)


def compared_lines(result: Compared, _width: int) -> Iterator[Line]:
    """What reads back equal, and every difference."""
    where = f" of node {result.node}" if result.named else ""
    for label, difference in result.differences:
        yield [Cell(f"  {label}{where}  ", "red"), Cell(difference)]
    what = _compared_text(result)
    if result.differences:
        differing = len({label for label, _ in result.differences})
        yield f"{differing} of {what}{where} differ{'s' if differing == 1 else ''} from {result.against}"
    else:
        yield f"read back   {plural(result.parameters, 'parameter')} of {what}{where} equal to {result.against}"
    yield from _frame_lines(result, where)
    if result.state_note:
        yield f"            {result.state_note}"


def _compared_text(result: Compared) -> str:
    objects = plural(result.objects, "object")
    if not result.objects:
        return plural(result.pdos, "PDO")
    return f"{plural(result.pdos, 'PDO')} and {objects}" if result.pdos else objects


def _frame_lines(result: Compared, where: str) -> Iterator[Line]:
    if result.frame_asked and not result.frames:
        yield [Cell("on the bus  "), Cell(f"no enabled TPDO{where} that could send a frame", "yellow")]
    for pdo, frame, milliseconds in result.frames:
        if frame is None:
            yield [Cell(f"on the bus  {pdo}{where}: "), Cell(f"no frame within {milliseconds:.0f} ms", "yellow")]
        else:
            data = frame.data.hex(" ").upper()
            after = f"after {milliseconds:.1f} ms"
            yield f"on the bus  {pdo}{where}: 0x{frame.can_id:03X} [{len(frame.data)}] {data} {after}"
