"""Read a node of a network file, without its device, and the meaning of its values under `physical`."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from dvtcli.domain.cob_id import HIGHEST_BASE_CAN_ID, CobId
from dvtcli.domain.network.network_config import (
    NOWHERE,
    ExpectedIdentity,
    FileWord,
    HeartbeatWatch,
    Mark,
    MasterRole,
    NodeConfig,
    ObjectConfig,
    PartialPdoConfig,
    PinConfig,
    ValueConfig,
)
from dvtcli.domain.object_syntax import parse_object
from dvtcli.domain.objects import ERROR_BEHAVIOUR
from dvtcli.domain.pdo import MAX_PDO_NUMBER, Direction, Pdo
from dvtcli.domain.times import counts
from dvtcli.errors import InputFileError
from dvtcli.files.network.file_log import FileLog, spelled
from dvtcli.files.network.key_values import (
    as_number,
    integer,
    key_mark,
    number_key,
    object_word,
    read_keys,
    shown,
    table,
    truth,
)
from dvtcli.files.network.network_keys import OF, Where
from dvtcli.files.network.yaml_tree import Branch, Leaf, Tree, YamlList

if TYPE_CHECKING:
    from dvtcli.domain.object_scalings import Rules

#: the keys of a PDO by sub-index, the last of equivalent keys; 0: the mapping
_SUB_INDICES = {
    "mapping": 0, "enabled": 1, "cob_id": 1, "transmission": 2, "inhibit_time": 3, "inhibit_ms": 3, "event_timer": 5,
    "event_deadline": 5, "sync_start": 6,
}  # fmt: skip


def read_pdos(branch: Branch, direction: Direction, title: str, log: FileLog) -> Iterator[PartialPdoConfig]:
    """Read the PDOs of *branch*, which has PDO numbers as keys."""
    lines: dict[int, int] = {}
    for leaf, value in branch.items.values():
        if spelled(leaf.text) in OF[Where.TPDO if direction is Direction.TPDO else Where.RPDO]:
            log.complain(
                leaf.mark, f"{leaf.text!r} in {direction} of {title} belongs to a PDO: it belongs below its number"
            )
            continue
        number = number_key(leaf, 1, MAX_PDO_NUMBER, "PDO number", log)
        if number is None:
            continue
        pdo = Pdo(direction, number)
        if number in lines:
            log.complain(leaf.mark, f"{pdo.label} of {title} was given twice (first at line {lines[number]})")
            continue
        lines[number] = leaf.mark.line
        if isinstance(value, Branch):
            yield replace(_pdo(pdo, value, f"{pdo.label} of {title}", log), mark=leaf.mark)
        elif isinstance(value, Leaf) and value.is_null:
            yield PartialPdoConfig(pdo, mark=leaf.mark)
        else:
            log.complain(value.mark, f"keys and values of {pdo.label} belong here, not {shown(value)}")


def _pdo(pdo: Pdo, branch: Branch, title: str, log: FileLog) -> PartialPdoConfig:
    found = read_keys(branch, Where.TPDO if pdo.is_tpdo else Where.RPDO, title, log)
    config = PartialPdoConfig(
        pdo,
        enabled=found.get("enabled"),
        rtr_allowed=found.get("rtr_allowed"),
        transmission_type=found.get("transmission"),
        inhibit_time=_inhibit(branch, found, log),
        event_timer=found.get("event_timer" if pdo.is_tpdo else "event_deadline"),
        sync_start_value=found.get("sync_start"),
        mapping=_mapping(found["mapping"], title, log) if "mapping" in found else None,
        keys={sub_index: key_mark(branch, name) for name, sub_index in _SUB_INDICES.items() if name in branch.items},
    )
    return _with_cob_id(config, found["cob_id"], branch, log) if "cob_id" in found else config


def _inhibit(branch: Branch, found: dict[str, Any], log: FileLog) -> int | None:
    if "inhibit_time" in branch.items and "inhibit_ms" in branch.items:
        log.complain(key_mark(branch, "inhibit_ms"), "inhibit_ms and inhibit_time are the same: give only one of them")
    elif "inhibit_ms" in found:
        try:
            return counts(found["inhibit_ms"], 100)
        except ValueError as wrong:
            log.complain(branch.items["inhibit_ms"][1].mark, str(wrong))
    return found.get("inhibit_time")


def _with_cob_id(config: PartialPdoConfig, said: int | str, branch: Branch, log: FileLog) -> PartialPdoConfig:
    """Return *config* with a COB-ID as in dcfgen: bits 31, 30 and 29 are part of the number."""
    if said == "auto":
        return replace(config, cob_id="auto")
    cob_id, mark = CobId.from_raw(int(said)), branch.items["cob_id"][1].mark
    if cob_id.can_id > HIGHEST_BASE_CAN_ID and not cob_id.extended:
        log.complain(mark, f"CAN-ID 0x{cob_id.can_id:X} has more than 11 bits; bit 29 (0x20000000) makes a 29-bit one")
    if not cob_id.rtr_allowed:
        if config.rtr_allowed:
            log.complain(mark, "bit 30 of cob_id forbids RTR, and rtr_allowed allows it")
        config = replace(config, rtr_allowed=False)
    if not cob_id.valid:
        if config.enabled:
            log.note(mark, "bit 31 of cob_id disables the PDO, whatever enabled says; so does dcfgen")
        config = replace(config, enabled=False)
        if not cob_id.can_id:
            return config  # 0x80000000 says off, and no CAN-ID
    return replace(config, cob_id=cob_id.can_id, extended=cob_id.extended)


def _mapping(row: YamlList, title: str, log: FileLog) -> tuple[FileWord, ...]:
    words = (_entry(tree, title, log) for tree in row.items)
    return tuple(word for word in words if word is not None)


def _entry(tree: Tree, title: str, log: FileLog) -> FileWord | None:
    if not isinstance(tree, Branch):
        return object_word(tree, log)
    found = read_keys(tree, Where.ENTRY, f"an object of {title}", log)
    if "index" not in found:
        return None
    bits = f"/{found['bits']}" if "bits" in found else ""
    return FileWord(f"{found['index']:04X}:{found.get('sub_index', 0):02X}{bits}", tree.mark)


#: the identity's own keys, and dcfgen's for the same
_IDENTITY = {
    "vendor": "vendor_id", "product": "product_code", "revision": "revision_number", "serial": "serial_number",
}  # fmt: skip
NONE = "none"


class Surroundings(NamedTuple):
    """The context of a node's keys: node-IDs by name, the master, and its heartbeat multiplier."""

    node_ids: Mapping[str, int]
    master: MasterRole | None
    multiplier: float


