"""Read the values of a network file by the table of keys, or complain with the expected form; unknown keys too."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, Literal

from dvtcli.domain.network.network_config import FileWord, Mark
from dvtcli.domain.object_syntax import parse_object
from dvtcli.files.network.file_log import FileLog, spelled
from dvtcli.files.network.network_keys import OF, STORE_WORDS, Kind, NetworkKey, Where
from dvtcli.files.network.yaml_tree import Branch, Leaf, Tree, YamlList

_INTEGER = re.compile(r"-?(?:0[xX][0-9A-Fa-f]+|0b[01]+|[0-9]+)")
#: 64 bits in binary, with their prefix
_MOST_BITS = 66
_LENGTH = re.compile(r"(.+)/([0-9]{1,3})", re.S)
_HEX_FROM = 0x1000
#: 2**64 - 1 in decimal
_MOST_DIGITS = 20


def integer(tree: Tree, key: NetworkKey, log: FileLog) -> int | None:
    """A whole number within the key's range, decimal, 0x or 0b."""
    value = whole_number(tree, log)
    if value is None or key.low <= value <= key.high:
        return value
    log.complain(tree.mark, f"{shown(tree)} is not within {_range(key)}")
    return None


def whole_number(tree: Tree, log: FileLog) -> int | None:
    """A whole number, decimal, 0x or 0b."""
    if not isinstance(tree, Leaf) or tree.kind != "int":
        quoted = isinstance(tree, Leaf) and tree.kind == "str" and _INTEGER.fullmatch(tree.text)
        hint = "; it is written without quotes" if quoted else ""
        log.complain(tree.mark, f"a whole number is expected here, not {shown(tree)}{hint}")
        return None
    return as_number(tree, log)


def as_number(leaf: Leaf, log: FileLog) -> int | None:
    """Return the number in *leaf*; complains if YAML 1.1 and 1.2 read different numbers."""
    if not _INTEGER.fullmatch(leaf.text):
        log.complain(leaf.mark, f"{leaf.text[:40]!r} is not a number; write it in decimal or as 0x…")
        return None
    digits = leaf.text.removeprefix("-")
    if len(digits) > (_MOST_BITS if digits.startswith("0b") else _MOST_DIGITS):
        log.complain(leaf.mark, f"a number of {len(digits)} characters is longer than any of 64 bits")
        return None
    if digits[:2] in ("0x", "0X"):
        return int(leaf.text, 16)
    if digits.startswith("0b"):
        return int(leaf.text, 2)
    if len(digits) > 1 and digits[0] == "0" and set(digits) <= set("01234567") and int(digits, 8) != int(digits):
        log.complain(
            leaf.mark,
            f"{leaf.text} is {int(digits, 8)} for some readers and {int(digits)} for others; write only one of them",
        )
        return None
    return int(leaf.text)


def _range(key: NetworkKey) -> str:
    if key.high >= _HEX_FROM and not key.unit:
        return f"0x{int(key.low):X}…0x{int(key.high):X}"
    return f"{key.low:.12g}…{key.high:.12g}{' ' if key.unit else ''}{'× ' if key.unit[:1].isdigit() else ''}{key.unit}"


def number(tree: Tree, key: NetworkKey, log: FileLog) -> float | None:
    """A number within the key's range."""
    if isinstance(tree, Leaf) and tree.kind == "int":
        value: float | None = as_number(tree, log)
    elif isinstance(tree, Leaf) and tree.kind == "float" and tree.text[-1:].isdigit():
        value = float(tree.text)
    else:
        log.complain(tree.mark, f"a number is expected here, not {shown(tree)}")
        return None
    if value is not None and not key.low <= value <= key.high:
        log.complain(tree.mark, f"{value:.12g} is not within {_range(key)}")
        return None
    return value


def truth(tree: Tree, _key: NetworkKey, log: FileLog) -> bool | None:
    """true or false, as YAML has them: a text is neither."""
    if isinstance(tree, Leaf) and tree.kind == "bool":
        return tree.text.lower() == "true"
    why = "; a text is not a truth value, and other tools take any text for true" if _is_text(tree) else ""
    log.complain(tree.mark, f"true or false is expected here, not {shown(tree)}{why}")
    return None


def _is_text(tree: Tree) -> bool:
    return isinstance(tree, Leaf) and tree.kind == "str"


def text(tree: Tree, _key: NetworkKey, log: FileLog) -> FileWord | None:
    """Read a text that is not blank."""
    if isinstance(tree, Leaf) and tree.kind == "str" and tree.text.strip():
        return FileWord(tree.text, tree.mark)
    log.complain(tree.mark, f"a text is expected here, not {shown(tree)}")
    return None


def cob_id(tree: Tree, key: NetworkKey, log: FileLog) -> int | Literal["auto"] | None:
    """Read a COB-ID of 32 bits, or auto."""
    if isinstance(tree, Leaf) and tree.kind == "str" and tree.text == "auto":
        return "auto"
    return integer(tree, key, log)


