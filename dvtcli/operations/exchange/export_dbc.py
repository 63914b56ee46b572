"""A whole network as a DBC file: of the nodes on the bus, a network file, or a recording. Writes to no node."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.unnamed_nodes import add_eds
from dvtcli.domain.can_ids import HEARTBEAT_BASE, SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.datatypes import Kind
from dvtcli.domain.frame import Field, byte_length, layout
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.network_state import Identifier, NetworkState, NodeState, identifier_of, identifier_text
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.object_scalings import NOTHING
from dvtcli.domain.objects import SYNC_OVERFLOW
from dvtcli.domain.text import all_nodes, plural
from dvtcli.errors import NoAnswer, UsageError
from dvtcli.files.dbc import LONGEST_NAME, NOBODY, DbcMessage, DbcSignal, Names, dbc_bytes
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of
from dvtcli.operations.values.object_values import scalings_of

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence
    from fractions import Fraction

    from dvtcli.domain.datatypes import DataType
    from dvtcli.domain.object_dictionary import OdEntry
    from dvtcli.domain.object_scalings import ObjectScalings, Rules
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.scaling import Scaling
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

_WHOLE = (Kind.BOOLEAN, Kind.INTEGER, Kind.UNSIGNED)
_NUMBERS = (Kind.BOOLEAN, Kind.INTEGER, Kind.UNSIGNED, Kind.REAL)


def pdo_signals(
    field: Field, node: NodeState, scalings: ObjectScalings, names: Names, *, split_bits: bool = False
) -> list[DbcSignal]:
    """Make a signal of the object at *field*; with *split_bits*, one per named bit."""
    index, sub_index = field.entry.index, field.entry.sub_index
    meaning = scalings.of(index, sub_index)
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    kind = entry.data_type if entry else None
    if not (split_bits and meaning.bits and (kind is None or kind.kind in _WHOLE)):
        return [_pdo_signal(field, node, scalings, names)]
    name = (node.dictionary.display_name(index, sub_index) if node.dictionary else "") or f"Object_{index:04X}"
    words = [meaning.bits.get(bit, f"bit {bit}") for bit in range(field.bits)]
    what = f"0x{index:04X}:{sub_index:02X} {name}"
    return [_bit(field.start_bit + bit, names.new(f"{name}.{word}", f"bit_{bit}"), f"{what}, bit {bit} {word}", names)
            for bit, word in enumerate(words)]  # fmt: skip


def _bit(start: int, name: str, comment: str, names: Names) -> DbcSignal:
    return DbcSignal(name, start, 1, comment=comment, long_name=names.whole(name))


def _pdo_signal(field: Field, node: NodeState, scalings: ObjectScalings, names: Names) -> DbcSignal:
    """Make a signal with unit, scale, limits and value names; unsigned without a type.

    Texts, times, and partly mapped REALs are raw bits.
    """
    index, sub_index = field.entry.index, field.entry.sub_index
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    kind = entry.data_type if entry else None
    meaning = NOTHING if kind is not None and kind.kind not in _NUMBERS else scalings.of(index, sub_index)
    is_real = kind is not None and kind.kind is Kind.REAL and kind.bits == field.bits
    signed = kind is not None and kind.kind is Kind.INTEGER
    name = node.dictionary.display_name(index, sub_index) if node.dictionary else ""
    raw = _raw_limits(entry, kind, node.node_id, field.bits, is_real=is_real)
    low, high = _physical(raw, meaning)
    words = (
        {} if is_real else {value: word for value, word in meaning.values.items() if _holds(value, field.bits, signed)}
    )
    short = names.new(name, f"Object_{index:04X}_{sub_index:02X}")
    return DbcSignal(
        short, field.start_bit, field.bits, signed, is_real,
        meaning.factor, meaning.offset, meaning.unit, low, high, words, (), _signal_comment(field, kind, name, meaning),
        names.whole(short),
    )  # fmt: skip


def _holds(value: int, bits: int, signed: bool) -> bool:
    return -(1 << bits - 1) <= value < 1 << bits - 1 if signed else 0 <= value < 1 << bits


def _raw_limits(
    entry: OdEntry | None, kind: DataType | None, node_id: int, bits: int, *, is_real: bool
) -> tuple[float, float] | None:
    """Return LowLimit and HighLimit, a missing limit by the type; None if both are missing."""
    low, high = (None, None) if entry is None else entry.limits(node_id)
    ends = None if kind is None or is_real else kind.limits
    if (low is None and high is None) or (ends is None and None in (low, high)) or (kind and kind.bits != bits):
        return None
    low, high = (
        (low if ends is None or low is not None else ends[0]),
        (high if ends is None or high is not None else ends[1]),
    )
    return (low, high) if low is not None and high is not None and low <= high else None


def _physical(
    raw: tuple[float, float] | None, meaning: Scaling
) -> tuple[Fraction | float | None, Fraction | float | None]:
    """Limits are scaled as values are; a negative factor turns them round."""
    if raw is None:
        return None, None
    ends = sorted(meaning.to_physical(end) for end in raw)
    return ends[0], ends[1]


def _signal_comment(field: Field, kind: DataType | None, name: str, meaning: Scaling) -> str:
    """Write the comment: object, type, full name, names of bits."""
    entry = field.entry
    what = " ".join(filter(None, (f"0x{entry.index:04X}:{entry.sub_index:02X}", kind.short if kind else "", name)))
    bits = ", ".join(f"bit {bit} {word}" for bit, word in sorted(meaning.bits.items()) if bit < field.bits)
    return f"{what}; {bits}" if bits else what


@dataclass(frozen=True, slots=True)
class DbcOptions:
    """*services* (see `SERVICES`) adds their frames; *split_bits* makes a signal per named bit.

    *everything* includes disabled PDOs, as if enabled.
    """

    services: tuple[str, ...] = ()
    split_bits: bool = False
    everything: bool = False

    @property
    def named(self) -> tuple[str, ...]:
        """Name the options that are not default."""
        return tuple(field.name for field in fields(self) if getattr(self, field.name))

    def __bool__(self) -> bool:
        """Tell whether any option is not default."""
        return bool(self.named)


#: the options of a DBC file if none are given
PLAIN = DbcOptions()
#: maximum length of a CAN frame (bits)
_MOST_BITS = 64
#: so that `_TPDO512` fits behind a node's name
_NODE_NAME = LONGEST_NAME - len("_TPDO512")
#: transmission types sent at SYNC, and those sent by an event timer (CiA 301, table 72)
_CYCLIC, _BY_EVENT = range(1, 241), (254, 255)
#: an enabled PDO with its node
_Held = tuple[NodeState, "Pdo", "PdoConfig"]


@dataclass(frozen=True, slots=True)
class _Drawn:
    """The inputs of signals: scalings and names of nodes by node-ID."""

    state: NetworkState
    scalings: Mapping[int, ObjectScalings]
    names: Mapping[int, str]
    split_bits: bool


@dataclass(slots=True)
class NetworkMessages:
    """The *messages* by CAN-ID, *nodes* with comments, and what is *left_out* with reasons."""

    names: dict[int, str]
    nodes: dict[str, str]
    messages: list[DbcMessage] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def network_messages(
    state: NetworkState, scalings: Mapping[int, ObjectScalings], options: DbcOptions = PLAIN
) -> NetworkMessages:
    """Make a message per CAN-ID of the enabled PDOs of *state*; *scalings* has scalings by node-ID.

    A TPDO defines the message; each RPDO with its CAN-ID makes its node a receiver of the mapped signals. *options* add
    messages of services for other CAN-IDs.
    """
    names = _node_names(state)
    nodes = {names[node.node_id]: f"node {node.node_id} {node.title or node.name}".rstrip() for node in state.nodes}
    found = NetworkMessages(names, nodes)
    held = [
        held_pdo
        for held_pdo in _held(state, everything=options.everything)
        if held_pdo[2].enabled or _could_be_on(held_pdo, found)
    ]
    for identifier, group in groupby(sorted(held, key=_place), _identifier):
        whole = [held_pdo for held_pdo in group if _fits(held_pdo, found)]
        if whole:
            drawn = _Drawn(state, scalings, found.names, options.split_bits)
            found.messages.append(_message(identifier, whole, drawn, found))
    taken = {dbc_message.number for dbc_message in found.messages}
    for message in service_messages(state, names, options.services):
        if message.number not in taken:
            found.messages.append(message)
        else:
            found.left_out.append(
                f"{message.name}: a PDO has the same CAN-ID {can_id_text(message.can_id, extended=message.extended)}"
            )
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
    """Tell whether a disabled PDO maps anything and has a CAN-ID."""
    node, pdo, config = held
    why = "it is off and has no CAN-ID" if not config.communication.cob_id.can_id else ""
    if why and config.mapping:
        found.left_out.append(f"{pdo.label} of node {node.node_id}: {why}")
    return bool(config.mapping) and not why


def _place(held: _Held) -> tuple[bool, int, bool, bool, int, int]:
    (can_id, extended), (node, pdo, config) = _identifier(held), held
    return extended, can_id, not config.enabled, not pdo.is_tpdo, node.node_id, pdo.number


def _fits(held: _Held, found: NetworkMessages) -> bool:
    """Tell whether it fits a message; records in *found* why not."""
    node, pdo, config = held
    bits = sum(entry.bits for entry in config.mapping)
    why = "it is multiplexed" if config.mpdo is not None else config.inconsistency or ""
    if not why and bits > _MOST_BITS:
        why = f"it has {bits} bits, and a frame has {_MOST_BITS}"
    if why:
        found.left_out.append(f"{pdo.label} of node {node.node_id}: {why}")
    return not why


def _message(identifier: Identifier, group: list[_Held], drawn: _Drawn, found: NetworkMessages) -> DbcMessage:
    """Make the message of PDOs with the same CAN-ID: defined by the first, received by the others."""
    (first, pdo, _), *others = group
    received = [receiving_pdo for receiving_pdo in group if not receiving_pdo[1].is_tpdo]
    for node, other, _ in others:
        if other.is_tpdo:
            also = f"{pdo.label} of node {first.node_id} has the same CAN-ID {identifier_text(identifier)}"
            found.left_out.append(f"{other.label} of node {node.node_id}: {also}")
    says = [group[0]] if pdo.is_tpdo else received
    signals = _signals(says, received, drawn)
    length = max(byte_length(sum(entry.bits for entry in config.mapping)) for _, _, config in says)
    cycle_ms = _cycle_ms(group[0], drawn.state)
    return DbcMessage(
        *identifier, f"{found.names[first.node_id]}_{pdo.label}", length,
        found.names[first.node_id] if pdo.is_tpdo else NOBODY, signals, _comment(group), cycle_ms,
    )  # fmt: skip


def _signals(says: list[_Held], received: list[_Held], drawn: _Drawn) -> tuple[DbcSignal, ...]:
    """Make non-overlapping signals of objects that *says* map, with receivers from *received*.

    With split bits, a signal per bit.
    """
    names, signals = Names(), list[DbcSignal]()
    for node, _, config in says:
        for mapped_object in _objects(config):
            if not any(_overlap(mapped_object, other) for other in signals):
                signals += pdo_signals(
                    mapped_object, node, drawn.scalings[node.node_id], names, split_bits=drawn.split_bits
                )
    receivers = {
        place: tuple(_receivers(drawn_signal, received, drawn.names)) for place, drawn_signal in enumerate(signals)
    }
    named = [replace(drawn_signal, receivers=receivers[place]) for place, drawn_signal in enumerate(signals)]
    return tuple(sorted(named, key=lambda signal: signal.start))


def _objects(config: PdoConfig) -> list[Field]:
    """Return mapped objects without dummies, which are gaps."""
    return [
        mapped_object
        for mapped_object in layout(config.mapping)
        if not mapped_object.entry.is_dummy and mapped_object.bits
    ]


def _overlap(one: Field, other: DbcSignal) -> bool:
    return one.start_bit < other.end and other.start < one.end_bit


def _receivers(signal: DbcSignal, received: list[_Held], nodes: Mapping[int, str]) -> dict[str, None]:
    hearing = (
        node
        for node, _, config in received
        if any(_overlap(mapped_object, signal) for mapped_object in _objects(config))
    )
    return dict.fromkeys(nodes[node.node_id] for node in hearing)


def _comment(group: list[_Held]) -> str:
    """Name producer and consumers, and the mapping's source if not the node itself."""
    return ", ".join(
        f"{pdo.label} of node {node.node_id}{'' if config.enabled else ' (off)'}"
        f"{f' (by {node.guessed[pdo]})' if pdo in node.guessed else ''}"
        for node, pdo, config in group
    )


