"""Plan the writes for a device's file, like those of a network file. Sends nothing."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.described_node import KnownValues
from dvtcli.device.other_producers import received_ids
from dvtcli.device.proposal import readable_value
from dvtcli.device.read_pdos import read_pdo
from dvtcli.device.read_whole import PAUSE_S
from dvtcli.device.target_config import TargetConfig
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.configuration import Configuration, NotWritten
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.lint.described import object_text
from dvtcli.domain.network.network_config import ExpectedIdentity, NetworkConfig, NodeConfig
from dvtcli.domain.network.network_plan import LeftOut, NetworkPlan
from dvtcli.domain.pdo import BY_SUB_INDEX, MAPPING, MAX_ENTRIES, Direction, Pdo, PdoConfig
from dvtcli.domain.rules.pdo_mapping import enables_nothing
from dvtcli.domain.text import all_nodes
from dvtcli.errors import SafetyRefusal, SdoAborted, UsageError
from dvtcli.files.eds.numbers import same_value
from dvtcli.operations.devices.backup_device import configuration, described
from dvtcli.operations.devices.held_device import (
    Included,
    entry_of,
    held_by,
    idle,
    included_of,
    is_setting,
    node_of_file,
    refuse_kind,
    selected_alone,
    selected_nodes,
    told_of,
    unlike_modules,
)
from dvtcli.operations.pdos.sync import short_frames
from dvtcli.operations.plans.apply_network import apply_network
from dvtcli.operations.plans.identify_nodes import identify_nodes, identity_errors
from dvtcli.operations.plans.judge_network import check_plans
from dvtcli.operations.plans.plan_network import checked_network, plans_of, with_unknown_syncs
from dvtcli.operations.plans.resolve_names import ResolvedConfig
from dvtcli.operations.results.failures import together
from dvtcli.operations.session.consent import powered_findings
from dvtcli.operations.values.object_values import planned_words, scaled_objects

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.network.network_plan import NodePlan
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.pdo import PdoCommunicationParameter
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.operations.devices.held_device import HeldDevice
    from dvtcli.operations.results import NetworkApplied
    from dvtcli.operations.session.session import Session, SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


def apply_device(
    session: Session,
    file: str,
    options: DeviceOptions,
    *,
    on_plan: Callable[[NetworkPlan], None] = lambda _plan: None,
) -> NetworkApplied:
    """Configure nodes as in *file* (a DCF, an XDC or a backup) by *options*; *on_plan* gets the plan.

    Asks first. A fault rolls the nodes back. A clone with remaining differences is incomplete: exit code 3. Raises as
    `plan_device` and `apply_network`.
    """
    plan = plan_device(session, file, options)
    on_plan(plan)
    done = apply_network(session, plan, name=f"{'clone' if options.is_clone else 'apply'} {file}")
    return replace(done, is_clone=options.is_clone)


#: reasons not to write an object that also prevent its read-back
_READS_ANOTHER_VALUE = frozenset({NotWritten.WRITE_ONLY, NotWritten.STORE, NotWritten.REQUEST, NotWritten.PROGRAM})


@dataclass(frozen=True, slots=True)
class DeviceOptions:
    """Options for a device's file.

    *include* are objects (`3001`, `3001:1`) or ranges of indices (`2000-2FFF`) that the user regards as configuration.
    *is_clone*: the file itself includes the maker's objects that no PDO can map, and must have an identity. *nodes* are
    node-IDs, empty for the selected nodes.
    """

    include: tuple[str, ...] = ()
    is_clone: bool = False
    nodes: tuple[int, ...] = ()


def plan_device(session: Session, file: str, options: DeviceOptions | None = None) -> NetworkPlan:
    """Plan the writes that bring the selected nodes to the values of *file*, a DCF, an XDC or a backup.

    Without a selection the file's node-ID is used, except for a clone. Raises SafetyRefusal if a node is another
    product, RuleError with all refusals of the rules, UsageError if the file cannot be read or no node is chosen.
    """
    options = options or DeviceOptions()
    refuse_kind(file)
    held = told_of(file, session.reporter)
    _refuse_nothing(held)
    ids = _node_ids(session, held, options)
    config = NetworkConfig(tuple(_network_config(held, node_id) for node_id in ids))
    if options.is_clone and not held.identity["product"]:
        _confirm_unknown(session, held, ids)
    with short_frames(session.bus) as frames, received_ids(session.bus) as received:
        met = identify_nodes(session, file, config)
        met.end()
        planned = [
            replace(node_plan, boot_ups=met.boot_ups[node_plan.node_id])
            for node_plan in _planned(session, met.nodes, held, config, options)
        ]
        plan = checked_network(session, NetworkPlan(file, tuple(planned)), received, of_device=True)
    return with_unknown_syncs(session, plan, frames)


def wanted_alone(node: Node, held: HeldDevice) -> TargetConfig | None:
    """Return the unjudged configuration in *held* for *node*, read again; None if it has no value.

    Raises SafetyRefusal if the file is for another product.
    """
    held = held if held.node_id else held_by(held.name, node.node_id)
    if not _says_anything(held):
        return None
    node.read_anew()
    for unlike in identity_errors(node, _network_config(held, node.node_id), held.name, force=False):
        raise unlike
    _refuse_other_modules(held, node, force=False)
    found = config_of_file(node, held)
    unwritten = tuple(
        (left_out.object, _unwritten(node, left_out)) for left_out in found.left_out.values() if left_out.remains
    )
    pdos = {pdo: want for pdo, want in found.resolved.pdos.items() if isinstance(want, PdoConfig)}
    said = {pdo: _said_of(held, pdo, config) for pdo, config in pdos.items()}
    unreadable = [left_out.object for left_out in found.left_out.values() if _reads_another_value(node, left_out)]
    blind = {place for place in found.resolved.values if readable_value(node, *place) is None}
    return TargetConfig(
        pdos,
        {place: data for place, data in found.resolved.values.items() if place not in blind},
        said,
        unwritten=unwritten,
        also_equal=tuple(object_text(*place) for place in found.also_equal),
        unreadable=(*unreadable, *(object_text(*place) for place in sorted(blind))),
    )


def _refuse_other_modules(held: HeldDevice, node: ReadableNode, *, force: bool) -> None:
    """Raise SafetyRefusal if *held* is of other modules than *node* has, except with *force*.

    A sub-index of the file belongs to another module then.
    """
    if not force and (unlike := unlike_modules(held, node)):
        raise SafetyRefusal(
            f"the node has other modules: {unlike}",
            node=node.node_id,
            place="1027",
            hint=Hint(Action.BACKUP, why="{} of this node shows its modules; ")
            + Hint(Action.FORCE, why="{} writes by sub-index all the same"),
        )


def _reads_another_value(node: NodeDescription, one: LeftOut) -> bool:
    """Tell whether the object is writable but does not read back the written value."""
    index, sub_index = (int(part, 16) for part in one.object.split(":")) if ":" in one.object else (0, 0)
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    return one.why in _READS_ANOTHER_VALUE and entry is not None and entry.access.writable


def _said_of(held: HeldDevice, pdo: Pdo, config: PdoConfig) -> frozenset[str]:
    """Return the parameters of *pdo* in *held* or missing on the node: others are the node's own."""
    places = held.objects.keys() - held.assumed
    said = {
        name
        for sub_index, name in BY_SUB_INDEX.items()
        if (pdo.communication_index, sub_index) in places or getattr(config.communication, name) is None
    }
    return frozenset(said | {MAPPING} if any(index == pdo.mapping_index for index, _ in places) else said)


