"""Write a DBC file's text by the format's rules for names, numbers and strings; needs no package.

Equal messages give equal bytes: the text has no time, place or version.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

SUFFIX = ".dbc"
#: the unnamed sender or receiver
NOBODY = "Vector__XXX"
#: maximum length of names; older tools cut longer names
LONGEST_NAME = 32
#: bit 31 of a message's number: it has a 29-bit CAN-ID
_EXTENDED = 1 << 31
#: decimal digits of a double
_DIGITS = 17
_KEYWORDS = frozenset(
    "VERSION NS_ NS_DESC_ BS_ BU_ BO_ SG_ EV_ CM_ BA_ BA_DEF_ BA_DEF_DEF_ BA_REL_ BA_DEF_REL_ BA_DEF_DEF_REL_ VAL_ "
    "VAL_TABLE_ CAT_ CAT_DEF_ CAT_REL_ FILTER ENVVAR_DATA_ EV_DATA_ SGTYPE_ SGTYPE_VAL_ SIG_GROUP_ SIG_VALTYPE_ "
    "SIGTYPE_VALTYPE_ SG_MUL_VAL_ BO_TX_BU_ BU_SG_REL_ BU_EV_REL_ BU_BO_REL_ VECTOR__XXX".casefold().split()
)


@dataclass(frozen=True, slots=True)
class DbcSignal:
    """A little-endian signal; *start* is its least significant bit, counted from bit 0 of byte 0.

    *low* and *high* are physical limits, both None for none. *values* are words for raw values.
    """

    name: str
    start: int
    bits: int
    signed: bool = False
    is_real: bool = False
    factor: Fraction = Fraction(1)
    offset: Fraction = Fraction(0)
    unit: str = ""
    low: Fraction | float | None = None
    high: Fraction | float | None = None
    values: Mapping[int, str] = field(default_factory=dict)
    receivers: tuple[str, ...] = ()
    comment: str = ""
    #: the uncut name, if *name* is cut
    long_name: str = ""

    @property
    def end(self) -> int:
        """The bit after the last bit."""
        return self.start + self.bits


@dataclass(frozen=True, slots=True)
class DbcMessage:
    """A message of *length* bytes; *cycle_ms* is 0 if the cycle is unknown."""

    can_id: int
    extended: bool
    name: str
    length: int
    sender: str = NOBODY
    signals: tuple[DbcSignal, ...] = ()
    comment: str = ""
    cycle_ms: int = 0

    @property
    def number(self) -> int:
        """The CAN-ID in the file's form."""
        return self.can_id | (_EXTENDED if self.extended else 0)


class Names:
    """Unique names by the rules of DBC files: letters, digits and `_`, unique also without case."""

    def __init__(self, longest: int = LONGEST_NAME) -> None:
        self._longest = longest
        self._taken: set[str] = set(_KEYWORDS)
        self._whole: dict[str, str] = {}

    def new(self, text: str, otherwise: str) -> str:
        """Return a new name like *text*, *otherwise* if no character is usable; `_2` etc. if already taken.

        If a text with parts (`Analogue inputs 16-bit.Input 1`) is too long, the last part counts.
        """
        whole = word = _legal(text) or otherwise
        if len(word) > self._longest:
            word = _legal(text.rpartition(".")[2]) or word
        name, number = word[: self._longest].rstrip("_") or "_", 1
        while name.casefold() in self._taken:
            number += 1
            tail = f"_{number}"
            name = word[: self._longest - len(tail)].rstrip("_") + tail
        self._taken.add(name.casefold())
        if len(whole) > self._longest:
            self._keep_whole(name, whole)
        return name

    def _keep_whole(self, name: str, whole: str) -> None:
        taken, found, number = {kept.casefold() for kept in self._whole.values()}, whole, 1
        while found.casefold() in taken:
            number += 1
            found = f"{whole}_{number}"
        self._whole[name] = found

    def whole(self, name: str) -> str:
        """Return the unshortened form of *name*, a result of `new`; empty if *name* is not shortened."""
        return self._whole.get(name, "")


def _legal(text: str) -> str:
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    word = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_")
    return f"_{word}" if word[:1].isdigit() else word


