"""Read a network file, and tell by its stamps (0x1020) which nodes match it. Writes nothing."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from dvtcli.device.stamped import ended_stamp, held_stamp, stamp_changes
from dvtcli.device.store.unstored import is_remembered
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.objects import COMMUNICATION_AREA, VERIFY_CONFIGURATION
from dvtcli.domain.plan import ValueChange
from dvtcli.domain.rules.finding import NOTE, Rule, note
from dvtcli.domain.store import DATE, TIME, Stamp
from dvtcli.domain.text import all_nodes, plural
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.network.read_network import WhyNot, read_network_file
from dvtcli.operations.values.named_objects import entry_at, object_at, object_index

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence

    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.domain.network.network_config import FileWord, LinkConfig, NetworkConfig, NodeConfig, PartialPdoConfig
    from dvtcli.domain.plan import Change
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.operations.session.session import Session, SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

#: dcfgen's name for the folder of the network file itself
BESIDE = "@BUS_CONFIG_PATH@/"


def read_network_config(file: str) -> NetworkConfig:
    """Read the network file *file*.

    Raises UsageError if it cannot be opened, InputFileError with all its errors; an unresolvable `dcf` or `profile` is
    an error, too, since rules need it.
    """
    try:
        why_not: dict[str, WhyNot] = {"dcf": partial(_why_no_dcf, Path(file).parent), "profile": _why_no_profile}
        return read_network_file(Path(file), why_not, partial(_why_no_modules, file))
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed


def eds_of(file: str, node: NodeConfig) -> Path | None:
    """Find the `dcf` of *node* in *file*: a file beside it, of a simulated family, or of the library.

    Returns None if there is none.
    """
    return None if node.dcf is None else _dcf_path(Path(file).parent, node.dcf.text)


def _dcf_path(folder: Path, name: str) -> Path | None:
    path = folder / name.removeprefix(BESIDE)
    if path.is_file():
        return path
    from dvtcli.files.device_library import files_named
    from dvtcli.simulator.network.family_file import family_eds, family_names

    if name in family_names():
        return family_eds(name)
    stored = files_named(name)
    return stored[0].path if len(stored) == 1 else None


def _why_no_dcf(folder: Path, name: str) -> str:
    """Explain why `dcf: NAME` in *folder* names no device description, with a suggestion; empty if it does."""
    found = _dcf_path(folder, name)
    if found is not None:
        return _why_no_description(found)
    from dvtcli.files.device_file import DEVICE_SUFFIXES
    from dvtcli.files.device_library import files_named, full_names, stored_files, why_several
    from dvtcli.files.network.file_log import nearest
    from dvtcli.simulator.network.family_file import family_names

    path = folder / name.removeprefix(BESIDE)
    inside = path.parent
    beside = (
        [file.name for file in inside.iterdir() if file.suffix.lower() in DEVICE_SUFFIXES] if inside.is_dir() else []
    )
    if path.exists():
        kind = "a folder" if path.is_dir() else "a pipe or a device"
        return f"{path} is {kind}, and dcf names a file: an EDS, DCF, XDD or XDC"
    if several := files_named(name):
        return f"there is no {path}, and {why_several(name, several)}: write one of {full_names(several)}"
    families = family_names()
    near = nearest(path.name, [*beside, *families, *(file.label for file in stored_files())])
    if near in beside:  # written as the file's author wrote the folder
        near = f"{name[: len(name) - len(path.name)]}{near}"
    meant = f"; did you mean {near!r}?" if near else f"; families are {', '.join(families)}"
    return f"there is no {path}, and no simulated family or library file is called {name[:40]!r}{meant}"


def _why_no_description(path: Path) -> str:
    """Explain why the file at *path* describes no device; empty if it does. Caches the parsed file."""
    from dvtcli.operations.session.simulated_nodes import read_dictionary

    try:
        read_dictionary(path)
    except (InputFileError, UsageError) as wrong:
        line = re.search(r":[0-9]+(?::[0-9]+)?$", wrong.place or "")
        at = f" ({path.name}{line[0]})" if line and line[0] not in wrong.text else ""
        return f"{wrong.text}{f': {wrong.why}' if wrong.why else ''}{at}"
    return ""


def _why_no_modules(file: str, node: NodeConfig) -> str:
    """Explain why the `dcf` of *node* does not have its modules; empty if it does, or another file describes it."""
    from dvtcli.operations.session.simulated_nodes import read_dictionary, why_no_modules

    path = eds_of(file, node)
    return "" if path is None else why_no_modules(read_dictionary(path), node.modules or ())


def _why_no_profile(name: str) -> str:
    """Explain why `profile: NAME` is unknown, with a suggestion; empty if known."""
    from dvtcli.files.profiles import profile_path

    try:
        profile_path(name)
    except UsageError as wrong:
        hint = str(wrong.hint or "")
        return f"{wrong.text}; {hint if hint.startswith('did') else f'known are {hint}'}"
    return ""


def skipped_rules(ids: Collection[int]) -> str:
    """Say that rules which need an EDS were skipped for the nodes *ids* without a description."""
    return (
        f"{all_nodes(sorted(ids))}: no EDS, so rules that need an EDS were skipped; `dcf:` next to node_id names an EDS"
    )


def named_nodes(session: Session) -> tuple[int, ...]:
    """Return the nodes that the user chose; empty for all of the file.

    A single node counts only if `-n` is on the line itself: at a prompt and in scripts, settings and variables `-n`
    only selects the current node.
    """
    ids = session.base.nodes
    typed = session.settings.is_typed("node") and session.ends_with_line
    return ids if len(ids) > 1 or typed else ()


def of_nodes(session: SessionUser, file: str, config: NetworkConfig, ids: tuple[int, ...]) -> NetworkConfig:
    """Restrict *config* to the nodes *ids*, if any (`-n 1,3`); raises UsageError for a node not in the file."""
    if not ids:
        return config
    if unknown := [chosen_id for chosen_id in ids if chosen_id not in {node.node_id for node in config.nodes}]:
        raise UsageError(f"{file} has no {all_nodes(unknown)}", place=file)
    chosen, alone = _without_torn_links(config, _without_stamps(config, config.of(ids)))
    if left_out := len(config.links) - len(chosen.links):
        stay = ", ".join(f"{end.node_id}:{end.pdo}" for end in alone)
        kept = f"; not changed: {stay}" if stay else ""
        session.reporter.note(
            f"{plural(left_out, 'link')} of {file} left out, since their producer or consumer was not chosen{kept}"
        )
    return chosen


def _without_stamps(config: NetworkConfig, chosen: NetworkConfig) -> NetworkConfig:
    """Drop from *chosen* the stamps that also cover links with nodes outside it."""
    ids = {node.node_id for node in chosen.nodes}
    nodes = (node if linked_with(config, node.node_id) <= ids else replace(node, stamp=None) for node in chosen.nodes)
    return replace(chosen, nodes=tuple(nodes))


def _without_torn_links(config: NetworkConfig, chosen: NetworkConfig) -> tuple[NetworkConfig, list[Endpoint]]:
    """Drop links of *chosen* that lack an end, and their PDOs; returns those PDOs, too.

    One end of such a link must not change while the other stays: the RPDO would receive another layout.
    """
    links, unlinked = chosen.links, {end for link in config.links if link not in chosen.links for end in link.ends}
    while shared := [link for link in links if not unlinked.isdisjoint(link.ends)]:
        links = tuple(link for link in links if link not in shared)
        unlinked |= {end for link in shared for end in link.ends}
    nodes = tuple(
        replace(node, pdos=tuple(pdo for pdo in node.pdos if Endpoint(node.node_id, pdo.pdo) not in unlinked))
        for node in chosen.nodes
    )
    ids = {node.node_id for node in chosen.nodes}
    alone = sorted((end for end in unlinked if end.node_id in ids), key=lambda end: (end.node_id, str(end.pdo)))
    return replace(chosen, nodes=nodes, links=links), alone


def tell_unknown_bit_rate(session: SessionNodes, nodes: int) -> None:
    """Report, once a session, that *nodes* nodes are read one by one as the bit rate is unknown, with a hint.

    Only for a bus that could read them in parallel: not for simulated nodes, twins, or an object gateway.
    """
    bus = session.bus
    if nodes < 2 or session.dry_run or bus.simulated or not bus.carries_frames or bus.bitrate is not None:
        return
    unknown = f"the bit rate of {bus.name} is not known"
    if not session.network.files.is_news(unknown):
        return
    session.reporter.note(
        Hint(
            Action.GIVE_BIT_RATE,
            {"rate": 250000},
            f"{verbatim(unknown)}: its {nodes} nodes are read one after the other, which takes long, and without a "
            "limit of the bus load for a running machine; faster with {} or bitrate = 250000 in dvtcli.toml",
        )
    )


#: changes with the text's form: older stamps are void
_VERSION = "dvtcli stamp 1"


def wanted_stamp(nodes: Mapping[int, Node], config: NetworkConfig, node_id: int) -> Stamp:
    """Compute a node's stamp from its part of *config*, the nodes linked with it, and its identity (0x1018)."""
    joined = linked_with(config, node_id)
    links = [
        [[[end.node_id, str(end.pdo)] for end in link.ends], link.heartbeat]
        for link in config.links
        if link.producer.node_id in joined
    ]
    said = [_words(nodes[node.node_id], node) for node in config.nodes if node.node_id in joined]
    document = [_VERSION, node_id, sorted(nodes[node_id].identity().items()), links, config.multiplier, said]
    return Stamp.of(json.dumps(document))