def _unwritten(node: NodeDescription, one: LeftOut) -> str:
    """Describe a differing setting that `apply` does not write."""
    if one.held is None or one.said is None:
        return f"differs, but apply does not write it: {one.why}"
    index, sub_index = (int(part, 16) for part in one.object.split(":"))
    held, said = (planned_words(node, index, sub_index, data) for data in (one.held, one.said))
    return f"is {held}, expected {said}, but apply does not write it: {one.why}"


def _node_ids(session: SessionNodes, held: HeldDevice, options: DeviceOptions) -> tuple[int, ...]:
    """Return the chosen nodes; reports a different node-ID in the file."""
    if options.is_clone:
        ids = options.nodes or selected_alone(session, held)
    else:
        ids = options.nodes or selected_nodes(session) or (node_of_file(session, held),)
    others = [str(other_id) for other_id in ids if held.node_id not in (None, other_id)]
    if others:
        text = f"{held.name} is of node {held.node_id}: on {all_nodes(others)} values with $NODEID use that node-ID"
        session.reporter.note(text)
    return ids


def _network_config(held: HeldDevice, node_id: int) -> NodeConfig:
    identity = ExpectedIdentity(held.identity["vendor"] or None, held.identity["product"] or None)
    return NodeConfig(Path(held.name).name, node_id, identity)


