"""Simulate a network file without a bus: its nodes from their EDS, DCF or family, configured.

Sends nothing to a real bus. Judges nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.proposal import resolve, untyped_lengths
from dvtcli.device.read_pdos import WHATEVER, read_cob_id, read_pdo
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.network.links import CONSUMER_PERIODS, watch_time_ms
from dvtcli.domain.network.network_config import (
    Endpoint,
    ExpectedIdentity,
    FileNote,
    FileWord,
    HeartbeatWatch,
    LinkConfig,
    NetworkConfig,
    NodeConfig,
    PartialPdoConfig,
)
from dvtcli.domain.network.network_state import NetworkState, NodeState
from dvtcli.domain.object_syntax import MappedObject, Skipped, UnknownName, resolve_entry
from dvtcli.domain.objects import CONSUMER_HEARTBEAT, PRODUCER_HEARTBEAT
from dvtcli.domain.pdo import DUMMY_BITS, Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry, split_dummy
from dvtcli.errors import DvtcliError, RuleError, SdoAborted, UsageError
from dvtcli.files.network.file_log import FileLog
from dvtcli.files.network.read_network import network_text
from dvtcli.operations.plans.network_states import network_after, network_state, with_config, with_link_marks
from dvtcli.operations.plans.read_network_config import eds_of, read_network_config
from dvtcli.operations.plans.resolve_names import pdo_request
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.operations.values.named_objects import is_name

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.network.network_plan import NetworkPlan
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.files.device_library import Match
    from dvtcli.operations.user.session_user import Reporter


def guessed_mappings(node: NodeState, node_config: NodeConfig, word: str) -> Mapping[Pdo, str]:
    """Name the source of the default mapping of each PDO that *node_config* does not map.

    *word* is the file or simulated family that describes it. Values of a DCF or XDC are not defaults.
    """
    said = {pdo.pdo for pdo in node_config.pdos if pdo.mapping is not None}
    unsaid = (pdo for pdo, config in node.pdos.items() if config.mapping and pdo not in said)
    return dict.fromkeys(
        (pdo for pdo in unsaid if not _has_value(node.dictionary, pdo)), f"the default mapping of {_source(word)}"
    )


def _has_value(dictionary: ObjectDictionary | None, pdo: Pdo) -> bool:
    """Tell whether *dictionary* (of a DCF or XDC) has this node's own mapping of *pdo*."""
    entries = [] if dictionary is None else [dictionary.entry(pdo.mapping_index, sub) for sub in (0, 1)]
    return any(entry is not None and entry.value is not None for entry in entries)


def _source(word: str) -> str:
    """Name a simulated family or a file."""
    name = Path(word).name
    return name if Path(name).suffix else f"the family {name}"


def described_network(
    file: str,
    reporter: Reporter | None = None,
    *,
    for_rules: bool = False,
    with_links: bool = True,
    on_bus: Mapping[int, DeviceWord] | None = None,
    config: NetworkConfig | None = None,
    failures: list[DvtcliError] | None = None,
) -> NetworkState:
    """Compute what the nodes of the network *file* hold once it is applied to devices with default values.

    *config* is the file as read, if read already. If *failures* is given, errors are appended to it, and the state has
    what could be made.

    A node is described by its `dcf`, else its `profile`'s family, else the family or library file of its identity (`eds
    add`), else *on_bus* by its node-ID; an undescribed node has only the file's values. Raises InputFileError with all
    errors of the file, RuleError if its configuration cannot be made. *with_links* False leaves out the links.
    """
    read = config or read_network_config(file)
    read = read if with_links else replace(read, links=())
    words = words_of(file, read, on_bus)
    config = _with_undescribed_links(read, words.keys())
    known = tuple(replace(node, identity=ExpectedIdentity()) for node in config.nodes if node.node_id in words)
    links = tuple(link for link in config.links if _is_described(link, words.keys()))
    state = NetworkState(file=file, master=config.master, links=links)
    if known:
        state = _simulated(
            file, replace(config, nodes=known, links=links), words, reporter, failures, for_rules=for_rules
        )
    named = {node.node_id: node for node in config.nodes}
    met = [_met(node, named[node.node_id], words[node.node_id]) for node in state.nodes]
    undescribed = [node for node in config.nodes if node.node_id not in words]
    nodes = sorted([*met, *map(state_of_file, undescribed)], key=lambda node_state: node_state.node_id)
    ids = tuple(node.node_id for node in undescribed)
    return with_link_marks(state._replace(nodes=tuple(nodes), undescribed=ids), read.links)