def _cycle_ms(held: _Held, state: NetworkState) -> int:
    """Return a TPDO's period (ms) by its event timer or SYNC; 0 if unknown."""
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


def export_dbc(session: SessionNodes, file: str, options: DbcOptions = PLAIN) -> Facts:
    """Export the enabled PDOs of answering nodes (or `-n`) to the DBC *file*.

    Asks before overwriting. Raises NoAnswer if no node answers; UsageError if the file cannot be written.
    """
    from dvtcli.operations.nodes.find_nodes import find_nodes
    from dvtcli.operations.plans.network_states import network_state

    place_of(file, "NAME.dbc")
    ids = session.base.nodes or tuple(row.node for row in find_nodes(session).rows if not row.note)
    if not ids:
        raise NoAnswer(
            "no node answers",
            hint=Hint(Action.CHECK_SETUP, why="check bit rate and supply: {}") + Hint(Action.FIND_NODES, why=", {}"),
        )
    nodes = [session.node(node_id) for node_id in ids]
    if unnamed := [node for node in nodes if node.dictionary is None]:
        who = all_nodes(node.node_id for node in unnamed)
        what = f"no EDS of {who}: without one, signals have no names, signs or units"
        session.reporter.warning(add_eds(unnamed, f"{what}; ", ", then export again"))
    return _write(session, file, None, network_state(nodes), {}, options)


