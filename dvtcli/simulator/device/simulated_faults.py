"""Faults of a simulated node and their text form: `refuse@3=0x06040041`, `2:late@5=0.8`, `store-fails`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple, Protocol, TypeVar

_LONGEST_S = 3600.0
_FORM = re.compile(r"(?:(?P<node>\w+):)?(?P<kind>[a-z-]+)(?:@(?P<at>\w+))?(?:=(?P<value>.+))?")


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault, happening once unless its kind lasts.

    - *at*: the SDO download at which the fault happens, from 1; None for lasting kinds. Counted are the requests
      to the node's SDO server that begin a download, including refused requests. So K is the step's number
      printed by `map`, if nothing (a login, a forced state, an earlier command) wrote to the node before.
    - *code*: the abort code of `refuse` and `refuse-read`, the error code of `emcy`, the bit rate (bit/s) of
      `bit-rate`. *seconds*: the time of kinds with a time, 0..3600.
    - *place*: index and sub-index of the object changed by the node, and its new *value*.
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
        """Raise ValueError if a number is missing, unsuitable for the kind, or out of range."""
        if (self.at is not None) != self.kind.counted or (self.at is not None and self.at < 1):
            raise wrong_fault(self.kind, "K counts SDO downloads from 1")
        highest, what = LARGEST.get(self.kind, ANY_ABORT)
        if (self.code is not None) != (self.kind in CODED) or not 0 <= (self.code or 0) <= highest:
            shown = str(highest) if self.kind is FaultKind.BIT_RATE else f"0x{highest:X}"
            raise wrong_fault(self.kind, f"the number is {what}, 0…{shown}")
        if (self.seconds is not None) != (self.kind in TIMED) or not 0 <= (self.seconds or 0) <= _LONGEST_S:
            raise wrong_fault(self.kind, f"S is a time, 0…{_LONGEST_S:.0f} seconds")
        if (self.place is not None) != (self.kind in ALTERING) or (self.place is None) != (self.value is None):
            raise wrong_fault(self.kind, "INDEX and SUB are hexadecimal, VALUE is decimal or 0x…")
        if self.node_id is not None and not 1 <= self.node_id <= 127:
            raise ValueError(f"node-ID {self.node_id} is not within 1…127")

    @classmethod
    def parse(cls, text: str) -> Fault:
        """Read `[NODE:]KIND[@K][=VALUE]`. Raises ValueError with the correct form."""
        found = _FORM.fullmatch(text.strip())
        if found is None or found["kind"] not in list(FaultKind):
            raise ValueError(f"no such fault; there are {known_kinds()}")
        kind, value = FaultKind(found["kind"]), found["value"]
        node_id = None if found["node"] is None else _whole_number(found["node"], kind)
        at = None if found["at"] is None else _whole_number(found["at"], kind)
        if kind in REFUSALS or kind is FaultKind.BIT_RATE:
            return cls(kind, at, code=None if value is None else _whole_number(value, kind), node_id=node_id)
        if kind is FaultKind.EMCY:
            code, _, seconds = (value or "").partition(":")
            return cls(
                kind, at, code=_whole_number(code, kind), seconds=_seconds(seconds or "0", kind), node_id=node_id
            )
        if kind in ALTERING:
            place, number = _alteration(value or "", kind)
            return cls(kind, at, node_id=node_id, place=place, value=number)
        if value is None and kind in RESETS:
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
    """The faults in *words*, for nodes *node_ids*. Raises ValueError naming the wrong word.

    Also wrong: a node that is not simulated, and two faults at one download.
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
    """An item for one node."""

    @property
    def node_id(self) -> int | None:
        """The node-ID, 1..127; None for the first simulated node."""
        ...


_Each = TypeVar("_Each", bound=_Directed)


def own_of(node_id: int, first: int, them: Iterable[_Each]) -> tuple[_Each, ...]:
    """The items of *them* for *node_id*; *first* is the first simulated node."""
    return tuple(each for each in them if (first if each.node_id is None else each.node_id) == node_id)


def _alteration(text: str, kind: FaultKind) -> tuple[tuple[int, int], int]:
    """An object and its new value, `1801:01:0xC0000281`."""
    found = re.fullmatch(r"(?:0x)?([0-9a-fA-F]{4}):([0-9a-fA-F]{1,2}):(\w+)", text)
    if found is None:
        raise wrong_fault(kind, f"{text!r} is not an object with a value")
    return (int(found[1], 16), int(found[2], 16)), _whole_number(found[3], kind)


def _whole_number(text: str, kind: FaultKind) -> int:
    """A number, decimal or `0x…`."""
    if not re.fullmatch(r"\d{1,10}|0[xX][0-9a-fA-F]{1,8}", text, re.ASCII):
        raise wrong_fault(kind, f"{text!r} is not a number")
    return int(text, 16 if text[1:2] in ("x", "X") else 10)


def _seconds(text: str, kind: FaultKind) -> float:
    if not re.fullmatch(r"\d{1,9}(\.\d{1,9})?", text, re.ASCII):
        raise wrong_fault(kind, f"{text!r} is not a time in seconds")
    return float(text)


#: how long a node takes from a reset to its boot-up where `reset@K` does not say (s)
BOOT_S = 0.1


