"""DBC files: their messages as layouts, by cantools (an optional extra), and messages written as DBC text."""

from __future__ import annotations

import json
import math
import re
import struct
import unicodedata
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.datatypes import Value
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.scaling import Scaling
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.bounded_process import BoundedProcess, child_command
from dvtcli.files.dbc_child import MOST_CPU_S, MOST_MEMORY
from dvtcli.files.extras import require
from dvtcli.files.input_file import read_input
from dvtcli.watch.decoder import Address, Layout, Signal, SignalPlace
from dvtcli.watch.service import Service

#: a line found in every DBC file: version, nodes, or a message
_SECTION = re.compile(r"^[ \t]*(?:VERSION\b|NS_[ \t]*:|BS_[ \t]*:|BU_[ \t]*:|BO_\s)", re.MULTILINE)
#: maximum size; DBC files of whole cars have 5 MB
_MOST_BYTES, _MOST_ENTRIES = 8 << 20, 100_000
#: a message's length in bytes; a signal's first bit and number of bits
_SIZES = re.compile(r"^[ \t]*(?:BO_[ \t]+\d+[ \t]+\w+[ \t]*:[ \t]*(\d+)|SG_[^:\n]*:[ \t]*(\d+)\|(\d+)@)", re.MULTILINE)
#: maximum length of a message (ISO 15765-2)
_MOST_MESSAGE_BYTES = 4095
#: limits of cantools: time (s) on a busy machine, and size of the output (bytes)
_SECONDS, _MOST_ANSWER = 3.0 * MOST_CPU_S, 48 << 20
_DESCRIBING = (".eds", ".dcf", ".xdd", ".xdc")
_TAKES = Hint(Action.GIVE_DBC, why="{} takes a DBC file or a network file (.yaml)")
_INSTEAD = Hint(Action.GIVE_DBC, {"file": "net.yaml"}, "a network file ({})") + Hint(
    Action.GIVE_EDS, why=" or {} decodes without it"
)
#: real numbers of IEEE 754, by their length in bits
_REALS = {16: struct.Struct(">e"), 32: struct.Struct(">f"), 64: struct.Struct(">d")}


def read_dbc(file: str) -> dict[Address, Layout]:
    """Read the messages of *file*.

    Raises UsageError if the file or cantools is missing, InputFileError if the file is no DBC.
    """
    path = Path(file)
    try:
        data = read_input(path, _MOST_BYTES, "DBC")
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", hint=_TAKES) from failed
    text = data.decode("cp1252", errors="replace")
    if not _SECTION.search(text):
        raise InputFileError(
            f"{path.name} is not a DBC file", why="it has no section of one", hint=_hint(path), place=file
        )
    _refuse_sizes(text, path)
    require("cantools", "dbc", f"reading {path.name}, a DBC file,", instead=_INSTEAD)
    messages = _messages(data, path)
    names = Counter(said["name"] for said in messages)
    for said in messages:
        if names[said["name"]] > 1:  # values of both would be in one column
            said["name"] += f" {can_id_text(said['id'], extended=said['extended'])}"
    return {(said["id"], said["extended"]): _layout(said, path.name) for said in messages}


def _messages(data: bytes, path: Path) -> list[dict[str, Any]]:
    """Parse *data* with cantools in a child process with limits of time and memory: cantools has none."""
    with BoundedProcess(child_command("dvtcli.files.dbc_child"), "cantools") as process:
        answer = b""
        with process.within(_SECONDS):
            try:
                process.stdin.write(data)
                process.stdin.close()
            except OSError:  # it has ended: why is told below
                pass
            else:
                answer = process.stdout.read(_MOST_ANSWER + 1)
        if not answer:
            lacks_memory, how = process.last_words()
            if process.lacked_time:
                raise _too_much(path, f"{MOST_CPU_S} s")
            if lacks_memory:
                raise _too_much(path, f"{MOST_MEMORY >> 20} MB")
            raise InputFileError(f"{path.name} cannot be read", why=f"cantools: {how}", place=str(path))
    if len(answer) > _MOST_ANSWER:
        raise _too_much(path, f"{_MOST_ANSWER >> 20} MB")
    read = json.loads(answer)
    if "wrong" in read:
        raise InputFileError(f"{path.name} is not a DBC file", why=read["wrong"], place=str(path))
    messages: list[dict[str, Any]] = read["messages"]
    return messages


def _too_much(path: Path, what: str) -> InputFileError:
    return InputFileError(
        f"{path.name} cannot be read", why=f"cantools takes more than {what} for it", place=str(path),
        hint="leave out the messages that are not needed",
    )  # fmt: skip


def _refuse_sizes(text: str, path: Path) -> None:
    """Raise InputFileError if a message or signal is larger than CAN allows, or the file has too many."""
    for number, found in enumerate(_SIZES.finditer(text)):
        if number >= _MOST_ENTRIES:
            what = f"more than {_MOST_ENTRIES:,} messages and signals"
            raise InputFileError(f"{path.name}: {what}", place=str(path), why="a DBC file of a machine has fewer")
        length, *bits = (0 if digits is None else int(digits[:20]) for digits in found.groups())
        if length > _MOST_MESSAGE_BYTES or any(bit > 8 * _MOST_MESSAGE_BYTES for bit in bits):
            line = text.count("\n", 0, found.start()) + 1
            raise InputFileError(
                f"{path.name}:{line}: no message has more than {_MOST_MESSAGE_BYTES} bytes", place=f"{path}:{line}"
            )


