"""A network for drawing: nodes, PDOs, links, frames, findings and differences as one plain value.

Texts come unescaped from devices and files: the drawing code must make them safe.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.network.network_state import Identifier, identifier_of
from dvtcli.domain.object_scalings import NOTHING
from dvtcli.domain.pdo import PdoConfig
from dvtcli.domain.scaling import Scaling


@dataclass(frozen=True, slots=True)
class PictureField:
    """Contents of *bits* bits in a frame from *start_bit* on: an *object* (`6041:00`), or a dummy."""

    start_bit: int
    bits: int
    object: str
    name: str = ""
    type_name: str = ""
    meaning: Scaling = NOTHING
    is_dummy: bool = False

    @property
    def end_bit(self) -> int:
        """The first bit behind the field."""
        return self.start_bit + self.bits

    @property
    def label(self) -> str:
        """Short name: a sub-index's own name, since the object's name says less."""
        if self.is_dummy:
            return "skipped"
        return self.name.rpartition(".")[2].strip() or self.name or self.object


@dataclass(frozen=True, slots=True)
class PicturePdo:
    """A PDO with its configuration, fields, and *partners*: receivers of a TPDO, or senders to an RPDO."""

    end: Endpoint
    config: PdoConfig
    fields: tuple[PictureField, ...] = ()
    partners: tuple[Endpoint, ...] = ()

    @property
    def identifier(self) -> Identifier:
        """The CAN-ID, and whether it has 29 bits."""
        return identifier_of(self.config)

    @property
    def is_tpdo(self) -> bool:
        """Whether the PDO is a TPDO."""
        return self.end.pdo.is_tpdo


@dataclass(frozen=True, slots=True)
class PictureNode:
    """A node: *name* in a file, device *title*, other information (*facts*), and PDOs.

    If not *is_told*, only the file's information is known.
    """

    node_id: int
    name: str = ""
    title: str = ""
    facts: tuple[tuple[str, str], ...] = ()
    pdos: tuple[PicturePdo, ...] = ()
    is_told: bool = True

    @property
    def label(self) -> str:
        """The node's name, else its device's, else its number."""
        return self.name or self.title or f"node {self.node_id}"

    def enabled(self, *, is_tpdo: bool) -> tuple[PicturePdo, ...]:
        """Enabled PDOs of one direction."""
        return tuple(pdo for pdo in self.pdos if pdo.is_tpdo is is_tpdo and pdo.config.enabled)


@dataclass(frozen=True, slots=True)
class PictureLink:
    """An RPDO that receives a TPDO; *fits* tells whether both have the same layout."""

    producer: Endpoint
    consumer: Endpoint
    identifier: Identifier
    fits: bool = True


@dataclass(frozen=True, slots=True)
class PictureFrame:
    """A frame by CAN-ID: *what* it is, *node*, period with reason, bus *share*, and times.

    Times are in µs. *share* and *response_us* are None if unbounded; *is_computed* is False for frames
    that were only received. *measured_hz* and *measured_share* are measurements, None without recording.
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
    measured_hz: float | None = None
    measured_share: float | None = None

    @property
    def has_no_limit(self) -> bool:
        """Whether the frame's frequency is unlimited."""
        return self.is_computed and self.share is None


@dataclass(frozen=True, slots=True)
class PictureFinding:
    """A finding of `check`: `error`, `warning` or `note`, with node and line in a file."""

    severity: str
    rule: str
    text: str
    node: int | None = None
    line: int | None = None


@dataclass(frozen=True, slots=True)
class PictureDifference:
    """A difference between node and file: *what* (`TPDO1`, `0x1017:00`), *key*, and the values *was* and *will*."""

    node: int
    what: str
    key: str
    was: str
    will: str


@dataclass(frozen=True, slots=True)
class PictureLoad:
    """Worst-case bus load at *bit_rate* bit/s; *total* is None if any frame is unlimited.

    *measured* is the measured load, *seconds* its duration; *fitting* are the bit rates that meet all deadlines.
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
    """A network for drawing; *source* names its origin.

    *compared* is the file compared with the nodes, empty for none; *differences* are None if the comparison failed,
    with *exit_code* as the reason; *notes* are further remarks.
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
        """The node with *node_id*, None if missing."""
        return next((node for node in self.nodes if node.node_id == node_id), None)

    @property
    def pdos(self) -> Iterator[tuple[PictureNode, PicturePdo]]:
        """Every PDO with its node."""
        for node in self.nodes:
            for pdo in node.pdos:
                yield node, pdo