def _says_anything(held: HeldDevice) -> bool:
    return bool(held.objects.keys() - held.assumed)


def _refuse_nothing(held: HeldDevice) -> None:
    """Raises UsageError if *held* has no value itself: equality with it would mean nothing."""
    if not _says_anything(held):
        raise UsageError(
            f"{held.name} has no values for a device",
            place=held.name,
            hint=Hint(Action.COMPARE, {"file": held.name})
            + Hint(Action.VERIFY, {"file": held.name}, " and {} take its defaults")
            + Hint(Action.RESTORE, why="brings a device's own")
            + Hint(Action.EXPORT, {"file": "x.dcf"}, "writes a DCF"),
        )


def _nothing_compared(held: HeldDevice) -> UsageError:
    """Make the error if no node could be compared: *held* has no configuration."""
    return UsageError(
        f"nothing compared: {held.name} has no setting that apply writes",
        place=held.name,
        hint=Hint(Action.BACKUP, why="is the file complete? {} makes a backup now")
        + Hint(Action.GIVE, {"include": "2001"}, "lists the objects to write"),
    )


def _confirm_unknown(session: SessionUser, held: HeldDevice, ids: Sequence[int]) -> None:
    """Ask for each node-ID of *ids* to be typed: *held* does not say of which product it is.

    Raises SafetyRefusal without that confirmation; --force needs none.
    """
    if session.options.force:
        return
    for node_id in ids:
        session.require_typed(
            f"{held.name} does not name its product: write it to node {node_id} anyway?",
            str(node_id),
            node_id,
            Hint(Action.FORCE, why="{} writes it to this node; else ")
            + Hint(
                Action.APPLY,
                {"file": held.name},
                "writes the standard configuration objects to the selected device, whatever its product",
            ),
        )


def _planned(
    session: SessionNodes, nodes: dict[int, Node], held: HeldDevice, config: NetworkConfig, options: DeviceOptions
) -> Iterator[NodePlan]:
    found: dict[int, DeviceFileConfig] = {}
    for node_id, node in nodes.items():
        _refuse_other_modules(held, node, force=session.options.force)
        own = held if held.node_id else held_by(held.name, node_id)
        included = included_of(node, own, options.include)
        found[node_id] = config_of_file(node, own, included, names_makers=options.is_clone)
        for text in found[node_id].idle:
            session.reporter.warning(text)
    if not any(found.values()):
        raise _nothing_compared(held)
    planned, refused = plans_of(
        nodes, config, {node_id: found_node.resolved for node_id, found_node in found.items()}, {}
    )
    if refused:
        raise together(refused)
    said = [_said(plan, nodes[plan.node_id], held, found[plan.node_id]) for plan in planned]
    judged = check_plans(nodes, said, force=session.options.force)
    return (_powered(session, plan) if len(plan.plan) else plan for plan in judged)


def _powered(session: SessionNodes, planned: NodePlan) -> NodePlan:
    """Warn if an enabled power stage would make `apply` refuse *planned*."""
    return replace(planned, findings=(*planned.findings, *powered_findings(session, planned.node_id)))


def _said(planned: NodePlan, node: ReadableNode, held: HeldDevice, found: DeviceFileConfig) -> NodePlan:
    left_out = tuple(omission for _, omission in sorted(found.left_out.items()))
    sizes = {left_object.object: len(left_object.held) for left_object in left_out if left_object.held is not None}
    known = planned.understood | scaled_objects(node, sizes)
    return replace(
        planned, left_out=left_out, also_equal=len(found.also_equal), compared_values=found.also_equal,
        understood=known, needs_power_off=True,
        doubt=_doubt(node, held),
    )  # fmt: skip


