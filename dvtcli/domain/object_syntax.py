"""Parse objects, mapping entries and COB-IDs as typed by people."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry, normalised
from dvtcli.domain.pdo import MAX_PDO_BITS, Direction

_OBJECT = re.compile(r"(?:0[xX])?([0-9A-Fa-f]{4})[hH]?(?:[:.](?:0[xX])?([0-9A-Fa-f]{1,2})[hH]?|/(0{1,2}))?")
_WRONG_NUMBER = re.compile(r"0[xX][0-9A-Fa-f]+(?::.*)?|[0-9A-Fa-f]+:[0-9A-Fa-fxX]*")
#: Decimal sub-index, as in some manuals: `0x2005-13` is 2005:0D.
_DECIMAL_SUB = re.compile(r"(?:0[xX])?([0-9A-Fa-f]{4})-([0-9]{1,3})(?:/[0-9]{1,3})?")
#: hexadecimal sub-index that may be meant decimal: `2005.13`
_DOTTED_SUB = re.compile(r"(?:0[xX])?([0-9A-Fa-f]{4})[hH]?\.([1-9][0-9])(?:/[0-9]{1,3})?")
#: CAN-IDs of PDOs in the pre-defined connection set (CiA 301, 7.3.5)
PDO_CAN_IDS = 0x181, 0x57F
_BITS = re.compile(r"[0-9]{1,3}")


class UnknownName(ValueError):
    """A name unknown to all dictionaries; *find_similar* looks for close names.

    *direction* is that of the PDO for which the name was typed, if known.
    """

    def __init__(self, text: str, find_similar: Callable[[Direction | None], Iterable[str]] = lambda _: ()) -> None:
        super().__init__(text)
        self._find_similar = find_similar
        self.direction: Direction | None = None

    @cached_property
    def similar(self) -> tuple[str, ...]:
        """Close names, best first; looking for them takes milliseconds."""
        return tuple(self._find_similar(self.direction))


class AmbiguousName(ValueError):
    """A *name* of several objects; *choices* are their numbers, in the order of the dictionary."""

    def __init__(self, name: str, found: Iterable[OdEntry], dictionary: ObjectDictionary) -> None:
        entries = list(found)
        self.name = name
        self.choices = tuple(_number(entry, dictionary) for entry in entries)
        own = {normalised(dictionary.display_name(entry.index, entry.sub_index)) for entry in entries}
        write = "write the index" if len(own) < len(entries) else "write the name in full or the index"
        which = ", ".join(self.choices[:_MOST_CHOICES]) + (", …" if len(entries) > _MOST_CHOICES else "")
        super().__init__(f"{name!r} means {len(entries)} objects ({which}); {write}")


def _number(entry: OdEntry, dictionary: ObjectDictionary) -> str:
    return f"{entry.index:04X}" if len(dictionary[entry.index].entries) == 1 else entry.object


#: how many objects with the same name a message lists
_MOST_CHOICES = 6


@dataclass(frozen=True, slots=True)
class MappedObject:
    """An object after `map PDO` with its length in bits, None if to be determined."""

    index: int
    sub_index: int
    bits: int | None = None


class Skipped(NamedTuple):
    """`dummy/16`: skip *bits* of the frame."""

    bits: int


def parse_object(text: str) -> tuple[int, int] | None:
    """Read `0x6C01:1`, `6C01:01`, `6041` or `6041h` (index and sub-index hexadecimal); None if *text* is a name.

    Also `6C01.1`; `6041/0`, since 0 is no length; and `0x2005-13`, with a decimal sub-index (RoboteQ CAN Networking
    Manual).

    Raises ValueError for a malformed number: an index has exactly four hexadecimal digits.
    """
    match = _OBJECT.fullmatch(text)
    if match:
        return int(match[1], 16), int(match[2] or match[3] or "0", 16)
    decimal = _DECIMAL_SUB.fullmatch(text)
    if decimal and "/" not in text and int(decimal[2]) <= 0xFF:
        return int(decimal[1], 16), int(decimal[2])
    if _WRONG_NUMBER.fullmatch(text):
        raise ValueError(
            f"{text!r} is not an object: an index has four hexadecimal digits, a sub-index one or two (6C01:1)"
        )
    return None


def has_sub_index(text: str) -> bool:
    """Whether *text* is more than an index: `1018:0`, `1018.0`, `1018/0`, `1018-0`, also a name; not `1018`."""
    return _OBJECT.fullmatch(text) is None or any(sign in text for sign in ":./")


def notation_note(text: str) -> str | None:
    """A note for an object whose sub-index some manuals write otherwise: `0x2005-13` is decimal, `2005.13` is not."""
    dotted = _DOTTED_SUB.fullmatch(text)
    if dotted is not None:
        return f"{text}: the sub-index after . is hexadecimal; this is {dotted[1].upper()}:{dotted[2]}"
    decimal = _DECIMAL_SUB.fullmatch(text)
    if decimal is None or int(decimal[2]) > 0xFF:
        return None
    return f"{text}: the sub-index after - is decimal; this is {decimal[1].upper()}:{int(decimal[2]):02X}"


def resolve_object(
    text: str, dictionary: ObjectDictionary | None, aliases: Mapping[str, str] | None = None
) -> tuple[int, int]:
    """Index and sub-index of *text*: a number, an alias of the profile, or a name in the EDS.

    Raises UnknownName if the name is unknown, ValueError if malformed or ambiguous.
    """
    numbers = parse_object(text)
    if numbers is not None:
        return numbers
    if not text.strip():
        raise ValueError("an object is missing: the word is empty")
    alias = (aliases or {}).get(normalised(text))
    if alias is not None:
        return resolve_object(alias, dictionary)
    if dictionary is None:
        raise UnknownName(f"{text!r} is a name, and there is no EDS to look it up in")
    return _by_name(text, dictionary, aliases or {})


def _by_name(text: str, dictionary: ObjectDictionary, aliases: Mapping[str, str]) -> tuple[int, int]:
    found = dictionary.find(text)
    if not found:
        close = partial(similar, text, dictionary, aliases)
        raise UnknownName(f"no object is named {text!r} in {dictionary.source}", close)
    chosen = _only(found, dictionary, text)
    if chosen is None:
        raise AmbiguousName(text, found, dictionary)
    return chosen.index, chosen.sub_index


def _only(found: list[OdEntry], dictionary: ObjectDictionary, text: str) -> OdEntry | None:
    """The unambiguous entry: a one-entry object's own name wins over equal names of sub-indices."""
    if len(found) == 1:
        return found[0]
    whole = [entry for entry in found if len(dictionary[entry.index].entries) == 1]
    exact = [entry for entry in found if entry.name == text]
    return next((choice[0] for choice in (whole, exact) if len(choice) == 1), None)


