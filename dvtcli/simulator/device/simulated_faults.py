"""What can go wrong with a simulated node, as words: `refuse@3=0x06040041`, `2:late@5=0.8`, `store-fails`.

Knows kinds, their numbers and their text form. Does not know how a fault is acted (`faulty`), nor clocks or buses.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple, Protocol, TypeVar

#: how long a node takes from a reset to its boot-up where `reset@K` does not say (s)
BOOT_S = 0.1
_LONGEST_S = 3600.0


class FaultKind(StrEnum):
    """What goes wrong, by the word that `--fault` takes."""

    REFUSE = "refuse"
    REFUSE_READ = "refuse-read"
    LOSE_REQUEST = "lose-request"
    LOSE_RESPONSE = "lose-response"
    LATE = "late"
    DUPLICATE = "duplicate"
    FOREIGN = "foreign"
    MALFORMED = "malformed"
    TOGGLE = "toggle"
    RESET = "reset"
    RESET_AFTER_READ = "reset-after-read"
    RESET_AT_READ = "reset-at-read"
    NO_BOOT_UP = "no-boot-up"
    ALTERS = "alters"
    ENABLE_ALTERS = "enable-alters"
    CORRECTS = "corrects"
    SILENT = "silent"
    BUS_ERROR = "bus-error"
    SLOW_STORE = "slow-store"
    STORE_FAILS = "store-fails"
    STORES_NOTHING = "stores-nothing"
    SAVES_ITSELF = "saves-itself"
    KEEPS_RAM = "keeps-ram"
    RESTORES_NOTHING = "restores-nothing"
    IGNORES_NMT = "ignores-nmt"
    EMCY = "emcy"
    BIT_RATE = "bit-rate"
    NO_BIT_TIMING = "no-bit-timing"
    KEEPS_BIT_RATE = "keeps-bit-rate"
    LOSES_BIT_RATE = "loses-bit-rate"
    FLASH_FAILS = "flash-fails"
    FLASH_ALTERS = "flash-alters"

    @property
    def counted(self) -> bool:
        """Whether it happens at one SDO download or upload, `@K`."""
        return self not in _LASTING

    @property
    def at_read(self) -> bool:
        """Whether K counts the uploads since the node's last download, instead of downloads."""
        return self in (FaultKind.REFUSE_READ, FaultKind.RESET_AFTER_READ, FaultKind.RESET_AT_READ)

    @property
    def of_bit_rate(self) -> bool:
        """Whether it is about the node's bit rate."""
        return self in (
            FaultKind.BIT_RATE,
            FaultKind.NO_BIT_TIMING,
            FaultKind.KEEPS_BIT_RATE,
            FaultKind.LOSES_BIT_RATE,
        )


#: what is wrong all the time
_LASTING = frozenset(
    {
        FaultKind.SLOW_STORE,
        FaultKind.STORE_FAILS,
        FaultKind.STORES_NOTHING,
        FaultKind.SAVES_ITSELF,
        FaultKind.KEEPS_RAM,
        FaultKind.RESTORES_NOTHING,
        FaultKind.IGNORES_NMT,
        FaultKind.NO_BOOT_UP,
        FaultKind.ENABLE_ALTERS,
        FaultKind.EMCY,
        FaultKind.BIT_RATE,
        FaultKind.NO_BIT_TIMING,
        FaultKind.KEEPS_BIT_RATE,
        FaultKind.LOSES_BIT_RATE,
        FaultKind.FLASH_FAILS,
        FaultKind.FLASH_ALTERS,
    }
)
_REFUSALS = (FaultKind.REFUSE, FaultKind.REFUSE_READ)
_RESETS = (FaultKind.RESET, FaultKind.RESET_AFTER_READ, FaultKind.RESET_AT_READ)
_TIMED = (FaultKind.LATE, *_RESETS, FaultKind.SLOW_STORE, FaultKind.CORRECTS, FaultKind.EMCY)
_CODED = (*_REFUSALS, FaultKind.EMCY, FaultKind.BIT_RATE)
#: the largest number of those that have one, and what it is
_LARGEST = {FaultKind.EMCY: (0xFFFF, "an error code"), FaultKind.BIT_RATE: (1_000_000, "a bit rate in bit/s")}
_ANY_ABORT = (0xFFFF_FFFF, "an abort code")
_ALTERING = (FaultKind.ALTERS, FaultKind.ENABLE_ALTERS)