def described_pdos(file: str, config: NetworkConfig) -> NetworkState:
    """Return the PDOs of `described_network` alone, without a plan if *config* itself says their COB-IDs and mappings.

    Raises as `described_network` for a PDO that cannot be made; of what else *file* says nothing is judged.
    """
    is_said = not config.links and not any(
        node.prune or any(pdo.cob_id == "auto" for pdo in node.pdos) for node in config.nodes
    )
    state = _as_described(file, config) if is_said else None
    return described_network(file, config=config) if state is None else state


def _as_described(file: str, config: NetworkConfig) -> NetworkState | None:
    """Return the PDOs of *config* on its simulated nodes; None if one of them cannot be made as it stands."""
    words, log, nodes = words_of(file, config), FileLog(file, network_text(file)), list[NodeState]()
    read: dict[DeviceWord, Mapping[Pdo, PdoConfig]] = {}
    options = simulation_of(words, force=True)
    with Session(options) as session:
        if words:
            session.bus.read_at_once()
        for told in config.nodes:
            word = words.get(told.node_id)
            if word is None:
                nodes.append(state_of_file(told))
                continue
            node = session.node(told.node_id)
            held = _held_pdos(node, read.get(word, {}))
            if word not in read:
                read[word] = {pdo: config for pdo, config in held.items() if _is_alike(node.dictionary, pdo, config)}
            pdos = _described_pdos(node, told, held, log)
            if pdos is None:
                return None
            state = NodeState(told.node_id, told.name, pdos, {}, node.dictionary, node.profile)
            nodes.append(replace(state, guessed=guessed_mappings(state, told, word.text)))
    return NetworkState(tuple(sorted(nodes, key=lambda node_state: node_state.node_id)), file=file)


def _held_pdos(node: ReadableNode, alike: Mapping[Pdo, PdoConfig]) -> dict[Pdo, PdoConfig]:
    """Read the PDOs of *node*; of those in *alike*, from a node of the same word, only the COB-ID."""
    held: dict[Pdo, PdoConfig] = {}
    for pdo in node.present():
        if (same := alike.get(pdo)) is not None:
            held[pdo] = same.with_parameters(cob_id=read_cob_id(node.sdo, pdo))
            continue
        with suppress(SdoAborted):  # neither COB-ID nor mapping: no such PDO
            held[pdo] = read_pdo(node.sdo, pdo, WHATEVER)
    return held


def _is_alike(dictionary: ObjectDictionary | None, pdo: Pdo, config: PdoConfig) -> bool:
    """Tell whether *pdo* (by default *config*) is the same on any node of *dictionary*, but for its COB-ID."""
    if dictionary is None or not config.has_cob_id:
        return False
    described = (dictionary.get(index) for index in (pdo.communication_index, pdo.mapping_index))
    return not any(
        entry.default_relative or entry.value_relative
        for described_object in described
        if described_object is not None
        for entry in described_object.entries.values()
        if (entry.index, entry.sub_index) != (pdo.communication_index, 1)
    )


def _described_pdos(
    node: ReadableNode, config: NodeConfig, held: Mapping[Pdo, PdoConfig], log: FileLog
) -> dict[Pdo, PdoConfig] | None:
    """Return the PDOs of *node*, which it *held* by default, with those of *config*; None as `_as_described`."""
    wanted: dict[Pdo, PdoConfig] = {}
    for pdo in config.pdos:
        request = pdo_request(node, pdo, log)
        if log.count or pdo.pdo not in held or held[pdo.pdo].unread:
            return None
        try:
            lengths = untyped_lengths(node, [request])
            wanted[pdo.pdo] = resolve(node, pdo.pdo, held[pdo.pdo], request, lengths, list)
        except (RuleError, UsageError):  # the plan says so, with its place in the file
            return None
    return {**wanted, **held, **wanted}


