"""A probe: SDO downloads to one disabled PDO, and the device's answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from dvtcli.domain.abort import abort_text
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry

#: `ProbeAnswer.code` of an accepted value.
ACCEPTED = 0


class Stand(StrEnum):
    """How the PDO stands before a probe."""

    FOUND = "as it was found, off"
    #: every PDO rolled back
    BACK = "as it was found"
    EMPTY = "off, count 0"
    FILLED = "off, one entry"
    ON = "enabled, one entry, on an unused CAN-ID"


class ProbeCondition(StrEnum):
    """Precondition of a probe."""

    ANYWHERE = "anywhere"
    #: an enabled PDO: needs PRE-OPERATIONAL, and a CAN-ID that is neither configured nor received
    QUIET = "PRE-OPERATIONAL and a quiet CAN-ID"
    #: a CAN-ID with a meaning for other nodes
    ISOLATED = "a bus without other nodes"
    #: the node as it was found, in OPERATIONAL
    OPERATIONAL = "a bus without other nodes, and a node that was OPERATIONAL before"
    #: a write to the device's memory
    STORE = "leave to store"


@dataclass(frozen=True, slots=True)
class ProbeWrite:
    """An SDO download."""

    index: int
    sub_index: int
    data: bytes

    @property
    def place(self) -> tuple[int, int]:
        """Index and sub-index."""
        return self.index, self.sub_index

    @property
    def label(self) -> str:
        """Index and sub-index as `1A03:01`."""
        return f"{self.index:04X}:{self.sub_index:02X}"

    def __str__(self) -> str:
        value = f"0x{int.from_bytes(self.data, 'little'):0{2 * len(self.data)}X}"
        return f"0x{self.label} <- {value}"


@dataclass(frozen=True, slots=True)
class Probe:
    """A probe of *pdo*, None for the device: the last of *writes*, after the others were accepted, from *stand*.

    *name* is unique in a run, *sense* describes the question for people. *check* is the simulated device's
    check for the same write, "" for none.
    """

    pdo: Pdo | None
    name: str
    sense: str
    stand: Stand
    writes: tuple[ProbeWrite, ...]
    check: str = ""
    where: ProbeCondition = ProbeCondition.ANYWHERE

    @property
    def label(self) -> str:
        """The probed PDO, else the object."""
        return self.pdo.label if self.pdo is not None else self.asked.label

    @property
    def asked(self) -> ProbeWrite:
        """The download that the device's answer refers to."""
        return self.writes[-1]

    @property
    def entry_bits(self) -> int:
        """Mapped bits of the probed mapping entry."""
        return int.from_bytes(self.asked.data, "little") & 0xFF


@dataclass(frozen=True, slots=True)
class ProbeAnswer:
    """The device's answer to *probe*: an abort code, 0 for accepted, None for no answer (reason: *why*).

    *held* is the object's value afterwards, None if unreadable.
    """

    probe: Probe
    code: int | None
    held: bytes | None = None
    why: str = ""

    @property
    def accepted(self) -> bool:
        """Whether the device took the value."""
        return self.code == ACCEPTED

    @property
    def kept(self) -> bool:
        """Whether the device accepted and kept the value."""
        return self.accepted and self.held == self.probe.asked.data

    @property
    def text(self) -> str:
        """The evidence, for a person: `0x1A03:01 <- 0x60410004 answered 0x06040041 (…)`."""
        asked = self.probe.asked
        if self.code is None:
            return f"{asked} was not asked: {self.why}"
        if self.code:
            return f"{asked} answered 0x{self.code:08X} ({abort_text(self.code)}), {self.probe.stand}"
        held = "" if self.held in (None, asked.data) else f", and reads 0x{_number(self.held):X}"
        return f"{asked} accepted{held}, {self.probe.stand}"


def _number(data: bytes | None) -> int:
    return int.from_bytes(data or b"", "little")


@dataclass(frozen=True, slots=True)
class Features:
    """Reasons besides length to refuse mapping: *access* and *kind* of number."""

    access: str
    kind: str


@dataclass(frozen=True, slots=True)
class ProbedPdo:
    """The probed PDO with its present and probing values.

    *parameters* are the bytes of each readable sub-index of the communication parameter, *entries* the raw words of
    readable sub-indices 1… of the mapping. *spare* are two unused CAN-IDs, none if the PDO must not be enabled. *fits*
    are mappable objects in this direction according to the file, *by_access* the same by access type, one per length,
    *unmappable* other objects; *features* are access and kind of each object. *absent* is a missing index. *more*:
    further entries exist and must not be written, since they refuse their old value. *other_way* is an object that only
    PDOs of the other direction map, if no file gives access types. *limits* are the lowest and the highest value of
    parameters and entries in the file, by index and sub-index.
    """

    pdo: Pdo
    held: PdoConfig
    parameters: Mapping[int, bytes]
    entries: tuple[int, ...]
    fits: tuple[PdoMappingEntry, ...]
    by_access: Mapping[str, tuple[PdoMappingEntry, ...]] = field(default_factory=dict)
    unmappable: tuple[PdoMappingEntry, ...] = ()
    features: Mapping[PdoMappingEntry, Features] = field(default_factory=dict)
    absent: int = 0x5FFE
    spare: tuple[int, ...] = ()
    more: bool = False
    other_way: PdoMappingEntry | None = None
    limits: Mapping[tuple[int, int], tuple[int, int]] = field(default_factory=dict)

    @property
    def off(self) -> CobId:
        """The COB-ID with bit 31 set: its value during probes."""
        return self.held.communication.cob_id.disabled()

    @property
    def objects(self) -> list[PdoMappingEntry]:
        """Mappable objects according to the file, of each length and access."""
        return [*self.fits, *(entry for entries in self.by_access.values() for entry in entries)]


#: Value in a profile or a family.
Value = bool | int | str | list["Value"]


@dataclass(frozen=True, slots=True)
class Learnt:
    """A learnt value with its *key* and tables (`rtr_bit.tpdo`), and the *evidence*."""

    key: str
    value: Value
    evidence: str


@dataclass(frozen=True, slots=True)
class Conclusions:
    """All learnt values: *profile* for the tool, *family* for a simulated device that answers the same."""

    profile: tuple[Learnt, ...]
    family: tuple[Learnt, ...]
