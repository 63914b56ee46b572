"""Send an NMT command (start, stop, preop, reset-node, reset-comm) and check that it worked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect, Final
from dvtcli.cli.params import CanopenType, NumberType
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.text import join_some
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import Commanded

_WORDS = {command.word: command for command in NmtCommand}


class NmtWord(click.Choice[str]):
    """A word of an NMT command; also `pre-op`, as answers call that state."""

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the word."""
        return super().convert("preop" if value.lower() == "pre-op" else value, param, ctx)


class NodeOrAll(CanopenType):
    """A node-ID, or the word `all`."""

    name = "node"

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """The node-ID; 0 for all."""
        return 0 if text.lower() == "all" else int(NumberType(1, 127, "a node-ID").parse(text, ctx))


def _final(params: Mapping[str, Any]) -> Final | None:
    """Some NMT commands lose changes, or put them to work."""
    one = _WORDS[params["command_"]]
    return Final(f"nmt {one.word}", one.is_reset) if one.is_reset or one is NmtCommand.START else None


@click.command("nmt", cls=DvtCommand, short_help=__doc__, effect=Effect.COMMANDS, final=_final)
@click.argument("command_", type=NmtWord(list(_WORDS)), metavar="start|stop|preop|reset-node|reset-comm")
@click.argument("node_id", type=NodeOrAll(), required=False, metavar="[NODE|all]")
@click.pass_obj
def command(session: Conversation, /, command_: str, node_id: int | None) -> Commanded:
    """Command a node's NMT state.

    \b
    nmt start
    nmt preop 5
    nmt reset-node all
    """
    from dvtcli.operations.nodes.command_nmt import command_nmt

    is_open = node_id is None and session.selected_id() is None
    if is_open and session.base.every_node:
        node_id = 0
    elif is_open and session.base.nodes:
        raise UsageError(
            f"nmt {command_} takes one node or `all`, and -n names several",
            hint=_several(command_, session.base.nodes),
        )
    if node_id == 0 and len(session.base.nodes) > 1 and _is_typed_alone(session):
        raise UsageError(
            f"`all` means every node on the bus, and -n names {join_some(map(str, session.base.nodes))}",
            hint=_several(command_, session.base.nodes),
        )
    if is_open and node_id is None:
        raise UsageError(
            f"no node is selected for nmt {command_}",
            hint=Hint(Action.CORRECT, {"words": ("nmt", command_, "all")}, "{} commands all nodes on the bus")
            + Hint(Action.CORRECT, {"words": ("nmt", command_, "ID")}, ", {} one node"),
        )
    return command_nmt(session, _WORDS[command_], node_id)


def _is_typed_alone(session: Conversation) -> bool:
    """Tell whether -n was typed with this very command: not for a session or a script, nor set by a file."""
    from dvtcli.cli.conversation import typed_name

    _, where = session.settings.typed.get("node", (None, ""))
    return where == typed_name("node") and not session.at_prompt and not session.in_script


def _several(command: str, nodes: Sequence[int]) -> Hint:
    """Hint at the command for the first of *nodes*."""
    more = f", and so for {join_some(map(str, nodes[1:]))}" if nodes[1:] else ""
    return Hint(Action.CORRECT, {"words": ("nmt", command, str(nodes[0]))}, f"{{}} commands node {nodes[0]}{more}")
