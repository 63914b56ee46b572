"""Read mappings of a network file by the table of keys: each value by its kind, unknown keys reported."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from dvtcli.domain.network.network_config import Mark
from dvtcli.files.network import leaves
from dvtcli.files.network.file_log import FileLog, spelled
from dvtcli.files.network.network_keys import OF, Kind, NetworkKey, Where
from dvtcli.files.network.yaml_tree import Branch, Leaf, Tree, YamlList

#: mappings that may have keys of other tools
_OPEN = {Where.FILE, Where.OPTIONS, Where.MASTER, Where.NODE}
_SLIP = 0.82
_IN_A_FILE = "the file: it belongs at the top level"
_IN_A_NODE = "a node: it belongs below the node's name"
_IN_A_PDO = "a PDO: it belongs below a number of tpdo or rpdo"
#: by the mapping with a misplaced key: the mappings it may be meant for, and their place in words
_BELONGS: dict[Where, dict[Where, str]] = {
    Where.FILE: {Where.NODE: _IN_A_NODE, Where.TPDO: _IN_A_PDO, Where.RPDO: _IN_A_PDO, Where.MASTER: "master"},
    Where.OPTIONS: {Where.FILE: _IN_A_FILE},
    Where.MASTER: {Where.FILE: _IN_A_FILE},
    Where.NODE: {Where.TPDO: _IN_A_PDO, Where.RPDO: _IN_A_PDO, Where.FILE: _IN_A_FILE},
    Where.TPDO: {Where.NODE: _IN_A_NODE},
    Where.RPDO: {Where.NODE: _IN_A_NODE},
}


def _as_it_is(tree: Tree, _key: NetworkKey, _log: FileLog) -> Tree:
    return tree


def _list(tree: Tree, _key: NetworkKey, log: FileLog) -> YamlList | None:
    if isinstance(tree, YamlList):
        return tree
    hint = "; [] for none" if isinstance(tree, Leaf) and tree.is_null else ""
    log.complain(tree.mark, f"a list is expected here, not {leaves.shown(tree)}{hint}")
    return None


def _modules(tree: Tree, key: NetworkKey, log: FileLog) -> tuple[int, ...] | None:
    """Read a list of module numbers; None after a complaint about any of them."""
    row = _list(tree, key, log)
    numbers = [leaves.integer(item, key, log) for item in row.items] if row is not None else [None]
    return None if None in numbers else tuple(number for number in numbers if number is not None)


def _object(tree: Tree, _key: NetworkKey, log: FileLog) -> object:
    return leaves.object_word(tree, log)


#: the reader of each kind of key; mappings and lists are passed on unchanged
_READERS: dict[Kind, Callable[[Any, NetworkKey, FileLog], object]] = {
    Kind.ANYTHING: _as_it_is,
    Kind.INTEGER: leaves.integer,
    Kind.NUMBER: leaves.number,
    Kind.TRUTH: leaves.truth,
    Kind.TEXT: leaves.text,
    Kind.COB_ID: leaves.cob_id,
    Kind.OBJECT: _object,
    Kind.VALUE: leaves.value_word,
    Kind.STORE: leaves.store_word,
    Kind.WATCH: _as_it_is,
    Kind.TABLE: leaves.table,
    Kind.NODES: leaves.table,
    Kind.PDOS: leaves.table,
    Kind.NUMBERS: leaves.table,
    Kind.PINS: leaves.table,
    Kind.MEANINGS: leaves.table,
    Kind.ENTRIES: _list,
    Kind.MODULES: _modules,
    Kind.VALUES: _list,
    Kind.LINKS: _list,
    Kind.ENDPOINT: _as_it_is,
    Kind.ENDPOINTS: _as_it_is,
    Kind.HEARTBEAT: leaves.heartbeat,
}


def read_keys(branch: Branch, where: Where, title: str, log: FileLog) -> dict[str, Any]:
    """Return the values of *branch* by key, without wrong or ignored keys; *title* names it in complaints."""
    known, found = OF[where], dict[str, Any]()
    for name, (leaf, value) in branch.items.items():
        key = known.get(name)
        if key is None:
            unknown_key(leaf, where, title, log)
        elif key.noted:
            if where is not Where.MASTER:
                log.note(leaf.mark, f"{name} is ignored: {key.sense}")
        else:
            read = _READERS[key.kind](value, key, log)
            if read is not None:
                found[name] = read
    for key in known.values():
        if key.required and key.name not in branch.items:
            log.complain(branch.mark, f"{title} has no {key.name}")
    return found


def unknown_key(leaf: Leaf, where: Where, title: str, log: FileLog) -> None:
    """Note a key of another tool; complain about a misspelt key, and about any unknown key in closed mappings."""
    name = leaf.text
    if belongs := belongs_to(name, where):
        log.complain(leaf.mark, f"{name[:40]!r} in {title} belongs to {belongs}")
    elif where is Where.MASTER and name == "baud_rate":
        log.note(leaf.mark, "baud_rate of master is ignored: dcfgen calls it baudrate, and takes 1000 without it")
    elif where not in _OPEN or is_slip(name, where, log):
        log.unknown(leaf.mark, name, title, OF[where])
    else:
        log.note(leaf.mark, f"{name[:40]} is ignored: a key of another tool")


def belongs_to(name: str, where: Where) -> str:
    """Return the right mapping for the key *name*, misplaced in *where*; empty if no mapping has this key."""
    found = spelled(name)
    for other, what in _BELONGS.get(where, {}).items():
        if found in OF[other] and not OF[other][found].noted and found not in OF[where]:
            return what
    return ""


def is_slip(name: str, where: Where, log: FileLog) -> bool:
    """Whether the unknown *name* is close to, or begins, an effective key of *where*."""
    return log.nearest(name, (key.name for key in OF[where].values() if not key.noted), _SLIP) is not None


def number_key(leaf: Leaf, low: int, high: int, what: str, log: FileLog) -> int | None:
    """Read a key that is a number of *what* within *low*..*high*, quoted or not; None after a complaint."""
    number = leaves.as_number(leaf, log) if leaf.kind == "int" or leaf.text.isdecimal() else None
    if number is not None and low <= number <= high:
        return number
    log.complain(leaf.mark, f"{leaf.text[:40]!r} is no {what}: {low}…{high}")
    return None


def key_mark(branch: Branch, name: str) -> Mark:
    """Return the place of the key *name* of *branch*."""
    return branch.items[name][0].mark