class FaultKind(StrEnum):
    """A kind of fault, by its name in `--fault`."""

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
        """True if the fault happens at one SDO download or upload, `@K`."""
        return self not in _LASTING

    @property
    def at_read(self) -> bool:
        """True if K counts the uploads since the node's last download instead of downloads."""
        return self in (FaultKind.REFUSE_READ, FaultKind.RESET_AFTER_READ, FaultKind.RESET_AT_READ)

    @property
    def of_flash(self) -> bool:
        """True if the fault concerns the flash memory of a boot loader."""
        return self in (FaultKind.FLASH_FAILS, FaultKind.FLASH_ALTERS)

    @property
    def of_bit_rate(self) -> bool:
        """True if the fault concerns the node's bit rate."""
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
REFUSALS = (FaultKind.REFUSE, FaultKind.REFUSE_READ)
RESETS = (FaultKind.RESET, FaultKind.RESET_AFTER_READ, FaultKind.RESET_AT_READ)
TIMED = (FaultKind.LATE, *RESETS, FaultKind.SLOW_STORE, FaultKind.CORRECTS, FaultKind.EMCY)
CODED = (*REFUSALS, FaultKind.EMCY, FaultKind.BIT_RATE)
#: the largest number of those that have one, and what it is
LARGEST = {FaultKind.EMCY: (0xFFFF, "an error code"), FaultKind.BIT_RATE: (1_000_000, "a bit rate in bit/s")}
ANY_ABORT = (0xFFFF_FFFF, "an abort code")
ALTERING = (FaultKind.ALTERS, FaultKind.ENABLE_ALTERS)


class Form(NamedTuple):
    """The text form and the effect of a kind."""

    text: str
    meaning: str


FORMS = {
    FaultKind.REFUSE: Form("refuse@K=CODE", "download K is answered with abort CODE (0x06040041)"),
    FaultKind.REFUSE_READ: Form("refuse-read@K=CODE", "the K-th upload after a download is answered with abort CODE"),
    FaultKind.LOSE_REQUEST: Form("lose-request@K", "the request never arrives"),
    FaultKind.LOSE_RESPONSE: Form("lose-response@K", "it is carried out, the answer is lost"),
    FaultKind.LATE: Form("late@K=S", "it is carried out, the answer comes S seconds late"),
    FaultKind.DUPLICATE: Form("duplicate@K", "it is answered twice"),
    FaultKind.FOREIGN: Form("foreign@K", "an answer for another object comes first"),
    FaultKind.MALFORMED: Form("malformed@K", "it is carried out, the answer has 3 bytes only"),
    FaultKind.TOGGLE: Form("toggle@K", "the next segment after download K has the wrong toggle bit"),
    FaultKind.RESET: Form("reset@K[=S]", f"the node resets instead, and boots after S seconds [{BOOT_S:g}]"),
    FaultKind.RESET_AFTER_READ: Form(
        "reset-after-read@K[=S]", "the node resets once it has answered the K-th upload after a download"
    ),
    FaultKind.RESET_AT_READ: Form(
        "reset-at-read@K[=S]", "the node resets instead of answering the K-th upload after a download"
    ),
    FaultKind.NO_BOOT_UP: Form("no-boot-up", "a reset by a fault ends without a boot-up message"),
    FaultKind.ALTERS: Form("alters@K=INDEX:SUB:VALUE", "with download K the node changes another object of its own"),
    FaultKind.ENABLE_ALTERS: Form(
        "enable-alters=INDEX:SUB:VALUE", "whenever a PDO is enabled the node changes that object"
    ),
    FaultKind.CORRECTS: Form("corrects@K=S", "download K is taken, and the old value is back S seconds later"),
    FaultKind.SILENT: Form("silent@K", "the node is dead from then on"),
    FaultKind.BUS_ERROR: Form("bus-error@K", "the bus is dead from then on"),
    FaultKind.SLOW_STORE: Form("slow-store=S", "every store is answered after S seconds"),
    FaultKind.STORE_FAILS: Form("store-fails", "every store answers 0x06060000"),
    FaultKind.STORES_NOTHING: Form("stores-nothing", "every store is acknowledged, and nothing is stored"),
    FaultKind.SAVES_ITSELF: Form("saves-itself", "every write is stored at once, although 0x1010 does not report it"),
    FaultKind.KEEPS_RAM: Form("keeps-ram", "an NMT reset leaves RAM as it is; only a power cycle does not"),
    FaultKind.RESTORES_NOTHING: Form("restores-nothing", "every restore is acknowledged, and nothing is restored"),
    FaultKind.IGNORES_NMT: Form("ignores-nmt", "NMT start, stop and pre-operational are not obeyed; resets are"),
    FaultKind.FLASH_FAILS: Form("flash-fails", "no program can be written: 0x1F57 reports it"),
    FaultKind.FLASH_ALTERS: Form("flash-alters", "a written program has a wrong byte: 0x1F56 reports it"),
    FaultKind.EMCY: Form(
        "emcy=CODE[:S]", "the node raises error CODE (0x3210) S seconds after each start [0]; 0: its errors are gone"
    ),
    FaultKind.BIT_RATE: Form("bit-rate=N", "the node runs at N bit/s (250000), and receives nothing else"),
    FaultKind.NO_BIT_TIMING: Form("no-bit-timing", "it refuses every other bit rate by LSS"),
    FaultKind.KEEPS_BIT_RATE: Form("keeps-bit-rate", "it takes another bit rate by LSS, and stays at the old one"),
    FaultKind.LOSES_BIT_RATE: Form(
        "loses-bit-rate", "it takes another bit rate by LSS, and is silent until it is switched off and on"
    ),
}


def known_kinds() -> str:
    """The text forms of every kind, in one line."""
    return ", ".join(form.text for form in FORMS.values())


def wrong_fault(kind: FaultKind, why: str) -> ValueError:
    """The error for a malformed fault of *kind*, with the reason *why*."""
    form = FORMS[kind]
    return ValueError(f"it is written {form.text} ({form.meaning}); {why}")
