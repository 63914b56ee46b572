"""Compare nodes with a file, a network file, a script or this session's changes: `verify`. Writes nothing."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.described_node import FileValues
from dvtcli.device.read_pdos import present_pdos, read_pdo
from dvtcli.device.store.pending import REBOOT, VERIFY
from dvtcli.device.target_config import TargetConfig, config_differences, session_target
from dvtcli.domain.hint import Action, Hint, as_hint
from dvtcli.domain.lint.described import object_text
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.text import join_some
from dvtcli.errors import UsageError
from dvtcli.files.device_file import holds_values
from dvtcli.files.input_file import read_input_head
from dvtcli.operations.devices.held_device import HeldDevice, node_of_file, selected_nodes, told_of
from dvtcli.operations.pdos.look_at_frames import look
from dvtcli.operations.plans.resolve_names import refuse_lacking
from dvtcli.operations.results import Compared, ComparedNodes
from dvtcli.operations.values.object_values import planned_words

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan
    from dvtcli.operations.session.session import Rehearse, Session, SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

NodePdo = tuple[int | None, "Pdo"]
#: The comparison without a file.
SESSION = "this session's changes"


def verify(
    session: Session,
    rehearse: Rehearse,
    pdos: Sequence[NodePdo] = (),
    file: str | None = None,
    *,
    frame: bool = False,
) -> Compared | ComparedNodes:
    """Compare the nodes with this session's changes, or with *file*.

    A file is a script, a network file, a DCF or an EDS. *pdos* are the PDOs to compare, each with its node-ID (None:
    the selected node); empty: everything. *frame* starts each node and checks a frame of each enabled TPDO. *rehearse*
    evaluates a script. Raises UsageError if there is nothing to compare.
    """
    is_device = file is not None and not _is_network(file) and not _is_script(file)
    return session.read_together(lambda: _verified(session, rehearse, pdos, file, frame=frame, is_device=is_device))


def _verified(
    session: Session, rehearse: Rehearse, pdos: Sequence[NodePdo], file: str | None, *, frame: bool, is_device: bool
) -> Compared | ComparedNodes:
    """Compare once; *is_device*: the *file* is about a device."""
    if file is not None and is_device:
        pdos, wanted = _device_wishes(session, pdos, file)
        plan = None
    else:
        wanted, plan = _wishes(session, rehearse, file)
    lacking = () if plan is None else plan.lacking
    if plan is not None and lacking and pdos:
        asked = {(session.node_id() if node_id is None else node_id, pdo) for node_id, pdo in pdos}
        if not asked.isdisjoint((*((lacked.node_id, lacked.pdo) for lacked in lacking), *plan.unlinked)):
            refuse_lacking(plan)
        lacking = ()
    if plan is not None and lacking and not any(wanted.values()):
        refuse_lacking(plan)
    options = _chosen(session, pdos, wanted, file or SESSION)
    named = len(options) > 1 or len(session.known_ids()) > 1
    lines = {} if plan is None else {node.node_id: _lines(node) for node in plan.nodes}
    compared = tuple(
        replace(
            compare(session, session.node(node_id), target, file, frame=frame, named=named),
            lines=lines.get(node_id, {}),
        )
        for node_id, target in options.items()
    )
    return compared[0] if len(compared) == 1 and not lacking else ComparedNodes(compared, lacking)


def _lines(node_plan: NodePlan) -> dict[str, int]:
    """Map PDOs and objects of *node_plan*, and the node itself, to lines of the network file."""
    objects = {f"{index:04X}:{sub_index:02X}": line for (index, sub_index), line in node_plan.object_lines.items()}
    return {"": node_plan.line, **{pdo.label: line for pdo, line in node_plan.lines.items()}, **objects}


def _wishes(
    session: Session, rehearse: Rehearse, file: str | None
) -> tuple[dict[int, TargetConfig], NetworkPlan | None]:
    """Return the target of each node, by a network file, a script or this session; and the network file's plan."""
    if file is not None:
        return _network_wishes(session, file) if _is_network(file) else (rehearse(file), None)
    return _session_targets(session), None


