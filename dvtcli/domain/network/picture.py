"""A network as it is drawn: its nodes, PDOs, links, frames, findings and differences as one plain value.

Reads nothing and draws nothing. Texts are as devices and files have them: who draws makes them safe.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from dvtcli.domain.meanings import NOTHING
from dvtcli.domain.network.network_state import Identifier, identifier_of
from dvtcli.domain.network.wanted_state import Endpoint
from dvtcli.domain.pdo import PdoConfig
from dvtcli.domain.scaling import Scaling


@dataclass(frozen=True, slots=True)
class PictureField:
    """What lies in *bits* bits of a frame from *start_bit* on: an *object* (`6041:00`), or a dummy that skips them."""

    start_bit: int
    bits: int
    object: str
    name: str = ""
    type_name: str = ""
    meaning: Scaling = NOTHING
    is_dummy: bool = False

    @property
    def end_bit(self) -> int:
        """The first bit behind it."""
        return self.start_bit + self.bits

    @property
    def label(self) -> str:
        """What it is called for short: of a sub-index its own name, which says more than that of the whole object."""
        if self.is_dummy:
            return "skipped"
        return self.name.rpartition(".")[2].strip() or self.name or self.object


@dataclass(frozen=True, slots=True)
class PicturePdo:
    """A PDO as it is set, what its frame holds, and its *partners*: who hears a TPDO, whom an RPDO hears."""

    end: Endpoint
    config: PdoConfig
    fields: tuple[PictureField, ...] = ()
    partners: tuple[Endpoint, ...] = ()

    @property
    def identifier(self) -> Identifier:
        """Its CAN-ID, and whether that has 29 bits."""
        return identifier_of(self.config)

    @property
    def is_tpdo(self) -> bool:
        """Whether its node sends it."""
        return self.end.pdo.is_tpdo


@dataclass(frozen=True, slots=True)
class PictureNode:
    """A node: its *name* in a file, the *title* of its device, what else is to be told (*facts*), and its PDOs.

    Of one that is not *told* only what a file says is known.
    """

    node_id: int
    name: str = ""
    title: str = ""
    facts: tuple[tuple[str, str], ...] = ()
    pdos: tuple[PicturePdo, ...] = ()
    is_told: bool = True

    @property
    def label(self) -> str:
        """What it is called: its name, else its device's, else its number."""
        return self.name or self.title or f"node {self.node_id}"

    def enabled(self, *, is_tpdo: bool) -> tuple[PicturePdo, ...]:
        """Its PDOs of one direction that are on."""
        return tuple(pdo for pdo in self.pdos if pdo.is_tpdo is is_tpdo and pdo.config.enabled)


@dataclass(frozen=True, slots=True)
class PictureLink:
    """An RPDO that hears a TPDO; *fits* says whether both sides have one layout."""

    producer: Endpoint
    consumer: Endpoint
    identifier: Identifier
    fits: bool = True


@dataclass(frozen=True, slots=True)
class PictureFrame:
    """What is sent with a CAN-ID: *what*, by which *node*, how often and why, its *share* of the bus, and its times.

    Times are in µs. *share* and *response_us* are None where nothing limits them; *is_computed* is False for what was
    only heard. *heard_hz* and *heard_share* are what was measured, None where nobody listened.
    """

    identifier: Identifier
    what: str
    node: int | None
    data_bytes: int
    why: str = ""
    period_us: Fraction | None = None
    share: Fraction | None = None
    response_us: Fraction | None = None
    deadline_us: Fraction | None = None
    is_late: bool = False
    is_computed: bool = True
    consumers: tuple[Endpoint, ...] = ()
    heard_hz: float | None = None
    heard_share: float | None = None

    @property
    def has_no_limit(self) -> bool:
        """Whether nothing says how often it comes at most."""
        return self.is_computed and self.share is None


@dataclass(frozen=True, slots=True)
class PictureFinding:
    """What a rule of `check` says: `error`, `warning` or `note`, about which node, in which line of a file."""

    severity: str
    rule: str
    text: str
    node: int | None = None
    line: int | None = None


@dataclass(frozen=True, slots=True)
class PictureDifference:
    """What of a node is not as the file says: *what* (`TPDO1`, `0x1017:00`), its *key*, how it *was* and *will* be."""

    node: int
    what: str
    key: str
    was: str
    will: str


@dataclass(frozen=True, slots=True)
class PictureLoad:
    """What the frames need of a bus of *bit_rate* bit/s at worst; *total* is None where something has no limit.

    *measured* is what was heard of it, *seconds* how long; *fitting* are the bit rates at which all is in time.
    """

    bit_rate: int
    limited: Fraction
    total: Fraction | None
    fits: bool
    is_assumed: bool = False
    fitting: tuple[int, ...] = ()
    assumed: tuple[str, ...] = ()
    measured: float | None = None
    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class NetworkPicture:
    """A network to be drawn; *source* says where it comes from.

    *compared* is the file that nodes were compared with, empty for none; *differences* are what differs then, None
    where that could not be found out, with the *exit_code* that tells why; *notes* is what else there is to say.
    """

    title: str
    source: str
    nodes: tuple[PictureNode, ...]
    links: tuple[PictureLink, ...]
    frames: tuple[PictureFrame, ...]
    load: PictureLoad
    findings: tuple[PictureFinding, ...] = ()
    compared: str = ""
    differences: tuple[PictureDifference, ...] | None = ()
    notes: tuple[str, ...] = ()
    exit_code: int = 0

    def node(self, node_id: int) -> PictureNode | None:
        """The node with *node_id*, None where there is none."""
        return next((node for node in self.nodes if node.node_id == node_id), None)

    @property
    def pdos(self) -> Iterator[tuple[PictureNode, PicturePdo]]:
        """Every PDO with its node."""
        for node in self.nodes:
            for pdo in node.pdos:
                yield node, pdo