def _met(node: NodeState, config: NodeConfig, word: DeviceWord) -> NodeState:
    return replace(with_config(node, config), guessed=guessed_mappings(node, config, word.text))


def words_of(file: str, config: NetworkConfig, on_bus: Mapping[int, DeviceWord] | None = None) -> dict[int, DeviceWord]:
    """Return the words for described nodes of *config*; *file* goes before *on_bus*."""
    found: dict[int, DeviceWord] = {}
    for node in config.nodes:
        text = simulated_word(file, node)
        if text is not None:
            found[node.node_id] = DeviceWord(text, node.modules or ())
        elif on_bus is not None and node.node_id in on_bus:
            found[node.node_id] = on_bus[node.node_id]
    return found


class DeviceWord(NamedTuple):
    """What describes a node: the `--sim` word *text*, and the *modules* of a modular device, () as the file says."""

    text: str
    modules: tuple[int, ...] = ()


def simulation_of(words: Mapping[int, DeviceWord], *, force: bool = False) -> Options:
    """Return the options that simulate the nodes of *words*, by node-ID."""
    modules = {node_id: ",".join(map(str, word.modules)) for node_id, word in words.items() if word.modules}
    return Options(
        sim=tuple(f"{word.text}@{node_id}" for node_id, word in words.items()),
        modules=tuple(f"{node_id}:{numbers}" for node_id, numbers in modules.items()),
        force=force,
    )


def _is_described(link: LinkConfig, told: Collection[int]) -> bool:
    """Tell whether all ends of *link* are on *told* nodes, described by an EDS or a family."""
    return all(end.node_id in told for end in link.ends)


def _with_undescribed_links(config: NetworkConfig, told: Collection[int]) -> NetworkConfig:
    """Give both ends of each link with an undescribed node the same CAN-ID, and enable them.

    The CAN-ID is the file's for the TPDO, else the pre-defined CAN-ID. Layouts need a dictionary.
    """
    ends: dict[Endpoint, int] = {}
    for link in config.links:
        can_id = _described_can_id(config, link.producer)
        if not _is_described(link, told) and can_id is not None:
            ends |= dict.fromkeys(link.ends, can_id)
    consumers = {end for link in config.links for end in link.consumers}
    undescribed = [link for link in config.links if not _is_described(link, told)]
    nodes = (_linked_node(_watching(config, node, undescribed), ends, consumers, told) for node in config.nodes)
    return replace(config, nodes=tuple(nodes))


def _watching(config: NetworkConfig, node: NodeConfig, links: Collection[LinkConfig]) -> NodeConfig:
    """Let *node* consume the heartbeats of its producers in *links*, with times of the file."""
    watched = {watch.producer for watch in node.watches}
    found: dict[int, HeartbeatWatch] = {}
    for link in links:
        producer, hears = link.producer.node_id, any(end.node_id == node.node_id for end in link.consumers)
        time_ms = link.heartbeat or _described_heartbeat_ms(config, producer)
        late_ms = (
            watch_time_ms(time_ms, CONSUMER_PERIODS if config.multiplier is None else config.multiplier)
            if time_ms
            else None
        )
        if hears and link.heartbeat is not False and late_ms and producer not in watched:
            found[producer] = HeartbeatWatch(producer, late_ms)
    return replace(node, watches=(*node.watches, *found.values()))


def _described_heartbeat_ms(config: NetworkConfig, node_id: int) -> int:
    said = (object_config for node in config.nodes if node.node_id == node_id for object_config in node.objects)
    return next(
        (
            int.from_bytes(object_config.data, "little")
            for object_config in said
            if object_config.index == PRODUCER_HEARTBEAT
        ),
        0,
    )


