"""Set node-IDs of the nodes of a network file, found by their identity."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import astuple, replace
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.hint import Action, Hint, as_hint
from dvtcli.domain.lss_services import PARTS, LssAddress
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.text import join_some
from dvtcli.errors import DvtcliError, NoAnswer, SafetyRefusal, UsageError
from dvtcli.operations.lss.lss_find import Identity, in_words, lss_bus, scanned, selected, two_alike, who_is_there
from dvtcli.operations.lss.lss_node_id import (
    all_back,
    consent_to_give,
    give,
    prove_all,
    received_node_ids,
    store_all,
    told_id,
)
from dvtcli.operations.plans.read_network_config import read_network_config
from dvtcli.operations.results.lss_nodes import LssChanged, LssGiven, LssNode

if TYPE_CHECKING:
    from dvtcli.domain.network.network_config import ExpectedIdentity, NodeConfig
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


def to_store(
    session: SessionUser, master: LssMaster, settled: Sequence[NodeConfig], there: Mapping[int, Identity | None]
) -> list[LssGiven]:
    """Return the *settled* nodes that LSS can store; warns of the others.

    *there* is the 0x1018 of each node-ID. Raises DeviceRefused if several nodes have the same address, SafetyRefusal if
    a node's node-ID differs by LSS and by SDO.
    """
    kept: list[LssGiven] = []
    out_of_reach: list[str] = []
    for config in settled:
        told = [part for part in there.get(config.node_id) or () if part is not None]
        one = (
            LssGiven(LssAddress(*told), config.node_id, config.node_id, name=config.name)
            if len(told) == PARTS
            else None
        )
        if one is not None and _takes_part(master, one):
            kept.append(one)
        else:
            out_of_reach.append(f"{config.name} ({config.node_id})")
    master.let_wait()
    if out_of_reach:
        session.reporter.warning(
            f"not stored, since LSS cannot reach them: {join_some(out_of_reach)}; store their node-IDs as their "
            f"manuals describe"
        )
    return kept


def _takes_part(master: LssMaster, one: LssGiven) -> bool:
    try:
        now = selected(master, one.address)
    except NoAnswer:
        return False
    require_same(one, now)
    return True


def require_same(one: LssGiven, now: int) -> None:
    """Raises SafetyRefusal if a node's node-ID by LSS (*now*) differs from that by SDO."""
    if now != one.before:
        raise SafetyRefusal(
            f"{one.name} has node-ID {told_id(now)} by LSS, but {told_id(one.before)} by SDO",
            why=str(one.address),
            hint=Hint(Action.RESET_COMMUNICATION, why="a new node-ID takes effect at a reset: {}"),
        )


#: temporary node-IDs, best first: low node-IDs are of masters and first machines
_FOR_THE_TIME_BEING = range(126, 0, -1)


def in_order(given: Sequence[LssGiven], used: Collection[int], kept: Collection[int]) -> list[LssGiven]:
    """Order the steps so that each of *given* gets a node-ID that is free by then.

    *used* are current node-IDs, *kept* further node-IDs that must stay free. Nodes that block each other use a
    temporary node-ID; raises SafetyRefusal if none is free, or if a node-ID belongs to a node that stays.
    """
    left, taken, steps = list(given), set(used), []
    wanted = {slave.node_id for slave in given} | set(kept)
    while left:
        free = next((slave for slave in left if slave.node_id not in taken), None)
        if free is None:
            free = _aside(left, taken | wanted)
            left[left.index(_of(left, free))] = replace(_of(left, free), before=free.node_id)
        else:
            left.remove(free)
        taken = taken - {free.before} | {free.node_id}
        steps.append(free)
    return steps


