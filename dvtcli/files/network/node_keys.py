"""One node of a network file. Does not know its device."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from dvtcli.domain.network.wanted_state import (
    NOWHERE,
    FileWord,
    HeartbeatWatch,
    Mark,
    MasterRole,
    NodeWish,
    ObjectWish,
    PdoWish,
    PinWish,
    ValueWish,
    WantedIdentity,
)
from dvtcli.domain.object_syntax import parse_object
from dvtcli.domain.pdo import Direction
from dvtcli.files.network import leaves
from dvtcli.files.network.file_log import FileLog
from dvtcli.files.network.known_keys import key_mark, number_key, read_keys
from dvtcli.files.network.network_keys import OF, Where
from dvtcli.files.network.pdo_keys import read_pdos
from dvtcli.files.network.physical_keys import read_physical
from dvtcli.files.network.yaml_tree import Branch, YamlList

#: the identity's own keys, and dcfgen's for the same
_IDENTITY = {
    "vendor": "vendor_id", "product": "product_code", "revision": "revision_number", "serial": "serial_number",
}  # fmt: skip
_ERROR_BEHAVIOUR = 0x1029
NONE = "none"


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What a node's keys refer to: node-IDs by name, the master, and after how many of its heartbeats it is late."""

    node_ids: Mapping[str, int]
    master: MasterRole | None
    multiplier: float


def read_node(name: str, branch: Branch, around: Surroundings, log: FileLog) -> NodeWish | None:
    """The node *name*; None without a node-ID, which was complained."""
    found = read_keys(branch, Where.NODE, f"node {name}", log)
    objects = tuple(sorted(_objects(branch, found, log), key=lambda wish: (wish.index, wish.sub_index)))
    values = tuple(_values(found.get("sdo"), f"sdo of {name}", {(o.index, o.sub_index): o.key for o in objects}, log))
    watches = tuple(sorted(_watches(branch, found, around, log), key=lambda watch: watch.producer))
    pins = tuple(_pins(found.get("vpdo"), log))
    identity, identity_marks = _identity(branch, found, name, log)
    pdos = sorted(_pdos(found, name, log), key=lambda wish: (not wish.pdo.is_tpdo, wish.pdo.number))
    if found.get("stamp") and found.get("store") not in ("all", "1"):
        log.complain(key_mark(branch, "stamp"), "a stamp that is not stored with all the rest vouches for nothing: "
                     "it needs store: true")  # fmt: skip
    if "node_id" not in found:
        return None
    profile: FileWord | None = found.get("profile")
    return NodeWish(
        name, found["node_id"], identity, None if profile is None else profile.text, found.get("dcf"),
        tuple(pdos), objects, values, watches, pins,
        found.get("store"), found.get("prune"), found.get("stamp"), branch.mark,
        key_mark(branch, "store") if "store" in found else NOWHERE,
        tuple(sorted(read_physical(found["physical"], log))) if "physical" in found else (),
        NOWHERE if profile is None else profile.mark, identity_marks,
    )  # fmt: skip


def _pdos(found: dict[str, Any], name: str, log: FileLog) -> Iterator[PdoWish]:
    for direction in (Direction.TPDO, Direction.RPDO):
        if str(direction) in found:
            yield from read_pdos(found[str(direction)], direction, f"node {name}", log)


def _identity(branch: Branch, found: dict[str, Any], name: str, log: FileLog) -> tuple[WantedIdentity, dict[int, Mark]]:
    """What `identity` says, and dcfgen's keys, whose 0 is not asked for; with the places of both by sub-index."""
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
    return WantedIdentity(**said), {sub: marks[own] for sub, own in enumerate(_IDENTITY, 1) if own in marks}


def _objects(branch: Branch, found: dict[str, Any], log: FileLog) -> Iterator[ObjectWish]:
    for key in OF[Where.NODE].values():
        if key.object is not None and key.name in found:
            index, sub_index, size = key.object
            data = int(found[key.name]).to_bytes(size, "little")
            yield ObjectWish(key.name, index, sub_index, data, key_mark(branch, key.name))
    behaviour: Branch | None = found.get("error_behavior")
    for leaf, value in behaviour.items.values() if behaviour else ():
        behaves = number_key(leaf, 1, 254, "sub-index of 0x1029", log)
        number = leaves.integer(value, OF[Where.NODE]["error_behavior"], log)
        if behaves is not None and number is not None:
            yield ObjectWish("error_behavior", _ERROR_BEHAVIOUR, behaves, bytes([number]), leaf.mark)


def _values(row: YamlList | None, title: str, said: dict[tuple[int, int], str], log: FileLog) -> Iterator[ValueWish]:
    """The entries of `sdo`; *said* are the objects that keys of the node set."""
    lines: dict[str, int] = {}
    for tree in row.items if row else ():
        if not isinstance(tree, Branch):
            log.complain(tree.mark, f"index, sub_index and value belong here, not {leaves.shown(tree)}")
            continue
        found = read_keys(tree, Where.SDO, title, log)
        word = _object(tree, found, title, log)
        if word is None:
            continue
        if word.text in lines:
            log.complain(word.mark, f"{word.text} has a value already (line {lines[word.text]}), and can have one only")
        elif (place := parse_object(word.text)) in said:
            log.complain(word.mark, f"{word.text} is what {said[place]} of this node sets already")
        elif "value" in found or "value" not in tree.items:
            yield ValueWish(word, found.get("value", FileWord("0")))
        lines[word.text] = word.mark.line


def _object(tree: Branch, found: dict[str, Any], title: str, log: FileLog) -> FileWord | None:
    """The object of an entry, whose number is written one way."""
    numbers = {"index", "sub_index"} & tree.items.keys()
    if "object" in tree.items and numbers:
        log.complain(key_mark(tree, "object"), "object and index are the same: say one of them")
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
        watched = leaves.truth(tree, key, log)
        if watched is not None:
            yield from _of_the_master(around, HeartbeatWatch(0, 0, mark), log, watched=watched)
        return
    seen: set[int] = set()
    for leaf, value in tree.items.values():
        time_ms = leaves.integer(value, key, log)
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
        log.note(watch.mark, "heartbeat_consumer is left alone: master has no node_id or no heartbeat_producer")
        return
    time_ms = int((master.heartbeat_producer_ms or 0) * around.multiplier) if watched else 0
    if time_ms > 0xFFFF:
        log.complain(watch.mark, f"the master's heartbeat would be late after {time_ms} ms, and 65535 is the most")
        return
    yield HeartbeatWatch(master.node_id or 0, time_ms, watch.mark)


def _pins(groups: Branch | None, log: FileLog) -> Iterator[PinWish]:
    key = OF[Where.NODE]["vpdo"]
    for group, (leaf, value) in sorted(groups.items.items()) if groups else ():
        pins = leaves.table(value, key, log)
        seen: dict[int, PinWish] = {}
        for pin_leaf, tied in pins.items.values() if pins else ():
            pin = number_key(pin_leaf, 1, 254, "pin", log)
            word = leaves.object_word(tied, log)
            if pin in seen:
                log.complain(pin_leaf.mark, f"pin {pin} of {leaf.text} is given twice")
            elif pin is not None and word is not None:
                seen[pin] = PinWish(group, pin, None if word.text == NONE else word, pin_leaf.mark)
        yield from (seen[pin] for pin in sorted(seen))