def _described_can_id(config: NetworkConfig, end: Endpoint) -> int | None:
    node = next((node for node in config.nodes if node.node_id == end.node_id), None)
    said = next((pdo.cob_id for pdo in node.pdos if pdo.pdo == end.pdo), None) if node is not None else None
    return said if isinstance(said, int) else end.pdo.default_can_id(end.node_id)


def _linked_node(
    node: NodeConfig, ends: Mapping[Endpoint, int], consumers: Collection[Endpoint], told: Collection[int]
) -> NodeConfig:
    pdos = {pdo.pdo: pdo for pdo in node.pdos}
    for end, can_id in ends.items():
        if end.node_id == node.node_id:
            said = pdos.get(end.pdo, PartialPdoConfig(end.pdo))
            hears = end in consumers and node.node_id not in told  # what it maps is laid out as the TPDO sends it
            pdos[end.pdo] = replace(
                said, cob_id=can_id, enabled=said.enabled is not False, mapping=None if hears else said.mapping
            )
    return replace(node, pdos=tuple(pdos.values()))


def _simulated(
    file: str,
    config: NetworkConfig,
    words: Mapping[int, DeviceWord],
    reporter: Reporter | None,
    failures: list[DvtcliError] | None,
    *,
    for_rules: bool,
) -> NetworkState:
    options = simulation_of(words, force=True)
    with Session(options, reporter) as session:
        session.bus.read_at_once()
        network_plan = _planned(session, config, FileLog(file, network_text(file)), failures, by_rules=for_rules)
        nodes = [session.node(node.node_id) for node in config.nodes]
        state = network_state(nodes, for_rules=for_rules)
        named = {node.node_id: node for node in config.nodes}
        known = tuple(_without_unsaid(node, named[node.node_id]) for node in state.nodes)
        return network_after(state._replace(nodes=known), network_plan, config)


def _without_unsaid(node: NodeState, config: NodeConfig) -> NodeState:
    """Drop transmission types and mappings that neither *config* nor the EDS has: the standard has no default."""
    types = {pdo.pdo for pdo in config.pdos if pdo.transmission_type is not None}
    mappings = {pdo.pdo for pdo in config.pdos if pdo.mapping is not None}
    pdos, unsaid = dict(node.pdos), set[Pdo]()
    for pdo, held in node.pdos.items():
        if pdo not in types and _is_unsaid(node, pdo.communication_index, 2):
            pdos[pdo] = held.with_parameters(transmission_type=None)
        if pdo not in mappings and _is_unsaid(node, pdo.mapping_index, 0):
            pdos[pdo] = replace(pdos[pdo], mapping=(), unread=(*held.unread, (pdo.mapping_index, 0)))
            unsaid.add(pdo)
    return replace(node, pdos=pdos, unsaid=frozenset(unsaid))


def _is_unsaid(node: NodeState, index: int, sub_index: int) -> bool:
    entry = None if node.dictionary is None else node.dictionary.entry(index, sub_index)
    return entry is not None and entry.initial(node.node_id) is None


def _planned(
    session: Session, config: NetworkConfig, log: FileLog, failures: list[DvtcliError] | None, *, by_rules: bool
) -> NetworkPlan:
    """Plan *config*; if *failures* is given, it also gets a UsageError, and the plan is empty."""
    from dvtcli.domain.network.network_plan import NetworkPlan
    from dvtcli.operations.plans.plan_network import plan_network_config

    try:
        return plan_network_config(session, config, log, failures=failures, by_rules=by_rules)
    except UsageError as failed:
        if failures is None:
            raise
        failures.append(failed)
        return NetworkPlan(log.file, ())


def simulated_word(file: str, node: NodeConfig) -> str | None:
    """Return the `--sim` word for *node* of *file*, without a node-ID; None if undescribed."""
    from dvtcli.files.profiles import profile_for_identity
    from dvtcli.simulator.network.family_file import family_names

    if (chosen := _chosen_word(file, node)) is not None:
        return chosen
    vendor, product = node.identity.vendor, node.identity.product
    if vendor is None or product is None:
        return None
    own = library_match(file, node)
    if own is not None:
        return str(own.file.path)
    profile = profile_for_identity(vendor, product)
    return profile.name if profile.matches(vendor, product) and profile.name in family_names() else None


