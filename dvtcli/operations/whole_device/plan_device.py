"""Plan the writes for a device's file, like those of a network file. Sends nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.other_producers import heard_ids
from dvtcli.device.raw_write_check import readable_value
from dvtcli.device.wish import Wish
from dvtcli.domain.configuration import NotWritten
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.lint.described import object_text
from dvtcli.domain.network.network_plan import NetworkPlan
from dvtcli.domain.network.wanted_state import NetworkWish, NodeWish, WantedIdentity
from dvtcli.domain.pdo import BY_SUB_INDEX, MAPPING, PdoConfig
from dvtcli.errors import UsageError
from dvtcli.operations.consent.power_stage import powered_findings
from dvtcli.operations.meanings.object_values import understood
from dvtcli.operations.meanings.planned_words import planned_words
from dvtcli.operations.plans.apply_network import apply_network
from dvtcli.operations.plans.judge_network import checked
from dvtcli.operations.plans.plan_network import checked_network, plans_of, with_unknown_syncs
from dvtcli.operations.results.failures import together
from dvtcli.operations.sync.unknown_sync import short_frames
from dvtcli.operations.wanted.identify_nodes import identify_nodes, unlike_wanted
from dvtcli.operations.whole_device.device_suffix import refuse_kind
from dvtcli.operations.whole_device.held_device import held_by, told_of
from dvtcli.operations.whole_device.included import included_of
from dvtcli.operations.whole_device.meant_nodes import node_of_file, selected_alone, selected_nodes
from dvtcli.operations.whole_device.wanted_of_file import WantedOfFile, wanted_of_file

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.network.network_plan import LeftOut, NodePlan
    from dvtcli.domain.pdo import Pdo
    from dvtcli.operations.results import NetworkApplied
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.session.session_nodes import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser
    from dvtcli.operations.whole_device.held_device import HeldDevice


def apply_device(
    session: Session,
    file: str,
    options: DeviceOptions,
    *,
    on_plan: Callable[[NetworkPlan], None] = lambda _plan: None,
) -> NetworkApplied:
    """Configure nodes as in *file* (a DCF, an XDC or a backup) by *options*; *on_plan* gets the plan.

    Asks first. A fault rolls the nodes back. A clone with remaining differences is incomplete: exit code 3. Raises as
    `plan_device` and `apply_network`.
    """
    plan = plan_device(session, file, options)
    on_plan(plan)
    done = apply_network(session, plan, name=f"{'clone' if options.is_clone else 'apply'} {file}")
    return replace(done, is_clone=options.is_clone)


#: reasons not to write an object that also prevent its read-back
_READS_ANOTHER_VALUE = frozenset({NotWritten.WRITE_ONLY, NotWritten.STORE, NotWritten.REQUEST, NotWritten.PROGRAM})


@dataclass(frozen=True, slots=True)
class DeviceOptions:
    """Options for a device's file.

    *include* are objects (`3001`, `3001:1`) or ranges of indices (`2000-2FFF`) that the user regards as configuration.
    *is_clone*: the file itself includes the maker's objects that no PDO can map, and must have an identity. *nodes* are
    node-IDs, empty for the selected nodes.
    """

    include: tuple[str, ...] = ()
    is_clone: bool = False
    nodes: tuple[int, ...] = ()


def plan_device(session: Session, file: str, options: DeviceOptions | None = None) -> NetworkPlan:
    """Plan the writes that bring the selected nodes to the values of *file*, a DCF, an XDC or a backup.

    Without a selection the file's node-ID is used, except for a clone. Raises SafetyRefusal if a node is another
    product, RuleError with all refusals of the rules, UsageError if the file cannot be read or no node is chosen.
    """
    options = options or DeviceOptions()
    refuse_kind(file)
    held = told_of(file, session.tell)
    _refuse_nothing(held)
    ids = _node_ids(session, held, options)
    wish = NetworkWish(tuple(_wish(held, node_id) for node_id in ids))
    if options.is_clone and not held.identity["product"]:
        _confirm_unknown(session, held, ids)
    with short_frames(session.bus) as frames, heard_ids(session.bus) as heard:
        met = identify_nodes(session, file, wish)
        met.end()
        planned = [
            replace(node_plan, boot_ups=met.boot_ups[node_plan.node_id])
            for node_plan in _planned(session, met.nodes, held, wish, options)
        ]
        plan = checked_network(session, NetworkPlan(file, tuple(planned)), heard, of_device=True)
    return with_unknown_syncs(session, plan, frames)


def wanted_alone(node: Node, held: HeldDevice) -> Wish | None:
    """Return the unjudged wishes of *held* for *node*, read again; None if it has no value.

    Raises SafetyRefusal if the file is for another product.
    """
    held = held if held.node_id else held_by(held.name, node.node_id)
    if not _says_anything(held):
        return None
    node.read_anew()
    for unlike in unlike_wanted(node, _wish(held, node.node_id).identity, force=False):
        raise unlike
    found = wanted_of_file(node, held)
    unwritten = tuple(
        (left_out.object, _unwritten(node, left_out)) for left_out in found.left_out.values() if left_out.remains
    )
    pdos = {pdo: want for pdo, want in found.wants.pdos.items() if isinstance(want, PdoConfig)}
    said = {pdo: _said_of(held, pdo, config) for pdo, config in pdos.items()}
    unreadable = [left_out.object for left_out in found.left_out.values() if _reads_another_value(node, left_out)]
    blind = {place for place in found.wants.values if readable_value(node, *place) is None}
    return Wish(
        pdos,
        {place: data for place, data in found.wants.values.items() if place not in blind},
        said,
        unwritten=unwritten,
        also_equal=tuple(object_text(*place) for place in found.also_equal),
        unreadable=(*unreadable, *(object_text(*place) for place in sorted(blind))),
    )


def _reads_another_value(node: NodeDescription, one: LeftOut) -> bool:
    """Tell whether the object is writable but does not read back the written value."""
    index, sub_index = (int(part, 16) for part in one.object.split(":")) if ":" in one.object else (0, 0)
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    return one.why in _READS_ANOTHER_VALUE and entry is not None and entry.access.writable


def _said_of(held: HeldDevice, pdo: Pdo, config: PdoConfig) -> frozenset[str]:
    """Return the parameters of *pdo* in *held* or missing on the node: others are the node's own."""
    places = held.objects.keys() - held.assumed
    said = {
        name
        for sub_index, name in BY_SUB_INDEX.items()
        if (pdo.communication_index, sub_index) in places or getattr(config.communication, name) is None
    }
    return frozenset(said | {MAPPING} if any(index == pdo.mapping_index for index, _ in places) else said)


