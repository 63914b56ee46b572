"""The text of nodes, NMT commands, SYNC and `doctor`, and of answers that have their own lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Protocol

from dvtcli.cli.view.lines import Cell, Line, Table, clipped, columns, part, squeezed
from dvtcli.domain.can_ids import SYNC_ID
from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.emergency_codes import register_words
from dvtcli.domain.hint import Hint
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.profile import GENERIC
from dvtcli.domain.text import all_nodes, plural, safe
from dvtcli.domain.times import local_clock
from dvtcli.operations.results.facts import Diagnosis, DvtAnswer
from dvtcli.operations.results.nodes import FaultRow, Faults, FaultSeen, LoggedIn

if TYPE_CHECKING:
    from dvtcli.operations.results import Commanded, NodeListing, NodeRow, SyncCheck, Synced, SyncSource
    from dvtcli.operations.results.nodes import ProgramLoaded


def program_lines(result: ProgramLoaded, _width: int) -> Iterator[Line]:
    """Show the running program, and the evidence."""
    what = f"program {result.number} of node {result.node}"
    if result.dry_run:
        new = f"load {result.file} ({result.size:,} bytes) and start it"
        yield [Cell("dry run: ", "cyan"), Cell(f"would stop and clear {what}, {new}. Nothing was sent.")]
        return
    seen = "its boot-up message was received" if result.restarted else "it answers so; no boot-up message was received"
    yield f"{what}: {result.file}, {result.size:,} bytes in {result.seconds:.1f} s, runs: {seen}"
    yield f"  0x1F56 says {_said(result.after)} (before: {_said(result.before)}){_compared(result)}"


def _said(identification: int | None) -> str:
    return "nothing" if identification is None else f"0x{identification:08X}"


def _compared(result: ProgramLoaded) -> str:
    if result.expected is None:
        return ": not compared; use --expect to compare"
    return f", as profile {result.expected_by} expects" if result.expected_by else ", as expected"


def login_lines(result: LoggedIn, _width: int) -> Iterator[Line]:
    """Show the node's access level and its rights."""
    if result.dry_run:
        yield [
            Cell("dry run: ", "cyan"),
            Cell("the twin accepts any passcode; none was asked for. Nothing was sent."),
        ]
    elif not result.wanted:
        yield f"node {result.node} logged out: access level {result.level}"
    else:
        yield [Cell(f"node {result.node} is at access level {result.level}"), Cell(f": {result.allows}", "dim")]


_STATE_STYLES = {
    NmtState.OPERATIONAL.label: "green",
    NmtState.PRE_OPERATIONAL.label: "yellow",
    NmtState.STOPPED.label: "red",
}
#: short names of states, as in the prompt
_SHORT = {state.label: state.short for state in NmtState} | {"state unknown": "unknown", "no heartbeat": "no HB"}
#: Minimum columns of a node's name and a file's name, to remain distinguishable.
_NAME, _FILE = 8, 16


def node_lines(result: NodeListing, width: int) -> Iterator[Line]:
    """Show the nodes found, or the details of a single node."""
    if result.detail and result.rows:
        yield from _node_detail(result.rows[0])
        return
    if result.rows:
        yield from _listed(result.rows, width)
    yield from _files_of_others(result)
    noted = [row for row in result.rows if row.note]
    yield from ([Cell(f"  {row.note}", "yellow")] for row in noted)
    if noted:
        yield [Cell("  scan --wait 500 gives each node more time", "dim")]
    count = len(result.rows)
    what = f"{count} node{'' if count == 1 else 's'} on {result.bus}, {result.seconds:.1f} s."
    yield what + (
        f" Select one: node {result.rows[0].node}" if result.rows else " Is the bit rate right? Is the bus powered?"
    )


def _listed(rows: Sequence[NodeRow], width: int) -> Iterator[Line]:
    """Show a line per node; the file's name goes to a second line if space is short."""
    table = Table(("NODE", "STATE", "TYPE", "VENDOR", "PRODUCT", ""), frozenset({0}))
    for row in rows:
        table.add(
            str(row.node), Cell(_SHORT.get(row.state, row.state), _STATE_STYLES.get(row.state, "")),
            _word(row.device_type), _word(row.vendor_id), _word(row.product_code), "",
        )  # fmt: skip
    names, files = ["NAME", *(safe(row.name or "-") for row in rows)], [Cell("KNOWN BY", "dim"), *map(_known_by, rows)]
    lines = [list(line) for line in table.lines()]
    room = width - sum(columns(cell.text) for cell in lines[0])
    name_width, file_width = _shared(room, max(map(columns, names)), max(columns(cell.text) for cell in files))
    for line, name, file in zip(lines, names, files, strict=True):
        shown = clipped(name, name_width)
        line.append(Cell(shown, line[1].style if line is lines[0] else ""))
        if file_width:
            gap = Cell(" " * (name_width - columns(shown) + 2))
            yield [*line, gap, Cell(_squeezed(file.text, file_width), file.style)]
            continue
        yield line
        if line is not lines[0] and file.text != "-":
            yield [Cell(f"{'':8}known by ", "dim"), Cell(_squeezed(file.text, width - 17), file.style)]


