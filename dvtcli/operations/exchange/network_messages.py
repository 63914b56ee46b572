"""What the nodes of a network send and hear by PDO, as the messages of a DBC file. Knows no file, reads no node."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import TYPE_CHECKING

from dvtcli.domain.frame import Field, byte_length, layout
from dvtcli.domain.network.network_state import Identifier, NetworkState, NodeState, identifier_of
from dvtcli.files.dbc_text import LONGEST_NAME, NOBODY, DbcMessage, DbcSignal, Names
from dvtcli.operations.exchange.dbc_options import DbcOptions
from dvtcli.operations.exchange.pdo_signals import pdo_signals
from dvtcli.operations.exchange.service_messages import service_messages

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dvtcli.domain.meanings import Meanings
    from dvtcli.domain.pdo import Pdo, PdoConfig

#: how a DBC file is without any wishes
PLAIN = DbcOptions()
#: what a CAN frame carries at most (bits)
_MOST_BITS = 64
#: so that `_TPDO512` fits behind a node's name
_NODE_NAME = LONGEST_NAME - len("_TPDO512")
#: transmission types that are sent at every such SYNC, and those that are sent by an event timer (CiA 301, table 72)
_CYCLIC, _BY_EVENT = range(1, 241), (254, 255)

#: an enabled PDO with whose it is
_Held = tuple[NodeState, "Pdo", "PdoConfig"]


@dataclass(frozen=True, slots=True)
class _Drawn:
    """What signals are made of: what the values of nodes mean, and what nodes are called, both by node-ID."""

    state: NetworkState
    meanings: Mapping[int, Meanings]
    names: Mapping[int, str]
    split_bits: bool


@dataclass(slots=True)
class NetworkMessages:
    """The *messages* in order of CAN-ID, the *nodes* by name with a comment, and what is *left_out* and why."""

    names: dict[int, str]
    nodes: dict[str, str]
    messages: list[DbcMessage] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def network_messages(
    state: NetworkState, meanings: Mapping[int, Meanings], wishes: DbcOptions = PLAIN
) -> NetworkMessages:
    """The enabled PDOs of *state*, one message a CAN-ID; *meanings*, by node-ID, says what their objects' values mean.

    A TPDO says what is in its message, and each RPDO with its CAN-ID makes its node a receiver of the signals it maps.
    Of *wishes* the services have a message where no PDO has their CAN-ID.
    """
    names = _node_names(state)
    nodes = {names[node.node_id]: f"node {node.node_id} {node.title or node.name}".rstrip() for node in state.nodes}
    found = NetworkMessages(names, nodes)
    held = [
        held_pdo
        for held_pdo in _held(state, everything=wishes.everything)
        if held_pdo[2].enabled or _could_be_on(held_pdo, found)
    ]
    for identifier, group in groupby(sorted(held, key=_place), _identifier):
        whole = [held_pdo for held_pdo in group if _fits(held_pdo, found)]
        if whole:
            drawn = _Drawn(state, meanings, found.names, wishes.split_bits)
            found.messages.append(_message(identifier, whole, drawn, found))
    taken = {dbc_message.number for dbc_message in found.messages}
    for message in service_messages(state, names, wishes.services):
        if message.number not in taken:
            found.messages.append(message)
        else:
            found.left_out.append(f"{message.name}: a PDO has its CAN-ID 0x{message.can_id:03X}")
    found.messages.sort(key=lambda drawn_message: drawn_message.number)
    _name_messages(found)
    return found


def _node_names(state: NetworkState) -> dict[int, str]:
    names = Names(_NODE_NAME)
    return {
        node.node_id: names.new(node.name or f"{node.title[:14]}_n{node.node_id}", f"node_{node.node_id}")
        for node in state.nodes
    }


def _name_messages(found: NetworkMessages) -> None:
    names = Names()
    found.messages[:] = [replace(message, name=names.new(message.name, "message")) for message in found.messages]


def _identifier(held: _Held) -> Identifier:
    return identifier_of(held[2])


def _held(state: NetworkState, *, everything: bool) -> Iterator[_Held]:
    for node in state.nodes:
        yield from ((node, pdo, config) for pdo, config in node.pdos.items() if config.enabled or everything)


def _could_be_on(held: _Held, found: NetworkMessages) -> bool:
    """Whether a PDO that is off maps anything and has a CAN-ID."""
    node, pdo, config = held
    why = "it is off, and has no CAN-ID" if not config.communication.cob_id.can_id else ""
    if why and config.mapping:
        found.left_out.append(f"{pdo.label} of node {node.node_id}: {why}")
    return bool(config.mapping) and not why


def _place(held: _Held) -> tuple[bool, int, bool, bool, int, int]:
    (can_id, extended), (node, pdo, config) = _identifier(held), held
    return extended, can_id, not config.enabled, not pdo.is_tpdo, node.node_id, pdo.number


def _fits(held: _Held, found: NetworkMessages) -> bool:
    """Whether a message can say it; why not is said in *found*."""
    node, pdo, config = held
    bits = sum(entry.bits for entry in config.mapping)
    why = "it is multiplexed" if config.mpdo is not None else config.inconsistency or ""
    if not why and bits > _MOST_BITS:
        why = f"it has {bits} bits, and a frame has {_MOST_BITS}"
    if why:
        found.left_out.append(f"{pdo.label} of node {node.node_id}: {why}")
    return not why


def _message(identifier: Identifier, group: list[_Held], drawn: _Drawn, found: NetworkMessages) -> DbcMessage:
    """The message of *group*, the PDOs with one CAN-ID: what the first one says, and what the others hear of it."""
    (first, pdo, _), *others = group
    heard = [receiving_pdo for receiving_pdo in group if not receiving_pdo[1].is_tpdo]
    for node, other, _ in others:
        if other.is_tpdo:
            also = f"{pdo.label} of node {first.node_id} has its CAN-ID 0x{identifier[0]:03X}, too"
            found.left_out.append(f"{other.label} of node {node.node_id}: {also}")
    says = [group[0]] if pdo.is_tpdo else heard
    signals = _signals(says, heard, drawn)
    length = max(byte_length(sum(entry.bits for entry in config.mapping)) for _, _, config in says)
    cycle_ms = _cycle_ms(group[0], drawn.state)
    return DbcMessage(
        *identifier, f"{found.names[first.node_id]}_{pdo.label}", length,
        found.names[first.node_id] if pdo.is_tpdo else NOBODY, signals, _comment(group), cycle_ms,
    )  # fmt: skip


def _signals(says: list[_Held], heard: list[_Held], drawn: _Drawn) -> tuple[DbcSignal, ...]:
    """One signal for each object that *says* map where no earlier one lies, received by those *heard* that map it.

    Where bits are wanted, one for each bit instead.
    """
    names, signals = Names(), list[DbcSignal]()
    for node, _, config in says:
        for mapped_object in _objects(config):
            if not any(_overlap(mapped_object, other) for other in signals):
                signals += pdo_signals(
                    mapped_object, node, drawn.meanings[node.node_id], names, split_bits=drawn.split_bits
                )
    receivers = {
        place: tuple(_receivers(drawn_signal, heard, drawn.names)) for place, drawn_signal in enumerate(signals)
    }
    named = [replace(drawn_signal, receivers=receivers[place]) for place, drawn_signal in enumerate(signals)]
    return tuple(sorted(named, key=lambda signal: signal.start))


def _objects(config: PdoConfig) -> list[Field]:
    """What is mapped, without dummies: these are gaps."""
    return [
        mapped_object
        for mapped_object in layout(config.mapping)
        if not mapped_object.entry.is_dummy and mapped_object.bits
    ]


def _overlap(one: Field, other: DbcSignal) -> bool:
    return one.start_bit < other.end and other.start < one.end_bit


def _receivers(signal: DbcSignal, heard: list[_Held], nodes: Mapping[int, str]) -> dict[str, None]:
    hearing = (
        node for node, _, config in heard if any(_overlap(mapped_object, signal) for mapped_object in _objects(config))
    )
    return dict.fromkeys(nodes[node.node_id] for node in hearing)


def _comment(group: list[_Held]) -> str:
    """Who sends and hears it, and by whose mapping where nobody said that of the node itself."""
    return ", ".join(
        f"{pdo.label} of node {node.node_id}{'' if config.enabled else ' (off)'}"
        f"{f' (by {node.guessed[pdo]})' if pdo in node.guessed else ''}"
        for node, pdo, config in group
    )


def _cycle_ms(held: _Held, state: NetworkState) -> int:
    """How often a TPDO is sent (ms): by its event timer, or at which SYNC; 0 where nobody knows."""
    _, pdo, config = held
    told = config.communication
    if not pdo.is_tpdo or told.transmission_type is None:
        return 0
    if told.transmission_type in _BY_EVENT:
        return told.event_timer or 0
    periods = set(state.sync_periods_us)
    if told.transmission_type in _CYCLIC and len(periods) == 1:
        return round(periods.pop() * told.transmission_type / 1000)
    return 0
