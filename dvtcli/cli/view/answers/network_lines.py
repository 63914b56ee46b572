"""The text of a network plan, and of its application."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.network.concise_dcf import download_lines
from dvtcli.domain.objects import VERIFY_CONFIGURATION
from dvtcli.domain.pdo import entry_text
from dvtcli.domain.plan import PdoChange, Step, step_text
from dvtcli.domain.rules import errors_in
from dvtcli.domain.text import all_nodes, join_some, plural
from dvtcli.operations.results.networks import action, differing, parameter_texts

if TYPE_CHECKING:
    from dvtcli.domain.network.network_plan import LeftOut, NetworkPlan, NodePlan
    from dvtcli.domain.network.worst_case_load import WorstCaseLoad
    from dvtcli.operations.results.networks import NetworkApplied, NetworkPlanned


#: maximum number of lines for settings that differ and are not written
_MOST_REMAINING = 12
_SIGNS = {"prune": ("-", "red"), "disable": ("~", "yellow"), "enable": ("~", "yellow"), "change": ("~", "yellow")}


def node_plan_lines(file: str, node_plan: NodePlan, width: int, *, compares: bool = False) -> Iterator[Line]:
    """Show a node's changes by *file*, and values not written with reasons; *compares*: as is and expected."""
    place = f"  {file}:{node_plan.line}" if node_plan.line else ""
    title = f"({node_plan.title})" if node_plan.title else ""
    said = " ".join(filter(None, (node_plan.name, title)))
    yield [Cell(f"node {node_plan.node_id}  {said}", "bold"), Cell(place, "dim")]
    for change in node_plan.plan.changes:
        if isinstance(change, PdoChange):
            yield from _pdo(node_plan, change, width, compares=compares)
        else:
            yield _object(node_plan, change.step, compares=compares)
            yield from _downloads(change.step.object, change.step.before, change.step.after)
    if not node_plan.is_read:
        yield [Cell("  = ", "dim"), Cell(f"not read: its stamp (0x{VERIFY_CONFIGURATION:04X}) is that of the file")]
    if node_plan.store and node_plan.unstored:
        yield [Cell("  ! ", "yellow"), Cell(f"not stored yet: {join_some(node_plan.unstored)}")]
    if node_plan.unchanged > 0:
        yield [Cell(f"  = {node_plan.unchanged} as wanted", "dim")]
    if node_plan.also_equal:
        more = plural(node_plan.also_equal, "more setting")
        yield [Cell(f"  = {more} equal to the file, not written", "dim")]
    if node_plan.is_asked_nothing and not any(found.rule == "asked-nothing" for found in node_plan.findings):
        yield [Cell("  ! ", "yellow"), Cell("the file has no settings for it: nothing was compared")]
    if node_plan.lacks:
        yield [Cell("  ! ", "yellow"), Cell(f"the device has no {join_some(node_plan.lacks)}")]
    yield from _left_out(node_plan)


def _left_out(node_plan: NodePlan) -> Iterator[Line]:
    """Show values of the file that are not written, by reason; read-only values are only counted."""
    for left_out in node_plan.remaining[:_MOST_REMAINING]:
        yield _otherwise(node_plan, left_out)
        yield from _downloads(left_out.object, left_out.held, left_out.said)
    if len(node_plan.remaining) > _MOST_REMAINING:
        rest = [left_out.object for left_out in node_plan.remaining[_MOST_REMAINING:]]
        yield [Cell("  ! ", "yellow"), Cell(f"differs, not written: {join_some(rest)}")]
    by_why: dict[str, list[str]] = {}
    for left_out in node_plan.left_out:
        if not left_out.remains:
            by_why.setdefault(left_out.why, []).append(f"{left_out.object}{_values(node_plan, left_out)}")
    silent = by_why.pop(_read_only(), []) if by_why else []
    for why, places in by_why.items():
        yield [Cell("  ! ", "yellow"), Cell(f"not written: {join_some(places)} {why}")]
    if silent:
        yield [Cell(f"  = {plural(len(silent), 'read-only object')} of the file ignored", "dim")]


