"""Words of `lss`: a node-ID, and the four numbers of an LSS address."""

from __future__ import annotations

from dvtcli.cli.params import NODE_ID
from dvtcli.domain.datatypes import parse_number
from dvtcli.domain.lss_services import LssAddress, LssRanges
from dvtcli.errors import UsageError

_PARTS = ("vendor", "product", "revision", "serial")
_HINT = "lss scan prints them: vendor=0x1E product=0x705302D revision=0x30000 serial=0x12345"


def no_words(words: tuple[str, ...]) -> None:
    """UsageError where something follows that takes nothing."""
    if words:
        raise UsageError(f"{words[0]}: nothing is expected here", hint="help lss")


def address_of_words(words: tuple[str, ...]) -> LssAddress:
    """The address that *words* say; UsageError where one of its four numbers is wrong, missing, or said twice."""
    said = {name: _number(word, number) for name, (word, number) in _parts(words).items()}
    missing = [name for name in _PARTS if name not in said]
    if missing:
        raise UsageError(f"an LSS address has four numbers: {', '.join(missing)} missing", hint=_HINT)
    return LssAddress(**said)


def address_or_ranges(words: tuple[str, ...]) -> LssAddress | LssRanges:
    """The address that *words* say, or ranges: `serial=LOW-HIGH`, and all of a revision or serial that is not said."""
    said = _parts(words)
    if said.keys() == set(_PARTS) and not any("-" in number for _, number in said.values()):
        return address_of_words(words)
    missing = [name for name in _PARTS[:2] if name not in said]
    if missing:
        raise UsageError(f"lss identify takes a vendor and a product: {', '.join(missing)} missing", hint=_HINT)
    vendor, product = (_number(*said[name]) for name in _PARTS[:2])
    revision, serial = (_range(*said[name]) if name in said else (0, 0xFFFFFFFF) for name in _PARTS[2:])
    return LssRanges(vendor, product, revision, serial)


def _parts(words: tuple[str, ...]) -> dict[str, tuple[str, str]]:
    """By name of a part the word that says it, and what that says."""
    said: dict[str, tuple[str, str]] = {}
    for word in words:
        name, equals, number = word.partition("=")
        if not equals or name not in _PARTS:
            raise UsageError(f"{word}: write vendor=… product=… revision=… serial=…", hint=_HINT)
        if name in said:
            raise UsageError(f"{name} is given twice", hint=_HINT)
        said[name] = word, number
    return said


def _number(word: str, number: str) -> int:
    try:
        said = parse_number(number)
    except ValueError as wrong:
        raise UsageError(f"{word}: {wrong}", hint=_HINT) from wrong
    if not 0 <= said <= 0xFFFFFFFF:
        raise UsageError(f"{word}: a number of 32 bits is 0…0xFFFFFFFF", hint=_HINT)
    return said


def _range(word: str, said: str) -> tuple[int, int]:
    low, dash, high = said.partition("-")
    ends = _number(word, low), _number(word, high if dash else low)
    if ends[0] > ends[1]:
        raise UsageError(f"{word}: the lower number first", hint="serial=0x10000-0x1FFFF")
    return ends


def node_id_and_address(words: tuple[str, ...]) -> tuple[int, LssAddress | None]:
    """The node-ID, and the address behind it where one is given."""
    if not words:
        raise UsageError("lss node-id needs the node-ID", hint="lss node-id 5")
    return _node_id(words[0]), address_of_words(words[1:]) if words[1:] else None


def node_or_address(words: tuple[str, ...]) -> LssAddress | int:
    """The node that is meant: its node-ID, or its address."""
    return _node_id(words[0]) if len(words) == 1 and "=" not in words[0] else address_of_words(words)


def only_node_id(words: tuple[str, ...]) -> int | None:
    """The node-ID, None where none is given."""
    no_words(words[1:])
    return _node_id(words[0]) if words else None


def one_file(words: tuple[str, ...]) -> str:
    """The network file that is named."""
    if len(words) != 1:
        raise UsageError("lss assign takes one network file", hint="lss assign press.yaml")
    return words[0]


def rate_and_file(words: tuple[str, ...]) -> tuple[int, str | None]:
    """The bit rate (bit/s), written `500k` or `500000`, and the network file behind it where one is given."""
    if not 1 <= len(words) <= 2:
        raise UsageError("lss bitrate takes a bit rate, and a network file or none", hint="lss bitrate 500k")
    digits = words[0].lower().removesuffix("bit/s").strip()
    factor = {"k": 1_000, "m": 1_000_000}.get(digits[-1:], 1)
    number = digits if factor == 1 else digits[:-1]
    if not (number.isascii() and number.isdigit() and len(number) <= 7):
        raise UsageError(f"{words[0]!r} is not a bit rate", hint="lss bitrate 500k, or 500000; 1M")
    return int(number) * factor, words[1] if len(words) == 2 else None


def _node_id(word: str) -> int:
    try:
        return NODE_ID.parse(word, None)
    except ValueError as wrong:
        raise UsageError(str(wrong), hint="lss node-id 5") from wrong