def _aside(left: Sequence[LssGiven], not_free: Collection[int]) -> LssGiven:
    """Return a step to a temporary node-ID for one of *left*."""
    one = next((slave for slave in left if any(other.node_id == slave.before for other in left)), None)
    node_id = next((node_id for node_id in _FOR_THE_TIME_BEING if node_id not in not_free), None)
    if one is None or node_id is None:
        raise SafetyRefusal(
            f"node-ID {left[0].node_id} is in use" if one is None else "no node-ID is free for a swap of node-IDs",
            hint=Hint(Action.FIND_NODES, why="lists the nodes on the bus"),
        )
    return replace(one, node_id=node_id)


def _of(left: Sequence[LssGiven], step: LssGiven) -> LssGiven:
    return next(slave for slave in left if slave.address == step.address)


def lss_assign(session: SessionNodes, file: str, *, stores: bool = False, prove: bool = False) -> LssChanged:
    """Set the node-IDs of the network *file* on nodes with another node-ID or none.

    Nodes are found by their identity in the file. Reports the plan and asks. Nodes with the right node-ID are left
    alone, nodes not found are `missing`. If a node does not come up with its node-ID, all are rolled back. *stores*
    stores all, once all came up, even unchanged nodes: theirs may be in RAM only. *prove* then resets and checks each
    node. Raises SafetyRefusal if a node-ID is another device's, an identity fits several nodes, or another master is
    active.
    """
    nodes = read_network_config(file).nodes
    options = _with_identity(session, file, nodes)
    if session.dry_run:
        return LssChanged("assign", dry_run=True)
    bus = lss_bus(session)
    there = who_is_there(bus, received_node_ids(session))
    waiting = [config for config in options if not _is_there(config, there)]
    if not (waiting or stores):
        return LssChanged("assign")
    settled = {config.node_id for config in nodes if config not in waiting}
    with LssMaster(bus) as master:
        kept = (
            to_store(session, master, [config for config in options if config not in waiting], there) if stores else []
        )
        found = [*scanned(session, master), *_movable(there, settled)] if waiting else []
        given, missing = _matched(waiting, found)
        _refuse_used(waiting, given, there)
        _confirm(master, given)
        steps = in_order(given, there, {config.node_id for config in nodes})
        if steps or kept:
            _agree(session, steps, kept, stores=stores, prove=prove)
            with session.cancellation.deferred():
                _give_all(session, master, steps)
                given = store_all(bus, master, kept, given, steps) if stores else given
                given = prove_all(session, master, given) if prove else given
    return LssChanged("assign", tuple(sorted(given, key=lambda slave: slave.node_id)), missing=missing)


def _with_identity(session: SessionUser, file: str, nodes: Sequence[NodeConfig]) -> list[NodeConfig]:
    """Return the *nodes* that LSS can find and report the others; raises UsageError if there are none."""
    options = [config for config in nodes if any(part is not None for part in astuple(config.identity))]
    if not options:
        hint = "add identity: {vendor: 0x1E, serial: 0x12345} under the node"
        raise UsageError(f"{file}: no node has an identity, which LSS needs to find it", hint=hint)
    others = [f"{config.name} ({config.node_id})" for config in nodes if config not in options]
    if others:
        session.reporter.note(f"no identity in {file}, not changed: {join_some(others)}")
    return options


def _is_there(config: NodeConfig, there: Mapping[int, Identity | None]) -> bool:
    """Tell whether the node already has its node-ID."""
    identity = there.get(config.node_id)
    return identity is not None and _fits(identity, config.identity)


def _fits(identity: Sequence[int | None], wanted: ExpectedIdentity) -> bool:
    return all(want in (None, part) for part, want in zip(identity, astuple(wanted), strict=True))


def _movable(there: Mapping[int, Identity | None], settled: Collection[int]) -> list[LssNode]:
    """Return nodes with a complete address whose node-IDs are not those of *settled* nodes."""
    found: list[LssNode] = []
    for node_id, identity in there.items():
        told = [part for part in identity or () if part is not None]
        if node_id not in settled and len(told) == PARTS:
            found.append(LssNode(LssAddress(*told), node_id))
    return found