def dbc_bytes(nodes: Mapping[str, str], messages: Sequence[DbcMessage]) -> bytes:
    """Return the file of *messages* and *nodes* (comments by name); all names must come from `Names`."""
    lines = ['VERSION ""', "", "NS_ :", "", "BS_:", "", f"BU_: {' '.join(nodes)}".rstrip(), ""]
    for message in messages:
        lines += (_message_line(message), *map(_signal_line, message.signals), "")
    lines += (*_comments(nodes, messages), *_attributes(messages), *_words(messages), *_reals(messages))
    return "".join(f"{line}\r\n" for line in lines).encode("cp1252", "replace")


def _message_line(message: DbcMessage) -> str:
    return f"BO_ {message.number} {message.name}: {message.length} {message.sender}"


def _signal_line(one: DbcSignal) -> str:
    place = f"{one.start}|{one.bits}@1{'-' if one.signed or one.is_real else '+'}"
    scale = f"({decimal(one.factor)},{decimal(one.offset)})"
    low, high = decimal(one.low or 0), decimal(one.high or 0)
    receivers = ",".join(one.receivers) or NOBODY
    return f" SG_ {one.name} : {place} {scale} [{low}|{high}] {quoted(one.unit)} {receivers}"


def _comments(nodes: Mapping[str, str], messages: Iterable[DbcMessage]) -> Iterator[str]:
    for name, comment in nodes.items():
        if comment:
            yield f"CM_ BU_ {name} {quoted(comment)};"
    for message in messages:
        if message.comment:
            yield f"CM_ BO_ {message.number} {quoted(message.comment)};"
        for signal in message.signals:
            if signal.comment:
                yield f"CM_ SG_ {message.number} {signal.name} {quoted(signal.comment)};"


def _attributes(messages: Iterable[DbcMessage]) -> Iterator[str]:
    yield 'BA_DEF_ "BusType" STRING ;'
    yield 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 4294967;'
    yield 'BA_DEF_ SG_ "SystemSignalLongSymbol" STRING ;'
    yield 'BA_DEF_DEF_ "BusType" "CAN";'
    yield 'BA_DEF_DEF_ "GenMsgCycleTime" 0;'
    yield 'BA_DEF_DEF_ "SystemSignalLongSymbol" "";'
    for message in messages:
        if message.cycle_ms:
            yield f'BA_ "GenMsgCycleTime" BO_ {message.number} {message.cycle_ms};'
        for signal in message.signals:
            if signal.long_name:
                yield f'BA_ "SystemSignalLongSymbol" SG_ {message.number} {signal.name} "{signal.long_name}";'


def _words(messages: Iterable[DbcMessage]) -> Iterator[str]:
    for message in messages:
        for signal in message.signals:
            if signal.values:
                words = " ".join(f"{raw} {quoted(word)}" for raw, word in sorted(signal.values.items()))
                yield f"VAL_ {message.number} {signal.name} {words} ;"


def _reals(messages: Iterable[DbcMessage]) -> Iterator[str]:
    for message in messages:
        for signal in message.signals:
            if signal.is_real:
                yield f"SIG_VALTYPE_ {message.number} {signal.name} : {1 if signal.bits == 32 else 2};"


def quoted(text: str) -> str:
    r"""Return *text* as a DBC string on one line, with ' and / instead of " and `\`: tools differ in reading them."""
    plain = text.replace('"', "'").replace("\\", "/").replace("\u03bc", "\u00b5").replace("\u03a9", "Ohm")
    return f'"{" ".join("".join(character if character.isprintable() else " " for character in plain).split())}"'


def decimal(number: Fraction | float) -> str:
    """Return *number* in decimal: exact if 17 digits suffice, else the nearest double."""
    if isinstance(number, float):
        return repr(number) if math.isfinite(number) else "0"
    exact = Fraction(number)
    places = _places(exact.denominator)
    if places is None or len(str(abs(exact.numerator) * 10**places // exact.denominator)) > _DIGITS:
        return repr(float(exact)) if exact.denominator != 1 else str(exact.numerator)
    digits = f"{abs(exact.numerator) * 10**places // exact.denominator:0{places + 1}}"
    text = f"{digits[:-places]}.{digits[-places:]}" if places else digits
    return f"-{text}" if exact < 0 else text


def _places(denominator: int) -> int | None:
    """Return the digits after the point for an exact fraction with *denominator*; None if none suffice."""
    places, rest = 0, denominator
    for prime in (2, 5):
        count = 0
        while rest % prime == 0:
            rest, count = rest // prime, count + 1
        places = max(places, count)
    return places if rest == 1 else None
