"""The text of an error: what, where, why, the device's state, and what to do."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Protocol, TypeVar

from dvtcli.cli.view.lines import Cell, Line, columns, part
from dvtcli.cli.view.typed_hints import error_text, typed
from dvtcli.domain.abort import abort_text
from dvtcli.domain.hint import Hint, next_step
from dvtcli.domain.profile import Severity
from dvtcli.domain.rules import Finding
from dvtcli.domain.rules.finding import FileComplaint
from dvtcli.domain.text import all_nodes, join_some, plural, safe
from dvtcli.errors import DvtcliError, InputFileError, LeftChanged, RuleError, State
from dvtcli.operations.results.documents import Document, finding_document

#: maximum length of a line; longer lines are shown around their caret
_LONGEST = 90
_AHEAD = 40


def _complaint_lines(error: InputFileError) -> Iterator[Line]:
    """Show the complaints of *error* with source lines, how many there are, and that nothing was done."""
    for complaint in error.complaints[:_MOST_COMPLAINTS]:
        yield [Cell(f"{complaint.place}: "), Cell("error: ", "red"), Cell(complaint.text, "bold")]
        yield from source_lines(complaint)
    more = f" ({_MOST_COMPLAINTS} shown)" if len(error.complaints) > _MOST_COMPLAINTS else ""
    sentences = [f"{plural(len(error.complaints), 'error')}{more}", f"{error.outcome[:1].upper()}{error.outcome[1:]}"]
    if error.hides_others:
        sentences.append("Further errors may show once these are corrected")
    yield " ".join(f"{sentence}." for sentence in sentences if sentence)


def source_lines(complaint: FileComplaint) -> Iterator[Line]:
    """Show the line of *complaint* and the line before, with a caret; nothing if the text is unknown."""
    if not complaint.source.strip():
        return
    start = max(0, complaint.column - 1 - _AHEAD) if len(complaint.source) > _LONGEST else 0
    before = complaint.before[start : start + _LONGEST]
    if before.strip():
        yield _numbered(complaint.line - 1, before)
    yield _numbered(complaint.line, complaint.source[start : start + _LONGEST])
    ahead = columns(_shown(complaint.source[start : complaint.column - 1]))
    wide = columns(_shown(complaint.source[complaint.column - 1 :][: complaint.width][:_LONGEST]))
    yield [Cell(f"{'':5} | ", "dim"), Cell(" " * ahead), Cell("^" * max(1, wide), "red")]


def _numbered(line: int, text: str) -> Line:
    return [Cell(f"{line:5} | ", "dim"), Cell(_shown(text))]


def _shown(text: str) -> str:
    return safe(text.replace("\t", " "))


#: An error's possible places beside a file or its line.
_OBJECT = re.compile(r"(?:0x)?[0-9A-F]{4}:[0-9A-F]{2}")
_PDO = re.compile(r"[RT]PDO[0-9]{1,3}")
_STATES: dict[State, str] = {
    "unchanged": "unchanged: nothing was written",
    "rolled_back": "rolled back: everything is as before and verified; nothing was stored",
    "left_changed": "LEFT CHANGED: see above",
    "unknown": "unknown: read the device again",
}
#: in a script the lines above may have changed things
_BY_THIS_LINE: dict[State, str] = {
    "unchanged": "unchanged by this line",
    "rolled_back": "rolled back: the changes of this line are reverted, read back equal",
}
#: line and column after a file's name in an error's place
_LINE = re.compile(r":[0-9]+(?::[0-9]+)?$")
#: maximum number of complaints on a screen; documents have more
_MOST_COMPLAINTS = 20
_STYLES = {Severity.ERROR: "red", Severity.WARNING: "yellow", Severity.NOTE: "cyan"}


def error_document(error: DvtcliError, at: str | None = None) -> Document:
    """Return `dvtcli.error/1`; *at* is `FILE:LINE` of the failing script line."""
    place = error.place or ""
    is_object = _OBJECT.fullmatch(place) is not None
    document: Document = {
        "schema": "dvtcli.error/1",
        "exit_code": error.exit_code,
        "error": error.slug,
        "node": error.node,
        "object": place.removeprefix("0x") if is_object else None,
        "file": _file(error),
        "abort": None if error.abort is None else f"0x{error.abort:08X}",
        "text": error_text(error),
        "why": error.why,
        "hint": error.hint,
        "next": next_step(error.hint),
        "state": error.worst_state,
        "nodes": [{"node": node_id, "state": state} for node_id, state in sorted(error.nodes.items())],
        "at": at,
        "stays": list(error.stays),
        "stays_differing": None if error.stays_differing is None else list(error.stays_differing),
        "also": [*(text for label, text in error.details if label == "also"), *map(_one_line, error.others)],
        "done": [text for label, text in error.details if label == "done"],
    }
    if isinstance(error, LeftChanged):
        document["left"] = [
            {
                "node": row.node_id,
                "changed": row.label,
                "object": row.place,
                "holds": None if row.holds is None else row.holds.hex(),
                "before": None if row.before is None else row.before.hex(),
                "text": row.text,
            }
            for row in error.left
        ]
        document["as_before"] = [
            {"node": node_id, "changed": list(labels)} for node_id, labels in error.as_before.items()
        ]
        if error.stores is not None:
            document["stores"] = error.stores.document()
    if isinstance(error, RuleError):
        document["findings"] = [finding_document(finding) for finding in error.findings]
    if isinstance(error, InputFileError | RuleError) and error.complaints:
        document["complaints"] = [
            {"file": complaint.file, "line": complaint.line, "column": complaint.column, "text": complaint.text}
            for complaint in error.complaints
        ]
    return document


def _one_line(error: DvtcliError) -> str:
    """Return the error's text with its hint."""
    return f"{error_text(error)}; {error.hint}" if error.hint else error_text(error)