def read_node(name: str, branch: Branch, around: Surroundings, log: FileLog) -> NodeConfig | None:
    """Read the node *name*; None after a complaint about its node-ID."""
    found = read_keys(branch, Where.NODE, f"node {name}", log)
    objects = tuple(sorted(_objects(branch, found, log), key=lambda config: (config.index, config.sub_index)))
    values = tuple(_values(found.get("sdo"), f"sdo of {name}", {(o.index, o.sub_index): o for o in objects}, log))
    watches = tuple(sorted(_watches(branch, found, around, log), key=lambda watch: watch.producer))
    pins = tuple(_pins(found.get("vpdo"), log))
    identity, identity_marks = _identity(branch, found, name, log)
    pdos = sorted(_pdos(found, name, log), key=lambda config: (not config.pdo.is_tpdo, config.pdo.number))
    if found.get("stamp") and found.get("store") not in ("all", "1"):
        log.complain(key_mark(branch, "stamp"),
            "a stamp is only valid if it is stored with all other values: it needs store: true")  # fmt: skip
    if "node_id" not in found:
        return None
    profile: FileWord | None = found.get("profile")
    if "dcf" in found and "eds" in found:
        log.note(key_mark(branch, "eds"), "eds is ignored: dcf describes the node")
    return NodeConfig(
        name=name, node_id=found["node_id"], identity=identity, profile=None if profile is None else profile.text,
        dcf=found.get("dcf", found.get("eds")),
        pdos=tuple(pdos), objects=objects, values=values, watches=watches, pins=pins,
        store=found.get("store"), prune=found.get("prune"), stamp=found.get("stamp"), mark=branch.mark,
        store_mark=key_mark(branch, "store") if "store" in found else NOWHERE,
        physical=tuple(sorted(read_physical(found["physical"], log))) if "physical" in found else (),
        profile_mark=NOWHERE if profile is None else profile.mark, identity_marks=identity_marks,
        modules=found.get("modules"), modules_mark=key_mark(branch, "modules") if "modules" in found else NOWHERE,
    )  # fmt: skip


