"""The text of changes, stores and comparisons."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.mapping import PdoMappingEntry
from dvtcli.domain.plan import Step
from dvtcli.domain.several import several
from dvtcli.results.changes import Changed, Compared, Stored
from dvtcli.view.lines import Cell, Line, Table


def change_lines(result: Changed, width: int) -> Iterator[Line]:
    """The steps as they were taken, and what became of them."""
    count = len(result.plan)
    labels = several(change.label for change in result.plan.changes)
    if not count:
        yield f"{labels} is as wanted already; nothing was written."
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
            Cell(f"{labels} would be set: {writes} on the twin, read back equal. Nothing was sent."),
        ]
        return
    verb = "put back" if result.undone else "set"
    keeps = f"In RAM only: {result.keep}" if result.volatile else "The device keeps it by itself"
    next_step = "" if result.undone else ", `undo` reverts it"
    if result.saved:
        keeps, next_step = "By this the device keeps what is set (assumed: nobody published it)", ""
    yield [
        Cell(f"{labels} {verb}: {writes}, read back equal, {result.seconds:.2f} s. "),
        Cell(f"{keeps}{next_step}.", "dim"),
    ]


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
    if result.word == "store":
        changed = ", ".join(result.changed) or "nothing by dvtcli"
        yield f'0x{result.object} <- "{word}"     changed since the last store: {changed}'
    else:
        yield f'0x{result.object} <- "{word}"'
    if result.dry_run:
        yield [Cell("dry run: ", "cyan"), Cell("on the twin only, nothing was sent")]
        return
    yield from _outcome(result)


def _outcome(result: Stored) -> Iterator[Line]:
    took = f"acknowledged after {result.seconds:.2f} s (limit {result.limit_s:.0f} s)"
    if result.word == "restore":
        done = (
            f"The node was reset ({result.reset}) and holds its defaults."
            if result.reset
            else ("Defaults come with the next reset: nmt reset-node")
        )
        yield f"restored, {took}. {done}"
    elif result.proved is None:
        yield f"stored, {took}. To check: store --prove"
    elif result.differences:
        yield [Cell("NOT KEPT: ", "red"), Cell("after the reset the node differs from what was stored:")]
        yield from (f"  {text}" for text in result.differences)
    else:
        yield f"stored, {took}. Proved: after a reset {result.proved} PDOs read back equal."


def compared_lines(result: Compared, _width: int) -> Iterator[Line]:
    """What reads back equal, and every difference."""
    for pdo, difference in result.differences:
        yield [Cell(f"  {pdo}  ", "red"), Cell(difference)]
    if not result.pdos:
        yield "nothing to compare: this session changed no PDO; name a PDO that was mapped, or a file"
        return
    plural = "" if result.pdos == 1 else "s"
    if result.differences:
        differing = len({pdo for pdo, _ in result.differences})
        yield f"{differing} of {result.pdos} PDO{plural} differ{'s' if differing == 1 else ''} from {result.against}"
    else:
        yield f"read back   {result.parameters} parameters of {result.pdos} PDO{plural} equal to {result.against}"
    for pdo, frame, milliseconds in result.frames:
        if frame is None:
            yield [Cell(f"on the bus  {pdo}: "), Cell(f"no frame within {milliseconds:.0f} ms", "yellow")]
        else:
            data = frame.data.hex(" ").upper()
            yield f"on the bus  {pdo}: 0x{frame.can_id:03X} [{len(frame.data)}] {data} after {milliseconds:.1f} ms"
    if result.state_note:
        yield f"            {result.state_note}"
