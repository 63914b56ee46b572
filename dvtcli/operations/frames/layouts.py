"""Find the layouts of frames: mappings of nodes, read once, and layouts of a file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_syntax import parse_object
from dvtcli.errors import BusUnavailable, NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.network.described_nodes import NETWORK_SUFFIXES, network_config_of
from dvtcli.operations.values.object_values import scalings_of
from dvtcli.watch.decoder import Decoder, SignalsOfMappings, described_channels, pdo_layouts

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.network.network_config import NetworkConfig, ValueConfig
    from dvtcli.domain.network.network_state import NodeState
    from dvtcli.domain.object_scalings import ObjectScalings, Rules
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import Reporter
    from dvtcli.watch.decoder import Address, Layout


def file_layouts(file: str, reporter: Reporter, config: NetworkConfig | None = None) -> Mapping[Address, Layout]:
    """Return the layouts of *file*, a network file by its suffix, else a DBC file; raises as their reading.

    *config* is the network file as read, if read already. *reporter* gets the object names in it without description:
    their frames stay bytes.
    """
    config = config or network_config_of(file)
    if config is None:
        from dvtcli.files.dbc import read_dbc

        return read_dbc(file)
    return _network_layouts(file, config, reporter)


def _network_layouts(file: str, network_config: NetworkConfig, reporter: Reporter) -> Mapping[Address, Layout]:
    """Return the layouts of PDOs in the network *file*, as applied, with its scalings.

    The file's own values go before defaults of a node's EDS.
    """
    from dvtcli.files.network.read_node import rules_by_node
    from dvtcli.operations.network.described_network import described_pdos, unknown_names

    state = described_pdos(file, network_config)
    for note in unknown_names(file, network_config):
        place = f"{file}:{note.mark.line}:{note.mark.column}"
        reporter.note(f"{place}: {note.text}; frames with such a name stay bytes")
    rules, decoder, kinds = rules_by_node(network_config.nodes), Decoder(), _Kinds()
    written = {node.node_id: _numbers(node.values) for node in network_config.nodes}
    for node in state.nodes:
        said = {pdo: config for pdo, config in node.pdos.items() if pdo not in node.guessed}
        decoder.add(kinds.layouts(node, said, rules.get(node.node_id, {}), f"the mapping in {Path(file).name}"))
    for node in state.nodes:
        for pdo, whose in node.guessed.items():
            layouts = kinds.layouts(node, {pdo: node.pdos[pdo]}, rules.get(node.node_id, {}), whose)
            decoder.add({address: _as_guess(file, layout) for address, layout in layouts.items()})
        decoder.add(described_channels(node.node_id, node.dictionary, written.get(node.node_id)))
    return decoder.layouts


def _numbers(values: Iterable[ValueConfig]) -> dict[tuple[int, int], int]:
    """Return those of *values* that are numbers of objects named by number."""
    found: dict[tuple[int, int], int] = {}
    for config in values:
        with suppress(ValueError):  # a name, or another kind of value
            place = parse_object(config.object.text)
            if place is not None:
                found[place] = int(config.value.text, 0)
    return found


class _Kinds:
    """The scalings and signals of the nodes of a file, made once for all nodes with the same dictionary and profile."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int], tuple[NodeState, ObjectScalings, SignalsOfMappings]] = {}

    def layouts(
        self, node: NodeState, pdos: Mapping[Pdo, PdoConfig], rules: Rules, source: str
    ) -> Mapping[Address, Layout]:
        """Return the layouts of *pdos* of *node*, whose own scalings are *rules*."""
        kind = id(node.dictionary), id(node.profile)
        found = None if rules else self._known.get(kind)
        if found is None:
            found = node, scalings_of(node.profile, node.dictionary, [rules]), SignalsOfMappings()
            if not rules:
                self._known[kind] = found  # with the node: its dictionary and profile keep their numbers
        _, scalings, signals = found
        return pdo_layouts(node.node_id, pdos, node.dictionary, scalings, source, signals)