def _doubt(node: ReadableNode, held: HeldDevice) -> str:
    """Return the question before a file with this identity is written to *node*; empty if none."""
    said, is_now = held.identity["revision"], node.identity()["revision"]
    if not (held.identity["vendor"] or held.identity["product"]):
        return f"{held.name} does not name its product"
    if not said or said == is_now:
        return ""
    now = "none" if is_now is None else f"0x{is_now:08X}"
    return f"node {node.node_id} has revision {now}, and {held.name} is of 0x{said:08X}"


def pdo_of_file(
    node: ReadableNode, held: HeldDevice, known: Configuration, pdo: Pdo, now: PdoConfig, left_out: dict[str, LeftOut]
) -> PdoConfig | None:
    """Compute the wanted *pdo* of *node* from *held* and its state *now*; None if incomplete in the file.

    Unwritable parameters stay, with the reason in *left_out*.
    """
    wanted = _wanted(node, held, known, pdo, now, left_out)
    if wanted is not None and enables_nothing(now, wanted):
        _leave_out(left_out, pdo.label, "is enabled without mapped objects in the file; apply enables no empty PDO")
        return None
    return wanted


def _wanted(
    node: ReadableNode, held: HeldDevice, known: Configuration, pdo: Pdo, now: PdoConfig, left_out: dict[str, LeftOut]
) -> PdoConfig | None:
    """Compute the wanted PDO, whether enabling is allowed or not."""
    said = _file_config(node, held, pdo)
    if said is None or said.held_count is not None:
        if said != now:
            _leave_out(left_out, pdo.label, "is incomplete in the file")
        return None
    if said.mpdo is not None:
        return _wanted_mpdo(node, known, pdo, now, said, left_out)
    is_part = _tell_beyond(held, pdo, said, left_out) or any(not entry.index for entry in said.mapping)
    if is_part and said.mapping != now.mapping:
        _leave_out(left_out, f"{pdo.mapping_index:04X}:00", "the file does not have all its mapping entries")
    if is_part:
        return replace(now, communication=_communication(node, known, pdo, now, said, left_out))
    wanted = replace(now, communication=_communication(node, known, pdo, now, said, left_out))
    if not said.has_mapping or (said.mapping == now.mapping and not _has_odd_mapping(now)):
        return wanted
    if why := _why_not(known, node.dictionary, (pdo.mapping_index, 0)):
        _leave_out(left_out, f"{pdo.mapping_index:04X}:00", why)
        return wanted
    return PdoConfig(wanted.communication, said.mapping, unread=now.lacking)


def _wanted_mpdo(
    node: ReadableNode, known: Configuration, pdo: Pdo, now: PdoConfig, said: PdoConfig, left_out: dict[str, LeftOut]
) -> PdoConfig:
    """Compute the wanted multiplexed PDO: the count of *said*, and its entry unless that is 0."""
    communication = _communication(node, known, pdo, now, said, left_out)
    entries = said.multiplexed if all(entry.raw for entry in said.multiplexed) else ()
    if said.mpdo == now.mpdo and entries in ((), now.multiplexed):
        return replace(now, communication=communication)
    if why := _why_not(known, node.dictionary, (pdo.mapping_index, 0)):
        _leave_out(left_out, f"{pdo.mapping_index:04X}:00", why)
        return replace(now, communication=communication)
    return PdoConfig(communication, (), said.mpdo, unread=now.lacking, multiplexed=entries)


def _file_config(node: ReadableNode, held: HeldDevice, pdo: Pdo) -> PdoConfig | None:
    try:
        return read_pdo(_Values(held, node), pdo)
    except SdoAborted:
        return None


def _tell_beyond(held: HeldDevice, pdo: Pdo, said: PdoConfig, left_out: dict[str, LeftOut]) -> bool:
    """Tell whether *held* has entries without a count, some beyond the node's own: recorded in *left_out*."""
    index = pdo.mapping_index
    if not said.has_mapping or held.says((index, 0)):
        return False
    why = f"is beyond the node's count ({said.count}), and the file says none ({index:04X}:00): it is not mapped"
    beyond = [sub for sub in range(said.count + 1, MAX_ENTRIES + 1) if held.maps((index, sub))]
    for sub_index in beyond:
        _leave_out(left_out, f"{index:04X}:{sub_index:02X}", why)
    return bool(beyond)


