"""What a CANopen manager downloads at boot-up (CiA 302-3, 0x1F22): make, show and plan concise DCFs of a network."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.described_node import Defaults, FileValues
from dvtcli.device.read_pdos import UNREADABLE, WHATEVER, read_pdo
from dvtcli.device.store.store_parameters import SIGNATURES
from dvtcli.domain.datatypes import Kind
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.concise_dcf import (
    ConciseEntry,
    concise_bytes,
    concise_entries,
    concise_of,
    concise_of_device,
)
from dvtcli.domain.network.network_config import ExpectedIdentity
from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan
from dvtcli.domain.object_syntax import parse_object
from dvtcli.domain.objects import CONCISE_DCF, EXPECTED_DATE, EXPECTED_TIME, VERIFY_CONFIGURATION
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Plan, disables, mapping_differs
from dvtcli.domain.store import DATE, TIME
from dvtcli.domain.text import join_some, plural
from dvtcli.errors import InputFileError, SdoAborted, UsageError
from dvtcli.files.device_file import DEVICE_SUFFIXES, read_device_file
from dvtcli.files.input_file import read_input
from dvtcli.files.network.file_log import FileLog
from dvtcli.files.network.read_network import network_text
from dvtcli.files.unread_values import must_tell_values
from dvtcli.operations.changes.change import mapped_names
from dvtcli.operations.network.check_live import words_of_present
from dvtcli.operations.network.described_network import DeviceWord, simulated_word, simulation_of, words_of
from dvtcli.operations.plans.judge_network import check_plans
from dvtcli.operations.plans.plan_network import plan_network_config, value_change
from dvtcli.operations.plans.read_network_config import named_nodes, read_network_config
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of
from dvtcli.operations.session.session import Session

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.network.network_config import NetworkConfig, NodeConfig
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.operations.user.session_user import Reporter, SessionUser

#: Maximum length read (bytes): 0x1F22 is a DOMAIN of some kB.
_MOST_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class ConciseDcf:
    """The concise DCF that a manager downloads to the node *node_id*, called *name* in its network file."""

    node_id: int
    name: str
    entries: tuple[ConciseEntry, ...]
    #: findings of the rules except errors
    findings: tuple[Finding, ...] = ()

    @property
    def data(self) -> bytes:
        """Return the bytes as in 0x1F22."""
        return concise_bytes(self.entries)


@dataclass(frozen=True, slots=True)
class ConciseNetwork:
    """The concise DCFs of a network file in its order, and the names of undescribed nodes."""

    nodes: tuple[ConciseDcf, ...]
    untold: tuple[NodeConfig, ...]


def concise_dcf(file: str, node: str | int | None = None, reporter: Reporter | None = None) -> ConciseDcf:
    """Make the concise DCF of a node of the network *file*, by name or node-ID; None for its only node.

    Undescribed nodes and their links are left out. Raises UsageError if *node* is unknown or undescribed, or the file
    cannot be read; InputFileError with all its errors, RuleError if its configuration cannot be made.
    """
    read = read_network_config(file)
    chosen = _chosen(file, read, node)
    if simulated_word(file, chosen) is None:
        raise UsageError(
            f"{file}: {chosen.name} has no EDS", place=f"{file}:{chosen.mark.line}",
            hint="dcf: names its file; a concise DCF has the values that differ from the EDS defaults",
        )  # fmt: skip
    return next(dcf for dcf in _concise(file, read, reporter).nodes if dcf.node_id == chosen.node_id)


def concise_dcfs(
    file: str, reporter: Reporter | None = None, on_bus: Mapping[int, DeviceWord] | None = None
) -> ConciseNetwork:
    """Make the concise DCFs of all described nodes of the network *file*; *on_bus* adds descriptions.

    Raises as `concise_dcf`.
    """
    return _concise(file, read_network_config(file), reporter, on_bus)


def _concise(
    file: str, read: NetworkConfig, reporter: Reporter | None, on_bus: Mapping[int, DeviceWord] | None = None
) -> ConciseNetwork:
    words = words_of(file, read, on_bus)
    config = read.of(words.keys())
    anyone = replace(config, nodes=tuple(replace(node, identity=ExpectedIdentity()) for node in config.nodes))
    made: list[ConciseDcf] = []
    if words:
        with Session(simulation_of(words), reporter) as session:
            network_plan = plan_network_config(session, anyone, FileLog(file, network_text(file)))
            dictionaries = {node_id: session.node(node_id).dictionary for node_id in words}
        node_plans = {node_plan.node_id: node_plan for node_plan in network_plan.nodes}
        made = [_made(node, node_plans[node.node_id], dictionaries[node.node_id]) for node in config.nodes]
    return ConciseNetwork(tuple(made), tuple(node for node in read.nodes if node.node_id not in words))


def _made(config: NodeConfig, node_plan: NodePlan, dictionary: ObjectDictionary | None) -> ConciseDcf:
    mapped = {pdo.pdo for pdo in config.pdos if pdo.mapping is not None}
    fixed: set[Pdo] = set()
    if dictionary is not None:
        fixed = _fixed(dictionary, node_plan.wanted)
        mapped = {
            pdo for pdo, after in node_plan.wanted.items() if pdo in mapped and _is_mapped(dictionary, pdo, after)
        }
    own = {place for value in config.values if (place := parse_object(value.object.text)) is not None}
    return ConciseDcf(config.node_id, config.name, concise_of(node_plan, mapped, fixed, own), node_plan.findings)


def _chosen(file: str, config: NetworkConfig, node: str | int | None) -> NodeConfig:
    """Find *node* in *config*; raises UsageError if unknown or ambiguous."""
    found = [
        node_config
        for node_config in config.nodes
        if node is None or str(node) in (node_config.name, str(node_config.node_id))
    ]
    if len(found) == 1:
        return found[0]
    names = join_some(f"{node_config.name} ({node_config.node_id})" for node_config in config.nodes) or "none"
    text = "a concise DCF is for one node" if node is None else f"no node is {node!r}"
    raise UsageError(
        f"{file}: {text}; it has {names}",
        place=file,
        hint=Hint(Action.GIVE, {"node": "NODE"}, "{}, by its name or node-ID"),
    )


def convert_network(session: SessionUser, file: str, target: str, node: str | int | None = None) -> Facts:
    """Write the concise DCF of *node* of the network *file*, or of the DCF or XDC *file*, to *target* (.cdcf).

    Asks before overwriting. *node* and errors as of `concise_dcf`; of a DCF it is the node-ID, if the file has none.
    """
    path = place_of(target, "node5.cdcf")
    if file.lower().endswith(DEVICE_SUFFIXES):
        one, left_out = _of_device(file, node)
    else:
        one, left_out = concise_dcf(file, node, session.reporter), ()
    ask_before_overwriting(session, path)
    make_file(session, path, one.data)
    count = plural(len(one.entries), "download")
    rows = (("file", file), ("to", target), ("node", one.node_id), ("entries", _rows(one.entries)))
    said = f"{target}: node {one.node_id} {one.name}, {count}, {len(one.data)} bytes for 0x1F22:{one.node_id:02X}"
    return Facts("concise-dcf", rows, (said, *(f"warning: left out: {text}" for text in left_out)))


def _of_device(file: str, node: str | int | None) -> tuple[ConciseDcf, tuple[str, ...]]:
    """Make the concise DCF of the ParameterValues of the DCF or XDC *file*; also returns what is left out, and why.

    Raises UsageError if the node-ID is unknown or another one, or *file* has no ParameterValue; InputFileError if a
    ParameterValue is malformed or contradictory.
    """
    try:
        read = read_device_file(Path(file))
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed
    must_tell_values(read, file)
    dictionary = read.dictionary
    said = {(entry.index, entry.sub_index): entry for entry in dictionary.entries() if entry.value is not None}
    if not said:
        raise UsageError(
            f"{file} has no ParameterValue: a concise DCF is made of the values for one node",
            place=file,
            hint=Hint(Action.EXPORT, {"file": "x.dcf"}, "writes a file that has them"),
        )
    node_id = _node_id(file, dictionary.info.node_id, node)
    left_out: list[str] = []
    pdos = _pdos_of(dictionary, node_id, said, left_out)
    with_mapping = {pdo for pdo in pdos if any(index == pdo.mapping_index for index, _ in said)}
    mapped = {pdo for pdo in with_mapping if _is_mapped(dictionary, pdo, pdos[pdo][1])}
    values: dict[tuple[int, int], bytes] = {}
    fixed, commands = [], []
    for place, entry in said.items():
        data = entry.initial(node_id)
        if Pdo.at(place[0]) is not None or data is None:  # a value of *said* is never None
            continue
        if not entry.access.writable:
            fixed.append(entry.object)
        elif place[0] in SIGNATURES:
            commands.append(entry.object)
        else:
            values[place] = data
    made = concise_of_device(pdos, mapped, _fixed(dictionary, pdos), values)
    entries = tuple(entry for entry in made if _is_writable(dictionary, entry.index, entry.sub_index))
    fixed += [entry.object for entry in made if entry not in entries]
    left_out += [
        f"{join_some(objects)} ({why})" for objects, why in ((fixed, "read-only"), (commands, "commands")) if objects
    ]
    name = dictionary.info.commissioning.node_name or Path(file).stem
    return ConciseDcf(node_id, name, entries), tuple(left_out)


def _pdos_of(
    dictionary: ObjectDictionary, node_id: int, said: Collection[tuple[int, int]], left_out: list[str]
) -> dict[Pdo, tuple[PdoConfig, PdoConfig]]:
    """Return each PDO with a value among *said*: as the device comes, and as the file has it."""
    found: dict[Pdo, tuple[PdoConfig, PdoConfig]] = {}
    for pdo in {pdo: None for index, _ in said if (pdo := Pdo.at(index)) is not None}:
        try:
            before, after = (read_pdo(read(dictionary, node_id), pdo, WHATEVER) for read in (Defaults, FileValues))
        except SdoAborted:
            left_out.append(f"{pdo.label} is incomplete in the file")
            continue
        if why := after.inconsistency or _read_only(dictionary, pdo, before, after):
            left_out.append(f"{pdo.label} ({why})")
        else:
            found[pdo] = before, after
    return found


def _read_only(dictionary: ObjectDictionary, pdo: Pdo, before: PdoConfig, after: PdoConfig) -> str:
    """Why *pdo* cannot be brought from *before* to *after*: its COB-ID or mapping is read-only; else empty."""
    differs = before.communication.cob_id != after.communication.cob_id or disables(before, after)
    if differs and not _is_writable(dictionary, pdo.communication_index, 1):
        return f"its COB-ID {pdo.communication_index:04X}:01 is read-only"
    if mapping_differs(before, after) and not _is_mappable(dictionary, pdo, after):
        return f"its mapping {pdo.mapping_index:04X} is read-only"
    return ""


def _fixed(dictionary: ObjectDictionary, pdos: Collection[Pdo]) -> set[Pdo]:
    """Those of *pdos* whose COB-ID cannot be written."""
    return {pdo for pdo in pdos if not _is_writable(dictionary, pdo.communication_index, 1)}


def _is_mapped(dictionary: ObjectDictionary, pdo: Pdo, after: PdoConfig) -> bool:
    """Whether a new device takes the mapping of *after*, also one that it has: a mapping needs a disabled PDO."""
    can_disable = not after.enabled or _is_writable(dictionary, pdo.communication_index, 1)
    return can_disable and _is_mappable(dictionary, pdo, after)


def _is_mappable(dictionary: ObjectDictionary, pdo: Pdo, after: PdoConfig) -> bool:
    """Whether the count and each entry of *after* can be written."""
    return all(_is_writable(dictionary, pdo.mapping_index, number) for number in range(len(after.mapping) + 1))


def _is_writable(dictionary: ObjectDictionary, index: int, sub_index: int) -> bool:
    entry = dictionary.entry(index, sub_index)
    return entry is not None and entry.access.writable


def _node_id(file: str, of_file: int | None, chosen: str | int | None) -> int:
    """Return the node-ID of a DCF, or *chosen* if it has none."""
    given = None if chosen is None else int(chosen) if str(chosen).isdecimal() else 0
    if given is not None and (not 1 <= given <= 127 or of_file not in (None, given)):
        text = "a DCF is chosen for by node-ID, 1..127" if of_file is None else f"{file} is of node {of_file}"
        raise UsageError(text, given={"node": chosen})
    node_id = of_file or given
    if node_id is None:
        raise UsageError(
            f"{file} has no node-ID",
            place=file,
            hint=Hint(Action.GIVE, {"node": "5"}, "{}, its node-ID"),
        )
    return node_id


def read_concise_file(file: str) -> tuple[ConciseEntry, ...]:
    """Read a concise DCF; raises UsageError if unreadable, InputFileError if invalid."""
    try:
        data = read_input(file, _MOST_BYTES, "concise DCF")
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed
    try:
        return concise_entries(data)
    except ValueError as wrong:
        raise InputFileError(f"{file} is not a concise DCF (0x1F22)", place=file, why=str(wrong)) from wrong


def show_concise(file: str, dictionary: ObjectDictionary | None = None) -> Facts:
    """Show what the concise DCF *file* downloads, in order, with names of *dictionary*."""
    entries = read_concise_file(file)
    rows = (("file", file), ("to", None), ("node", None), ("entries", _rows(entries)))
    said = [f"{file}: {plural(len(entries), 'download')}"]
    said += (f"  {entry.object}  {_shown(entry, dictionary)}".rstrip() for entry in entries)
    return Facts("concise-dcf", rows, tuple(said))


def _rows(entries: tuple[ConciseEntry, ...]) -> list[dict[str, str]]:
    return [{"object": entry.object, "data": entry.data.hex(" ").upper()} for entry in entries]


def _shown(one: ConciseEntry, dictionary: ObjectDictionary | None) -> str:
    name = "" if dictionary is None else dictionary.display_name(one.index, one.sub_index)
    entry = None if dictionary is None else dictionary.entry(one.index, one.sub_index)
    is_text = entry is not None and entry.data_type is not None and entry.data_type.kind is Kind.VISIBLE_STRING
    if 1 <= len(one.data) <= 8 and not is_text:
        value = f"0x{int.from_bytes(one.data, 'little'):0{2 * len(one.data)}X}"
    else:
        value = one.data[:16].hex(" ").upper() + (f" … {len(one.data)} bytes" if len(one.data) > 16 else "")
    return f"{value:<10}  {name}"


#: Sub-index of 0x1020 for these objects: expected configuration date and time.
_EXPECTED = {EXPECTED_DATE: DATE, EXPECTED_TIME: TIME}
_NO_MANAGER = (
    "0x1F22 is the object of a CANopen manager (CiA 302-3) with its download values; check that the node-ID is the "
    "manager's"
)
_NOBODY = "it has no EDS; dcf: names an EDS"
_ITSELF = "it is the manager, which has no download for itself"


def plan_manager(session: Session, file: str, manager: int) -> NetworkPlan:
    """Plan the downloads of the node *manager* to each node of the network *file*.

    Reads the manager, and the identity of nodes without an EDS in the file: these must answer and match (else NoAnswer,
    SafetyRefusal, as of `plan_network`). Undescribed nodes are left out, reported, and `untold` in the plan. Raises
    UsageError if *manager* has no concise DCFs, no node is left, or `-n` names others; else as `concise_dcf`, and
    RuleError with all refusals of the rules.
    """
    if any(named_id != manager for named_id in named_nodes(session)):
        raise UsageError(
            f"node {manager} gets the download values of all nodes of {file}, but only some nodes were named",
            given={"to_manager": manager},
            hint=Hint(
                Action.GIVE,
                {"node_id": None},
                "leave out {} to write all; a download that is already right is not written",
            ),
        )
    config = read_network_config(file)
    found = concise_dcfs(file, session.reporter, words_of_present(session, file, config))
    mine = [dcf for dcf in found.nodes if dcf.node_id != manager]
    left_out = {(node_config.node_id, node_config.name): _NOBODY for node_config in found.untold}
    left_out |= {
        (node_config.node_id, node_config.name): _ITSELF
        for node_config in config.nodes
        if node_config.node_id == manager
    }
    for (node_id, name), why in sorted(left_out.items()):
        session.reporter.note(f"{file}: node {node_id} {name} is left out: {why}")
    if not mine:
        raise UsageError(f"{file} has no node for node {manager} to configure", place=file)
    node = session.node(manager)
    boot_ups = session.bus.boot_ups(manager)
    node.read_anew()
    node_plan = replace(_node_plan(session, node, mine), boot_ups=boot_ups)
    nodes = tuple(check_plans({manager: node}, [node_plan], force=session.options.force))
    untold = tuple(node_config.node_id for node_config in found.untold if node_config.node_id != manager)
    return NetworkPlan(file, nodes, manager=manager, untold=untold)


def _node_plan(session: SessionUser, node: ReadableNode, mine: list[ConciseDcf]) -> NodePlan:
    """Plan the writes to the manager *node* for *mine*, as far as it has the objects."""
    held = {place: data for dcf in mine for place, data in _held(node, dcf)}
    wanted = {place: data for dcf in mine for place, data in _wanted(dcf).items() if place in held}
    counts = {dcf.node_id: len(dcf.entries) for dcf in mine}
    changes = tuple(
        value_change(node, place, held[place], data, _reason(place, counts)) for place, data in wanted.items()
        if data != held[place]
    )  # fmt: skip
    for index in _lacking(held, mine):
        session.reporter.note(
            f"node {node.node_id} has no 0x{index:04X}: it downloads at each boot-up, whatever 0x1020 is"
        )
    said = tuple(
        replace(finding, text=f"node {each.node_id}: {finding.text}") for each in mine for finding in each.findings
    )
    return NodePlan(
        "manager", Plan(node.node_id, changes), node.identity(), node.title,
        values=wanted, names=mapped_names(node, changes), findings=said,
    )  # fmt: skip


def _wanted(one: ConciseDcf) -> dict[tuple[int, int], bytes]:
    """Return the manager's wanted values of a node; no date without a stamp: an old date would skip the download."""
    stamp = {entry.sub_index: entry.data for entry in one.entries if entry.index == VERIFY_CONFIGURATION}
    expected = {(index, one.node_id): stamp.get(sub_index, bytes(4)) for index, sub_index in _EXPECTED.items()}
    return {(CONCISE_DCF, one.node_id): one.data, **expected}