def _file(error: DvtcliError) -> str | None:
    """Return the error's file, with the line if known."""
    place = error.place or ""
    return None if _OBJECT.fullmatch(place) or _PDO.fullmatch(place) else error.place


def error_lines(error: DvtcliError, at: str | None = None) -> Iterator[Line]:
    """Show the error and those found beside it; *at* is `FILE:LINE` of the failing script line."""
    yield from _error_lines(error, at)
    for other in error.others:
        yield from _error_lines(other, at)
    if error.others:
        yield f"{len(error.others) + 1} lines with errors; no line ran."


def _error_lines(error: DvtcliError, at: str | None) -> Iterator[Line]:
    """Show one error, most important line first."""
    if isinstance(error, InputFileError) and error.complaints:
        yield from _complaint_lines(error)
        yield from _rows([*error.details, *_hint_row(error.hint)])
        return
    if isinstance(error, RuleError) and any(finding.complaint for finding in error.findings):
        yield from _placed_lines(error, at)
        return
    yield [Cell(f"{at}: " if at else ""), Cell("error: ", "red"), Cell(error_text(error), "bold")]
    if isinstance(error, RuleError):
        yield from _rule_lines(error, at)
        return
    left = _left_rows(error) if isinstance(error, LeftChanged) else ()
    rows: list[tuple[str, str | Hint]] = [*left, *error.details]
    file = _file(error)
    if error.exit_code == 4 and file and file != at and _LINE.search(file) and file not in error.text:
        rows.append(("file", file))
    if error.abort is not None:
        rows.append(("abort", f"0x{error.abort:08X}  {abort_text(error.abort)}"))
    rows += [("why", error.why)] if error.why else []
    rows += _hint_row(error.hint)
    if error.exit_code not in (2, 4) or error.stays or error.state_text or error.worst_state != "unchanged":
        rows.append(("state", _state(error, at)))
    if error.traced_by:
        rows.append(("frames", error.traced_by))
    yield from _rows(rows)


def _hint_row(hint: Hint | str | None) -> list[tuple[str, str | Hint]]:
    return [("hint", hint)] if hint else []


def _rows(rows: Iterable[tuple[str, str | Hint]]) -> Iterator[Line]:
    for label, text in rows:
        yield [Cell(f"  {label:<7} ", "dim"), part(text)]


def _left_rows(error: LeftChanged) -> Iterator[tuple[str, str]]:
    """Return changed values, a line per PDO or object."""
    texts: dict[tuple[int, str], list[str]] = {}
    for row in error.left:
        texts.setdefault((row.node_id, row.label), []).append(row.text)
    for (node_id, label), some in texts.items():
        yield "left", f"{label} of node {node_id}: {join_some(some)}"


def _state(error: DvtcliError, at: str | None) -> str:
    """Return the device's state in words; for a script line its own effect, and earlier lines that stay."""
    text = error.state_text or _STATES[error.state]
    if at and error.state_text is None and (error.stays or error.state == "unchanged"):
        text = _BY_THIS_LINE.get(error.state, text)
    others = [str(node_id) for node_id, state in sorted(error.nodes.items()) if state != error.state]
    if others and error.state_text is None:
        text = f"{text}, except for {all_nodes(others)}" if error.node is None else f"node {error.node} {text}"
    if not error.stays:
        return text
    stays = f"the changes of {join_some(error.stays)} stay"
    if error.stays_differing is not None:
        is_held = not error.stays_differing
        stays += (
            ", read back equal" if is_held else f", and differ from the set values: {join_some(error.stays_differing)}"
        )
    return f"{text}; {stays}"


def _rule_lines(error: RuleError, at: str | None) -> Iterator[Line]:
    for complaint in error.complaints[:_MOST_COMPLAINTS]:
        yield from source_lines(complaint)
    for number, finding in enumerate(error.findings):
        if number:
            yield [Cell("  also    ", "dim"), Cell(finding.text)]
        yield [Cell("  rule    ", "dim"), Cell(_rule_text(finding))]
        if finding.hint:
            yield [Cell("  hint    ", "dim"), part(finding.hint)]
    yield from _rows(row for row in error.details if row[0] == "also")
    yield [Cell("  state   ", "dim"), Cell(_state(error, at) + _forced(error))]