def linked_with(config: NetworkConfig, node_id: int) -> frozenset[int]:
    """List the nodes that links of *config* join with *node_id*, directly or not, including itself."""
    found = {node_id}
    while more := {end.node_id for link in config.links for end in link.ends if _touches(link, found)} - found:
        found |= more
    return frozenset(found)


def _touches(link: LinkConfig, found: set[int]) -> bool:
    return any(end.node_id in found for end in link.ends)


def _words(node: Node, config: NodeConfig) -> list[Any]:
    return [
        config.node_id,
        bool(config.prune),
        sorted((_pdo_words(node, pdo) for pdo in config.pdos), key=lambda row: str(row[0])),
        sorted(
            [object_config.index, object_config.sub_index, object_config.data.hex()] for object_config in config.objects
        ),
        sorted([_at(object_at, node, value.object), value.value.text] for value in config.values),
        sorted([watch.producer, watch.time_ms] for watch in config.watches),
        sorted([pin.group, pin.pin, pin.object and _at(object_index, node, pin.object)] for pin in config.pins),
    ]


def _pdo_words(node: Node, pdo: PartialPdoConfig) -> list[Any]:
    mapping = None if pdo.mapping is None else [_at(entry_at, node, word) for word in pdo.mapping]
    return [
        str(pdo.pdo), pdo.enabled, pdo.cob_id, pdo.extended, pdo.rtr_allowed, pdo.transmission_type, pdo.inhibit_time,
        pdo.event_timer, pdo.sync_start_value, mapping,
    ]  # fmt: skip


