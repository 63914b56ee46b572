"""Read single values of a network file, or complain with the expected form.

Each reader returns None after a complaint.
"""

from __future__ import annotations

import re
from typing import Literal

from dvtcli.domain.network.network_config import FileWord
from dvtcli.domain.object_syntax import parse_object
from dvtcli.files.network.file_log import FileLog
from dvtcli.files.network.network_keys import STORE_WORDS, NetworkKey
from dvtcli.files.network.yaml_tree import Branch, Leaf, Tree

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