def _squeezed(file: str, width: int) -> str:
    """Return the file's name in *width* columns, with the profile uncut if possible."""
    profile, colon, name = file.rpartition(": ")
    return squeezed(f"{profile}{colon}{squeezed(name, max(_NAME, width - columns(profile + colon)))}", width)


def _shared(room: int, name: int, file: int) -> tuple[int, int]:
    """Divide *room* columns between *name* and *file*; 0 for a file means a second line."""
    name_width = max(min(name, _NAME), min(name, max(room - 2 - file, (room - 2) // 3)))
    file_width = min(file, room - 2 - name_width)
    return (name_width, file_width) if file_width >= min(file, _FILE) else (max(min(name, _NAME), min(name, room)), 0)


def _known_by(row: NodeRow) -> Cell:
    """Return the file that names the node's objects, after the profile with its rules."""
    from dvtcli.files.device_library import label_of

    if not row.source and not row.profile:
        return Cell("-")
    profile = "" if row.profile in ("", GENERIC.name) else f"{row.profile}: "
    return Cell(f"{profile}{label_of(row.source)}") if row.source else Cell(f"{profile}no EDS", "yellow")


def _files_of_others(result: NodeListing) -> Iterator[Line]:
    """Show notes on the nodes' files, merged for nodes with the same note, and nodes without a file."""
    unknown = [str(row.node) for row in result.rows if not row.source and not row.note]
    if unknown:
        yield [Cell(f"  no EDS for {all_nodes(unknown)}: `eds add FILE`, or --eds FILE", "dim")]
    said: dict[str, list[str]] = {}
    for row in result.rows:
        if row.eds_note:
            said.setdefault(row.eds_note, []).append(str(row.node))
    for note, nodes in said.items():
        yield [Cell(f"  {all_nodes(nodes)}: {note}", "yellow")]


def _word(value: int | None) -> str:
    return "-" if value is None else f"0x{value:08X}"


def _node_detail(row: NodeRow) -> Iterator[Line]:
    yield [
        Cell(f"node {row.node}", "bold"),
        Cell(f"  {row.name}"),
        Cell(f"  {row.state}", _STATE_STYLES.get(row.state, "")),
    ]
    facts = (
        ("device type", _word(row.device_type)), ("vendor", _word(row.vendor_id)),
        ("product", _word(row.product_code)), ("revision", _word(row.revision)), ("serial", _word(row.serial)),
        ("profile", row.profile), ("EDS", row.source or "none: --eds FILE names its objects"),
        ("EDS by", _found_by(row)), ("EDS note", row.eds_note), ("note", row.note),
    )  # fmt: skip
    for label, value in facts:
        if value:
            yield [Cell(f"  {label:<12}", "dim"), Cell(value)]


def _found_by(row: NodeRow) -> str:
    """Return the reason for the choice of the file, if not obvious."""
    from dvtcli.operations.session.simulated_nodes import SIMULATED

    return "" if row.eds_why == SIMULATED else row.eds_why


def commanded_lines(result: Commanded, _width: int) -> Iterator[Line]:
    """Show an NMT command and each node's state."""
    dry = Cell(" (dry run: nothing was sent)" if result.dry_run else "", "cyan")
    if result.node:
        state = result.states[0][1]
        yield [Cell(f"NMT {result.command} to node {result.node}: "), *_seen(result, state), dry]
        return
    known = plural(len(result.states), "node") if result.states else "no node is seen: state not confirmed"
    yield [Cell(f"NMT {result.command} to all nodes: {known}"), dry]
    for node, state in result.states:
        yield [Cell(f"  node {node}: "), *_seen(result, state)]


def _seen(result: Commanded, state: str | None) -> list[Cell]:
    if state is None:
        return [Cell("state not confirmed (no heartbeat)", "yellow")]
    if result.wanted in (None, state):
        return [Cell(state, _STATE_STYLES.get(state, ""))]
    return [Cell(state, "red"), Cell(f", not {result.wanted} as commanded")]


def synced_lines(result: Synced, width: int) -> Iterator[Line]:
    """Show the number of SYNCs sent, and the frames received."""
    dry = " (dry run: nothing was sent)" if result.dry_run else ""
    came = sum(count for _, count, _ in result.frames)
    with_id = (
        ""
        if result.can_id == SYNC_ID
        else f" with CAN-ID {can_id_text(result.can_id, extended=result.extended)} (the node's 0x1005)"
    )
    yield f"{plural(result.count, 'SYNC')} sent{with_id}{dry}, {plural(came, 'frame')} came"
    table = Table(("COB-ID", "WHAT", "FRAMES", "LAST DATA"), frozenset({2}))
    for frame, count, label in result.frames:
        table.add(
            can_id_text(frame.can_id, extended=frame.extended), label or "-", str(count), frame.data.hex(" ").upper()
        )
    if result.frames:
        yield from table.lines(width)
    elif result.note:
        yield result.note


def sync_check_lines(result: SyncCheck, _width: int) -> Iterator[Line]:
    """Show each node's SYNC settings, and the number of SYNCs received."""
    yield from (_source_text(source) for source in result.nodes)
    yield f"on the bus: {result.heard or 'no'} SYNC in {result.listened_ms} ms"


def _source_text(source: SyncSource) -> str:
    word = "no 0x1005" if source.cob_id is None else f"0x1005 = 0x{source.cob_id:08X}"
    period = "no 0x1006" if source.period_us is None else f"0x1006 = {source.period_us / 1000:g} ms"
    does = "produces SYNC" if source.produces else "does not produce SYNC"
    can_id = can_id_text(source.can_id, extended=source.extended)
    return f"node {source.node}  {does} {can_id} ({word}, {period})"


_SOURCES = {"active": "active now", "history": "history", "heard": "EMCY received"}


def fault_lines(result: Faults, width: int) -> Iterator[Line]:
    """Show a node's errors with remedies, and its error register."""
    yield from _remembered(result)
    if result.rows:
        table = Table(("WHERE", "CODE", "MEANING", "COUNT", "LAST", "MORE"), frozenset({3}), shrink=2)
        for row in result.rows:
            count = "" if row.count is None else str(row.count)
            table.add(_SOURCES[row.source], f"0x{row.code:04X}", Cell(row.text, "bold"), count, _at(row), _more(row))
        yield from table.lines(width)
        yield from _remedies(result.rows)
    yield _register(result)


def _remembered(result: Faults) -> Iterator[Line]:
    who = f"node {result.node} ({result.name})"
    if result.cleared:
        what = f"held {len(result.rows)}" if result.rows else "was empty already"
        end = " on its twin; the node itself was not changed" if result.dry_run else ", read back"
        yield f"{who}: the error history {what}, and is empty now{end}"
    elif result.rows:
        yield f"{who}: errors, newest first"
    else:
        yield f"{who}: no error is reported and no EMCY was received"
    if not result.has_history:
        yield "it has no error history (0x1003)"


def _register(result: Faults) -> Line:
    if result.register is None:
        return "it has no error register (0x1001)"
    words = ", ".join(result.register_words) or "no error now"
    still = (
        ": still wrong; clearing the history does not remove the cause" if result.cleared and result.register else ""
    )
    return [
        Cell(f"error register 0x{result.register:02X}: "),
        Cell(words, "bold" if result.register else ""),
        Cell(still),
    ]


def _remedies(rows: Iterable[FaultRow]) -> Iterator[Line]:
    """Show the remedy once per error code."""
    for code, remedy in {row.code: row.remedy for row in rows if row.remedy}.items():
        yield [Cell(f"  0x{code:04X}: ", "dim"), part(remedy)]


def _at(row: FaultRow) -> str:
    return "" if row.last_s is None else local_clock(row.last_s, "milliseconds")


def _more(row: FaultRow) -> str:
    """Return the manufacturer's bytes unless 0."""
    if row.information:
        return f"0x{row.information:04X}"
    return row.manufacturer.hex(" ").upper() if row.manufacturer and any(row.manufacturer) else ""


def fault_seen_lines(result: FaultSeen, _width: int) -> Iterator[Line]:
    """Show an EMCY message with local time and meaning, and with the remedy on first occurrence."""
    fault = result.fault
    register = ", ".join(register_words(fault.register or 0)) or "no error now"
    more = _more(fault)
    yield [
        Cell(f"{_at(fault)}  ", "dim"),
        Cell(f"node {result.node:<3}  0x{fault.code:04X}  "),
        Cell(fault.text, "bold"),
        Cell(f"  register 0x{fault.register or 0:02X}: {register}"),
        Cell(f"  {more}" if more else ""),
        Cell(f"  ({fault.count} times)" if (fault.count or 0) > 1 else "", "dim"),
    ]
    if fault.remedy and fault.count == 1:
        yield [Cell(" " * 14), part(fault.remedy)]


class HasLines(Protocol):
    """An answer with its own lines."""

    @property
    def text(self) -> Sequence[Hint | str]:
        """A line each."""
        ...


def text_lines(result: HasLines, _width: int) -> Iterable[Line]:
    """The lines as they are."""
    return result.text


def answer_lines(result: DvtAnswer, _width: int) -> Iterable[Line]:
    """Show a word's answer alone, as the DVT prints it, in rows if it has several."""
    return result.rows or (result.answer,)


_STYLES = {"ok": "green", "warn": "yellow", "FAIL": "red"}


def diagnosis_lines(result: Diagnosis, _width: int) -> Iterator[Line]:
    """Show a line per check with its next step, and the sum."""
    for check in result.checks:
        yield [Cell(f"{check.verdict:<4}", _STYLES[check.verdict]), Cell(f"  {check.name:<11} {check.text}")]
        if check.hint:
            hint = check.hint
            yield [Cell(" " * 18), Cell(hint, "dim") if isinstance(hint, str) else hint]
    count = {verdict: sum(check.verdict == verdict for check in result.checks) for verdict in _STYLES}
    yield f"{count['ok']} ok, {plural(count['warn'], 'warning')}, {count['FAIL']} failed"
