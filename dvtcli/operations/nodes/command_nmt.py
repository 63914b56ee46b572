"""Send NMT commands to a node or all nodes, and check the resulting states."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.device.nmt_gate import NodeAccess
from dvtcli.device.resets import SentReset, reset_all_and_wait, send_reset
from dvtcli.device.seen_state import CONFIRM_S, seen_state, seen_states
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.profile import GENERIC
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError
from dvtcli.operations.results import Commanded
from dvtcli.operations.session.consent import consent_to_reset, consent_to_reset_silent

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.operations.session.session import SessionNodes


def command_nmt(session: SessionNodes, command: NmtCommand, node_id: int | None = None) -> Commanded:
    """Send *command* to *node_id* (0: all nodes, None: the selected node), and check each node's state.

    A reset of a node that could move needs consent, else SafetyRefusal. The result names changes lost by a reset.
    """
    target = session.node_id() if node_id is None else node_id
    if target and command.is_reset:
        return end_reset(session, begin_reset(session, command, target))
    if session.dry_run and not target:
        _meet_all(session)
    concerned = {target} if target else _known(session)
    if command.is_reset:
        concerned = _received(session)
        consent_to_reset(session, concerned)
        if not concerned:
            consent_to_reset_silent(session)
    nodes = _told(session, concerned)
    silent: list[int] = []
    states = {target: _to_one(session, target, command)} if target else _to_all(session, command, silent)
    return _commanded(session, target, command, nodes, states, silent)


@dataclass(frozen=True, slots=True)
class BegunReset:
    """A node that is being reset; *met* is the node if known before."""

    command: NmtCommand
    sent: SentReset
    met: list[Node]

    @property
    def node_id(self) -> int:
        """The node's."""
        return self.sent.node_id


def begin_reset(session: SessionNodes, command: NmtCommand, node_id: int) -> BegunReset:
    """Send the reset *command* to *node_id* (1..127); if it could move, needs consent, else SafetyRefusal."""
    consent_to_reset(session, {node_id})
    met = _told(session, {node_id})
    return BegunReset(command, send_reset(_access(session, node_id), command), met)


def end_reset(session: SessionNodes, begun: BegunReset) -> Commanded:
    """Wait for the node's boot-up message, or another answer, and read its state; raises NoAnswer if none comes."""
    begun.sent.wait()
    silent = [] if begun.sent.booted else [begun.node_id]
    state = session.node(begun.node_id).access.state()
    return _commanded(session, begun.node_id, begun.command, begun.met, {begun.node_id: state}, silent)


def _told(session: SessionNodes, node_ids: Collection[int]) -> list[Node]:
    """Return the met nodes among *node_ids*, with their caches dropped before the command."""
    nodes = [node for node in session.network.nodes.values() if node.node_id in node_ids]
    for node in nodes:
        node.commanded()
    return nodes


def _commanded(
    session: SessionNodes,
    target: int,
    command: NmtCommand,
    nodes: Sequence[Node],
    states: Mapping[int, NmtState | None],
    silent: Sequence[int],
) -> Commanded:
    """Make the result: the *states*, and changes of met *nodes* lost by a reset.

    *silent* are nodes that answer after a reset without a boot-up message.
    """
    reset = command.is_reset
    communication = command is NmtCommand.RESET_COMMUNICATION
    lost = tuple(
        f"{label} of node {node.node_id}"
        for node in (nodes if reset else [])
        for label in node.was_reset(communication=communication)
    )
    if not session.dry_run:
        said = f"nmt {command.word}{'' if target else ' all'}"
        session.record.add(target or session.selected_id() or 0, [said])
    if reset and session.in_script:
        _note_what_came_up(session, states)
    seen = tuple((seen_id, None if state is None else state.label) for seen_id, state in sorted(states.items()))
    notes: list[Hint | str] = [
        f"node {node_id} sent no boot-up message, and answers: whether it restarted is not known" for node_id in silent
    ]
    for note in notes:
        session.reporter.warning(note)
    notes += _interrupted(session, {*states, *([] if target else [session.selected_id()])})
    if not (target or reset or session.dry_run or session.bus.simulated):
        session.reporter.note(_UNSEEN)
    wanted = None if reset else command.after.label
    return Commanded(target, command.word, seen, session.dry_run, lost, wanted, tuple(notes))