def _pdos(found: dict[str, Any], name: str, log: FileLog) -> Iterator[PartialPdoConfig]:
    for direction in (Direction.TPDO, Direction.RPDO):
        if str(direction) in found:
            yield from read_pdos(found[str(direction)], direction, f"node {name}", log)


def _identity(
    branch: Branch, found: dict[str, Any], name: str, log: FileLog
) -> tuple[ExpectedIdentity, dict[int, Mark]]:
    """Read `identity` and dcfgen's keys (0: not asked for), with their places by sub-index."""
    said: dict[str, int] = {}
    marks: dict[str, Mark] = {}
    if "identity" in found:
        said = read_keys(found["identity"], Where.IDENTITY, f"identity of node {name}", log)
        marks = {own: key_mark(found["identity"], own) for own in said}
    for own, theirs in _IDENTITY.items():
        value = found.get(theirs)
        if value and said.setdefault(own, value) != value:
            log.complain(key_mark(branch, theirs), f"{theirs} is not what identity says of {own}")
        elif value:
            marks.setdefault(own, key_mark(branch, theirs))
    return ExpectedIdentity(**said), {sub: marks[own] for sub, own in enumerate(_IDENTITY, 1) if own in marks}


def _objects(branch: Branch, found: dict[str, Any], log: FileLog) -> Iterator[ObjectConfig]:
    for key in OF[Where.NODE].values():
        if key.object is not None and key.name in found:
            index, sub_index, size = key.object
            data = int(found[key.name]).to_bytes(size, "little")
            yield ObjectConfig(key.name, index, sub_index, data, key_mark(branch, key.name))
    behaviour: Branch | None = found.get("error_behavior")
    for leaf, value in behaviour.items.values() if behaviour else ():
        behaves = number_key(leaf, 1, 254, "sub-index of 0x1029", log)
        number = integer(value, OF[Where.NODE]["error_behavior"], log)
        if behaves is not None and number is not None:
            yield ObjectConfig("error_behavior", ERROR_BEHAVIOUR, behaves, bytes([number]), leaf.mark)


def _values(
    row: YamlList | None, title: str, said: Mapping[tuple[int, int], ObjectConfig], log: FileLog
) -> Iterator[ValueConfig]:
    """Read the entries of `sdo`; *said* are the objects already set by the node's keys."""
    configs: dict[str, ValueConfig] = {}
    for tree in row.items if row else ():
        if not isinstance(tree, Branch):
            log.complain(tree.mark, f"index, sub_index and value belong here, not {shown(tree)}")
            continue
        found = read_keys(tree, Where.SDO, title, log)
        word = _object(tree, found, title, log)
        if word is None or ("value" in tree.items and "value" not in found):
            continue
        config = ValueConfig(word, found.get("value", FileWord("0")))
        earlier = configs.setdefault(word.text, config)
        own = said.get(parse_object(word.text) or (-1, -1))
        if own is not None:
            text = f"{word.text} is already set by {own.key} of this node"
            if _number_in(config.value.text) == int.from_bytes(own.data, "little"):
                log.note(word.mark, f"{text}, to the same value")
            else:
                log.complain(word.mark, text)
        elif earlier is config:
            yield config
        elif _same_text(config.value.text, earlier.value.text):
            log.note(word.mark, f"{word.text} has this value already (line {earlier.object.mark.line})")
        else:
            text = f"{word.text} has a value already (line {earlier.object.mark.line}), and can have only one value"
            log.complain(word.mark, text)


def _same_text(one: str, other: str) -> bool:
    """Whether the values *one* and *other* of a file are the same text, or the same number."""
    return one == other or (_number_in(one) is not None and _number_in(one) == _number_in(other))


def _number_in(text: str) -> int | None:
    try:
        return int(text, 0)
    except ValueError:
        return None


def _object(tree: Branch, found: dict[str, Any], title: str, log: FileLog) -> FileWord | None:
    """Read an entry's object, which must be written in one way only."""
    numbers = {"index", "sub_index"} & tree.items.keys()
    if "object" in tree.items and numbers:
        log.complain(key_mark(tree, "object"), "object and index are the same: give only one of them")
    elif "object" in found:
        word: FileWord = found["object"]
        place = parse_object(word.text)
        return FileWord(f"{place[0]:04X}:{place[1]:02X}", word.mark) if place else word
    elif "index" in found:
        return FileWord(f"{found['index']:04X}:{found.get('sub_index', 0):02X}", tree.mark)
    elif not {"object", "index"} & tree.items.keys():
        log.complain(tree.mark, f"an entry of {title} has neither index nor object")
    return None


