"""The text of what one node of a network is planned to be: its PDOs, its objects, and what is left as it is.

Does not know the other nodes.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.configuration import NotWritten
from dvtcli.domain.network.concise_difference import download_lines
from dvtcli.domain.parameter_text import entry_text, parameter_text
from dvtcli.domain.plan import STAMP, PdoChange, Step
from dvtcli.domain.several import join_some, plural
from dvtcli.domain.shown_value import step_text
from dvtcli.operations.results.networks import action, differing

if TYPE_CHECKING:
    from dvtcli.domain.network.network_plan import LeftOut, NodePlan

#: how many settings that differ and are not written have a line each
_MOST_REMAINING = 12
_SIGNS = {"prune": ("-", "red"), "disable": ("~", "yellow"), "enable": ("~", "yellow"), "change": ("~", "yellow")}


def node_plan_lines(file: str, node: NodePlan, width: int, *, compares: bool = False) -> Iterator[Line]:
    """What *file* changes on the node, what of it is not written, and why; with *compares* what is, and is expected."""
    place = f"  {file}:{node.line}" if node.line else ""
    title = f"({node.title})" if node.title else ""
    said = " ".join(filter(None, (node.name, title)))
    yield [Cell(f"node {node.node_id}  {said}", "bold"), Cell(place, "dim")]
    for change in node.plan.changes:
        if isinstance(change, PdoChange):
            yield from _pdo(node, change, width, compares=compares)
        else:
            yield _object(node, change.step, compares=compares)
            yield from _downloads(change.step.object, change.step.before, change.step.after)
    if not node.is_read:
        yield [Cell("  = ", "dim"), Cell(f"not read: its stamp (0x{STAMP:04X}) is that of the file")]
    if node.store and node.unstored:
        yield [Cell("  ! ", "yellow"), Cell(f"not stored yet: {join_some(node.unstored)}")]
    if node.unchanged > 0:
        yield [Cell(f"  = {node.unchanged} as wanted", "dim")]
    if node.also_equal:
        more = plural(node.also_equal, "more setting")
        yield [Cell(f"  = {more} as the file says, of those that are not written", "dim")]
    if node.is_asked_nothing and not any(found.rule == "asked-nothing" for found in node.findings):
        yield [Cell("  ! ", "yellow"), Cell("the file asks for nothing of it: nothing was compared")]
    if node.lacks:
        yield [Cell("  ! ", "yellow"), Cell(f"the device has no {join_some(node.lacks)}")]
    yield from _left_out(node)


def _left_out(node: NodePlan) -> Iterator[Line]:
    """What the file says and nobody writes, by why; what is read-only is only counted."""
    for left_out in node.remaining[:_MOST_REMAINING]:
        yield _otherwise(node, left_out)
        yield from _downloads(left_out.object, left_out.held, left_out.said)
    if len(node.remaining) > _MOST_REMAINING:
        rest = [left_out.object for left_out in node.remaining[_MOST_REMAINING:]]
        yield [Cell("  ! ", "yellow"), Cell(f"differs, not written: {join_some(rest)}")]
    by_why: dict[str, list[str]] = {}
    for left_out in node.left_out:
        if not left_out.remains:
            by_why.setdefault(left_out.why, []).append(f"{left_out.object}{_values(node, left_out)}")
    silent = by_why.pop(NotWritten.READ_ONLY, [])
    for why, places in by_why.items():
        yield [Cell("  ! ", "yellow"), Cell(f"not written: {join_some(places)} {why}")]
    if silent:
        yield [Cell(f"  = {plural(len(silent), 'read-only object')} of the file left aside", "dim")]


def _otherwise(node: NodePlan, one: LeftOut) -> Line:
    """A setting in which the node differs from the file, and why it stays so."""
    return [Cell("  ! ", "yellow"), Cell(f"differs, not written: {one.object}{_values(node, one)} {one.why}")]


def _values(node: NodePlan, one: LeftOut) -> str:
    """What the node holds of an object and what the file says, where both are known."""
    if one.held is None or one.said is None:
        return ""
    index, sub_index = (int(part, 16) for part in one.object.split(":"))
    step, known = Step(index, sub_index, one.held, one.said, ""), node.understood.get(one.object)
    return f" (holds {step_text(step, one.held, known)}, the file says {step_text(step, one.said, known)})"


def _downloads(place: str, before: bytes | None, after: bytes | None) -> Iterator[Line]:
    """What a manager would download otherwise to its nodes, where that is what changes."""
    yield from ([Cell(f"      {text}")] for text in download_lines(place, before, after))


def _sides(held: str, wanted: str, *, compares: bool) -> tuple[str, ...]:
    """The cells for what a node holds and what it is to hold: a difference, or a change."""
    return (f"is {held}, expected {wanted}",) if compares else (held, "->", wanted)


def _object(node: NodePlan, step: Step, *, compares: bool) -> Line:
    """A single object: what it holds, what it is to hold, and what that means."""
    known = node.understood.get(step.object)
    before, after = step_text(step, step.before, known), step_text(step, step.after, known)
    said = "" if step.reason == "write" else f"  {step.reason}"
    return [
        Cell("  ~ ", "yellow"),
        Cell(f"0x{step.object}  {' '.join(_sides(before, after, compares=compares))}"),
        Cell(said),
    ]


def _pdo(node: NodePlan, change: PdoChange, width: int, *, compares: bool) -> Iterator[Line]:
    kind = action(node, change)
    sign, style = _SIGNS[kind]
    if kind == "prune":
        yield [
            Cell(f"  {sign} ", style),
            Cell(f"{change.label}  enabled on the node, not in the file: goes off (prune)"),
        ]
        return
    stays_off = not change.before.enabled and not change.after.enabled
    yield [Cell(f"  {sign} ", style), Cell(change.label), Cell("  stays off" if stays_off else "", "dim")]
    table = Table(indent=6, shrink=3)
    for key, was, will in differing(change):
        if key == "map":
            _entries(table, node, was, will, compares=compares)
        else:
            held, wanted = (parameter_text(key, value, change.pdo) for value in (was, will))
            table.add(key, *_sides(held, wanted, compares=compares))
    yield from table.lines(width)


def _entries(table: Table, node: NodePlan, was: list[str], will: list[str], *, compares: bool) -> None:
    for number in range(max(len(was), len(will))):
        before, after = (side[number] if number < len(side) else "-" for side in (was, will))
        if before != after:
            name = node.names.get(after.rpartition("/")[0], "")
            wanted = f"{entry_text(after)}  {name}".rstrip()
            table.add(f"map {number + 1}", *_sides(entry_text(before), wanted, compares=compares))
