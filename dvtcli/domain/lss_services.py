"""LSS (CiA 305): the LSS address of a node, and the services by their numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

SWITCH_GLOBAL, CONFIGURE_NODE_ID, STORE_CONFIGURATION = 0x04, 0x11, 0x17
CONFIGURE_BIT_TIMING, ACTIVATE_BIT_TIMING = 0x13, 0x15
#: the first of the four frames of *switch state selective*, the answer to the last, and the six of *identify*
SELECT, SELECTED, IDENTIFY, IDENTIFIED = 0x40, 0x44, 0x46, 0x4F
IDENTIFY_UNCONFIGURED, IDENTIFIED_UNCONFIGURED, FAST_SCAN = 0x4C, 0x50, 0x51
#: the first of the four services that inquire the address, and the service that inquires the node-ID
INQUIRE, INQUIRE_NODE_ID = 0x5A, 0x5E
WAITING, CONFIGURATION = 0, 1
#: *bit checked* of the fast scan's first question, which every node without a node-ID answers
SCAN_RESET = 0x80
BITS, PARTS = 32, 4
#: error codes of the configuration services (CiA 305); 0 is success, 255 manufacturer-specific
NODE_ID_REFUSED = {1: "it does not support this node-ID"}
BIT_TIMING_REFUSED = {1: "it cannot run at that bit rate"}
STORE_REFUSED = {1: "it cannot store its node-ID", 2: "its storage medium failed"}
#: the standard's bit rates (bit/s), each with its index in the table of bit timings (table selector 0)
BIT_TIMINGS = {1_000_000: 0, 800_000: 1, 500_000: 2, 250_000: 3, 125_000: 4, 50_000: 6, 20_000: 7, 10_000: 8}
#: services that change a slave, in words; finding and selecting slaves does not
CHANGES = {
    CONFIGURE_NODE_ID: "LSS configure node-ID",
    CONFIGURE_BIT_TIMING: "LSS configure bit timing",
    ACTIVATE_BIT_TIMING: "LSS activate bit timing",
    STORE_CONFIGURATION: "LSS store configuration",
}
_OWN = 0xFF


@dataclass(frozen=True, slots=True, order=True)
class LssAddress:
    """LSS address: the four 32-bit numbers of a node's identity (0x1018:1..4)."""

    vendor: int
    product: int
    revision: int
    serial: int

    @property
    def parts(self) -> tuple[int, int, int, int]:
        """The four numbers in LSS order."""
        return self.vendor, self.product, self.revision, self.serial

    def __str__(self) -> str:
        """The address as an argument of `lss select`."""
        names = ("vendor", "product", "revision", "serial")
        return " ".join(f"{name}=0x{number:X}" for name, number in zip(names, self.parts, strict=True))


class LssRanges(NamedTuple):
    """Nodes of one product with revision and serial number in ranges (lowest, highest)."""

    vendor: int
    product: int
    revision: tuple[int, int] = (0, 0xFFFF_FFFF)
    serial: tuple[int, int] = (0, 0xFFFF_FFFF)

    @property
    def numbers(self) -> tuple[int, int, int, int, int, int]:
        """The numbers of the six *identify remote slave* frames, in their order."""
        return self.vendor, self.product, *self.revision, *self.serial


def refusal(reasons: dict[int, str], code: int, own: int) -> str:
    """Reason for the refusal of a configuration service: error *code*, with the manufacturer's *own* code after 255."""
    if code == _OWN:
        return f"a manufacturer-specific reason, {own} (0x{own:02X})"
    return f"{reasons.get(code, 'a reason that CiA 305 does not define')} (error code {code})"