def _hint(path: Path) -> Hint:
    """Say how to get a DBC file."""
    described = path.suffix.lower() in _DESCRIBING
    takes = Hint(Action.GIVE_EDS, {"file": path.name}, "takes an EDS, DCF, XDD or XDC")
    return takes if described else _TAKES


def _layout(said: Mapping[str, Any], file: str) -> Layout:
    """Convert a message as cantools describes it; values are scaled on reading, so only the unit is kept."""
    signals = tuple(
        Signal(signal["name"], signal["name"], "", _of_unit(signal["unit"]),
               place=SignalPlace(signal["start"], signal["bits"], signal["big_endian"]))
        for signal in said["signals"]
    )  # fmt: skip
    read = _reader(said["signals"], said["length"])
    return Layout(Service("message", said["name"]), signals, read, byte_length=said["length"], source=file)


@cache
def _of_unit(unit: str) -> Scaling:
    return Scaling(unit)


@dataclass(slots=True)
class _Field:
    """A signal in a frame: *bits* bits from bit *begin* on, counted in the signal's byte order.

    *chooser* is the position of the signal's multiplexor among the fields. The frame contains the signal only if the
    multiplexor's value is within a range of *firsts* to *lasts*. *depth* counts the multiplexors above it; -1: never
    sent.
    """

    begin: int
    bits: int
    is_big_endian: bool
    is_signed: bool
    is_real: bool
    scale: float
    offset: float
    chooser: int | None
    firsts: Sequence[int]
    lasts: Sequence[int]
    depth: int = 0

    def raw(self, little: int, big: int, length_bits: int) -> Value | None:
        """Return the unscaled value from a frame of *length_bits*, given as both numbers; None if not contained."""
        end = self.begin + self.bits
        if end > length_bits:
            return None
        number = (big >> length_bits - end if self.is_big_endian else little >> self.begin) & (1 << self.bits) - 1
        if self.is_real:
            kind = _REALS.get(self.bits)
            return None if kind is None else float(kind.unpack(number.to_bytes(self.bits // 8, "big"))[0])
        return number - (1 << self.bits) if self.is_signed and number >> self.bits - 1 else number

    def scaled(self, raw: Value | None) -> Value | None:
        """Return *raw* scaled; None for a number beyond the range of a double, unfit to draw or compare."""
        if not isinstance(raw, int | float):
            return None
        try:
            value = raw if self.scale == 1 and self.offset == 0 else raw * self.scale + self.offset
            float(value)
        except OverflowError:
            return None
        return value

    def is_chosen_by(self, value: Value | None) -> bool:
        """Whether the frame contains this signal if the multiplexor has this *value*."""
        if not isinstance(value, int | float) or not isfinite(value):
            return False
        at = bisect_right(self.firsts, int(value)) - 1
        return at >= 0 and int(value) <= self.lasts[at]


def _fields(signals: Sequence[Mapping[str, Any]]) -> list[_Field]:
    places = {signal["name"]: place for place, signal in enumerate(signals)}
    fields = [_field(signal, places) for signal in signals]
    for signal in fields:
        above = [signal]
        while (chooser := above[-1].chooser) is not None and len(above) <= len(fields) and not above[-1].depth:
            above.append(fields[chooser])
        is_circle = len(above) > len(fields)
        depth = -1 if is_circle or above[-1].depth < 0 else above[-1].depth
        for multiplexed in reversed(above[:-1]):
            depth = depth if depth < 0 else depth + 1
            multiplexed.depth = depth
    return fields


def _field(said: Mapping[str, Any], places: Mapping[str, int]) -> _Field:
    start, scale, offset, chosen_by = said["start"], said["scale"], said["offset"], said["chosen_by"]
    if not said["real"] and all(isinstance(number, int) or number.is_integer() for number in (scale, offset)):
        scale, offset = int(scale), int(offset)
    multiplexor = said["multiplexor"]
    chooser = None if multiplexor is None else places.get(multiplexor)
    return _Field(
        begin=8 * (start // 8) + 7 - start % 8 if said["big_endian"] else start, bits=said["bits"],
        is_big_endian=said["big_endian"], is_signed=said["signed"], is_real=said["real"], scale=scale, offset=offset,
        chooser=chooser, firsts=[first for first, _ in chosen_by], lasts=[last for _, last in chosen_by],
        depth=-1 if multiplexor is not None and chooser is None else 0,
    )  # fmt: skip


def _reader(signals: Sequence[Mapping[str, Any]], length: int) -> Callable[[bytes], list[Value | None]]:
    """Return a function from a frame's data to a value for each of *signals*; None for an absent signal."""

    @cache
    def fields_and_chosen() -> tuple[list[_Field], list[int]]:
        """Build the fields, and the positions of multiplexed fields, on first use: most messages never occur."""
        fields = _fields(signals)
        chosen = (place for place, field in enumerate(fields) if field.depth)
        return fields, sorted(chosen, key=lambda place: fields[place].depth)

    def read(data: bytes) -> list[Value | None]:
        fields, chosen = fields_and_chosen()
        data = data[:length]
        little, big, bits = int.from_bytes(data, "little"), int.from_bytes(data, "big"), 8 * len(data)
        values = [field.scaled(field.raw(little, big, bits)) for field in fields]
        for place in chosen:  # multiplexors come before what they choose
            field = fields[place]
            if field.chooser is None or field.depth < 0 or not field.is_chosen_by(values[field.chooser]):
                values[place] = None
        return values

    return read


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