def _unwritten(node: NodeDescription, one: LeftOut) -> str:
    """Describe a differing setting that `apply` does not write."""
    if one.held is None or one.said is None:
        return f"differs, and apply does not write it: {one.why}"
    index, sub_index = (int(part, 16) for part in one.object.split(":"))
    held, said = (planned_words(node, index, sub_index, data) for data in (one.held, one.said))
    return f"is {held}, expected {said}; apply does not write it: {one.why}"


def _node_ids(session: SessionNodes, held: HeldDevice, options: DeviceOptions) -> tuple[int, ...]:
    """Return the chosen nodes; reports a different node-ID in the file."""
    if options.is_clone:
        ids = options.nodes or selected_alone(session, held)
    else:
        ids = options.nodes or selected_nodes(session) or (node_of_file(session, held),)
    others = [str(other_id) for other_id in ids if held.node_id not in (None, other_id)]
    if others:
        text = f"{held.name} is of node {held.node_id}: on node {', '.join(others)} what follows the node-ID does so"
        session.tell.note(text)
    return ids


def _wish(held: HeldDevice, node_id: int) -> NodeWish:
    identity = WantedIdentity(held.identity["vendor"] or None, held.identity["product"] or None)
    return NodeWish(Path(held.name).name, node_id, identity)


def _says_anything(held: HeldDevice) -> bool:
    return bool(held.objects.keys() - held.assumed)