def _otherwise(node_plan: NodePlan, one: LeftOut) -> Line:
    """Show a setting that differs from the file, and the reason for not writing it."""
    return [Cell("  ! ", "yellow"), Cell(f"differs, not written: {one.object}{_values(node_plan, one)} {one.why}")]


def _values(node_plan: NodePlan, one: LeftOut) -> str:
    """Return the node's and the file's value of an object, if both are known."""
    if one.held is None or one.said is None:
        return ""
    index, sub_index = (int(part, 16) for part in one.object.split(":"))
    step, known = Step(index, sub_index, one.held, one.said, ""), node_plan.understood.get(one.object)
    return f" (is {step_text(step, one.held, known)}, expected {step_text(step, one.said, known)})"


def _downloads(place: str, before: bytes | None, after: bytes | None) -> Iterator[Line]:
    """Show the changes in a manager's downloads to its nodes, if *place* is a concise DCF."""
    yield from ([Cell(f"      {text}")] for text in download_lines(place, before, after))


def _sides(held: str, wanted: str, *, compares: bool) -> tuple[str, ...]:
    """Return the cells for present and wanted value: a difference, or a change."""
    return (f"is {held}, expected {wanted}",) if compares else (held, "->", wanted)


def _object(node_plan: NodePlan, step: Step, *, compares: bool) -> Line:
    """Show an object with present value, wanted value, and reason."""
    known = node_plan.understood.get(step.object)
    before, after = step_text(step, step.before, known), step_text(step, step.after, known)
    said = "" if step.reason == "write" else f"  {step.reason}"
    if step.before is None:
        sides = f"not compared (write-only): {after} is written each time"
    else:
        sides = " ".join(_sides(before, after, compares=compares))
    return [Cell("  ~ ", "yellow"), Cell(f"0x{step.object}  {sides}"), Cell(said)]


def _pdo(node_plan: NodePlan, change: PdoChange, width: int, *, compares: bool) -> Iterator[Line]:
    kind = action(node_plan, change)
    sign, style = _SIGNS[kind]
    if kind == "prune":
        yield [
            Cell(f"  {sign} ", style),
            Cell(f"{change.label}  enabled on the node, not in the file: will be disabled (prune)"),
        ]
        return
    is_off = not change.before.enabled and not change.after.enabled
    is_left_off = any(found.rule == "mapped-but-off" and found.pdo == change.pdo for found in node_plan.findings)
    why = ": the file does not enable it" if is_left_off else ""
    off = f"  stays off{why}" if is_off else ""
    yield [Cell(f"  {sign} ", style), Cell(change.label), Cell(off, "dim")]
    table = Table(indent=6, shrink=3)
    for key, was, will in differing(change):
        if key == "map":
            _entries(table, node_plan, was, will, compares=compares)
        else:
            held, wanted = parameter_texts(change, key, was, will)
            table.add(key, *_sides(held, wanted, compares=compares))
    yield from table.lines(width)


def _entries(table: Table, node_plan: NodePlan, was: list[str], will: list[str], *, compares: bool) -> None:
    for number in range(max(len(was), len(will))):
        before, after = (side[number] if number < len(side) else "-" for side in (was, will))
        if before != after:
            name = node_plan.names.get(after.rpartition("/")[0], "")
            wanted = f"{entry_text(after)}  {name}".rstrip()
            table.add(f"map {number + 1}", *_sides(entry_text(before), wanted, compares=compares))


def _read_only() -> str:
    from dvtcli.domain.configuration import NotWritten

    return NotWritten.READ_ONLY


def _is_lifted(left_out: LeftOut) -> bool:
    """Whether --include lifts the reason against writing."""
    from dvtcli.domain.configuration import NotWritten

    return any(left_out.why == reason for reason in NotWritten if reason.is_lifted_by_include)


