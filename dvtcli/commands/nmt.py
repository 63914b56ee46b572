"""Send an NMT command: start, stop, pre-operational, or a reset; and see that it worked."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.params import CanopenType, NumberType
from dvtcli.shell import DvtCommand

if TYPE_CHECKING:
    from dvtcli.results import Commanded
    from dvtcli.session import Session

_COMMANDS = {
    "start": (NmtCommand.START, NmtState.OPERATIONAL),
    "stop": (NmtCommand.STOP, NmtState.STOPPED),
    "preop": (NmtCommand.ENTER_PRE_OPERATIONAL, NmtState.PRE_OPERATIONAL),
    "reset-node": (NmtCommand.RESET_NODE, NmtState.PRE_OPERATIONAL),
    "reset-comm": (NmtCommand.RESET_COMMUNICATION, NmtState.PRE_OPERATIONAL),
}
#: Longest wait for a heartbeat that confirms the new state, in seconds.
_CONFIRM_S = 1.5


class NodeOrAll(CanopenType):
    """A node-ID, or the word `all`."""

    name = "node"

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """The node-ID; 0 for all."""
        return 0 if text.lower() == "all" else int(NumberType(1, 127, "a node-ID").parse(text, ctx))


@click.command("nmt", cls=DvtCommand, short_help=__doc__)
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
    from dvtcli.results import Commanded

    specifier, wanted = _COMMANDS[command_]
    target = session.node_id() if node_id is None else node_id
    reset = specifier in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)
    nodes = [node for node in session.network.nodes.values() if target in (0, node.node_id)]
    for node in nodes:
        node.commanded()
    state = None
    if target:
        state = _to_one(session, target, specifier, wanted)
    else:
        session.bus.send_nmt(specifier, 0)
    communication = specifier is NmtCommand.RESET_COMMUNICATION
    lost = tuple(
        f"{label} of node {node.node_id}"
        for node in (nodes if reset else [])
        for label in node.was_reset(communication=communication)
    )
    if not session.dry_run:
        said = f"nmt {command_}{'' if target else ' all'}"
        session.record(target or session.selected_id() or 0, [said])
    return Commanded(target, command_, state.label if state is not None else None, session.dry_run, lost)


def _to_one(session: Session, target: int, specifier: NmtCommand, wanted: NmtState) -> NmtState | None:
    """A node that was not met yet may be stopped, and silent: it is commanded before it is asked who it is."""
    from dvtcli.device.access import Access
    from dvtcli.device.store import reset_and_wait
    from dvtcli.domain.profile import GENERIC

    met = session.network.nodes.get(target)
    access = met.access if met is not None else Access(session.bus, target, GENERIC)
    reset = specifier in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)
    if reset:
        reset_and_wait(access, specifier)
    else:
        session.bus.send_nmt(specifier, target)
    if wanted is not NmtState.STOPPED:
        access = session.node(target).access
    return access.state() if reset else access.confirmed(wanted, _CONFIRM_S)