def _refuse_nothing(held: HeldDevice) -> None:
    """Raises UsageError if *held* has no value itself: equality with it would mean nothing."""
    if not _says_anything(held):
        raise UsageError(
            f"{held.name} does not say what a device is to hold: it has no value of any object",
            place=held.name,
            hint=Hint(Action.COMPARE, {"file": held.name})
            + Hint(Action.VERIFY, {"file": held.name}, " and {} take its defaults")
            + Hint(Action.RESTORE, why="brings a device's own")
            + Hint(Action.EXPORT, {"file": "x.dcf"}, "writes one"),
        )


def _nothing_compared(held: HeldDevice) -> UsageError:
    """Make the error if no node could be compared: *held* has no configuration."""
    return UsageError(
        f"nothing compared: {held.name} says no setting of a device, only what nobody writes",
        place=held.name,
        hint=Hint(Action.BACKUP, why="is it the whole file? {} makes one now")
        + Hint(Action.GIVE, {"include": "2001"}, "names what is configuration"),
    )


def _confirm_unknown(session: SessionUser, held: HeldDevice, ids: Sequence[int]) -> None:
    """Ask for each node-ID of *ids* to be typed: *held* does not say of which product it is.

    Raises SafetyRefusal without that confirmation; --force needs none.
    """
    if session.options.force:
        return
    for node_id in ids:
        session.require_typed(
            f"{held.name} does not say which product it is of: write it to node {node_id} all the same?",
            str(node_id),
            node_id,
            Hint(Action.FORCE, why="{} writes it to this node; else ")
            + Hint(
                Action.APPLY,
                {"file": held.name},
                "writes what is configuration by the standards, on whatever device is selected",
            ),
        )


def _planned(
    session: SessionNodes, nodes: dict[int, Node], held: HeldDevice, wish: NetworkWish, options: DeviceOptions
) -> Iterator[NodePlan]:
    found: dict[int, WantedOfFile] = {}
    for node_id, node in nodes.items():
        own = held if held.node_id else held_by(held.name, node_id)
        included = included_of(node, own, options.include)
        found[node_id] = wanted_of_file(node, own, included, names_makers=options.is_clone)
        for text in found[node_id].idle:
            session.tell.warning(text)
    if not any(found.values()):
        raise _nothing_compared(held)
    planned, refused = plans_of(nodes, wish, {node_id: found_node.wants for node_id, found_node in found.items()}, {})
    if refused:
        raise together(refused)
    said = [_said(plan, nodes[plan.node_id], held, found[plan.node_id]) for plan in planned]
    judged = checked(nodes, said, force=session.options.force)
    return (_powered(session, plan) if len(plan.plan) else plan for plan in judged)


def _powered(session: SessionNodes, planned: NodePlan) -> NodePlan:
    """Warn if an enabled power stage would make `apply` refuse *planned*."""
    return replace(planned, findings=(*planned.findings, *powered_findings(session, planned.node_id)))


def _said(planned: NodePlan, node: ReadableNode, held: HeldDevice, found: WantedOfFile) -> NodePlan:
    left_out = tuple(omission for _, omission in sorted(found.left_out.items()))
    sizes = {left_object.object: len(left_object.held) for left_object in left_out if left_object.held is not None}
    known = planned.understood | understood(node, sizes)
    return replace(
        planned, left_out=left_out, also_equal=len(found.also_equal), also_held=found.also_equal,
        understood=known, needs_power_off=True,
        doubt=_doubt(node, held),
    )  # fmt: skip


def _doubt(node: ReadableNode, held: HeldDevice) -> str:
    """Return the question before a file with this identity is written to *node*; empty if none."""
    said, is_now = held.identity["revision"], node.identity()["revision"]
    if not (held.identity["vendor"] or held.identity["product"]):
        return f"{held.name} does not say which product it is of"
    if not said or said == is_now:
        return ""
    now = "none" if is_now is None else f"0x{is_now:08X}"
    return f"node {node.node_id} has revision {now}, and {held.name} is of 0x{said:08X}"