def _held(node: ReadableNode, one: ConciseDcf) -> Iterator[tuple[tuple[int, int], bytes]]:
    """Yield the manager's values of a node; date and time are optional for a manager."""
    try:
        yield (CONCISE_DCF, one.node_id), node.observed(partial(node.known_value, CONCISE_DCF, one.node_id))
    except SdoAborted as aborted:
        raise no_manager(node, f"1F22:{one.node_id:02X}", aborted) from aborted
    for index in _EXPECTED:
        try:
            yield (index, one.node_id), node.observed(partial(node.known_value, index, one.node_id))
        except SdoAborted as aborted:
            if aborted.code not in UNREADABLE:
                raise


def no_manager(node: NodeDescription, place: str, aborted: SdoAborted) -> UsageError:
    """Make the error for *node* without concise DCFs: reading *place* was *aborted*."""
    text = f"node {node.node_id} ({node.title}) does not return its 0x{place}: {aborted.text}"
    return UsageError(text, node=node.node_id, place=place, hint=_NO_MANAGER)


def _lacking(held: Mapping[tuple[int, int], bytes], mine: list[ConciseDcf]) -> list[int]:
    """List which of date and time the manager lacks for nodes with a stamp."""
    stamped = [dcf.node_id for dcf in mine if any(entry.index == VERIFY_CONFIGURATION for entry in dcf.entries)]
    return [index for index in _EXPECTED if any((index, node_id) not in held for node_id in stamped)]


def _reason(place: tuple[int, int], downloads: Mapping[int, int]) -> str:
    index, node_id = place
    if index == CONCISE_DCF:
        return f"node {node_id}: {plural(downloads[node_id], 'download')} when it boots"
    return f"node {node_id}: expected {'date' if _EXPECTED[index] == DATE else 'time'}"