def convert_to_dbc(session: SessionUser, source: str, file: str, options: DbcOptions = PLAIN) -> Facts:
    """Convert the PDOs of the network file *source*, as applied, to the DBC *file*.

    Asks before overwriting. Raises as reading a network file; UsageError if the DBC file cannot be written.
    """
    from dvtcli.files.network.read_node import rules_by_node
    from dvtcli.operations.network.described_network import described_network
    from dvtcli.operations.plans.read_network_config import read_network_config

    place_of(file, "NAME.dbc")
    config = read_network_config(source)
    state = described_network(source, session.reporter, config=config)
    for node in state.nodes:
        _tell_guessed(session, source, node, everything=options.everything)
    if unnamed := [node.node_id for node in state.nodes if node.dictionary is None]:
        what = f"no EDS of {all_nodes(unnamed)}: without one, signals have no names, signs or units"
        session.reporter.warning(f"{what}; `dcf:` of a node in {source} names one")
    return _write(session, file, source, state, rules_by_node(config.nodes), options)


def _tell_guessed(session: SessionUser, source: str, node: NodeState, *, everything: bool) -> None:
    """Report PDOs with a message whose mapping is not in *source*."""
    pdos = [pdo for pdo in node.guessed if node.pdos[pdo].enabled or everything]
    if pdos:
        names = f"{', '.join(pdo.label for pdo in pdos)} of node {node.node_id} map{'s' if len(pdos) == 1 else ''}"
        whose = node.guessed[pdos[0]]  # one file, or family, describes the node
        session.reporter.warning(
            f"{source} does not describe what {names}: taken from {whose}, which may differ from the node"
        )


