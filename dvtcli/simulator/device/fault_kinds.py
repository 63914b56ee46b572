"""The kinds of faults of a simulated node: text form, effect, and number ranges."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

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
    FaultKind.SAVES_ITSELF: Form("saves-itself", "every write is stored at once, which 0x1010 does not tell"),
    FaultKind.KEEPS_RAM: Form("keeps-ram", "an NMT reset leaves RAM as it is; only a power cycle does not"),
    FaultKind.RESTORES_NOTHING: Form("restores-nothing", "every restore is acknowledged, and nothing is restored"),
    FaultKind.IGNORES_NMT: Form("ignores-nmt", "NMT start, stop and pre-operational are not obeyed; resets are"),
    FaultKind.FLASH_FAILS: Form("flash-fails", "no program can be written: 0x1F57 says so"),
    FaultKind.FLASH_ALTERS: Form("flash-alters", "a program that is written has one byte wrong: 0x1F56 says so"),
    FaultKind.EMCY: Form(
        "emcy=CODE[:S]", "the node raises error CODE (0x3210) S seconds after each start [0]; 0: its errors are gone"
    ),
    FaultKind.BIT_RATE: Form("bit-rate=N", "the node runs at N bit/s (250000), and receives nothing else"),
    FaultKind.NO_BIT_TIMING: Form("no-bit-timing", "LSS cannot tell it another bit rate: it refuses each"),
    FaultKind.KEEPS_BIT_RATE: Form("keeps-bit-rate", "it takes another bit rate by LSS, and stays at the old one"),
    FaultKind.LOSES_BIT_RATE: Form(
        "loses-bit-rate", "it takes another bit rate by LSS, and is not heard any more until it is switched off and on"
    ),
}


def known_kinds() -> str:
    """The text forms of every kind, in one line."""
    return ", ".join(form.text for form in FORMS.values())


def wrong_fault(kind: FaultKind, why: str) -> ValueError:
    """The error for a malformed fault of *kind*, with the reason *why*."""
    form = FORMS[kind]
    return ValueError(f"it is written {form.text} ({form.meaning}); {why}")