def plan_lines(plan: NetworkPlan, width: int, *, compares: bool = False) -> Iterator[Line]:
    """Show each node's differences, and the sum; *compares* is as in `node_plan_lines`."""
    for node in plan.nodes:
        yield from node_plan_lines(plan.file, node, width, compares=compares)
    yield ""
    if plan.changed or any(node.stores for node in plan.nodes):
        yield [Cell("Plan: ", "bold"), Cell(f"{_counted(plan)}.")]


def planned_lines(result: NetworkPlanned, width: int) -> Iterator[Line]:
    """Show the plan, and the next step."""
    yield from plan_lines(result.plan, width, compares=result.tells)
    yield from _remaining(result.plan)
    yield from _untold(result.plan)
    if result.plan.lacking:
        what = " and ".join(sorted({"objects" if lacked.pdo is None else "PDOs" for lacked in result.plan.lacking}))
        yield f"Nothing was written; writing is not possible: the devices have no {what} of the file."
        return
    if not result.plan.changed and result.plan.to_do:
        yield "Every node has the values of the file, but not everything is stored."
    elif not result.plan.changed and not result.plan.remains and not result.plan.untold:
        yield f"No difference: {_so(result.plan)}. Nothing was written."
        yield from _aside(result.plan)
    if result.need is not None:
        yield from _load(result.need)
    if result.tells and result.plan.changed and not result.exit_code and not result.interrupted:
        count = sum(len(node.plan.unreadable) for node in result.plan.nodes)
        yield f"No difference in the readable values; {plural(count, 'write-only value')} not compared."
        return
    if not result.interrupted and not result.plan.to_do:
        return
    saved = f" Saved: {verbatim(result.saved)}." if result.saved else ""
    runs = result.saved.lower().endswith(".309")
    if result.interrupted:
        nodes = all_nodes(result.interrupted)
        why = f"Nothing was written.{saved} Next: {{}}, since a change of {nodes} was interrupted; then plan again"
        yield Hint(Action.RECOVER_ALL, why=why)
        return
    arguments = {
        "file": result.saved or result.plan.file,
        "to_manager": None if result.saved else result.plan.manager,
        "force": any(errors_in(node.findings) for node in result.plan.nodes),
    }
    yield Hint(Action.RUN if runs else Action.APPLY, arguments, f"Nothing was written.{saved} Next: {{}}")


def _remaining(plan: NetworkPlan) -> Iterator[Line]:
    """Show the settings that differ from the file and are not written."""
    for node in plan.nodes:
        if not node.remaining:
            continue
        lifted = _includes(node)
        named = " ".join(f"--include {word}" for word in lifted[:3])
        more = " …" if len(lifted) > 3 else ""
        are, verb = ("is", "differs") if len(node.remaining) == 1 else ("are", "differ")
        what = f"{plural(len(node.remaining), 'setting')} of node {node.node_id} {verb} from {plan.file}"
        hint = f"{named}{more} writes {'it' if are == 'is' else 'such'}" if lifted else ""
        hint = hint or join_some(left_out.object for left_out in node.remaining)
        yield [Cell(f"! {what} and {are} not written: {hint}", "yellow")]


def _includes(node_plan: NodePlan) -> list[str]:
    """Return --include words for just the writable settings in *node.remaining*: sub-indices, or a common index."""
    could = [left_out.object for left_out in node_plan.remaining if _is_lifted(left_out)]
    others = {
        left_out.object[:4] for left_out in node_plan.left_out if _is_lifted(left_out) and left_out.object not in could
    }
    others |= {change.step.object[:4] for change in node_plan.plan.changes if not isinstance(change, PdoChange)}
    many = {index for index, count in Counter(place[:4] for place in could).items() if count > 1} - others
    words = (place[:4] if place[:4] in many or place.endswith(":00") else place for place in could)
    return list(dict.fromkeys(words))