def _has_odd_mapping(now: PdoConfig) -> bool:
    return now.mpdo is not None or now.held_count is not None


def _communication(
    node: NodeDescription, known: Configuration, pdo: Pdo, now: PdoConfig, said: PdoConfig, left_out: dict[str, LeftOut]
) -> PdoCommunicationParameter:
    """Take parameters of *said* that the node has and lets be written, else those of *now*."""
    wanted = now.communication
    for sub_index, name in BY_SUB_INDEX.items():
        value, place = getattr(said.communication, name), (pdo.communication_index, sub_index)
        if value in (None, getattr(wanted, name)) or (name == "cob_id" and not said.has_cob_id):
            continue
        if name == "cob_id" and not value.raw:
            value = CobId(0, valid=False)  # CAN-ID 0x000 is NMT: the file tells no COB-ID
        if why := _why_not(known, node.dictionary, place):
            _leave_out(left_out, f"{place[0]:04X}:{place[1]:02X}", why)
        else:
            wanted = replace(wanted, **{name: value})
    return wanted


def _leave_out(left_out: dict[str, LeftOut], place: str, why: str) -> None:
    """Record a differing parameter that stays."""
    left_out[place] = LeftOut(place, why, remains=True)


def _why_not(known: Configuration, dictionary: ObjectDictionary | None, place: ObjectAddress) -> str:
    why = known.why_not(entry_of(dictionary, place))
    return "" if why is None else str(why)


@dataclass(frozen=True, slots=True)
class _Values(KnownValues):
    """The values of *held*, else of the node, readable like a node."""

    held: HeldDevice
    node: ReadableNode

    def known_value(self, index: int, sub_index: int) -> bytes:
        """Return the file's value, else the node's; raises SdoAborted if the node refuses."""
        place = index, sub_index
        data = self.held.on_node(place, entry_of(self.node.dictionary, place), self.node.node_id)
        return self.node.read_cache.upload(index, sub_index) if data is None else data


#: reasons not even to read an object: secrets, programs, unreadable or meaningless values
_NOT_READ = frozenset(
    {
        NotWritten.READ_ONLY, NotWritten.WRITE_ONLY, NotWritten.PASSCODE, NotWritten.PROGRAM, NotWritten.REQUEST,
        NotWritten.STORE, NotWritten.ERROR_HISTORY, NotWritten.SDO_CHANNEL,
    }
)  # fmt: skip


@dataclass(slots=True)
class DeviceFileConfig:
    """The configuration of a node in a file (*resolved*), and values not written (*left_out*, by object, with reasons).

    Left out are differing values and unreadable ones.
    """

    resolved: ResolvedConfig = field(default_factory=ResolvedConfig)
    left_out: dict[str, LeftOut] = field(default_factory=dict)
    #: settings of the file that the node holds already, and that need no write
    also_equal: dict[ObjectAddress, bytes] = field(default_factory=dict)
    #: messages about included objects without effect
    idle: tuple[Hint, ...] = ()

    def __bool__(self) -> bool:
        """Tell whether any value of the file was compared."""
        is_other = any(left_out.remains for left_out in self.left_out.values())
        return bool(self.resolved.pdos or self.resolved.values or self.also_equal or is_other)


def config_of_file(
    node: Node, held: HeldDevice, included: Collection[Included] = (), *, names_makers: bool = False
) -> DeviceFileConfig:
    """Compute the configuration of *node* in *held*: the file's own values, not defaults.

    *included* is configuration by the user's choice. *names_makers*: the file itself includes the maker's objects that
    no PDO can map. Raises UsageError if the node's objects are unknown.
    """
    if node.dictionary is None and held.dictionary is not None:
        node.describe(held.dictionary)
    dictionary = described(node)
    known = replace(
        configuration(node, dictionary, [inclusion.range for inclusion in included if inclusion.range is not None]),
        included_objects=frozenset(inclusion.object for inclusion in included if inclusion.object is not None),
    )
    named = frozenset(_of_maker(dictionary, held)) if names_makers else frozenset()
    found = DeviceFileConfig()
    pdos = _pdos(node, held, known, found)
    known = replace(known, named=named, taken=_taken(node, pdos))
    for place, kept in sorted(held.objects.items()):
        if kept.data is not None and place not in held.assumed and Pdo.at(place[0]) is None:
            _value(node, held, known, entry_of(dictionary, place), found)
    _look_again(node, found)
    found.idle = tuple(idle(held, known, included))
    return found