#: index and sub-index written as one number, or with a prefix each
_DIGITS = re.compile(r"(?:0x)?([0-9A-Fa-f]{4})[:.]?(?:0x)?([0-9A-Fa-f]{2})(?:[:/]\d+)?")


def similar(
    text: str, dictionary: ObjectDictionary, aliases: Mapping[str, str], direction: Direction | None = None
) -> list[str]:
    """Names close to *text*, best first, at most three; with *direction* first those that such a PDO is for."""
    wanted = normalised(text)
    digits = _DIGITS.fullmatch(text)
    if digits is not None and (
        any(map(str.isdecimal, text)) or dictionary.entry(int(digits[1], 16), int(digits[2], 16)) is not None
    ):  # otherwise it is a word such as `decade`
        return [f"{digits[1]}:{digits[2]}".upper()]
    entries = list(dictionary.entries())
    own = [normalised(name) for entry in entries for name in (entry.name, entry.denotation)]
    close = _close(wanted, [*aliases, *filter(None, own)])
    if direction is None:
        return close
    suited = [entry for entry in entries if entry.pdo_mapping and _suits(entry, direction)]
    usual = {address: place for place, address in enumerate(USUAL)}
    suited.sort(key=lambda entry: usual.get((entry.index, entry.sub_index), len(usual)))
    first = [name for entry in suited if len(wanted) > 2 and wanted in (name := normalised(entry.name))]
    meant = {normalised(entry.name) for entry in suited}
    return list(dict.fromkeys([*(name for name in close if name in meant), *first, *close]))[:3]


def _close(wanted: str, names: Sequence[str]) -> list[str]:
    from difflib import get_close_matches

    close = get_close_matches(wanted, dict.fromkeys(names), n=3, cutoff=0.6)
    return close or list(dict.fromkeys(name for name in names if len(wanted) > 2 and wanted in name))[:3]


def _suits(entry: OdEntry, direction: Direction) -> bool:
    """Whether a TPDO sends what the device sets, an RPDO what it is given."""
    return entry.access.writable is (direction is Direction.RPDO)


#: what drives (CiA 402) and I/O modules (CiA 401) map first, in this order
USUAL: tuple[tuple[int, int], ...] = (
    (0x6041, 0), (0x6040, 0), (0x606C, 0), (0x6064, 0), (0x60FF, 0), (0x607A, 0), (0x6077, 0), (0x6061, 0),
    (0x6060, 0), (0x6000, 1), (0x6200, 1), (0x6401, 1), (0x6411, 1),
)  # fmt: skip


def resolve_entry(
    text: str, dictionary: ObjectDictionary | None, aliases: Mapping[str, str] | None = None
) -> MappedObject | Skipped:
    """A mapping entry as typed: an object, optionally `/BITS`, or `dummy/BITS`.

    The whole word is tried as a name first, since names contain `/`. Raises as `resolve_object`, and ValueError for a
    length outside 1..64.
    """
    try:
        return MappedObject(*resolve_object(text, dictionary, aliases))
    except ValueError:
        head, slash, tail = text.rpartition("/")
        if not slash:
            raise
    bits = _length(text, tail)
    if head.lower() == "dummy":
        return Skipped(bits)
    return MappedObject(*resolve_object(head, dictionary, aliases), bits)


def _length(text: str, digits: str) -> int:
    if not _BITS.fullmatch(digits) or not 1 <= int(digits) <= MAX_PDO_BITS:
        raise ValueError(f"{text!r}: after / write a length in bits, 1..{MAX_PDO_BITS}")
    return int(digits)


def parse_cob_id(text: str) -> int:
    """Read a CAN-ID written in hexadecimal **with** `0x`. Raises ValueError with a hint otherwise."""
    if re.fullmatch(r"0[xX][0-9A-Fa-f]{1,8}", text):
        value = int(text, 16)
        if value <= 0x1FFF_FFFF:
            return value
        raise ValueError(
            f"{text} is more than a CAN-ID's 29 bits; bits 29..31 (extended, RTR, valid) have options of their own"
        )
    if re.fullmatch(r"[0-9A-Fa-f]{1,8}", text):
        likely = text.isdecimal() and PDO_CAN_IDS[0] <= int(text) <= PDO_CAN_IDS[1]
        decimal = f"0x{int(text):X} (decimal {text}) or " if likely else ""
        raise ValueError(f"{text!r}: a COB-ID is written in hexadecimal with 0x; {decimal}0x{text}?")
    raise ValueError(f"{text!r} is not a COB-ID; write 0x201, auto or keep")