def _as_guess(file: str, layout: Layout) -> Layout:
    """Mark *layout* as not from *file*."""
    who = f"{layout.service.label} of node {layout.service.node}"
    said = f"{Path(file).name} does not say what {who} maps: read by {layout.source}, which the node need not hold"
    return replace(layout, guess=said)


def file_names(file: str) -> dict[int, str]:
    """Return the names of nodes by node-ID in *file*; none unless it is a network file."""
    if Path(file).suffix.lower() not in NETWORK_SUFFIXES:
        return {}
    from dvtcli.operations.plans.read_network_config import read_network_config

    return {node.node_id: node.name for node in read_network_config(file).nodes}


#: how long is waited for a first heartbeat where no node is named (s): most are sent once a second or faster
HEARD_S = 1.2
_WITHOUT_EDS = Hint(Action.GIVE_EDS, why="its values have no names and are unsigned: -1 reads 65535; {}") + Hint(
    Action.ADD_EDS, why=", or {}, gives them"
)


def open_wire(session: SessionNodes) -> CanopenBus:
    """Open the bus to receive only, even under --dry-run; raises UsageError if it carries no frames."""
    bus = session.open_network().bus
    if not bus.carries_frames:
        raise UsageError(
            f"{bus.name} carries no CAN frames: there is nothing to listen to",
            hint="objects can be read and written there; an interface of this machine receives frames",
        )
    return bus


def live_decoder(session: SessionNodes, nodes: tuple[int, ...], dbc: str | None = None) -> Decoder:
    """Return the decoder of *nodes*, else of selected, simulated and heard nodes; the DBC file goes first.

    Reports nodes without an answer; their frames stay bytes. Sends nothing but SDO uploads.
    """
    decoder = Decoder()
    for _, decoder in live_decoders(session, nodes, dbc):  # noqa: B007 - the last one knows all
        pass
    return decoder


def live_decoders(
    session: SessionNodes, nodes: tuple[int, ...], dbc: str | None = None, *, named: bool = False
) -> Iterator[tuple[int | None, Decoder]]:
    """Like `live_decoder`, node by node: the next node (None: finished), and the decoder so far.

    *named* adds the nodes' names: a further read of each node without an EDS.
    """
    known, names, called = Decoder(), dict[int, str](), dict[int, str]()
    if dbc is not None:
        known.add(file_layouts(dbc, session.reporter))
        called = file_names(dbc) if named else {}
    for node_id in () if dbc is not None and not nodes else nodes or _present(session):
        yield node_id, Decoder(known.layouts, names, called)
        try:
            node = session.node(node_id)
            scalings = scalings_of(node.profile, node.dictionary)
            known.add(pdo_layouts(node_id, node.pdos(), node.dictionary, scalings, mapping_of(session, node_id)))
            known.add(described_channels(node_id, node.dictionary))
            if named:
                names[node_id] = _name(node)
            if node.dictionary is None:
                session.reporter.note(f"node {node_id} has no EDS: {_WITHOUT_EDS}")
        except BusUnavailable:
            raise
        except (NoAnswer, SdoAborted, SdoProtocolError) as silent:
            session.reporter.note(f"node {node_id}: its mapping cannot be read ({silent.text}); its frames stay bytes")
    yield None, Decoder(known.layouts, names, called)


def mapping_of(session: SessionNodes, node_id: int) -> str:
    """Say whose mapping is used: a simulated node is not the producer in a recording."""
    simulated = node_id in session.network.simulated_ids
    return f"the mapping of the simulated node {node_id}" if simulated else f"the mapping that node {node_id} holds now"


def _name(node: ReadableNode) -> str:
    """Name *node*: by its EDS, 0x1008, or its family."""
    from dvtcli.operations.nodes.find_nodes import device_name

    named = node.dictionary.info.product_name if node.dictionary is not None else device_name(node.sdo)
    return named or node.profile.title


def _present(session: SessionNodes) -> list[int]:
    """List nodes known without a scan: selected, simulated, or by heartbeat."""
    network = session.network
    found = {session.selected_id(), *network.simulated_ids, *network.nodes}
    if found == {None}:
        bus = session.wire
        bus.sleep(HEARD_S)
        found |= set(bus.nodes_seen())
    return sorted(node_id for node_id in found if node_id is not None)