class _Form(NamedTuple):
    """How a kind is written, and what it does."""

    text: str
    meaning: str


_FORMS = {
    FaultKind.REFUSE: _Form("refuse@K=CODE", "download K is answered with abort CODE (0x06040041)"),
    FaultKind.REFUSE_READ: _Form("refuse-read@K=CODE", "the K-th upload after a download is answered with abort CODE"),
    FaultKind.LOSE_REQUEST: _Form("lose-request@K", "the request never arrives"),
    FaultKind.LOSE_RESPONSE: _Form("lose-response@K", "it is carried out, the answer is lost"),
    FaultKind.LATE: _Form("late@K=S", "it is carried out, the answer comes S seconds late"),
    FaultKind.DUPLICATE: _Form("duplicate@K", "it is answered twice"),
    FaultKind.FOREIGN: _Form("foreign@K", "an answer for another object comes first"),
    FaultKind.MALFORMED: _Form("malformed@K", "it is carried out, the answer has 3 bytes only"),
    FaultKind.TOGGLE: _Form("toggle@K", "the next segment after download K has the wrong toggle bit"),
    FaultKind.RESET: _Form("reset@K[=S]", f"the node resets instead, and boots after S seconds [{BOOT_S:g}]"),
    FaultKind.RESET_AFTER_READ: _Form(
        "reset-after-read@K[=S]", "the node resets once it has answered the K-th upload after a download"
    ),
    FaultKind.RESET_AT_READ: _Form(
        "reset-at-read@K[=S]", "the node resets instead of answering the K-th upload after a download"
    ),
    FaultKind.NO_BOOT_UP: _Form("no-boot-up", "a reset by a fault ends without a boot-up message"),
    FaultKind.ALTERS: _Form("alters@K=INDEX:SUB:VALUE", "with download K the node changes another object of its own"),
    FaultKind.ENABLE_ALTERS: _Form(
        "enable-alters=INDEX:SUB:VALUE", "whenever a PDO is enabled the node changes that object"
    ),
    FaultKind.CORRECTS: _Form("corrects@K=S", "download K is taken, and the old value is back S seconds later"),
    FaultKind.SILENT: _Form("silent@K", "the node is dead from then on"),
    FaultKind.BUS_ERROR: _Form("bus-error@K", "the bus is dead from then on"),
    FaultKind.SLOW_STORE: _Form("slow-store=S", "every store is answered after S seconds"),
    FaultKind.STORE_FAILS: _Form("store-fails", "every store answers 0x06060000"),
    FaultKind.STORES_NOTHING: _Form("stores-nothing", "every store is acknowledged, and nothing is stored"),
    FaultKind.SAVES_ITSELF: _Form("saves-itself", "every write is stored at once, which 0x1010 does not tell"),
    FaultKind.KEEPS_RAM: _Form("keeps-ram", "an NMT reset leaves RAM as it is; only a power cycle does not"),
    FaultKind.RESTORES_NOTHING: _Form("restores-nothing", "every restore is acknowledged, and nothing is restored"),
    FaultKind.IGNORES_NMT: _Form("ignores-nmt", "NMT start, stop and pre-operational are not obeyed; resets are"),
    FaultKind.FLASH_FAILS: _Form("flash-fails", "no program can be written: 0x1F57 says so"),
    FaultKind.FLASH_ALTERS: _Form("flash-alters", "a program that is written has one byte wrong: 0x1F56 says so"),
    FaultKind.EMCY: _Form(
        "emcy=CODE[:S]", "the node raises error CODE (0x3210) S seconds after each start [0]; 0: its errors are gone"
    ),
    FaultKind.BIT_RATE: _Form("bit-rate=N", "the node runs at N bit/s (250000), and hears nothing else"),
    FaultKind.NO_BIT_TIMING: _Form("no-bit-timing", "LSS cannot tell it another bit rate: it refuses each"),
    FaultKind.KEEPS_BIT_RATE: _Form("keeps-bit-rate", "it takes another bit rate by LSS, and stays at the old one"),
    FaultKind.LOSES_BIT_RATE: _Form(
        "loses-bit-rate", "it takes another bit rate by LSS, and is not heard any more until it is switched off and on"
    ),
}
_FORM = re.compile(r"(?:(?P<node>\w+):)?(?P<kind>[a-z-]+)(?:@(?P<at>\w+))?(?:=(?P<value>.+))?")


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that goes wrong, once unless its kind says otherwise.

    - *at*: the SDO download at which it happens, from 1; None for the kinds that last. What counts are the
      requests of the node's SDO server that begin a download, refused ones too. So K is the step's number that
      `map` prints, as long as nothing (a login, a forced state, an earlier command) wrote to the node before.
    - *code*: the abort code of `refuse` and `refuse-read`, the error code of `emcy`, the bit rate (bit/s) of
      `bit-rate`. *seconds*: of the kinds that take a time, 0..3600.
    - *place*: index and sub-index of the object that the node changes by itself, and its *value* then.
    - *node_id*: 1..127, None for the first simulated node.
    """

    kind: FaultKind
    at: int | None = None
    code: int | None = None
    seconds: float | None = None
    node_id: int | None = None
    place: tuple[int, int] | None = None
    value: int | None = None

    def __post_init__(self) -> None:
        """Raise ValueError where a number is missing, has no meaning for the kind, or is out of its range."""
        if (self.at is not None) != self.kind.counted or (self.at is not None and self.at < 1):
            raise _wrong(self.kind, "K counts SDO downloads from 1")
        highest, what = _LARGEST.get(self.kind, _ANY_ABORT)
        if (self.code is not None) != (self.kind in _CODED) or not 0 <= (self.code or 0) <= highest:
            shown = str(highest) if self.kind is FaultKind.BIT_RATE else f"0x{highest:X}"
            raise _wrong(self.kind, f"the number is {what}, 0…{shown}")
        if (self.seconds is not None) != (self.kind in _TIMED) or not 0 <= (self.seconds or 0) <= _LONGEST_S:
            raise _wrong(self.kind, f"S is a time, 0…{_LONGEST_S:.0f} seconds")
        if (self.place is not None) != (self.kind in _ALTERING) or (self.place is None) != (self.value is None):
            raise _wrong(self.kind, "INDEX and SUB are hexadecimal, VALUE is decimal or 0x…")
        if self.node_id is not None and not 1 <= self.node_id <= 127:
            raise ValueError(f"node-ID {self.node_id} is not within 1…127")

    @classmethod
    def parse(cls, text: str) -> Fault:
        """Read `[NODE:]KIND[@K][=VALUE]`; ValueError says what would be right."""
        found = _FORM.fullmatch(text.strip())
        if found is None or found["kind"] not in list(FaultKind):
            raise ValueError(f"no such fault; there are {_known()}")
        kind, value = FaultKind(found["kind"]), found["value"]
        node_id = None if found["node"] is None else _whole(found["node"], kind)
        at = None if found["at"] is None else _whole(found["at"], kind)
        if kind in _REFUSALS or kind is FaultKind.BIT_RATE:
            return cls(kind, at, code=None if value is None else _whole(value, kind), node_id=node_id)
        if kind is FaultKind.EMCY:
            code, _, seconds = (value or "").partition(":")
            return cls(kind, at, code=_whole(code, kind), seconds=_seconds(seconds or "0", kind), node_id=node_id)
        if kind in _ALTERING:
            place, number = _alteration(value or "", kind)
            return cls(kind, at, node_id=node_id, place=place, value=number)
        if value is None and kind in _RESETS:
            return cls(kind, at, seconds=BOOT_S, node_id=node_id)
        return cls(kind, at, seconds=None if value is None else _seconds(value, kind), node_id=node_id)

    def __str__(self) -> str:
        text = "" if self.node_id is None else f"{self.node_id}:"
        text += self.kind if self.at is None else f"{self.kind}@{self.at}"
        if self.kind is FaultKind.EMCY:
            return f"{text}=0x{self.code or 0:04X}:{self.seconds!r}"
        if self.code is not None:
            return f"{text}={self.code}" if self.kind is FaultKind.BIT_RATE else f"{text}=0x{self.code:08X}"
        if self.place is not None:
            return f"{text}={self.place[0]:04X}:{self.place[1]:02X}:0x{self.value:X}"
        return text if self.seconds is None else f"{text}={self.seconds!r}"


def read_faults(words: Iterable[str], node_ids: Sequence[int]) -> tuple[Fault, ...]:
    """What each of *words* says, for nodes *node_ids*; ValueError names the word that is wrong.

    Wrong are also a node that is not simulated, and two faults at one download.
    """
    found: dict[tuple[object, ...], Fault] = {}
    for word in words:
        try:
            fault = Fault.parse(word)
        except ValueError as wrong:
            raise ValueError(f"{word}: {wrong}") from wrong
        node_id = node_ids[0] if fault.node_id is None else fault.node_id
        if node_id not in node_ids:
            raise ValueError(f"{word}: no simulated node {node_id}")
        key = (node_id, fault.kind.at_read, fault.at or (fault.kind, fault.code))
        if key in found:
            raise ValueError(f"{word}: {found[key]} happens there already")
        found[key] = fault
    return tuple(found.values())


class _Directed(Protocol):
    """What is meant for one node."""

    @property
    def node_id(self) -> int | None:
        """Which one, 1..127; None for the first simulated node."""
        ...


_Each = TypeVar("_Each", bound=_Directed)


def own_of(node_id: int, first: int, them: Iterable[_Each]) -> tuple[_Each, ...]:
    """Those of *them* that are *node_id*'s, where *first* is the first simulated node."""
    return tuple(each for each in them if (first if each.node_id is None else each.node_id) == node_id)