def _is_network(file: str) -> bool:
    return file.lower().endswith((".yaml", ".yml"))


def _session_targets(session: SessionNodes) -> dict[int, TargetConfig]:
    network = session.network
    for node_id, before in tuple(network.left.items()):
        if before.wanted or before.wanted_values or before.unreadable_values:
            network.node(node_id)  # it was changed before the bus was gone: who is it now?
    return {node_id: session_target(node) for node_id, node in sorted(network.nodes.items())}


def _device_wishes(
    session: SessionNodes, pdos: Sequence[NodePdo], file: str
) -> tuple[list[NodePdo], dict[int, TargetConfig]]:
    """Return *pdos* with their nodes, and the targets of these nodes by a *file* about a device."""
    named = {node_id for node_id, _ in pdos if node_id is not None}
    if named and any(node_id is None for node_id, _ in pdos):
        named.add(session.node_id())  # a PDO without a node is the selected one's
    if len(named) > 1:
        raise UsageError("a DCF is for one node: use one line for each node")
    held = told_of(file, session.reporter)
    meant = tuple(named) or selected_nodes(session) or (node_of_file(session, held),)
    return [(meant_id, pdo) for meant_id in meant for _, pdo in pdos], {
        meant_id: _device_config(session, session.node(meant_id), held) for meant_id in meant
    }


def _network_wishes(session: Session, file: str) -> tuple[dict[int, TargetConfig], NetworkPlan]:
    from dvtcli.operations.plans.plan_network import plan_network

    plan = plan_network(session, file, lists_missing=True)
    return {node.node_id: _node_wish(node) for node in plan.nodes}, plan


def _node_wish(node_plan: NodePlan) -> TargetConfig:
    """The target of a node in a network file; write-only objects are named, not compared."""
    unreadable = tuple(change.label for change in node_plan.plan.unreadable)
    values = {place: data for place, data in node_plan.values.items() if object_text(*place) not in unreadable}
    return TargetConfig(dict(node_plan.wanted), values, unreadable=unreadable)


def _is_script(file: str) -> bool:
    if file.lower().endswith(".tcl"):
        raise UsageError(
            f"{file}: the changes of a Tcl script are not known before it runs",
            place=file,
            hint=as_hint("run it at the prompt after a command that set something")
            + Hint(Action.SAVE_SCRIPT, why=", or {} there and compare with that"),
        )
    if file.lower().endswith(".dvt"):
        return True
    try:
        return read_input_head(file, 32).lstrip(b"\xef\xbb\xbf").startswith(b"# dvtcli script")
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror}", place=file) from failed


def _chosen(
    session: SessionNodes, pdos: Sequence[NodePdo], options: dict[int, TargetConfig], against: str
) -> dict[int, TargetConfig]:
    """Restrict *options* to *pdos* (empty: everything); raises UsageError if nothing is left to compare."""
    configured = {node_id: target for node_id, target in options.items() if target}
    if not configured:
        said = "this session changed nothing" if against == SESSION else f"{against} sets nothing"
        blind = [f"{label} of node {node_id}" for node_id, target in options.items() for label in target.unreadable]
        if blind:
            said = (
                f"{against} set{'' if against == SESSION else 's'} only {join_some(blind)}, which cannot be read back"
            )
        raise UsageError(
            f"nothing to compare: {said}",
            hint=Hint(
                Action.VERIFY,
                {"file": "FILE"},
                "{} compares with a script, a DCF or an EDS"
                + ("; each command of a shell is its own session" if against == SESSION else ""),
            ),
        )
    asked: dict[int, list[Pdo]] = {}
    for node_id, pdo in pdos:
        asked.setdefault(session.node_id() if node_id is None else node_id, []).append(pdo)
    for node_id, wanted in asked.items():
        missing = [pdo for pdo in wanted if node_id not in configured or pdo not in configured[node_id].pdos]
        if missing:
            what = f"{missing[0].label} of node {node_id}" if len(session.known_ids()) > 1 else missing[0].label
            said = f"this session did not set {what}" if against == SESSION else f"{against} says nothing of {what}"
            raise UsageError(
                said,
                hint=Hint(
                    Action.VERIFY, {"file": "FILE"}, "compares with a script, a DCF or an EDS; else map or set it first"
                ),
            )
    return {node_id: configured[node_id].only(wanted) for node_id, wanted in sorted(asked.items())} or configured