def recording_to_dbc(session: SessionUser, source: str, file: str, options: DbcOptions = PLAIN) -> Facts:
    """Convert the PDOs known from SDO transfers in the recording *source* to the DBC *file*.

    Asks before overwriting. Raises as `recorded_network`; UsageError if the DBC file cannot be written.
    """
    from dvtcli.operations.exchange.recorded_network import recorded_network

    place_of(file, "NAME.dbc")
    state, missing = recorded_network(session, Path(source))
    return _write(session, file, source, state, {}, options, missing)


def _write(
    session: SessionUser,
    file: str,
    source: str | None,
    state: NetworkState,
    said: Mapping[int, Rules],
    options: DbcOptions,
    missing: Sequence[str] = (),
) -> Facts:
    found = messages_of(state, said, options)
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


def messages_of(state: NetworkState, said: Mapping[int, Rules], options: DbcOptions = PLAIN) -> NetworkMessages:
    """Make the messages of *state*; *said* has rules by node-ID that override profiles and files."""
    scalings = {
        node.node_id: scalings_of(node.profile, node.dictionary, [said.get(node.node_id, {})]) for node in state.nodes
    }
    return network_messages(state, scalings, options)


_STATES = {state.value: "boot-up" if state is NmtState.INITIALISING else state.label.lower() for state in NmtState}
#: position of an expedited SDO's bytes; others have only the first byte in common
_SDO = (
    DbcSignal("Command", 0, 8), DbcSignal("Object_index", 8, 16), DbcSignal("Sub_index", 24, 8),
    DbcSignal("Data", 32, 32),
)  # fmt: skip
_EMCY = (
    DbcSignal("Error_code", 0, 16), DbcSignal("Error_register", 16, 8), DbcSignal("Manufacturer_data", 24, 40),
)  # fmt: skip