def object_word(tree: Tree, log: FileLog) -> FileWord | None:
    """An object as at the prompt: `6041`, `6C01:01/16`, `dummy/8`, a name; a number here is hexadecimal."""
    if not isinstance(tree, Leaf) or tree.kind in ("bool", "null") or not tree.text.strip():
        log.complain(tree.mark, f"an object is expected here, not {shown(tree)}")
        return None
    length = _LENGTH.fullmatch(tree.text)
    try:
        place = parse_object(length[1] if length else tree.text)
    except ValueError as wrong:
        log.complain(tree.mark, str(wrong))
        return None
    if length and (place or length[1].lower() == "dummy") and not 1 <= int(length[2]) <= 64:
        log.complain(tree.mark, f"{tree.text}: after / stands a length in bits, 1…64")
        return None
    return FileWord(tree.text.strip(), tree.mark)


def value_word(tree: Tree, _key: NetworkKey, log: FileLog) -> FileWord | None:
    """Read an object's value as typed; the node's dictionary gives its type later."""
    if not isinstance(tree, Leaf) or tree.is_null:
        log.complain(tree.mark, f"a value is expected here, not {shown(tree)}")
        return None
    if tree.kind == "int":
        number = as_number(tree, log)
        if number is None:
            return None
        return FileWord(str(number) if "0b" in tree.text else tree.text, tree.mark)
    if tree.kind == "bool":
        return FileWord("1" if tree.text.lower() == "true" else "0", tree.mark)
    return FileWord(tree.text, tree.mark)


def store_word(tree: Tree, key: NetworkKey, log: FileLog) -> str | Literal[False] | None:
    """Read the argument of `store`: a word or sub-index; false for nothing."""
    if isinstance(tree, Leaf) and tree.kind == "bool":
        return "all" if tree.text.lower() == "true" else False
    if isinstance(tree, Leaf) and tree.kind == "int":
        found = integer(tree, key, log)
        return None if found is None else str(found)
    if isinstance(tree, Leaf) and tree.text in STORE_WORDS:
        return tree.text
    log.complain(tree.mark, f"true, false, {', '.join(STORE_WORDS)} or a sub-index is expected here, not {shown(tree)}")
    return None


def heartbeat(tree: Tree, key: NetworkKey, log: FileLog) -> int | Literal[False] | None:
    """A heartbeat in ms, or false."""
    if isinstance(tree, Leaf) and tree.kind == "bool" and tree.text.lower() == "false":
        return False
    return integer(tree, key, log)


def table(tree: Tree, _key: NetworkKey, log: FileLog) -> Branch | None:
    """Read a mapping; null is an empty mapping."""
    if isinstance(tree, Leaf) and tree.is_null:
        return Branch(tree.mark, {})
    if isinstance(tree, Branch):
        return tree
    log.complain(tree.mark, f"keys and values belong here, not {shown(tree)}")
    return None


def shown(tree: Tree) -> str:
    """*tree* in a few characters, for a complaint."""
    if isinstance(tree, Leaf):
        if tree.is_null:
            return "nothing"
        return f'"{tree.text[:40]}"' if tree.kind == "str" else tree.text[:40]
    return "a mapping" if isinstance(tree, Branch) else "a list"


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
    log.complain(tree.mark, f"a list is expected here, not {shown(tree)}{hint}")
    return None


def _modules(tree: Tree, key: NetworkKey, log: FileLog) -> tuple[int, ...] | None:
    """Read a list of module numbers; None after a complaint about any of them."""
    row = _list(tree, key, log)
    numbers = [integer(item, key, log) for item in row.items] if row is not None else [None]
    return None if None in numbers else tuple(number for number in numbers if number is not None)


def _object(tree: Tree, _key: NetworkKey, log: FileLog) -> object:
    return object_word(tree, log)


#: the reader of each kind of key; mappings and lists are passed on unchanged
_READERS: dict[Kind, Callable[[Any, NetworkKey, FileLog], object]] = {
    Kind.ANYTHING: _as_it_is,
    Kind.INTEGER: integer,
    Kind.NUMBER: number,
    Kind.TRUTH: truth,
    Kind.TEXT: text,
    Kind.COB_ID: cob_id,
    Kind.OBJECT: _object,
    Kind.VALUE: value_word,
    Kind.STORE: store_word,
    Kind.WATCH: _as_it_is,
    Kind.TABLE: table,
    Kind.NODES: table,
    Kind.PDOS: table,
    Kind.NUMBERS: table,
    Kind.PINS: table,
    Kind.MEANINGS: table,
    Kind.ENTRIES: _list,
    Kind.MODULES: _modules,
    Kind.VALUES: _list,
    Kind.LINKS: _list,
    Kind.ENDPOINT: _as_it_is,
    Kind.ENDPOINTS: _as_it_is,
    Kind.HEARTBEAT: heartbeat,
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
    number = as_number(leaf, log) if leaf.kind == "int" or leaf.text.isdecimal() else None
    if number is not None and low <= number <= high:
        return number
    log.complain(leaf.mark, f"{leaf.text[:40]!r} is not a {what}: {low}…{high}")
    return None


def key_mark(branch: Branch, name: str) -> Mark:
    """Return the place of the key *name* of *branch*."""
    return branch.items[name][0].mark