def compare_node(
    session: SessionNodes, node: Node, pdos: Collection[Pdo] = (), file: str | None = None, *, frame: bool = False
) -> Compared:
    """Compare *pdos* (empty: everything) of *node* with this session's changes, or the DCF or EDS *file*.

    Raises UsageError if there is nothing to compare.
    """
    target = session_target(node) if file is None else _device_config(session, node, told_of(file, session.reporter))
    missing = [pdo.label for pdo in pdos if pdo not in target.pdos]
    if missing or not target:
        what = f"set {missing[0]}" if missing else "set anything"
        said = f"{file} does not {what}" if file else f"this session did not {what}"
        raise UsageError(f"nothing to compare: {said}", node=node.node_id)
    return compare(session, node, target.only(pdos) if pdos else target, file, frame=frame)


def compare(
    session: SessionNodes,
    node: Node,
    target: TargetConfig,
    file: str | None = None,
    *,
    frame: bool = False,
    named: bool = False,
) -> Compared:
    """Compare a node; again after a frame, as the node was started and may have restarted."""
    format_value = partial(planned_words, node)
    found = config_differences(node, target, format_value)
    frames, note = look(session, node, [pdo for pdo in target.pdos if pdo.is_tpdo]) if frame else ((), "")
    found = config_differences(node, target, format_value) if frame else found
    if file is None:
        _judge(node, target, differs=bool(found))
    return Compared(
        node.node_id, len(target.pdos), target.parameters, found, file or SESSION, frames, note,
        objects=target.objects, frame_asked=frame, named=named, unsaid=target.unsaid, not_comparable=target.unreadable,
        labels=tuple(_labels(target)),
    )  # fmt: skip


def _labels(target: TargetConfig) -> Iterator[str]:
    yield from (pdo.label for pdo in target.pdos)
    yield from (f"{index:04X}:{sub_index:02X}" for index, sub_index in target.values)
    yield from dict(target.unwritten)
    yield from target.also_equal


def _judge(node: Node, target: TargetConfig, *, differs: bool) -> None:
    """Forbid a store after a difference; only a full comparison without differences allows it again."""
    suspicions = node.pending.suspicions
    if differs:
        suspicions[VERIFY] = "verify found differences from the values that this session set"
    elif set(node.wanted) <= set(target.pdos) and set(node.wanted_values) <= set(target.values):
        suspicions.pop(VERIFY, None)
        suspicions.pop(REBOOT, None)


def _device_config(session: SessionUser, node: Node, held: HeldDevice) -> TargetConfig:
    """Return the configuration in a DCF, an XDC or a backup for this node, or an EDS's default PDOs.

    Raises SafetyRefusal if the file is for another product.
    """
    if holds_values(held.name):
        from dvtcli.operations.devices.plan_device import wanted_alone

        found = wanted_alone(node, held)
        if found is not None or held.dictionary is None:
            return found or TargetConfig()
        session.reporter.note(f"{held.name} has no values: its defaults are compared")
    assert held.dictionary is not None  # noqa: S101 - only a backup describes nothing
    values = FileValues(held.dictionary, node.node_id)
    return TargetConfig({pdo: read_pdo(values, pdo) for pdo in present_pdos(values, held.dictionary)})
