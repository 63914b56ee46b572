"""Send an NMT command: start, stop, pre-operational, or a reset; and see that it worked."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import CanopenType, NumberType
from dvtcli.domain.nmt import NmtCommand, NmtState

if TYPE_CHECKING:
    from dvtcli.device.nmt_gate import Access
    from dvtcli.operations.results import Commanded
    from dvtcli.operations.session import Session

TASK = ("Find nodes", 30)

_COMMANDS = {
    "start": (NmtCommand.START, NmtState.OPERATIONAL),
    "stop": (NmtCommand.STOP, NmtState.STOPPED),
    "preop": (NmtCommand.ENTER_PRE_OPERATIONAL, NmtState.PRE_OPERATIONAL),
    "reset-node": (NmtCommand.RESET_NODE, NmtState.PRE_OPERATIONAL),
    "reset-comm": (NmtCommand.RESET_COMMUNICATION, NmtState.PRE_OPERATIONAL),
}
_RESETS = (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)


class NodeOrAll(CanopenType):
    """A node-ID, or the word `all`."""

    name = "node"

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """The node-ID; 0 for all."""
        return 0 if text.lower() == "all" else int(NumberType(1, 127, "a node-ID").parse(text, ctx))


@click.command("nmt", cls=DvtCommand, short_help=__doc__, effect=Effect.COMMANDS)
@click.argument("command_", type=click.Choice(list(_COMMANDS)), metavar="start|stop|preop|reset-node|reset-comm")
@click.argument("node_id", type=NodeOrAll(), required=False, metavar="[NODE|all]")
@click.pass_obj
def command(session: Session, /, command_: str, node_id: int | None) -> Commanded:
    """Command a node's NMT state.

    \b
    nmt start
    nmt preop 5
    nmt reset-node all
    """
    from dvtcli.operations.reset_consent import consent_to_reset
    from dvtcli.operations.results import Commanded

    specifier, wanted = _COMMANDS[command_]
    target = session.node_id() if node_id is None else node_id
    reset = specifier in _RESETS
    concerned = {target} if target else _known(session)
    if reset:
        consent_to_reset(session, concerned)
    nodes = [node for node in session.network.nodes.values() if node.node_id in concerned]
    for node in nodes:
        node.commanded()
    states = {target: _to_one(session, target, specifier, wanted)} if target else _to_all(session, specifier, wanted)
    communication = specifier is NmtCommand.RESET_COMMUNICATION
    lost = tuple(
        f"{label} of node {node.node_id}"
        for node in (nodes if reset else [])
        for label in node.was_reset(communication=communication)
    )
    if not session.dry_run:
        said = f"nmt {command_}{'' if target else ' all'}"
        session.record(target or session.selected_id() or 0, [said])
    if reset and session.in_script:
        _note_what_came_up(session, states)
    seen = tuple((one, None if state is None else state.label) for one, state in sorted(states.items()))
    return Commanded(target, command_, seen, session.dry_run, lost, None if reset else wanted.label)


def _known(session: Session) -> set[int]:
    """The nodes that were met, and those that were heard."""
    from dvtcli.operations.layouts import open_wire

    return {*session.network.nodes, *([] if session.dry_run else open_wire(session).heard_nodes())}


def _access(session: Session, node_id: int) -> Access:
    """A node that was not met yet may be stopped, and silent: it is commanded before it is asked who it is."""
    from dvtcli.device.nmt_gate import Access
    from dvtcli.domain.profile import GENERIC

    met = session.network.nodes.get(node_id)
    return met.access if met is not None else Access(session.bus, node_id, GENERIC)


def _to_one(session: Session, target: int, specifier: NmtCommand, wanted: NmtState) -> NmtState | None:
    """Command one node; the state that it is seen in, None where it cannot be seen."""
    from dvtcli.device.seen_state import seen_state
    from dvtcli.device.store_parameters import reset_and_wait

    access = _access(session, target)
    if specifier in _RESETS:
        reset_and_wait(access, specifier)
        return session.node(target).access.state()
    session.bus.send_nmt(specifier, target)
    if wanted is not NmtState.STOPPED:
        access = session.node(target).access
    return seen_state(access, wanted)


def _to_all(session: Session, specifier: NmtCommand, wanted: NmtState) -> dict[int, NmtState | None]:
    """Command all nodes; the states of those that were met or are heard, None where one cannot be seen."""
    from dvtcli.device.seen_state import CONFIRM_S, seen_states
    from dvtcli.device.store_parameters import reset_all_and_wait

    bus, known = session.bus, _known(session)
    if specifier in _RESETS:
        reset_all_and_wait(bus, specifier, known)
        return {node_id: _access(session, node_id).state() for node_id in known}
    bus.send_nmt(specifier, 0)
    if not known and not session.dry_run:
        bus.sleep(CONFIRM_S)  # nobody was heard before: who is there says so now
    states = seen_states({node_id: _access(session, node_id) for node_id in known | _known(session)}, wanted)
    late = _known(session) - states.keys()
    return states | seen_states({node_id: _access(session, node_id) for node_id in late}, wanted)


def _note_what_came_up(session: Session, node_ids: Iterable[int]) -> None:
    """Read what a met node came up with: `store --if-changed` compares with that."""
    from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError

    for node in (session.network.nodes[node_id] for node_id in node_ids if node_id in session.network.nodes):
        with suppress(NoAnswer, SdoAborted, SdoProtocolError):  # not known is not unchanged: then it is stored
            node.pdos()