def _chosen_word(file: str, node: NodeConfig) -> str | None:
    """Return the `--sim` word of the node's own `dcf` or `profile`."""
    from dvtcli.simulator.network.family_file import family_names

    if node.dcf is not None and (path := eds_of(file, node)) is not None:
        return node.dcf.text if node.dcf.text in family_names() else str(path)
    return node.profile if node.profile in family_names() else None


def unknown_names(file: str, config: NetworkConfig, known: Collection[int] = ()) -> Iterator[FileNote]:
    """Note each node of *config* (from *file*) that uses object names but has no description.

    Nodes in *known* have a dictionary from elsewhere.
    """
    for node in config.nodes:
        words = [word for pdo in node.pdos for word in pdo.mapping or ()]
        words += [value.object for value in node.values]
        names = [word for word in words if is_name(word.text)]
        if names and node.node_id not in known and simulated_word(file, node) is None:
            text = (
                f"object {names[0].text!r} of node {node.node_id} is unknown: add `dcf:` or `profile:` to the node, "
                f"or a file with its identity to the library"
            )
            yield FileNote(text, names[0].mark, len(names))


def library_match(file: str, node: NodeConfig) -> Match | None:
    """Find the library file for *node* by its identity; None if *file* names another, or there is none."""
    from dvtcli.files.device_library import match, stored_files

    vendor, product = node.identity.vendor, node.identity.product
    if vendor is None or product is None or _chosen_word(file, node) is not None:
        return None
    return match(stored_files(), vendor, product, node.identity.revision)


def state_of_file(node_config: NodeConfig) -> NodeState:
    """Build the state of a node from *node_config* alone: PDOs named there are enabled unless disabled."""
    numbers = {
        (object_config.index, object_config.sub_index): int.from_bytes(object_config.data, "little")
        for object_config in node_config.objects
    }
    for sub_index, watch in enumerate(node_config.watches, 1):
        numbers[CONSUMER_HEARTBEAT, sub_index] = watch.producer << 16 | watch.time_ms
    pdos = {
        pdo.pdo: config
        for pdo in node_config.pdos
        if (config := _undescribed_pdo(node_config.node_id, pdo)) is not None
    }
    return with_config(NodeState(node_config.node_id, node_config.name, pdos, numbers), node_config)


def _undescribed_pdo(node_id: int, node_config: PartialPdoConfig) -> PdoConfig | None:
    default = node_config.pdo.default_can_id(node_id)
    can_id = node_config.cob_id if isinstance(node_config.cob_id, int) else default
    if can_id is None:
        return None
    cob_id = CobId(can_id, node_config.enabled is not False, node_config.rtr_allowed is not False, node_config.extended)
    communication = PdoCommunicationParameter(
        cob_id,
        node_config.transmission_type,
        node_config.inhibit_time,
        node_config.event_timer,
        node_config.sync_start_value,
    )
    entries = None if node_config.mapping is None else [_undescribed_entry(word) for word in node_config.mapping]
    if entries is None or None in entries:
        return PdoConfig(communication, (), unread=((node_config.pdo.mapping_index, 0),))
    return PdoConfig(
        communication, tuple(entry for told_entries in entries if told_entries is not None for entry in told_entries)
    )


def _undescribed_entry(word: FileWord) -> tuple[PdoMappingEntry, ...] | None:
    """Return the mapping that *word* means, None if a dictionary is needed."""
    try:
        found = resolve_entry(word.text, None, {})
        if isinstance(found, Skipped):
            return tuple(split_dummy(found.bits, DUMMY_BITS))
    except (UnknownName, ValueError):
        return None
    return _entry(found)


def _entry(found: MappedObject) -> tuple[PdoMappingEntry, ...] | None:
    if found.bits is None:
        return None
    return (PdoMappingEntry(found.index, found.sub_index, found.bits),)