def _matched(options: Sequence[NodeConfig], found: Sequence[LssNode]) -> tuple[list[LssGiven], tuple[str, ...]]:
    """Match *found* nodes to node-IDs, and name missing nodes; raises SafetyRefusal if ambiguous."""
    given: list[LssGiven] = []
    missing: list[str] = []
    for config in options:
        fitting = [node for node in found if _fits(node.address.parts, config.identity)]
        if len(fitting) > 1:
            raise SafetyRefusal(
                f"{len(fitting)} nodes fit the identity of {config.name}", node=config.node_id,
                why="; ".join(f"node-ID {told_id(_id(node))}: {node.address}" for node in fitting),
                hint="add serial: to their identities",
            )  # fmt: skip
        if not fitting:
            missing.append(config.name)
            continue
        (node,) = fitting
        if not node.confirmed:
            raise two_alike(node.address)
        twice = next((slave.name for slave in given if slave.address == node.address), None)
        if twice is not None:
            raise SafetyRefusal(f"{twice} and {config.name} have the same identity", hint=str(node.address))
        given.append(LssGiven(node.address, _id(node), config.node_id, name=config.name))
    return given, tuple(missing)


def _id(node: LssNode) -> int:
    return UNCONFIGURED if node.node_id is None else node.node_id


def _refuse_used(
    options: Sequence[NodeConfig], given: Sequence[LssGiven], there: Mapping[int, Identity | None]
) -> None:
    """Raises SafetyRefusal if a node-ID of *options* is in use by a node that keeps it."""
    moving = {slave.before for slave in given}
    for config in options:
        if config.node_id in there and config.node_id not in moving:
            identity = there[config.node_id]
            raise SafetyRefusal(
                f"node-ID {config.node_id} is in use, and not by {config.name}",
                node=config.node_id,
                why=f"0x1018 says {in_words(identity)}"
                if identity
                else "it sends frames, but its identity cannot be read",
                hint=Hint(Action.SHOW_NODE, {"node": config.node_id}, "shows the node that has it")
                + _another(identity, {*there, *(config.node_id for config in options)}),
            )


def _another(identity: Identity | None, taken: Collection[int]) -> Hint:
    """Suggest how the node of *identity* gets a node-ID that is not *taken*."""
    told = [part for part in identity or () if part is not None]
    free = next((node_id for node_id in range(1, 128) if node_id not in taken), None)
    if len(told) != PARTS or free is None:
        return as_hint("its LSS address is unknown: change its node-ID with its switches or its own tool")
    address = tuple(str(LssAddress(*told)).split())
    return Hint(Action.LSS_NODE_ID, {"id": free, "address": address}, "gives it another node-ID")


def _confirm(master: LssMaster, given: Sequence[LssGiven]) -> None:
    """Verify by LSS that each of *given* is present once with its old node-ID; raises otherwise."""
    for slave in given:
        require_same(slave, selected(master, slave.address))
    master.let_wait()


def _agree(
    session: SessionNodes, steps: Sequence[LssGiven], kept: Sequence[LssGiven], *, stores: bool, prove: bool
) -> None:
    """Report the plan and ask."""
    lines = [f"{step.name} gets node-ID {step.node_id} (now {told_id(step.before)})" for step in steps]
    lines += [f"{slave.name} stores node-ID {slave.node_id}, which it has" for slave in kept]
    if len(lines) > 1:
        for number, line in enumerate(lines, 1):
            session.reporter.note(f"plan {number}: {line}")
    consent_to_give(session, steps, kept, store=stores, prove=prove)


def _give_all(session: SessionNodes, master: LssMaster, steps: Sequence[LssGiven]) -> None:
    """Carry out *steps*; if a node does not come up, roll all back."""
    done: list[LssGiven] = []
    for number, step in enumerate(steps):
        session.reporter.progress(f"LSS: node-ID {step.node_id} to {step.name}", number, len(steps))
        try:
            selected(master, step.address)
            give(session, master, step)
        except DvtcliError as failed:
            raise all_back(session.bus, master, done, failed, at=step) from failed
        done.append(step)