def _of_maker(dictionary: ObjectDictionary, held: HeldDevice) -> Iterator[ObjectAddress]:
    """Yield objects with a value in the file that no PDO receives or transmits."""
    for place in held.objects.keys() - held.assumed:
        entry = dictionary.entry(*place)
        if entry is not None and not entry.pdo_mapping:
            yield place


def _pdos(node: ReadableNode, held: HeldDevice, known: Configuration, found: DeviceFileConfig) -> dict[Pdo, PdoConfig]:
    """Compute the wanted PDOs of the file."""
    said = {pdo for place in held.objects.keys() - held.assumed if (pdo := Pdo.at(place[0])) is not None}
    wanted: dict[Pdo, PdoConfig] = {}
    present = set(node.present())
    for pdo in sorted(said, key=lambda wanted_pdo: (not wanted_pdo.is_tpdo, wanted_pdo.number)):
        if pdo not in present:
            found.left_out[pdo.label] = LeftOut(pdo.label, "the node does not have it", remains=True)
            continue
        now = node.observed(partial(node.known_pdo, pdo))
        config = pdo_of_file(node, held, known, pdo, now, found.left_out)
        if config is not None:
            wanted[pdo] = config
    found.resolved.pdos.update(wanted)
    return wanted


def _taken(node: ReadableNode, wanted: dict[Pdo, PdoConfig]) -> frozenset[ObjectAddress]:
    """Return process data: objects that enabled RPDOs of the node receive, now or later."""
    rpdos = [pdo for pdo in node.present() if pdo.direction is Direction.RPDO]
    now = node.observed(lambda: [node.known_pdo(pdo) for pdo in rpdos])
    then = (config for pdo, config in wanted.items() if not pdo.is_tpdo)
    return frozenset(
        (entry.index, entry.sub_index)
        for config in (*now, *then)
        if config.enabled
        for entry in config.mapping
        if not entry.is_dummy
    )


def _value(node: ReadableNode, held: HeldDevice, known: Configuration, entry: OdEntry, found: DeviceFileConfig) -> None:
    """Add the file's value of an object, or the reason for leaving it out."""
    place = entry.index, entry.sub_index
    why = known.why_not(entry)
    is_write_only = why is NotWritten.WRITE_ONLY and known.why_not_unread(entry) is None
    if why in _NOT_READ and not is_write_only:
        found.left_out[entry.object] = LeftOut(entry.object, str(why))
        return
    data = held.on_node(place, entry, node.node_id)
    if data is None:
        return
    if is_write_only:
        found.resolved.values[place] = data
        found.resolved.reasons[place] = _name(node, place)
        return
    try:
        now = node.observed(partial(node.known_value, *place))
    except SdoAborted as aborted:
        text = f"cannot be read: {aborted.text}"
        found.left_out[entry.object] = LeftOut(entry.object, text, is_setting(why), said=data)
        return
    is_same = same_value(entry.data_type, data, now)
    if why is None:
        found.resolved.values[place] = now if is_same else data
        found.resolved.reasons[place] = _name(node, place)
    elif is_same and is_setting(why):
        found.also_equal[place] = now
    elif not is_same:
        found.left_out[entry.object] = LeftOut(entry.object, str(why), is_setting(why), now, data)


def _look_again(node: ReadableNode, found: DeviceFileConfig) -> None:
    """Read differing unwritten objects again: they may change by themselves."""
    suspects = [left_out for left_out in found.left_out.values() if left_out.remains and left_out.held is not None]
    if suspects:
        node.bus.sleep(PAUSE_S)
    for suspect in suspects:
        index, _, sub_index = suspect.object.partition(":")
        now = node.observed(partial(node.upload, int(index, 16), int(sub_index, 16)))
        if now != suspect.held:
            found.left_out[suspect.object] = replace(suspect, why="changes by itself", remains=False, held=now)


def _name(node: NodeDescription, place: ObjectAddress) -> str:
    return (node.dictionary.display_name(*place) if node.dictionary else "") or "write"
