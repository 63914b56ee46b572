"""The text of `learn`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.abort import abort_text
from dvtcli.domain.learning.probe import IN_OPERATIONAL, Value
from dvtcli.domain.text import join_some
from dvtcli.operations.results.learnt import HabitListing, LearnForecast, LearntDevice, Wanted


def habit_lines(result: HabitListing, width: int) -> Iterator[Line]:
    """Show forgotten habits, then a line per setting accepted only in a certain PDO or node state."""
    if result.forgotten:
        yield f"forgotten: the recorded needs of {join_some(result.forgotten)}"
    if not result.rows:
        yield "no needs of devices are recorded"
        return
    table = Table(("VENDOR-PRODUCT-REVISION", "REFUSED", "TIMES", "SO"), shrink=1)
    for row in result.rows:
        for wanted in row.wanted:
            so = "disabled first" if wanted.counts else "tried first"
            table.add(Cell(row.name, "bold"), _refused(wanted), str(wanted.times), so)
        for state in row.pre_operational:
            so = "PRE-OPERATIONAL first" if state.counts else "tried first"
            refused = f"PDO writes while it is OPERATIONAL, 0x{state.abort:08X}"
            table.add(Cell(row.name, "bold"), refused, str(state.times), so)
        if row.problem:
            table.add(Cell(row.name, "bold"), Cell(row.problem, "yellow"), "", "tried first")
    yield from table.lines(width)
    yield [Cell(f"saved in {result.folder}; profiles forget NAME deletes it", "dim")]


def _refused(wanted: Wanted) -> str:
    """Return the parameter by its place, and the refusal."""
    base = "0x1800" if wanted.direction == "tpdo" else "0x1400"
    return f"{base}:{wanted.sub_index:02X} and similar parameters while the PDO is on, 0x{wanted.abort:08X}"


#: Maximum number of questions to name for a reason.
_NAMED = 4
_ABSENT = "absent."


def learnt_lines(result: LearntDevice, width: int) -> Iterator[Line]:
    """Show accepted values, answers to other values, and the files written."""
    yield [Cell(f"node {result.node}", "bold"), Cell(f"  {result.title}: what it accepts")]
    table = Table(("VALUE", "LEARNT", "EVIDENCE"), shrink=2)
    for learnt in result.conclusions.profile:
        table.add(learnt.key, value_text(learnt.value), Cell(_short(learnt.evidence), "dim"))
    yield from table.lines(width)
    yield from _answer_lines(result, width)
    yield from _lacking(result, width)
    yield from _not_learnt(result)
    yield from _compared(result, width)
    labels = " and ".join(pdo.upper() for pdo in result.pdos)
    count = sum(answer.code is not None for answer in result.answers)
    yield (
        f"{count} questions, {result.writes} writes to {labels}, {result.seconds:.1f} s; everything is rolled back and "
        "read back equal"
    )
    yield from _saving(result)
    for path in result.saved:
        yield f"written: {path}"
    if result.saved:
        yield _use(result)


def _use(result: LearntDevice) -> str:
    """Say which nodes use the saved profile."""
    if result.identified:
        return "from now on nodes with its identity use the last file; delete the file to revert this"
    name = Path(result.saved[-1]).stem
    return f"it has no vendor-ID (0x1018:01), so no node uses the last file automatically: -p {name} selects it"


def _answer_lines(result: LearntDevice, width: int) -> Iterator[Line]:
    table = Table(("CHECK", "TPDO", "RPDO", "ABORT"), shrink=3)
    codes: dict[str, dict[str, int]] = {}
    for learnt in result.conclusions.family:
        table_name, _, check = learnt.key.rpartition(".")
        if table_name.startswith("answers.") and isinstance(learnt.value, int):
            codes.setdefault(check, {})[table_name.removeprefix("answers.")] = learnt.value
    if not codes:
        return
    yield ""
    for check, by_way in codes.items():
        cells = [_code(by_way.get(way)) for way in ("tpdo", "rpdo")]
        said = next((abort_text(code) for code in by_way.values() if code), "")
        table.add(check, *cells, Cell(said, "dim"))
    yield from table.lines(width)


def _code(code: int | None) -> str:
    if code is None:
        return "-"
    return f"0x{code:08X}" if code else "accepted"


def _lacking(result: LearntDevice, width: int) -> Iterator[Line]:
    """Show objects in the EDS that the device lacks."""
    codes: dict[int, list[str]] = {}
    for learnt in result.conclusions.family:
        if learnt.key.startswith(_ABSENT) and isinstance(learnt.value, int):
            codes.setdefault(learnt.value, []).append(f"0x{learnt.key.removeprefix(_ABSENT)}")
    if not codes:
        return
    table = Table(("NOT THERE, THOUGH IN THE EDS", "ABORT", "MEANING"), shrink=2)
    for code, names in codes.items():
        for first in range(0, len(names), _NAMED):
            row = " ".join(names[first : first + _NAMED])
            table.add(row, f"0x{code:08X}", Cell(abort_text(code), "dim"))
    yield ""
    yield from table.lines(width)


def _not_learnt(result: LearntDevice) -> Iterator[Line]:
    reasons: dict[str, dict[str, None]] = {}
    for answer in result.not_learnt:
        reasons.setdefault(answer.why, {})[answer.probe.name] = None
    if reasons:
        yield ""
    for why, names in reasons.items():
        state = IN_OPERATIONAL if all(name.endswith(IN_OPERATIONAL) for name in names) else ""
        first, more = [name.removesuffix(state) for name in names][:_NAMED], len(names) - _NAMED
        said = ", ".join(first) + (f" and {more} more" if more > 0 else "") + state
        yield [Cell("not learnt: ", "yellow"), Cell(f"{said}: {why}")]


def _compared(result: LearntDevice, width: int) -> Iterator[Line]:
    if result.compared is None:
        return
    name, differences = result.compared
    yield ""
    if not differences:
        yield f"no difference from the profile {name}"
        return
    yield f"it differs from the profile {name}:"
    table = Table(("VALUE", "PROFILE", "LEARNT", "EVIDENCE"), shrink=3)
    for difference in differences:
        said = "-" if difference.said is None else value_text(difference.said)
        table.add(
            difference.key, said, value_text(difference.learnt.value), Cell(_short(difference.learnt.evidence), "dim")
        )
    yield from table.lines(width)


def _saving(result: LearntDevice) -> Iterator[str]:
    """Show the result of --with-store."""
    for answer in result.answers:
        if answer.probe.pdo is None and answer.code is not None:
            said = f"answered 0x{answer.code:08X} ({abort_text(answer.code)})" if answer.code else "accepted"
            yield f"0x{answer.probe.label}: {answer.probe.name} {said}"
    if any(answer.probe.pdo is None and answer.accepted for answer in result.answers):
        yield "it may boot with its earlier values: not checked by a reset"


def _short(evidence: str) -> str:
    """The first answer, and how many more there are: the profile and the document have them all."""
    first, *more = evidence.split("; ")
    return f"{first} (+{len(more)})" if more else first


def value_text(value: Value) -> str:
    """A learnt value on a screen: ranges as `0..240`."""
    if isinstance(value, list) and value and all(isinstance(bounds, list) and len(bounds) == 2 for bounds in value):
        return ", ".join(f"{bounds[0]}..{bounds[1]}" for bounds in value if isinstance(bounds, list))
    if isinstance(value, list):
        return ", ".join(map(value_text, value)) or "none"
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else str(value)


def forecast_lines(result: LearnForecast, width: int) -> Iterator[Line]:
    """Show every planned probe."""
    table = Table(("PDO", "QUESTION", "WRITE", "NEEDS"), shrink=1)
    for probe in result.probes:
        table.add(probe.label, probe.sense, str(probe.asked), str(probe.where))
    yield from table.lines(width)
    if result.stores:
        yield [Cell("note: ", "yellow"), Cell(result.stores)]
    if any(probe.pdo is None for probe in result.probes):
        yield [Cell("note: ", "yellow"), Cell("from then on the node boots with its values of that moment")]
    yield (
        f"dry run: {result.likely} would write to node {result.node} {result.writes} times at most if it answers as "
        f"its family does, and roll everything back; nothing was sent"
    )