def _known() -> str:
    """Every kind as it is written, in one line."""
    return ", ".join(form.text for form in _FORMS.values())


def _wrong(kind: FaultKind, why: str) -> ValueError:
    form = _FORMS[kind]
    return ValueError(f"it is written {form.text} ({form.meaning}); {why}")


def _alteration(text: str, kind: FaultKind) -> tuple[tuple[int, int], int]:
    """An object and the value that it takes, `1801:01:0xC0000281`."""
    found = re.fullmatch(r"(?:0x)?([0-9a-fA-F]{4}):([0-9a-fA-F]{1,2}):(\w+)", text)
    if found is None:
        raise _wrong(kind, f"{text!r} is no object with a value")
    return (int(found[1], 16), int(found[2], 16)), _whole(found[3], kind)


def _whole(text: str, kind: FaultKind) -> int:
    """A number, decimal or `0x…`."""
    if not re.fullmatch(r"\d{1,10}|0[xX][0-9a-fA-F]{1,8}", text, re.ASCII):
        raise _wrong(kind, f"{text!r} is no number")
    return int(text, 16 if text[1:2] in ("x", "X") else 10)


def _seconds(text: str, kind: FaultKind) -> float:
    if not re.fullmatch(r"\d{1,9}(\.\d{1,9})?", text, re.ASCII):
        raise _wrong(kind, f"{text!r} is no time in seconds")
    return float(text)
