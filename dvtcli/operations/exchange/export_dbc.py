"""A whole network as a DBC file: of the nodes on the bus, a network file, or a recording. Writes to no node."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.network_state import NetworkState
from dvtcli.domain.several import plural
from dvtcli.errors import NoAnswer
from dvtcli.files.dbc_text import dbc_bytes
from dvtcli.operations.exchange.network_messages import PLAIN, NetworkMessages, network_messages
from dvtcli.operations.meanings.physical_meanings import meanings_of
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dvtcli.domain.meanings import Rules
    from dvtcli.domain.network.network_state import NodeState
    from dvtcli.operations.exchange.dbc_options import DbcOptions
    from dvtcli.operations.session.session import Session


def export_dbc(session: Session, file: str, wishes: DbcOptions = PLAIN) -> Facts:
    """Write the enabled PDOs of the nodes that answer (or of those of `-n`), as they are now, to the DBC *file*.

    Asks before it overwrites. NoAnswer where no node answers; UsageError where the file cannot be written.
    """
    from dvtcli.operations.nodes.find_nodes import find_nodes
    from dvtcli.operations.plans.network_states import network_state

    place_of(file, "NAME.dbc")
    ids = session.base.nodes or tuple(row.node for row in find_nodes(session).rows if not row.note)
    if not ids:
        raise NoAnswer(
            "no node answers",
            hint=Hint(Action.CHECK_SETUP, why="look at bit rate and supply: {}") + Hint(Action.FIND_NODES, why=", {}"),
        )
    state = network_state([session.node(node_id) for node_id in ids])
    return _write(session, file, None, state, {}, wishes)


def convert_to_dbc(session: Session, source: str, file: str, wishes: DbcOptions = PLAIN) -> Facts:
    """Write what the nodes of the network file *source* send and hear once it is applied to the DBC *file*.

    Asks before it overwrites. Raises as reading a network file does; UsageError where the DBC file cannot be written.
    """
    from dvtcli.files.network.physical_keys import rules_by_node
    from dvtcli.operations.network.described_network import described_network
    from dvtcli.operations.wanted.network_wish import read_wish

    place_of(file, "NAME.dbc")
    wish = read_wish(source)
    state = described_network(source, session.tell, wish=wish)
    for node in state.nodes:
        _tell_guessed(session, source, node, everything=wishes.everything)
    return _write(session, file, source, state, rules_by_node(wish.nodes), wishes)


def _tell_guessed(session: Session, source: str, node: NodeState, *, everything: bool) -> None:
    """Say of which PDOs that get a message *source* does not say what they map."""
    pdos = [pdo for pdo in node.guessed if node.pdos[pdo].enabled or everything]
    if pdos:
        names = f"{', '.join(pdo.label for pdo in pdos)} of node {node.node_id} map{'s' if len(pdos) == 1 else ''}"
        whose = node.guessed[pdos[0]]  # one file, or family, describes the node
        session.tell.warning(f"{source} does not say what {names}: by {whose}, which the node need not hold")


def recording_to_dbc(session: Session, source: str, file: str, wishes: DbcOptions = PLAIN) -> Facts:
    """Write the PDOs that the SDO transfers in the recording *source* say to the DBC *file*.

    Asks before it overwrites. Raises as `recorded_network`; UsageError where the DBC file cannot be written.
    """
    from dvtcli.operations.exchange.recorded_network import recorded_network

    place_of(file, "NAME.dbc")
    state, missing = recorded_network(session, Path(source))
    return _write(session, file, source, state, {}, wishes, missing)


def _write(
    session: Session,
    file: str,
    source: str | None,
    state: NetworkState,
    said: Mapping[int, Rules],
    wishes: DbcOptions,
    missing: Sequence[str] = (),
) -> Facts:
    found = messages_of(state, said, wishes)
    left_out = [*missing, *found.left_out]
    path = place_of(file)
    ask_before_overwriting(session, path)
    make_file(session, path, dbc_bytes(found.nodes, found.messages))
    signals = sum(len(message.signals) for message in found.messages)
    rows = (
        ("file", file), ("from", source), ("nodes", [node.node_id for node in state.nodes]),
        ("messages", len(found.messages)), ("signals", signals), ("left_out", left_out),
    )  # fmt: skip
    counts = (
        f"{plural(len(state.nodes), 'node')}, {plural(len(found.messages), 'message')}, {plural(signals, 'signal')}"
    )
    return Facts("dbc", rows, (f"{file}: {counts}", *(f"note: left out: {omitted}" for omitted in left_out)))


def messages_of(state: NetworkState, said: Mapping[int, Rules], wishes: DbcOptions = PLAIN) -> NetworkMessages:
    """The messages of *state*; *said*, by node-ID, goes before what profiles and files say of values."""
    meanings = {
        node.node_id: meanings_of(node.profile, node.dictionary, [said.get(node.node_id, {})]) for node in state.nodes
    }
    return network_messages(state, meanings, wishes)