def _untold(plan: NetworkPlan) -> Iterator[Line]:
    """Show nodes without a download by the manager, whose state is therefore unknown."""
    if not plan.untold:
        return
    nodes = f"node{'' if len(plan.untold) == 1 else 's'} {', '.join(map(str, plan.untold))}"
    yield [Cell(f"! node {plan.manager} gets no values for {nodes}: no EDS; dcf: names an EDS", "yellow")]


def _so(plan: NetworkPlan, already: str = "") -> str:
    """Say that all nodes are as in the file, if it asks for anything."""
    if all(node.is_asked_nothing for node in plan.nodes):
        return "the file has no settings"
    return f"{_every(plan)} has {_what(plan)}{already}"


def _every(plan: NetworkPlan) -> str:
    """Name the nodes without differences."""
    if plan.manager is not None:
        return f"node {plan.manager}"
    if len(plan.unread) == len(plan.nodes):
        return f"every node, by its stamp (0x{VERIFY_CONFIGURATION:04X}),"
    if any(node.is_asked_nothing for node in plan.nodes):
        return "every node that the file sets"
    return "every node that was read" if plan.unread else "every node"


def _what(plan: NetworkPlan) -> str:
    """Name the source of the compared values; `link` and `unlink` have no file."""
    if plan.file.startswith(("link ", "unlink ")):
        return f"what `{plan.file}` makes"
    is_all = not plan.remains and not plan.untold and not any(map(_not_written, plan.nodes))
    return "the values of the file" if is_all else "the part of the file that is written"


def _aside(plan: NetworkPlan) -> Iterator[Line]:
    """Show the number of other values in the file that are not written."""
    if count := sum(len(_not_written(node)) for node in plan.nodes):
        more = "1 more is" if count == 1 else f"{count} more are"
        compare = Hint(Action.COMPARE, {"file": plan.file, "all": True}, f"{more} not written, and may differ: {{}}")
        yield [Cell("  ! ", "yellow"), compare]


def _not_written(node_plan: NodePlan) -> list[str]:
    """Return writable values of the file that are left out."""
    return [left_out.object for left_out in node_plan.left_out if not left_out.remains and left_out.why != _read_only()]


_ONLY_NODES = "Frames of other nodes are not counted."


def _load(need: WorstCaseLoad) -> Iterator[Line]:
    """Show the worst-case bus load of the plan's nodes after the change."""
    rate, share = f"{need.bit_rate / 1000:g} kbit/s", f"{100 * float(need.limited):.1f} %"
    if need.unlimited:
        from dvtcli.cli.view.answers.load_lines import unbounded

        whose = "; ".join(f"{names} ({why})" for names, why, _ in unbounded(need.unlimited))
        yield [
            Cell("Worst-case bus load afterwards is "),
            Cell("unbounded", "red"),
            Cell(f": {whose}. All other frames: {share} at {rate}. {_ONLY_NODES}"),
        ]
    else:
        late = join_some(
            f"{stream_need.stream.node}:{stream_need.stream.pdo or stream_need.stream.kind}"
            for stream_need in need.late
        )
        too_late = f"; too late: {late}" if late else ""
        yield f"Worst-case bus load at {rate} afterwards: {share}{too_late}. {_ONLY_NODES}"


def applied_lines(result: NetworkApplied, _width: int) -> Iterator[Line]:
    """Show the result of a plan shown before, and how it is stored."""
    plan = result.plan
    yield from _untold(plan)
    if not plan.changed and not result.stored:
        said = _so(plan, " already")
        yield f"{said[0].upper()}{said[1:]}; nothing was written."
        yield from _aside(plan)
        yield from _remaining(plan)
        return
    writes, nodes = plural(plan.writes, "write"), plural(sum(bool(len(node.plan)) for node in plan.nodes), "node")
    equal = _read_back(plan)
    if result.dry_run:
        text = f"{writes} on the twins of {nodes}, {equal}. Nothing was written."
        yield [Cell("dry run: ", "cyan"), Cell(text)]
        yield from _remaining(plan)
        return
    if plan.changed:
        yield f"{nodes} set: {writes}, {equal}, {result.seconds:.2f} s."
    yield from _stored(result)
    yield from _kept(result)
    yield from _remaining(plan)