def _at(resolve: Callable[[Node, str], object], node: Node, word: FileWord) -> str:
    """Resolve *word* on *node*; returns *word* if unknown (reported when planned)."""
    try:
        return str(resolve(node, word.text))
    except UsageError:
        return word.text


RULES = (
    Rule("stamp-absent", NOTE, "`stamp: true` of a network file, but the node has no writable 0x1020",
         "CiA 301, 0x1020"),
    Rule("stamp-foreign", NOTE, "`stamp: true` of a network file, but 0x1020 of the node is not a stamp of dvtcli",
         "CiA 301, 0x1020"),
)  # fmt: skip
_PLACE = f"0x{VERIFY_CONFIGURATION:04X}"
#: Indices that are stored (0x1010), restored and reset together with the stamp (CiA 301, 7.5.2.13).
_WITH_STAMP = COMMUNICATION_AREA


class Stamping(NamedTuple):
    """A plan's part about a node's stamp: wanted objects, their changes, findings."""

    values: Mapping[tuple[int, int], bytes]
    changes: tuple[ValueChange, ...] = ()
    findings: tuple[Finding, ...] = ()


def stamps_of(nodes: Mapping[int, Node], config: NetworkConfig) -> dict[int, Stamp]:
    """Map node-IDs of *config* to their wanted stamps."""
    return {
        node.node_id: wanted_stamp(nodes, config, node.node_id)
        for node in config.nodes
        if node.stamp and linked_with(config, node.node_id) <= nodes.keys()
    }