_UNSEEN = Hint(Action.FIND_NODES, why="nodes without a heartbeat may have got it, too, unconfirmed: {} finds them")


def _known(session: SessionNodes) -> set[int]:
    """Return the node-IDs that were met or heard."""
    return {*session.network.nodes, *([] if session.dry_run else session.open_network().bus.nodes_seen())}


def _received(session: SessionNodes) -> set[int]:
    """Return the nodes present, as known before a reset of all: met, selected and answering, or heard."""
    if not session.dry_run and not session.bus.simulated:
        session.bus.sleep(CONFIRM_S)  # the first command of a session has heard nobody yet
        selected = session.selected_id()
        if selected is not None:
            with suppress(NoAnswer, SdoProtocolError):  # selected, and not there
                session.node(selected)
    return _known(session)


def _meet_all(session: SessionNodes) -> None:
    """Make twins of all nodes that are heard or selected, so that a dry run names them."""
    bus = session.open_network().bus
    if not bus.simulated:
        bus.sleep(CONFIRM_S)
    selected = session.selected_id()
    for node_id in sorted({*bus.nodes_seen(), *([] if selected is None else [selected])}):
        with suppress(NoAnswer, SdoProtocolError):  # heard, and answers nothing: there is no twin of it
            session.node(node_id)


def _interrupted(session: SessionNodes, node_ids: Iterable[int | None]) -> tuple[Hint | str, ...]:
    """Report interrupted changes of the nodes."""
    network = session.open_network()  # under --dry-run, too: what is left half configured is the node itself
    said = (
        network.interrupted(node_id) for node_id in sorted(known_id for known_id in node_ids if known_id is not None)
    )
    return tuple(dict.fromkeys(text for text in said if text))  # one of several nodes is said once


def _access(session: SessionNodes, node_id: int) -> NodeAccess:
    """Return access without identification: an unknown node may be stopped and silent."""
    met = session.network.nodes.get(node_id)
    return met.access if met is not None else NodeAccess(session.bus, node_id, GENERIC)


def _to_one(session: SessionNodes, target: int, command: NmtCommand) -> NmtState | None:
    """Command a node without a reset; returns its state, None if unknown."""
    access = _access(session, target)
    session.bus.send_nmt(command, target)
    if command.after is not NmtState.STOPPED:
        access = session.node(target).access
    return seen_state(access, command.after)


def _to_all(session: SessionNodes, command: NmtCommand, silent: list[int]) -> dict[int, NmtState | None]:
    """Command all nodes; returns the states of met and heard nodes, None if unknown.

    Adds nodes that answer after a reset without a boot-up message to *silent*.
    """
    bus, known = session.bus, _known(session)
    if command.is_reset:
        silent += reset_all_and_wait(bus, command, known)
        return {node_id: _access(session, node_id).state() for node_id in known}
    bus.send_nmt(command, 0)
    if not known and not session.dry_run:
        bus.sleep(CONFIRM_S)  # nobody was heard before: who is there says so now
    states = seen_states({node_id: _access(session, node_id) for node_id in known | _known(session)}, command.after)
    late = _known(session) - states.keys()
    return states | seen_states({node_id: _access(session, node_id) for node_id in late}, command.after)


def _note_what_came_up(session: SessionNodes, node_ids: Iterable[int]) -> None:
    """Read the boot-up values of met nodes, for `store --if-changed`."""
    for node in (session.network.nodes[node_id] for node_id in node_ids if node_id in session.network.nodes):
        with suppress(NoAnswer, SdoAborted, SdoProtocolError):  # not known is not unchanged: then it is stored
            node.pdos()