def _read_back(plan: NetworkPlan) -> str:
    """Say how many writes read back equal; the other objects are write-only."""
    count = sum(len(node.plan.unreadable) for node in plan.nodes)
    if not count:
        return "read back equal"
    equal = f"{plan.writes - count} read back equal, " if plan.writes > count else ""
    return f"{equal}{count} acknowledged (write-only)"


def _kept(result: NetworkApplied) -> Iterator[Line]:
    """Show how to store on nodes without a store, as `write` does."""
    stored, told = {store.node for store in result.stored}, dict[tuple[str, str], list[str]]()
    reverts = {node.node_id: "" if result.not_remembered else _reverts(node) for node in result.plan.nodes}
    for node_id, words in result.keep.items():
        if node_id not in stored:
            told.setdefault((typed(words), reverts[node_id]), []).append(str(node_id))
    for (words, reverts_text), nodes in told.items():
        where = all_nodes(nodes)
        own = "its" if len(nodes) == 1 else "their"
        text = f"In RAM only on {where}: {words}" if words else f"Stored by {where} on {own} own"
        yield [Cell(f"{text}{reverts_text}.", "dim")]
    for node_id, labels in result.kept_without.items():
        if labels and node_id not in stored:
            yield [Cell(f"Stored by node {node_id} on its own: {join_some(labels)}.", "dim")]


def _reverts(node_plan: NodePlan) -> str:
    """Say what `undo --all` reverts on *node_plan*: not a write-only value, as what it held is not known."""
    blind = [change.label for change in node_plan.plan.unreadable]
    if not blind:
        return ", `undo --all` reverts it"
    kept = f"`undo` cannot revert {join_some(blind)} (write-only)"
    return f", {kept}" if len(blind) == len(node_plan.plan.changes) else f", {kept}, `undo --all` reverts the rest"


def _stored(result: NetworkApplied) -> Iterator[Line]:
    """Show the nodes that acknowledged the store, and the result of a restart if any."""
    told: dict[str, list[str]] = {}
    for store in result.stored:
        if store.proof is None:
            text = ""
        elif store.proof.holds:
            text = "Stored on {}, and proved by a restart."
        else:
            text = "Acknowledged by {}, and not proved by the restart."
        told.setdefault(text, []).append(str(store.node))
    for text, nodes in told.items():
        if text:
            yield text.format(all_nodes(nodes))
        else:
            why = f"Stored, as acknowledged by {all_nodes(nodes)}; {{}} proves it"
            yield Hint(Action.PROVE_STORE, {"node": [int(node) for node in nodes]}, why)


def _counted(plan: NetworkPlan) -> str:
    pdos = [(node, change) for node in plan.nodes for change in node.plan.changes if isinstance(change, PdoChange)]
    offs = sum(action(node, change) in ("prune", "disable") for node, change in pdos)
    values = sum(len(node.plan.changes) for node in plan.nodes) - len(pdos)
    stores = [str(node.node_id) for node in plan.nodes if node.stores]
    parts = [plural(len(pdos) - offs, "PDO change"), plural(offs, "disable") if offs else ""]
    parts += [
        plural(values, "object") if values else "",
        f"{sum(max(0, node.unchanged) for node in plan.nodes)} unchanged",
    ]
    store = f"a store on {all_nodes(stores)}" if stores else "no store"
    return f"{', '.join(filter(None, parts))}; {plural(plan.writes, 'SDO write')}, {store}"