def stamping(node: Node, wanted: Stamp | None, changes: Sequence[Change]) -> Stamping:
    """Plan the stamp of *node* with *changes*; *wanted* None: no stamp.

    Our stamp ends with the first change; a stamp by another tool is left alone.
    """
    if wanted is None:
        return Stamping({}, ended_stamp(node, changes))
    held = held_stamp(node)
    if held is None:
        text = "stamp: true has no effect: the node has no writable 0x1020"
        return Stamping({}, findings=(note("stamp-absent", _PLACE, text),))
    if held.is_foreign:
        text = f"0x1020 is {held}, not a stamp of dvtcli: it is not changed, and the node gets no stamp"
        return Stamping({}, findings=(note("stamp-foreign", _PLACE, text),))
    values = {(VERIFY_CONFIGURATION, sub_index): wanted.data(sub_index) for sub_index in (DATE, TIME)}
    due = changes or held != wanted
    return Stamping(values, stamp_changes(held, wanted, f"stamp: {wanted}") if due else ())


def nodes_by_stamp(nodes: Mapping[int, Node], config: NetworkConfig) -> frozenset[int]:
    """List nodes whose stamp proves that they hold and have stored their part of *config*.

    Excluded are nodes with a change to recover or a remembered change not stored. Linked nodes are trusted together or
    not at all. Also excluded are nodes for which the file names objects that are not stored along with 0x1020: objects
    kept without a store, and all outside 0x1000..0x1FFF, which an RPDO may write and which have their own group in
    0x1010 and 0x1011: a restart could restore an old stamp beside a new value.
    """
    stamps = stamps_of(nodes, config)
    own = {node.node_id for node in config.nodes if _is_stamped(nodes, node, stamps.get(node.node_id))}
    return frozenset(node_id for node_id in own if linked_with(config, node_id) <= own)


def _is_stamped(nodes: Mapping[int, Node], config: NodeConfig, wanted: Stamp | None) -> bool:
    if wanted is None:
        return False
    node = nodes[config.node_id]
    guard = node.guard
    if node.unstored or (guard is not None and (guard.unfinished_journal() or is_remembered(node, guard.history))):
        return False
    stored = all(index in _WITH_STAMP and node.profile.store.needed_for(index) for index in _indices(node, config))
    return stored and held_stamp(node) == wanted


def _indices(node: NodeDescription, config: NodeConfig) -> Iterator[int]:
    """Yield the indices of objects that *config* names, a PDO's by its communication record; 0 for unknown names."""
    yield from (pdo.pdo.communication_index for pdo in config.pdos)
    yield from (object_config.index for object_config in config.objects)
    for word in (value.object for value in config.values):
        try:
            yield object_at(node, word.text)[0]
        except UsageError:
            yield 0
    if config.pins:
        yield from (group.index for group in node.profile.vpdo.values())