def _placed_lines(error: RuleError, at: str | None) -> Iterator[Line]:
    """Show findings by place in the file; then findings without a place."""
    ordered = sorted(_merged(error.findings), key=_line_of)
    for finding in ordered[:_MOST_COMPLAINTS]:
        node = "" if error.node is None or finding.text.startswith("node ") else f"node {error.node}: "
        place = f"{at}: " if at else ""
        place = place if finding.complaint is None else f"{place}{finding.complaint.place}: "
        yield [Cell(place), Cell("error: ", "red"), Cell(f"{node}{finding.text}", "bold")]
        yield from () if finding.complaint is None else source_lines(finding.complaint)
        yield [Cell("  rule    ", "dim"), Cell(_rule_text(finding))]
        if finding.hint:
            yield [Cell("  hint    ", "dim"), part(finding.hint)]
    if len(ordered) > _MOST_COMPLAINTS:
        yield f"{len(ordered)} errors ({_MOST_COMPLAINTS} shown)."
    yield from _rows(row for row in error.details if row[0] == "also")
    yield [Cell("  state   ", "dim"), Cell(_state(error, at) + _forced(error))]


def _merged(findings: Iterable[Finding]) -> Iterator[Finding]:
    """Yield *findings* that say the same at the same place of a file as one, with all objects."""
    same: dict[tuple[str, str, str], list[Finding]] = {}
    for finding in findings:
        place = finding.place if finding.complaint is None else finding.complaint.place
        same.setdefault((place, finding.rule, finding.text), []).append(finding)
    for some in same.values():
        yield replace(some[0], place=join_some(dict.fromkeys(finding.place for finding in some)))


def _line_of(finding: Finding) -> tuple[bool, int]:
    return finding.complaint is None, 0 if finding.complaint is None else finding.complaint.line


def _forced(error: RuleError) -> str:
    """Describe the effect of --force, if applicable."""
    if error.rehearsed or not error.can_force:
        return ""
    return "; --force continues anyway, and writes nothing" if error.only_looked else "; --force sends it anyway"


def _rule_text(finding: Finding) -> str:
    text = f"{finding.rule} at {finding.place}"
    if finding.abort is not None:
        text += f"; the device would answer 0x{finding.abort:08X} ({abort_text(finding.abort)})"
    return text


#: number from which warnings or notes that say the same of several nodes or PDOs of a file are one line
MANY = 3
PDO_CAN_ID = re.compile(r"\b0x[0-9A-F]{3}\b")
_OWN_NODE = re.compile(r"node \d+: ")


class _OfARule(Protocol):
    @property
    def rule(self) -> str: ...


F = TypeVar("F", bound=_OfARule)


def by_cause(findings: Iterable[F], cause: Callable[[F], str], many: int = 1) -> Iterator[list[F]]:
    """Yield *findings* of a rule with equal *cause* together if they are *many*, else each alone at its place."""
    found = [((finding.rule, cause(finding)), finding) for finding in findings]
    causes: dict[tuple[str, str], list[F]] = {}
    for key, finding in found:
        causes.setdefault(key, []).append(finding)
    for key, finding in found:
        if len(causes[key]) < many:
            yield [finding]
        elif causes[key][0] is finding:
            yield causes[key]


def finding_lines(findings: Iterable[Finding]) -> Iterator[Line]:
    """Show tolerated findings; warnings and notes that say the same of places in a file are one line if many."""
    found = list(findings)
    in_file = [each for each in found if each.complaint is not None and each.severity is not Severity.ERROR]
    yield from map(finding_line, (each for each in found if each.complaint is None or each.severity is Severity.ERROR))
    for first, *others in by_cause(in_file, _without_place, MANY):
        lines = dict.fromkeys(str(other.complaint.line) for other in others if other.complaint is not None)
        more = f" ({len(others) + 1} times: also line {', '.join(lines)})" if others else ""
        yield finding_line(replace(first, text=f"{first.text}{more}"))


def _without_place(finding: Finding) -> str:
    """The text and hint of *finding* without its own node, its PDO and the PDO's CAN-ID; all other values remain."""
    text = finding.text[own.end() :] if (own := _OWN_NODE.match(finding.text)) else finding.text
    if finding.pdo is not None:
        can_ids = set(PDO_CAN_ID.findall(text))
        places = [finding.pdo.label, *(can_ids if len(can_ids) == 1 else ())]
        text = re.sub(rf"\b(?:{'|'.join(places)})\b", "…", text)
    return f"{text}\n{typed(finding.hint)}"


def finding_line(finding: Finding) -> Line:
    """Show a tolerated finding on one line, with its place in a file."""
    word = "forced" if finding.severity is Severity.ERROR else str(finding.severity)
    place = "" if finding.complaint is None else f"{finding.complaint.place}: "
    line: list[Cell | Hint] = [Cell(place), Cell(f"{word}: ", _STYLES[finding.severity]), Cell(finding.text)]
    return [*line, Cell("; "), part(finding.hint)] if finding.hint else line
