"""Resolve the names of a network file on a node, and find PDOs and objects that the device lacks.

Reports all unknown names at once. Reads values, writes nothing.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.proposal import proposal, readable_value
from dvtcli.device.read_pdos import read_optional, read_side_by_side
from dvtcli.device.store.store_parameters import SIGNATURES
from dvtcli.device.virtual_pdos import read_pins
from dvtcli.domain.abort import Abort, abort_text
from dvtcli.domain.datatypes import parse_number
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.network_config import ValueConfig
from dvtcli.domain.network.network_plan import MissingObject
from dvtcli.domain.object_syntax import Skipped, UnknownName
from dvtcli.domain.objects import CONSUMER_HEARTBEAT
from dvtcli.domain.pdo import Pdo, PdoMappingEntry
from dvtcli.domain.profile import ObjectAddress
from dvtcli.domain.request import PdoRequest, Switched
from dvtcli.domain.rules import errors_in
from dvtcli.domain.rules.finding import ERROR, Rule, error
from dvtcli.domain.rules.mapped_object import object_findings
from dvtcli.domain.rules.pdo_mapping import length_findings
from dvtcli.domain.text import join_some
from dvtcli.errors import DvtcliError, SdoAborted, UsageError
from dvtcli.operations.values.named_objects import entry_at, object_at, object_index, tied_name
from dvtcli.operations.values.object_values import scaling_of, typed_bytes
from dvtcli.operations.values.write_type import object_type

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.virtual_pdos import Pins
    from dvtcli.domain.network.network_config import (
        Endpoint,
        FileWord,
        Mark,
        NetworkConfig,
        NodeConfig,
        ObjectConfig,
        PartialPdoConfig,
        PinConfig,
    )
    from dvtcli.domain.network.network_plan import NetworkPlan
    from dvtcli.domain.object_syntax import MappedObject
    from dvtcli.domain.request import AnyPdoRequest
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.files.network.file_log import FileLog

_FOLLOWS = re.compile(r"\$NODEID\s*(?:\+\s*(?P<more>\S+))?|(?P<first>\S+)\s*\+\s*\$NODEID", re.IGNORECASE)


def following(number: int) -> str:
    """Write node-ID plus *number* as `$NODEID+…`."""
    return f"$NODEID+0x{number:X}"


def of_node(text: str, node_id: int) -> str:
    """Evaluate the value *text* on the node with *node_id*; returns *text* if it has no `$NODEID`.

    Raises ValueError if anything but a number is added to `$NODEID`.
    """
    found = _FOLLOWS.fullmatch(text.strip())
    return str(parse_number(found["more"] or found["first"] or "0") + node_id) if found else text


class ResolvedValue(NamedTuple):
    """The bytes wanted at *place*, the reason in words, and the place in the file."""

    place: tuple[int, int]
    data: bytes
    reason: str
    mark: Mark


def wanted_pins(node: ReadableNode, configs: Iterable[PinConfig], log: FileLog) -> Iterator[ResolvedValue]:
    """Resolve *configs* into objects of virtual PDOs, pins before the number of active pins."""
    for name, group in groupby(configs, key=lambda config: config.group):
        pins = list(group)
        if name in node.profile.vpdo:
            yield from _group(node, read_pins(node, name), pins, log)
        else:
            have = join_some(node.profile.vpdo) or "no virtual PDOs"
            log.complain(pins[0].mark, f"node {node.node_id} ({node.profile.title}) has no {name!r}, but {have}")


def _group(node: NodeDescription, held: Pins, configs: list[PinConfig], log: FileLog) -> Iterator[ResolvedValue]:
    ties: dict[int, int] = {}
    for config in configs:
        index = held.group.none if config.object is None else _index(node, config, log)
        if config.pin > len(held.values):
            have = f"it has 1…{len(held.values)}" if held.values else "it has none"
            log.complain(config.mark, f"node {node.node_id} has no {held.name} pin {config.pin}: {have}")
        elif index is not None:
            ties[config.pin] = index
    marks = {config.pin: config.mark for config in configs}
    for sub_index, value in held.with_ties(ties).items() if ties else ():
        data = value.to_bytes(2 if sub_index else 1, "little")
        reason = held.reason(sub_index, value, tied_name(node, value))
        yield ResolvedValue((held.group.index, sub_index), data, reason, marks.get(sub_index, configs[0].mark))


def _index(node: NodeDescription, config: PinConfig, log: FileLog) -> int | None:
    word = config.object
    try:
        return None if word is None else object_index(node, word.text)
    except UsageError as wrong:
        log.complain(
            config.mark if word is None else word.mark,
            f"{wrong.text}; {wrong.hint}" if isinstance(wrong.hint, str) else wrong.text,
        )
        return None


#: What to do about a name on a node without description.
_NO_EDS = (
    "add `dcf: drive.eds` next to its `node_id` (`dcf: generic`: a simulated family), or a file to the library; "
    "numbers need no EDS"
)


@dataclass(slots=True)
class ResolvedConfig:
    """The wanted PDOs and objects of a node in order, with reasons; *pruned*: PDOs not in any file."""

    pdos: dict[Pdo, AnyPdoRequest] = field(default_factory=dict)
    values: dict[ObjectAddress, bytes] = field(default_factory=dict)
    reasons: dict[ObjectAddress, str] = field(default_factory=dict)
    #: its lines in the file
    lines: dict[ObjectAddress, int] = field(default_factory=dict)
    pruned: frozenset[Pdo] = frozenset()


def resolve_node_config(node: ReadableNode, config: NodeConfig, log: FileLog) -> ResolvedConfig:
    """Resolve *config* on *node*; *log* gets what has no meaning there."""
    resolved = ResolvedConfig()
    for pdo in config.pdos:
        complaints = log.count
        request = pdo_request(node, pdo, log)
        if log.count == complaints:
            resolved.pdos[pdo.pdo] = request
        else:
            _judge_entries(node, pdo, log)
    if config.prune:
        others = {pdo: cob_id for pdo, cob_id in node.known_cob_ids().items() if pdo not in resolved.pdos}
        resolved.pruned = frozenset(pdo for pdo, cob_id in others.items() if cob_id.valid)
        resolved.pdos.update({pdo: Switched(enabled=False) for pdo in sorted(resolved.pruned)})
    for want in _wanted(node, config, log):
        resolved.values[want.place], resolved.reasons[want.place] = want.data, want.reason
        if want.mark.line:
            resolved.lines.setdefault(want.place, want.mark.line)
    return resolved


def _wanted(node: ReadableNode, config: NodeConfig, log: FileLog) -> Iterator[ResolvedValue]:
    """Resolve the object values of *config* on *node*; reports lines that contradict each other."""
    said = (*_objects(config), *_values(node, config, log))
    watches = _watches(node, config, said, log)
    taken = {watch.place for watch in watches}
    pins = wanted_pins(node, config.pins, log)
    found: dict[ObjectAddress, ResolvedValue] = {}
    for want in (
        *(said_value for said_value in said if not (_is_free_entry(said_value) and said_value.place in taken)),
        *watches,
        *pins,
    ):
        before = found.setdefault(want.place, want)
        if wrong := _why_not(node, want.place):
            log.complain(want.mark, wrong)
        elif before.data != want.data:
            later, other = (want, before) if want.mark.line else (before, want)
            log.complain(later.mark, f"{_shown(want.place)} has another value already ({_whence(other)})")
        else:
            yield want


def _whence(want: ResolvedValue) -> str:
    """Name the file line of *want*, or its purpose if there is no line."""
    return f"line {want.mark.line}: {want.reason}" if want.mark.line else want.reason


def _shown(place: ObjectAddress) -> str:
    return f"0x{place[0]:04X}:{place[1]:02X}"


def pdo_request(node: NodeDescription, config: PartialPdoConfig, log: FileLog) -> PdoRequest:
    """Resolve a PDO of *config* on *node*; unknown entries are reported to *log* and left out."""
    objects = None if config.mapping is None else tuple(_entries(node, config.mapping, log))
    return PdoRequest(
        cob_id=config.cob_id, transmission_type=config.transmission_type, inhibit_time=config.inhibit_time,
        event_timer=config.event_timer, sync_start_value=config.sync_start_value, rtr_allowed=config.rtr_allowed,
        extended=config.extended, enabled=config.enabled, objects=objects,
    )  # fmt: skip


def _entries(node: NodeDescription, words: tuple[FileWord, ...], log: FileLog) -> Iterator[MappedObject | Skipped]:
    for word in words:
        try:
            yield entry_at(node, word.text)
        except UsageError as wrong:
            log.complain(word.mark, _unknown(node, wrong))


def _judge_entries(node: ReadableNode, config: PartialPdoConfig, log: FileLog) -> None:
    """Report known entries of *config* that the rules refuse; unknown entries prevent judging the PDO."""
    if config.pdo not in node.present():
        return
    now = node.known_pdo(config.pdo)
    held = proposal(node, config.pdo, now, now)
    for word in config.mapping or ():
        try:
            known = entry_at(node, word.text)
        except UsageError:  # it was told
            continue
        if isinstance(known, Skipped):
            continue
        bits = known.bits if known.bits is not None else node.length_of(known.index, known.sub_index)
        entry = PdoMappingEntry(known.index, known.sub_index, bits or 8)  # of an object that is not there nobody knows
        lengths = () if bits is None else length_findings(held, "", entry)
        for finding in errors_in((*object_findings(held, "", entry), *lengths)):
            log.complain(word.mark, finding.text)


def _unknown(node: NodeDescription, wrong: UsageError) -> str:
    """Explain why a name is unknown on *node*, with help for a file."""
    if node.dictionary is None and isinstance(wrong.__cause__, UnknownName):
        return f"{wrong.text}: {_NO_EDS}"
    return _text(wrong)


def _text(wrong: DvtcliError) -> str:
    return f"{wrong.text}; {wrong.hint}" if isinstance(wrong.hint, str) else wrong.text


def _objects(config: NodeConfig) -> Iterator[ResolvedValue]:
    yield from (
        ResolvedValue(
            (object_config.index, object_config.sub_index), object_config.data, object_config.key, object_config.mark
        )
        for object_config in config.objects
    )


def _values(node: ReadableNode, config: NodeConfig, log: FileLog) -> Iterator[ResolvedValue]:
    for value in config.values:
        try:
            place = object_at(node, value.object.text)
        except UsageError as wrong:
            log.complain(value.object.mark, _unknown(node, wrong))
            continue
        if refusal := _why_not(node, place):
            log.complain(value.object.mark, refusal)
            continue
        try:
            kind = object_type(node, *place)
            text = value.value.text if kind.limits is None else of_node(value.value.text, node.node_id)
            data = typed_bytes(kind, scaling_of(node, *place), text)
            yield ResolvedValue(place, data, _name(node, place), value.value.mark)
        except ValueError as unfit:
            log.complain(value.value.mark, f"{value.value.text!r} for {_shown(place)}: {unfit}")
        except SdoAborted as aborted:
            log.complain(value.object.mark, aborted.text)


def _name(node: NodeDescription, place: ObjectAddress) -> str:
    return "write" if node.dictionary is None else node.dictionary.display_name(*place) or "write"


def set_elsewhere(node: NodeDescription, place: ObjectAddress) -> str:
    """Explain why `sdo` of a file must not set the object at *place*, and what does; empty if it may."""
    index, text = place[0], _shown(place)
    if index in SIGNATURES:
        return f"{text} is a command: `store: true` stores once all nodes are verified"
    pdo = Pdo.at(index)
    if pdo is not None:
        return f"{text} is part of {pdo.label}: `{pdo.direction}:` with `{pdo.number}:` sets it"
    login = node.profile.login
    if login is not None and place == login.passcode:
        return f"{text} is a passcode, which must not be in a file: logging in asks for it"
    return ""


def _why_not(node: ReadableNode, place: ObjectAddress) -> str:
    """Explain why a file must not set the object at *place*; empty if it may."""
    if elsewhere := set_elsewhere(node, place):
        return elsewhere
    try:
        readable_value(node, *place)
    except SdoAborted as aborted:
        return f"{aborted.text}: values that cannot be read are neither compared nor set"
    return ""


def _watches(
    node: ReadableNode, config: NodeConfig, said: Collection[ResolvedValue], log: FileLog
) -> Collection[ResolvedValue]:
    """Choose entries of 0x1016 for *config*: the producer's own entry, else a free entry.

    Skips entries *said* to hold another value; an entry said to hold 0 is free, and taken last.
    Source: CiA 301, 7.5.2.19: node-ID in bits 16..23, time in ms below; an entry with 0 in either is unused.
    """
    if not config.watches:
        return ()
    wanted: dict[int, ResolvedValue] = {}
    count = read_optional(node.read_cache, CONSUMER_HEARTBEAT, 0, 1) or 0
    held = {sub: read_optional(node.read_cache, CONSUMER_HEARTBEAT, sub, 4) for sub in range(1, count + 1)}
    mine = {
        said_value.place[1]: int.from_bytes(said_value.data, "little")
        for said_value in said
        if said_value.place[0] == CONSUMER_HEARTBEAT
    }
    slots = {sub: value for sub, value in held.items() if value is not None and sub not in mine}
    slots |= {sub: value for sub, value in mine.items() if sub and not value and held.get(sub) is not None}
    filled = len(mine.keys() - slots.keys())
    for watch in config.watches:
        own = _entry_of(watch.producer, {**slots, **{sub: value for sub, value in mine.items() if value}})
        sub = (
            own if own is not None else next((free_sub for free_sub, value in slots.items() if not _used(value)), None)
        )
        if own is None and not watch.time_ms:
            continue  # it watches nothing of that node already
        if sub is None:
            besides = f", {filled} of them as sdo has it" if filled else ""
            log.complain(watch.mark, f"0x1016 of node {node.node_id} has no free entry ({count} in all{besides})")
            continue
        slots[sub] = watch.producer << 16 | watch.time_ms if watch.time_ms else 0
        late = f"late after {watch.time_ms} ms" if watch.time_ms else "no longer monitored"
        reason = f"node {watch.producer} is {late}"
        data = slots[sub].to_bytes(4, "little")
        wanted[sub] = ResolvedValue((CONSUMER_HEARTBEAT, sub), data, reason, watch.mark)
    return wanted.values()


def _entry_of(producer: int, entries: Mapping[int, int]) -> int | None:
    """Return the sub-index that consumes the heartbeat of node *producer*, if any."""
    return next((sub for sub, value in entries.items() if _used(value) and _producer(value) == producer), None)


def _is_free_entry(want: ResolvedValue) -> bool:
    """Tell whether an entry of 0x1016 is to be unused."""
    return want.place[0] == CONSUMER_HEARTBEAT and want.place[1] > 0 and not any(want.data)


def _used(value: int) -> bool:
    return bool(value & 0xFFFF and _producer(value))


def _producer(value: int) -> int:
    return value >> 16 & 0xFF


RULES = (
    Rule("pdo-lacking", ERROR, "a network file sets a PDO, or links one, that the device does not have",
         "the device's own answer"),
    Rule("object-lacking", ERROR, "a network file sets an object that the device does not have",
         "the device's own answer"),
)  # fmt: skip
_LACKED = (Abort.NO_OBJECT, Abort.NO_SUB_INDEX)
#: what to do about a missing object
_HINT = Hint(
    Action.FIND_OBJECTS,
    why="check that it is the right device, or remove the object from the file; {} finds the objects of an EDS",
)


def refuse_lacking(network_plan: NetworkPlan) -> NetworkPlan:
    """Return *network_plan*; raises RuleError if devices lack objects of its file: nothing is carried out."""
    if network_plan.lacking:
        from dvtcli.operations.results.failures import missing_error

        raise missing_error(network_plan.lacking)
    return network_plan


def without_missing(
    nodes: Mapping[int, ReadableNode], config: NetworkConfig, log: FileLog
) -> tuple[NetworkConfig, MissingObjects]:
    """Drop from *config* what its *nodes* lack and the links of such PDOs; returns both."""
    asked: dict[int, dict[Pdo, Mark]] = {}
    for node_config in config.nodes:
        asked[node_config.node_id] = {pdo.pdo: pdo.mark for pdo in node_config.pdos}
    for link in config.links:
        for end in link.ends:
            asked[end.node_id].setdefault(end.pdo, link.mark)
    places = {
        wanted_node.node_id: dict(_places(nodes[wanted_node.node_id], wanted_node)) for wanted_node in config.nodes
    }
    ahead = [partial(_look_ahead, nodes[node_id], pdos, places[node_id]) for node_id, pdos in asked.items()]
    read_side_by_side(nodes.values(), ahead)
    missing = MissingObjects(log)
    for node_id, pdos in asked.items():
        for pdo, mark in pdos.items():
            missing.look(nodes[node_id], pdo, mark)
        for place, mark in places[node_id].items():
            missing.look_at(nodes[node_id], place, mark)
    left = missing.left_of(nodes, config)
    missing.unlinked = missing.unlinked_of(config, left)
    return left, missing


def _look_ahead(node: ReadableNode, pdos: Mapping[Pdo, Mark], places: Mapping[ObjectAddress, Mark]) -> None:
    """Read *pdos* and *places* ahead; read errors are raised later, at their use."""
    for pdo in pdos:
        with suppress(DvtcliError):
            node.known_pdo(pdo)
    for place in places:
        with suppress(DvtcliError):
            node.known_value(*place)


def _places(node: NodeDescription, config: NodeConfig) -> Iterator[tuple[ObjectAddress, Mark]]:
    """Yield the single objects that *config* sets, with their places in the file; forbidden objects are left out."""
    configs: tuple[ObjectConfig | ValueConfig, ...] = (*config.objects, *config.values)
    for object_config in configs:
        place, mark = (
            _place_of(node, object_config),
            object_config.object.mark if isinstance(object_config, ValueConfig) else object_config.mark,
        )
        if place is not None and not set_elsewhere(node, place):
            yield place, mark


def _place_of(node: NodeDescription, one: ObjectConfig | ValueConfig) -> ObjectAddress | None:
    """Resolve an object name; None if *node* does not know it."""
    if not isinstance(one, ValueConfig):
        return one.index, one.sub_index
    try:
        return object_at(node, one.object.text)
    except UsageError:
        return None


@dataclass(slots=True)
class MissingObjects:
    """The missing objects (*found*) and PDOs linked with them (*unlinked*); *log* has their places in the file."""

    log: FileLog
    found: list[MissingObject] = field(default_factory=list)
    unlinked: tuple[tuple[int, Pdo], ...] = ()
    _places: set[tuple[int, ObjectAddress]] = field(default_factory=set)

    def of(self, node_id: int) -> tuple[str, ...]:
        """List labels of what the node with *node_id* lacks."""
        return tuple(missing.label for missing in self.found if missing.node_id == node_id)

    def look(self, node: ReadableNode, pdo: Pdo, mark: Mark) -> None:
        """Add *pdo* if *node* does not have it; raises other errors of reading it."""
        try:
            node.known_pdo(pdo)
        except (SdoAborted, UsageError) as missing:
            if isinstance(missing, SdoAborted) and missing.code not in _LACKED:
                raise
            place = f"0x{missing.place}" if missing.place else pdo.label
            finding = error("pdo-lacking", place, missing.text, hint=missing.hint)
            self._take(node, pdo, finding, mark, missing.abort)

    def look_at(self, node: ReadableNode, place: ObjectAddress, mark: Mark) -> None:
        """Add the object at *place* if *node* does not have it; other errors are reported elsewhere."""
        try:
            node.known_value(*place)
        except SdoAborted as missing:
            if missing.code in _LACKED:
                text = f"node {node.node_id} has no 0x{missing.place}: {abort_text(missing.code)}"
                hint = missing.hint if node.dictionary is None else _HINT
                self._places.add((node.node_id, place))
                finding = error("object-lacking", f"0x{missing.place}", text, hint=hint)
                self._take(node, None, finding, mark, missing.abort)

    def _take(self, node: NodeDescription, pdo: Pdo | None, finding: Finding, mark: Mark, abort: int | None) -> None:
        complaint = self.log.shown(mark, finding.text) if mark.line else None
        self.found.append(MissingObject(node.node_id, pdo, finding.place.removeprefix("0x"), finding, complaint, abort))

    def left_of(self, nodes: Mapping[int, NodeDescription], config: NetworkConfig) -> NetworkConfig:
        """Return *config* without them, and without stamps, which would cover only the rest."""
        if not self.found:
            return config
        links = tuple(
            replace(link, consumers=received)
            for link in config.links
            if not self._has(link.producer) and (received := tuple(end for end in link.consumers if not self._has(end)))
        )
        return replace(config, nodes=tuple(self._node(nodes[node.node_id], node) for node in config.nodes), links=links)

    def _has(self, end: Endpoint) -> bool:
        return any((missing.node_id, missing.pdo) == (end.node_id, end.pdo) for missing in self.found)

    def _node(self, node: NodeDescription, config: NodeConfig) -> NodeConfig:
        def is_there(one: ObjectConfig | ValueConfig) -> bool:
            place = _place_of(node, one)
            return place is None or (node.node_id, place) not in self._places

        missing = {missing_object.pdo for missing_object in self.found if missing_object.node_id == config.node_id}
        return replace(
            config, pdos=tuple(pdo for pdo in config.pdos if pdo.pdo not in missing), stamp=None,
            objects=tuple(filter(is_there, config.objects)), values=tuple(filter(is_there, config.values)),
        )  # fmt: skip

    def unlinked_of(self, config: NetworkConfig, left: NetworkConfig) -> tuple[tuple[int, Pdo], ...]:
        """List the other ends of links of *config* missing in *left*: their configuration is unknown."""
        linked = {link.producer for link in left.links}
        gone = [end for link in config.links if link.producer not in linked for end in link.ends]
        return tuple(dict.fromkeys((end.node_id, end.pdo) for end in gone if not self._has(end)))