def _watches(branch: Branch, found: dict[str, Any], around: Surroundings, log: FileLog) -> Iterator[HeartbeatWatch]:
    tree = found.get("heartbeat_consumer")
    if tree is None:
        return
    mark, key = key_mark(branch, "heartbeat_consumer"), OF[Where.NODE]["heartbeat_consumer"]
    if not isinstance(tree, Branch):
        watched = truth(tree, key, log)
        if watched is not None:
            yield from _of_the_master(around, HeartbeatWatch(0, 0, mark), log, watched=watched)
        return
    seen: set[int] = set()
    for leaf, value in tree.items.values():
        time_ms = integer(value, key, log)
        producer = around.node_ids.get(leaf.text)
        if producer is None:
            producer = number_key(leaf, 1, 127, "node of this file, and no node-ID", log)
        if producer in seen:
            log.complain(leaf.mark, f"node {producer} is watched twice")
        elif producer is not None and time_ms is not None:
            yield HeartbeatWatch(producer, time_ms, leaf.mark)
            seen.add(producer)


def _of_the_master(
    around: Surroundings, watch: HeartbeatWatch, log: FileLog, *, watched: bool
) -> Iterator[HeartbeatWatch]:
    """dcfgen's true and false: whether the node watches the master."""
    master = around.master
    if master is None or not 1 <= (master.node_id or 0) <= 127 or (watched and not master.heartbeat_producer_ms):
        log.note(watch.mark, "heartbeat_consumer is ignored: master has no node_id or no heartbeat_producer")
        return
    time_ms = int((master.heartbeat_producer_ms or 0) * around.multiplier) if watched else 0
    if time_ms > 0xFFFF:
        log.complain(watch.mark, f"the master's heartbeat would be late after {time_ms} ms, and 65535 is the most")
        return
    yield HeartbeatWatch(master.node_id or 0, time_ms, watch.mark)


def _pins(groups: Branch | None, log: FileLog) -> Iterator[PinConfig]:
    key = OF[Where.NODE]["vpdo"]
    for group, (leaf, value) in sorted(groups.items.items()) if groups else ():
        pins = table(value, key, log)
        seen: dict[int, PinConfig] = {}
        for pin_leaf, tied in pins.items.values() if pins else ():
            pin = number_key(pin_leaf, 1, 254, "pin", log)
            word = object_word(tied, log)
            if pin in seen:
                log.complain(pin_leaf.mark, f"pin {pin} of {leaf.text} was given twice")
            elif pin is not None and word is not None:
                seen[pin] = PinConfig(group, pin, None if word.text == NONE else word, pin_leaf.mark)
        yield from (seen[pin] for pin in sorted(seen))


def read_physical(branch: Branch, log: FileLog) -> Iterator[tuple[str, str]]:
    """Read objects with their meaning as JSON; complains if a profile could not have it."""
    for name, (leaf, tree) in branch.items.items():
        said = _plain(tree, log)
        try:
            _rules({name: said}, log.file)
        except InputFileError as wrong:
            log.complain(leaf.mark, wrong.text)
        else:
            yield name, json.dumps(said, ensure_ascii=False)


def rules_of(physical: Iterable[tuple[str, str]]) -> Rules:
    """Return the meanings of a node's objects in the form of a profile."""
    return _rules({name: json.loads(text) for name, text in physical}, "")


def rules_by_node(nodes: Iterable[NodeConfig]) -> dict[int, Rules]:
    """Return `rules_of` for each of *nodes*, by node-ID."""
    return {node.node_id: rules_of(node.physical) for node in nodes}


def _rules(said: dict[str, object], file: str) -> Rules:
    from dvtcli.files.profiles import physical_rules
    from dvtcli.files.toml_item import Item

    return physical_rules(Item(said, ("physical",), file, {}))


def _plain(tree: Tree, log: FileLog) -> object:
    """*tree* as TOML would have it; a real number stays a text, and exact."""
    if isinstance(tree, Branch):
        return {name: _plain(value, log) for name, (_, value) in tree.items.items()}
    if isinstance(tree, YamlList):
        return [_plain(item, log) for item in tree.items]
    return _number(tree, log) if tree.kind == "int" else tree.text


def _number(leaf: Leaf, log: FileLog) -> object:
    number = as_number(leaf, log)
    return leaf.text if number is None else number