def service_messages(state: NetworkState, names: Mapping[int, str], services: Collection[str]) -> list[DbcMessage]:
    """Make the messages of *services*, from `SERVICES`; *names* by node-ID."""
    return [message for service in SERVICES if service in services for message in _BY_SERVICE[service](state, names)]


def _nmt(_state: NetworkState, names: Mapping[int, str]) -> Iterator[DbcMessage]:
    every = tuple(names.values())
    commands = {command.value: command.word for command in NmtCommand}
    yield DbcMessage(0, False, "NMT", 2, NOBODY, (
        DbcSignal("Command", 0, 8, values=commands, receivers=every),
        DbcSignal("Node_ID", 8, 8, values={0: "all nodes"}, receivers=every),
    ))  # fmt: skip


def _sync(state: NetworkState, names: Mapping[int, str]) -> Iterator[DbcMessage]:
    senders = [node for node in state.nodes if node.produces_sync]
    periods_us = state.sync_periods_us
    identifiers = dict.fromkeys(sender.sync for sender in senders or state.nodes)
    counted = any((node.number(SYNC_OVERFLOW) or 0) > 1 for node in state.nodes)
    signals = (DbcSignal("Counter", 0, 8, receivers=tuple(names.values())),) if counted else ()
    for number, identifier in enumerate(identifiers):
        yield DbcMessage(
            *identifier, "SYNC" if not number else f"SYNC_{number + 1}", len(signals),
            names[senders[0].node_id] if len(senders) == 1 else NOBODY, signals,
            cycle_ms=round(periods_us[0] / 1000) if len(periods_us) == 1 else 0,
        )  # fmt: skip


def _emcy(state: NetworkState, names: Mapping[int, str]) -> Iterator[DbcMessage]:
    for node in state.nodes:
        if node.emcy is not None:
            name = names[node.node_id]
            yield DbcMessage(*node.emcy, f"{name}_EMCY", 8, name, _EMCY, f"emergency of node {node.node_id}")


def _heartbeat(state: NetworkState, names: Mapping[int, str]) -> Iterator[DbcMessage]:
    for node in state.nodes:
        watching = tuple(names[other.node_id] for other in state.nodes if node.node_id in other.watched)
        signals = (DbcSignal("State", 0, 7, values=_STATES, receivers=watching), DbcSignal("Toggle", 7, 1))
        yield DbcMessage(
            HEARTBEAT_BASE + node.node_id, False, f"{names[node.node_id]}_Heartbeat", 1, names[node.node_id], signals,
            f"heartbeat of node {node.node_id}; the toggle bit is of guarding", node.heartbeat_ms,
        )  # fmt: skip


def _sdo(state: NetworkState, names: Mapping[int, str]) -> Iterator[DbcMessage]:
    for node in state.nodes:
        name, node_id = names[node.node_id], node.node_id
        asked = tuple(DbcSignal(each.name, each.start, each.bits, receivers=(name,)) for each in _SDO)
        yield DbcMessage(
            SDO_REQUEST_BASE + node_id, False, f"{name}_SDO_Req", 8, NOBODY, asked, f"SDO to node {node_id}"
        )
        yield DbcMessage(
            SDO_RESPONSE_BASE + node_id, False, f"{name}_SDO_Ans", 8, name, _SDO, f"SDO from node {node_id}"
        )


_BY_SERVICE: dict[str, Callable[[NetworkState, Mapping[int, str]], Iterator[DbcMessage]]] = {
    "nmt": _nmt, "sync": _sync, "emcy": _emcy, "heartbeat": _heartbeat, "sdo": _sdo,
}  # fmt: skip
#: the services by their words
SERVICES = tuple(_BY_SERVICE)


def services_of(text: str | None) -> tuple[str, ...]:
    """The services in *text*, with commas between them; UsageError for a word that is none."""
    words = tuple(word.strip().lower() for word in (text or "").split(",") if word.strip())
    if odd := [word for word in words if word not in SERVICES]:
        raise UsageError(
            "no such service",
            given={"services": odd[0]},
            hint=Hint(Action.GIVE, {"services": ",".join(SERVICES)}, "{}, or some of these"),
        )
    return words
