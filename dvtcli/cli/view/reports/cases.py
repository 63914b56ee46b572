"""The cases of a comparison, and of a script's lines, as CI tools count them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.cli.view.answers.compare_lines import value_text
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.domain.plan import PdoChange, step_text
from dvtcli.domain.text import join_some, plural
from dvtcli.operations.results.comparisons import Compared, WholeCompared
from dvtcli.operations.results.networks import NetworkPlanned, differing, parameter_texts

if TYPE_CHECKING:
    from dvtcli.domain.network.network_plan import MissingObject, NodePlan
    from dvtcli.domain.plan import Change
    from dvtcli.errors import DvtcliError
    from dvtcli.operations.results import ComparedNodes
    from dvtcli.operations.results.comparisons import ObjectDifference


@dataclass(frozen=True, slots=True)
class Case:
    """A PDO or object of a *node* or a file; *differences* are texts, empty if none.

    *level* is `error`, `warning` or `notice`, or `skipped` if not checked; *file* with *line* and *column* (0: unknown)
    is the place of the wanted value.
    """

    node: int | str
    name: str
    differences: tuple[str, ...] = ()
    level: str = "error"
    file: str = ""
    line: int = 0
    column: int = 0

    @property
    def where(self) -> str:
        """The owner of the case for display."""
        return self.node if isinstance(self.node, str) else f"node {self.node}"


def cases_of(result: NetworkPlanned | Compared | ComparedNodes | WholeCompared) -> Iterator[Case]:
    """Return every case of *result*, node by node."""
    if isinstance(result, NetworkPlanned):
        for node in result.plan.nodes:
            yield from _planned(result, node)
        yield from _lacking(result.plan.lacking, result.plan.file)
    elif isinstance(result, Compared):
        yield from _compared(result)
    elif isinstance(result, WholeCompared):
        yield from _whole_device(result)
    else:
        for compared in result.nodes:
            yield from _compared(compared)
        yield from _lacking(result.lacking, result.nodes[0].against)


def _planned(result: NetworkPlanned, node: NodePlan) -> Iterator[Case]:
    """Return differences: errors if requested, else notices of planned writes by `apply`."""
    level = "error" if result.tells else "notice"
    if not node.is_read:
        trusted = ("not read: its stamp (0x1020) is that of the file",)
        yield Case(node.node_id, "stamp", trusted, "skipped", result.plan.file, node.line)
    unreadable = node.plan.unreadable
    for change in node.plan.changes:
        is_compared = change not in unreadable
        differences = tuple(_differences(node, change)) if is_compared else ("not compared: it is write-only",)
        case_level = level if is_compared else "skipped"
        yield Case(node.node_id, change.label, differences, case_level, result.plan.file, _line(node, change))
    for held in node.holds:
        yield Case(node.node_id, held.label, file=result.plan.file, line=_line(node, held))
    for left in node.remaining:
        differences = (f"differs, not written: {left.why}",)
        yield Case(node.node_id, left.object, differences, level, result.plan.file, node.line)
    if node.store and node.unstored:
        differences = (f"not stored yet: {join_some(node.unstored)}",)
        yield Case(node.node_id, "store", differences, level, result.plan.file, node.line)
    for finding in node.findings:
        level = "notice" if str(finding.severity) == "note" else "warning"
        said = finding.complaint
        line, column = (node.line, 0) if said is None else (said.line, said.column)
        yield Case(node.node_id, finding.rule, (finding.text,), level, result.plan.file, line, column)


def _lacking(lacking: Sequence[MissingObject], file: str) -> Iterator[Case]:
    """Return PDOs and objects of *file* missing in nodes."""
    for lacked in lacking:
        line = 0 if lacked.complaint is None else lacked.complaint.line
        yield Case(lacked.node_id, lacked.label, (lacked.finding.text,), "error", file, line)


def _line(node: NodePlan, change: Change) -> int:
    """Return the file's line for *change*: of its PDO or object, else its node."""
    if isinstance(change, PdoChange):
        return node.lines.get(change.pdo, 0) or node.line
    return node.object_lines.get((change.step.index, change.step.sub_index), 0) or node.line


def _differences(node: NodePlan, change: Change) -> Iterator[str]:
    if isinstance(change, PdoChange):
        for key, was, will in differing(change):
            held, expected = parameter_texts(change, key, was, will)
            yield f"{key} is {held}, expected {expected}"
    else:
        known = node.understood.get(change.step.object)
        held, expected = (step_text(change.step, data, known) for data in (change.step.before, change.step.after))
        why = "" if change.step.reason == "write" else f" ({change.step.reason})"
        yield f"is {held}, expected {expected}{why}"


def _compared(one: Compared) -> Iterator[Case]:
    found: dict[str, list[str]] = {label: [] for label in one.labels}
    for label, text in one.differences:
        found.setdefault(label, []).append(text)
    for label, texts in found.items():
        yield Case(one.node, label, tuple(texts), file=one.against, line=one.line_of(label))
    for label, frame, _ in one.frames:
        differences = () if frame else ("none came",)
        yield Case(one.node, f"frame of {label}", differences, file=one.against, line=one.line_of(label))


def _whole_device(result: WholeCompared) -> Iterator[Case]:
    """Return each differing setting, and equal settings together; other objects are notices on request."""
    where = result.second if result.node is None else result.node
    equal = result.objects - len(result.differences)
    yield Case(where, plural(equal, "equal setting"), file=result.first)
    if result.unlike:
        yield Case(where, "another device", (result.unlike,), "warning", result.first)
    for difference in result.differences:
        yield Case(where, _named(difference), (_sides(difference),), file=result.first)
    for difference in (*result.about, *result.apart) if result.shows_all else ():
        yield Case(where, _named(difference), (_sides(difference),), "notice", result.first)


def _named(one: ObjectDifference) -> str:
    return f"0x{one.object} {one.name}".rstrip()


def _sides(one: ObjectDifference) -> str:
    before, after = (one.unread or "-" if data is None else value_text(one, data) for data in (one.before, one.after))
    return f"is {after}, expected {before}"


@dataclass(slots=True)
class LineRan:
    """A line: place, output, and exit *code* (None: not run), with its *error*."""

    file: str
    number: int
    words: str
    code: int | None = None
    said: str = ""
    error: DvtcliError | None = None
    seconds: float = 0.0
    #: the next step of its error, as typed
    hint: str = ""


def why_failed(line: LineRan) -> str:
    """Return the error of *line* with its exit code."""
    said = f"exit code {line.code}" if line.error is None else error_text(line.error, str(line.error))
    return f"{said} (exit code {line.code})" if line.error is not None else said
